"""Large models: frames on fewer elements, matrices in all modes, and what is too large."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from diagnosis_problems import sensors_on_joints
from numpy.testing import assert_allclose

from femubench import Case, Measurement, Model, NotApplicable, Sensors, solve_modes
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.fem.coarse_mesh import coarsen_mesh
from femubench.core.fem.frame import Factor, GroundSpring, Joint, Material, Member, Place, Support
from femubench.core.fem.model import Dofs
from femubench.core.fit.projection import Projector
from femubench.core.inference.coordinates import modes_for
from femubench.core.inference.settings import overridden, settings
from femubench.core.modal.eigen import DENSE_LIMIT, count_evaluations, modes_of
from femubench.core.roles import Effect
from femubench.fem import Frame, MatrixGeometry, Section
from femubench.plugins.effects.added_mass import AddedMass
from femubench.plugins.effects.axial_preload import AxialPreload
from femubench.plugins.effects.material import MemberStiffness, YoungsModulus
from femubench.plugins.effects.shear_deformation import ShearDeformation
from femubench.plugins.effects.temperature import Temperature
from tests.simulated import modes_at

FrameBuilder = Callable[..., Frame]
USED, HELD_OUT = 6, 3
ALUMINIUM = Material(70e9, 0.33, 2700.0)


@pytest.fixture(scope="module")
def model(ladder: FrameBuilder) -> Model:
    """Return the ladder with 26 elements a member, 543 dofs."""
    frame = ladder("timoshenko", elements=26, polar=False, accelerometer=False)
    return Model.of(replace(frame, rotary_inertia=True))


def measured(
    truth: Model, sensors: Sensors, count: int, rng: np.random.Generator | None = None
) -> Measurement:
    """Return a test of a model, exact without a generator, with the deviations of a good test."""
    found = modes_at(truth, sensors, count, hertz_std=0.002)
    if rng is None:
        return found
    frequencies = found.frequencies + found.frequency_std * rng.standard_normal(count)
    shapes = found.shapes + 0.015 * rng.standard_normal(found.shapes.shape)
    return replace(found, frequencies=frequencies, shapes=shapes)


def test_a_large_model_is_solved_once_for_fewer_modes(model: Model) -> None:
    fresh, other = (Model.of(model.frame_structure.frame) for _ in range(2))
    with count_evaluations() as counter:
        many, few = (modes_of(fresh, count) for count in (24, 9))
        assert counter.count == 1
        more = modes_of(fresh, 30)
        assert counter.count == 2
    assert (len(many), len(few), len(more)) == (24, 9, 30)
    assert_allclose(few.eigenvalues[3:], solve_modes(other, 9).eigenvalues[3:], rtol=1e-9)


@pytest.mark.parametrize(
    "effect", [ShearDeformation(), Temperature(), AxialPreload()], ids=lambda effect: effect.name
)
def test_alike_elements_share_matrices_and_act_as_each_alone(model: Model, effect: Effect) -> None:
    frame = model.frame_structure.frame
    tube = Section.rectangular_tube(0.06, 0.03, 0.003)
    members = tuple(replace(member, section=tube) for member in frame.members)
    model = Model.of(replace(frame, beam="euler-bernoulli", members=members))
    basis = np.random.default_rng(3).standard_normal((model.size, 5))
    hypothesis = hypotheses_of(model, [effect])[-1]
    place, part = hypothesis.place, Projector(model, basis)(hypothesis)
    values = hypothesis.values(hypothesis.grid)[-1]
    after = effect.extend(model, place, [float(v) for v in values])
    for mass, old, new in (
        (False, model.stiffness, after.stiffness),
        (True, model.mass, after.mass),
    ):
        change = part.matrix(hypothesis.grid_factors[-1], mass=mass)
        expected = basis.T @ ((new - old) @ basis)
        if change is None:
            assert abs(expected).max() <= 1e-12 * abs(basis.T @ (old @ basis)).max()
        else:
            assert_allclose(change, expected, rtol=0, atol=2e-6 * abs(expected).max())
    blocks = {id(t.operator.blocks): t.operator.blocks for t in hypothesis.change.terms}
    elements = len(model.frame_structure.mesh.ends)
    # One matrix an element would be as much as an assembled one, for every term of every place.
    assert all(len(own) <= elements for own in blocks.values())
    if effect.name != "temperature":
        assert all(len(own) < elements / 4 for own in blocks.values())


def case_of(model: Model, measurement: Measurement, **more: Any) -> Case:
    used, held_out = tuple(range(1, USED + 1)), tuple(range(USED + 1, USED + HELD_OUT + 1))
    return Case("case", "", "", Path(), model, measurement, used, held_out, **more)


def test_a_frame_has_as_many_elements_as_leave_it_small(model: Model) -> None:
    frame = model.frame_structure.frame
    assert coarsen_mesh(model, model.size - 1, 25).size == model.size - 3 * len(frame.members)
    assert coarsen_mesh(model, 100, 25).size == model.size - 3 * len(frame.members)
    factor = Factor("E", ("AB/26",), 0.9)
    found = coarsen_mesh(Model.of(replace(frame, factors=(factor,))), DENSE_LIMIT, 2)
    counts = {m.name: m.elements for m in found.frame_structure.frame.members}
    (others,) = {count for name, count in counts.items() if name != "AB"}
    assert counts["AB"] == 26
    assert DENSE_LIMIT - 3 * len(frame.members) < found.size <= DENSE_LIMIT
    assert others < 26


@pytest.mark.slow(5)
def test_a_large_frame_is_diagnosed_on_fewer_elements(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = MemberStiffness().extend(model, "AB", [-0.3])
    measurement = measured(truth, sensors_on_joints(model.frame_structure.frame), USED + HELD_OUT)
    monkeypatch.setattr("femubench.core.diagnosis.diagnose.DENSE_LIMIT", 200)
    effects = [AddedMass(), MemberStiffness()]
    found = diagnose(case_of(model, measurement), effects, faults=(), pairs=False)
    (cause,) = found.causes
    assert (found.verdict, cause.effect, cause.place) == ("named", "member-stiffness", "AB")
    assert cause.parameters[0].value == pytest.approx(-0.3, rel=1e-2)
    (note,) = (note for note in found.notes if "elements a member" in note)
    assert "with 9 elements a member at most, in 186 degrees of freedom instead of 543" in note
    assert "frequencies are 0.14 % off those with all elements" in note
    assert found.extended.size == 186


def test_too_many_degrees_of_freedom_are_refused(model: Model) -> None:
    alike = r"543 degrees of freedom, with as few elements.* 500 at most.*members that lie in line"
    with overridden({"most_dofs": 500}), pytest.raises(NotApplicable, match=alike):
        modes_for(model)
    n = settings.most_dofs + 1
    dofs = Dofs(np.arange(n), ("z",) * n, np.zeros((n, 3)))
    geometry = MatrixGeometry(tuple(map(str, range(n))), dofs)
    stiffness = sp.csc_array(sp.diags_array(np.arange(1.0, n + 1.0)))
    with pytest.raises(NotApplicable, match=r"2001 degrees of freedom.* 2000 .*model\.groups"):
        modes_for(Model(sp.csc_array(sp.eye_array(n)), stiffness, dofs, geometry))


@pytest.mark.slow(5)
def test_a_model_of_matrices(model: Model) -> None:
    """Groups of a stiffness matrix, no elements, no tolerances, no model error."""
    n = model.size
    xyz = np.column_stack([np.arange(n, dtype=float), np.zeros((n, 2))])
    dofs = Dofs(np.arange(n), ("z",) * n, xyz)
    geometry = MatrixGeometry(tuple(f"n{i}" for i in range(n)), dofs)
    feet = zip("ACDF", (1e5, 2e5, 4e5, 7e5), strict=True)
    springs = [GroundSpring(Place(joint=joint), "z", value) for joint, value in feet]
    whole = model.attach((), springs).stiffness
    weaker = MemberStiffness().extend(model, "BE", [-0.5]).stiffness
    rung = sp.csc_array(2.0 * (model.stiffness - weaker))
    held = sp.csc_array(whole - rung)
    bare = Model(model.mass, held + rung, dofs, geometry, groups={"frame": held, "rung": rung})
    truth = MemberStiffness().extend(bare, "group:rung", [0.6])
    rows = np.arange(10, n, 31)
    labels = tuple(f"s{i}" for i in rows)
    sensors = Sensors(labels, xyz[rows], ("z",) * len(rows))
    rng = np.random.default_rng(3)
    measurement = measured(truth, sensors, USED + HELD_OUT, rng)
    case = case_of(bare, measurement, model_error=0.0)
    diagnosis = diagnose(case, [MemberStiffness(), YoungsModulus()], pairs=False)
    assert [(c.effect, c.place) for c in diagnosis.causes] == [("member-stiffness", "group:rung")]
    assert diagnosis.causes[0].parameters[0].value == pytest.approx(0.6, rel=0.2)


def lattice(count: int, elements: int) -> Frame:
    """Return a building of count x count x count bays, clamped at its feet."""
    rng = np.random.default_rng(0)
    section = Section.rectangular_tube(0.06, 0.03, 0.003)
    grid = [(i, j, k) for i in range(count + 1) for j in range(count + 1) for k in range(count + 1)]
    joints = tuple(
        Joint(
            "J{}.{}.{}".format(*at),
            tuple(np.array(at) * (1.0, 0.8, 0.9) + 0.03 * rng.standard_normal(3)),
        )
        for at in grid
    )
    members = []
    for at in grid:
        for along in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
            to = tuple(a + b for a, b in zip(at, along, strict=True))
            if max(to) <= count and (along[2] or at[2]):
                ends = "J{}.{}.{}".format(*at), "J{}.{}.{}".format(*to)
                name = f"m{len(members) + 1}"
                members.append(Member(name, ends, elements, section, ALUMINIUM))
    feet = (joint.name for joint in joints if joint.name.endswith(".0"))
    held = ("x", "y", "z", "rx", "ry", "rz")
    supports = tuple(Support(Place(joint=foot), held) for foot in feet)
    return Frame("3d", "timoshenko", joints, tuple(members), supports=supports, rotary_inertia=True)


@pytest.mark.nightly
@pytest.mark.parametrize(("elements", "size"), [(10, 2000), (118, 29000)])
def test_a_lattice_is_diagnosed_in_minutes(elements: int, size: int) -> None:
    frame = lattice(2, elements)
    model = Model.of(frame)
    assert model.size > size
    free = [joint for joint in frame.joints if not joint.name.endswith(".0")][:15]
    points = [(joint, direction) for joint in free for direction in "xy"]
    sensors = Sensors(
        tuple(f"{joint.name}:{d}" for joint, d in points),
        np.array([joint.xyz for joint, _ in points]),
        tuple(d for _, d in points),
    )
    truth = MemberStiffness().extend(model, "m15", [-0.3])
    measurement = measured(truth, sensors, 12, np.random.default_rng(3))
    case = Case("lattice", "", "", Path(), model, measurement, tuple(range(1, 9)), (9, 10, 11, 12))
    diagnosis = diagnose(case)
    assert diagnosis.verdict == "named"
    assert (diagnosis.causes[0].effect, diagnosis.causes[0].place) == ("member-stiffness", "m15")
