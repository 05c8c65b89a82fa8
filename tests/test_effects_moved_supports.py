"""Supports that moved, went or came, on a cantilever solved as a continuous beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from continuous_beams import Cantilever
from effect_checks import changed_matrices, check_neutral, compare

from femubench import Diagnosis, Measurement, Model, diagnose
from femubench.core.case.case import Case
from femubench.core.change.tabulated import change_of
from femubench.core.inference.examine import examine
from femubench.core.modal.eigen import solve_dense
from femubench.fem import (
    Frame,
    Joint,
    Material,
    Member,
    ModelError,
    Place,
    Section,
    Support,
)
from femubench.plugins.effects.support_added import SupportAdded
from femubench.plugins.effects.support_position import SupportPosition
from femubench.plugins.effects.support_removed import SupportRemoved

LENGTH, SECTION, STEEL = 1.0, Section.solid_rectangle(0.03, 0.012), Material(207e9, 0.3, 7850.0)
CANTILEVER = Cantilever(LENGTH, SECTION, STEEL, (0.2, 0.4, 0.5, 0.75, 0.9, 1.0))
ROLLER = 0.6


def beam(
    rollers: Sequence[float] = (ROLLER,), members: int = 1, elements: int = 20, stiffer: float = 1.0
) -> Model:
    """Return a cantilever on rollers, of one member or of several in a row."""
    joints = tuple(Joint(f"J{i}", (LENGTH * i / members, 0.0, 0.0)) for i in range(members + 1))
    steel = replace(STEEL, E=stiffer * STEEL.E)
    row = tuple(
        Member(f"m{i}", (f"J{i}", f"J{i + 1}"), elements // members, SECTION, steel)
        for i in range(members)
    )
    held = [Support(Place(joint="J0"), ("x", "z", "ry"))]
    for x in rollers:
        i, s = divmod(x * members, 1.0)
        at = Place(joint=f"J{int(i)}") if s < 1e-9 else Place(member=f"m{int(i)}", s=s)
        held.append(Support(at, ("z",)))
    return Model.of(Frame("in-plane", "euler-bernoulli", joints, row, supports=tuple(held)))


def measure(
    rollers: Sequence[float], noise: float, rng: np.random.Generator, count: int = 4
) -> Measurement:
    return CANTILEVER.measure(count, noise, 0.01 if noise < 0.01 else 0.03, rng, rollers)


def tell(
    model: Model,
    before: Sequence[float],
    now: Sequence[float],
    noise: float,
    seed: int,
    count: int = 4,
) -> Diagnosis:
    """Diagnose the beam on rollers, given that it lay on others."""
    rng = np.random.default_rng(seed)
    was, test = (measure(rollers, noise, rng, count) for rollers in (before, now))
    every = test.numbers
    where = Path(".")
    return diagnose(
        Case("", "", "", where, model, test, every, (), reference=was, reference_used=every)
    )


def check_moved(found: Diagnosis, place: str, displacement: float) -> None:
    assert found.verdict == "named"
    (cause,) = found.causes
    assert (cause.effect, cause.place) == ("support-position", place)
    (moved,) = cause.parameters
    assert abs(moved.value - displacement) < 2.0 * moved.std
    assert moved.std < 0.35 * abs(moved.value)  # of which an own error of the cause is 0.3


@pytest.mark.slow(15)
def test_a_moved_roller_is_named_and_nothing_where_nothing_moved() -> None:
    """The drawing may be wrong by 5 % in E and by 1 cm in the roller: the reference knows it."""
    drawn = beam(members=1, elements=10, stiffer=1.05)
    was = ROLLER - 0.01
    for seed, (noise, shift) in enumerate([(0.002, -0.093), (0.02, 0.15)]):
        check_moved(tell(drawn, [was], [was + shift], noise, seed), "support:m0@0.6", shift)
        assert tell(drawn, [was], [was], noise, seed).verdict == "none"


@pytest.mark.slow(8)
def test_a_roller_less_and_one_more_are_named_so() -> None:
    gone = tell(beam(), [ROLLER], [], 0.02, 1, 3)
    new = tell(beam(members=2), [ROLLER], [ROLLER, 0.85], 0.002, 2)
    assert (gone.verdict, new.verdict) == ("named", "named")
    ((effect, place),) = [(c.effect, c.place) for c in gone.causes]
    assert (effect, place) == ("support-removed", "support:m0@0.6")
    (cause,) = new.causes
    assert (cause.effect, cause.place) == ("support-added", "m1@0.75:z")
    offset = cause.parameters[1]
    assert abs(0.875 + offset.value - 0.85) < 2.0 * offset.std < 0.02


@pytest.mark.nightly
@pytest.mark.parametrize("noise", [0.002, 0.02])
@pytest.mark.parametrize("count", [3, 4])
def test_every_shift_of_the_roller(noise: float, count: int) -> None:
    """What no reading can show at this noise is no cause, and nothing else is named for it."""
    for seed, shift in enumerate((-0.15, -0.093, -0.05, -0.02, 0.02, 0.05, 0.093, 0.15)):
        found = tell(beam(), [ROLLER], [ROLLER + shift], noise, seed, count)
        # By 2 cm all frequencies together change by 12 to 16 of chi-square at this noise: one draw
        # in five cannot be distinguished from the reference.
        if noise > 0.01 and abs(shift) < 0.03 and not found.states.differs:
            assert (found.verdict, found.causes) == ("none", ())
        else:
            check_moved(found, "support:m0@0.6", shift)
    for seed in range(20, 28):
        assert tell(beam(), [ROLLER], [ROLLER], noise, seed, count).verdict == "none"
    for shift in (-0.01, 0.01):
        found = tell(beam(), [ROLLER], [ROLLER + shift], noise, 30, count)
        assert found.verdict in (("named",) if noise < 0.01 else ("named", "none"))
        assert {cause.effect for cause in found.causes} <= {"support-position"}


@pytest.mark.parametrize("members", [1, 2, 5])
def test_changes_are_the_frames_written_out(members: int) -> None:
    """By 20 cm a support passes four elements and, of five members, a joint."""
    model = beam(members=members)
    moved, added, removed = SupportPosition(), SupportAdded(), SupportRemoved()
    (place,) = moved.places(model)
    assert place == {1: "support:m0@0.6", 2: "support:m1@0.2", 5: "support:J3"}[members]
    assert removed.places(model) == (place,)
    assert len(added.places(model)) == 4
    check_neutral(moved, model, place)
    check_neutral(removed, model, place)
    check_neutral(added, model, added.places(model)[3])
    for shift in (-0.2, -0.07, 0.004, 0.11):
        found = compare(moved, model, place, [shift], count=4)
        assert found.frequency < 1e-3
        assert found.effect > 20.0 * found.frequency
    gone = compare(removed, model, place, [p.scale for p in removed.parameters(model, place)], 3)
    assert gone.frequency < 1e-3 < gone.effect
    for offset in (-0.1, 0.03, 0.12):
        point = added.places(model)[3]
        found = compare(added, model, point, [added.parameters(model, point)[0].scale, offset], 3)
        assert found.frequency < 1e-3 < found.effect


def test_a_quarter_whose_middle_is_a_joint_is_sought_there() -> None:
    """As in a deck of a solver, whose members are single elements."""
    model = beam(members=8, elements=8)
    assert SupportAdded().places(model) == tuple(f"J{i}:z" for i in (1, 3, 5, 7))
    found = tell(model, [ROLLER], [ROLLER, 0.85], 0.002, 2)
    assert [(c.effect, c.place) for c in found.causes] == [("support-added", "J7:z")]


def test_a_fine_mesh_and_a_support_in_space() -> None:
    """Of more elements than a cubic each can be spared for, several share one."""
    effect, frame = SupportPosition(), beam(elements=30).frame_structure.frame
    clamp = Support(Place(joint="J0"), ("x", "y", "z", "rx", "ry", "rz"))
    roller = Support(Place(member="m0", s=ROLLER), ("y", "z"))
    space = replace(frame, plane="3d", supports=(clamp, roller))
    for model in (Model.of(frame), Model.of(space)):
        check_neutral(effect, model, "support:m0@0.6")
        for shift in (-0.11, 0.003, 0.2):
            found = compare(effect, model, "support:m0@0.6", [shift], count=4)
            assert found.frequency < 1e-3 < found.effect


def test_the_rate_of_change_is_that_of_the_continuous_beam() -> None:
    """Across elements and at their nodes, where the functions of two elements meet."""
    model, effect = beam(), SupportPosition()
    change = change_of(effect, model, effect.places(model)[0])
    (parameter,) = change.parameters
    for shift in (-0.075, -0.05, 0.02, 0.1, 0.137):
        x = parameter.coordinate(shift)
        mass, stiffness = changed_matrices(model, change, [shift])
        values, shapes = solve_dense(mass, stiffness)
        rate = np.zeros(3)
        for slope, term in zip(change.slopes(np.array([x]))[0], change.terms, strict=True):
            near = shapes[:, :3]
            work = np.einsum("nj,nj->j", near, term.operator.apply(near))
            rate += slope * work * (-values[:3] if term.matrix == "mass" else 1.0)
        hertz = np.sqrt(values[:3]) / (2.0 * np.pi)
        rate /= 2.0 * hertz * (2.0 * np.pi) ** 2 * parameter.slope(x)
        step = 1e-4
        ends = [CANTILEVER.modes(3, [ROLLER + shift + d])[0] for d in (-step, step)]
        np.testing.assert_allclose(hertz, (ends[0] + ends[1]) / 2.0, rtol=1e-3)
        wanted = (ends[1] - ends[0]) / (2.0 * step)
        np.testing.assert_allclose(rate, wanted, rtol=0.02, atol=0.01 * np.abs(wanted).max())


def test_what_is_fastened_does_not_slide() -> None:
    """A clamp, a pin along the beam and a foot of a corner stay; a tip's roller goes inwards."""
    effect, model = SupportPosition(), beam([1.0])
    assert effect.places(model) == ("support:J1",)
    (parameter,) = effect.parameters(model, "support:J1")
    assert parameter.one_sided
    assert parameter.range[0] == 0.0
    frame = model.frame_structure.frame
    (place,) = [s.at for s in effect.frame(frame, "support:J1", [0.2]).supports if s.at.member]
    assert place.s == pytest.approx(0.8)
    pin = Support(Place(joint="J1"), ("x", "z"))
    pinned = Model.of(replace(frame, supports=(frame.supports[0], pin)))
    assert effect.places(pinned) == ()
    assert SupportRemoved().places(pinned) == ("support:J1",)
    with pytest.raises(ModelError, match="no beam lies on"):
        effect.parameters(pinned, "support:J1")
    up = (*frame.joints, Joint("up", (1.0, 0.0, 0.5)))
    post = Member("post", ("J1", "up"), 4, SECTION, STEEL)
    corner = replace(frame, joints=up, members=(*frame.members, post))
    assert effect.places(Model.of(corner)) == ()
    free = Model.of(replace(frame, supports=()))
    assert SupportAdded().places(free) == SupportRemoved().places(free) == ()


def test_they_are_sought_with_a_reference_alone() -> None:
    rng = np.random.default_rng(0)
    test = measure([ROLLER + 0.05], 0.002, rng)
    effects = [SupportPosition(), SupportAdded(), SupportRemoved()]
    was = measure([ROLLER], 0.002, rng)
    for reference, names in ((None, set()), (was, {e.name for e in effects})):
        seen = examine(beam(), test, effects, tolerance=0.005, reference=reference, pairs=False)
        assert {p.hypothesis.effect.name for p in seen.problem.space.projections} == names
