"""Struts, oscillators and masses on arms at nodes of matrices: as on a frame, and in a basis."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import test_chain
from diagnosis_problems import case_of, clamped_portal
from effect_checks import as_matrices
from test_chain import Boxes, Point, diagnose_files, write_deck, write_responses, write_shells

import femubench
from femubench import Case, Model, Sensors, fem, solve_modes
from femubench.core.case.nodes import with_mesh
from femubench.core.case.reducing import expand_model, reduce_case
from femubench.core.drawing.places import find_wireframe
from femubench.core.drawing.wireframe import to_point
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.effect import FrameEffect, ModelPlaces
from femubench.fem import FloatArray, Frame, Material, MatrixGeometry, Section
from femubench.modal import rigid_modes_of
from femubench.plugins.effects.attached_oscillator import AttachedOscillator
from femubench.plugins.effects.brace_spring import BraceSpring
from femubench.plugins.effects.mass_offset import MassOffset
from tests.simulated import modes_at

BRACE, OSCILLATOR, OFFSET = BraceSpring(), AttachedOscillator(), MassOffset()
FrameBuilder = Callable[..., Frame]


def hertz(model: Model, count: int = 10) -> FloatArray:
    return np.asarray(elastic_modes(model, count).natural_frequencies)


@pytest.fixture(scope="module")
def pair(portal: FrameBuilder) -> tuple[Model, Model]:
    """Return a free portal in space, and the same as matrices."""
    model = Model.of(portal(3))
    return model, as_matrices(model)


def node_at(matrices: Model, model: Model, joint: str) -> str:
    """Return the node of matrices that is a joint of the frame."""
    at = ModelPlaces(model).nodes[joint]
    return next(n for n, xyz in ModelPlaces(matrices).nodes.items() if np.allclose(xyz, at))


def test_a_brace_is_that_of_the_frame(pair: tuple[Model, Model]) -> None:
    model, matrices = pair
    (first, last), value = ModelPlaces(model).node_pairs(BRACE.places(model)[0])[0], 3e5
    place = f"{node_at(matrices, model, first)}-{node_at(matrices, model, last)}"
    found = hertz(BRACE.extend(matrices, place, [value]))
    truth = hertz(BRACE.extend(model, f"{first}-{last}", [value]))
    assert abs(truth / hertz(model) - 1.0).max() > 1e-3
    np.testing.assert_allclose(found, truth, rtol=1e-9)


@pytest.mark.parametrize("free", ["", ":free"])
@pytest.mark.parametrize("direction", ["x", "y", "z"])
def test_an_oscillator_is_that_of_the_frame(
    pair: tuple[Model, Model], direction: str, free: str
) -> None:
    model, matrices = pair
    joint, mass, values = model.frame_structure.frame.joints[1].name, model.total_mass, [0.0, 0.0]
    values = [0.03 * mass, 1.3 * float(hertz(model)[0])]
    at = node_at(matrices, model, joint)
    found = OSCILLATOR.extend(matrices, f"{at}:{direction}{free}", values)
    truth = OSCILLATOR.extend(model, f"{joint}:{direction}{free}", values)
    assert found.size == model.size + 1
    np.testing.assert_allclose(hertz(found), hertz(truth), rtol=1e-8)
    # It goes along when the whole is moved or turned, wherever its node is drawn.
    assert rigid_modes_of(found).shape[1] == rigid_modes_of(truth).shape[1] == 6
    sensors = Sensors(("s",), ModelPlaces(model).nodes[joint][None], (direction,))
    shapes = solve_modes(found).elastic.shapes
    assert found.observe(sensors).shape == (1, found.size)
    twice = OSCILLATOR.extend(found, f"{at}:{direction}{free}", values)
    assert twice.size == model.size + 2 > shapes.shape[1]


def test_a_sensor_between_nodes_does_not_read_what_hangs_next_to_it(
    pair: tuple[Model, Model],
) -> None:
    matrices = with_mesh(pair[1])
    found = OSCILLATOR.extend(matrices, "n2:x", [0.02, 40.0])
    assert isinstance(found.geometry, MatrixGeometry)
    assert isinstance(matrices.geometry, MatrixGeometry)
    near = found.geometry.places["n2~x"][None] + 1e-4
    (at, foot), (own, drawn) = (g.nearest(near)[0] for g in (found.geometry, matrices.geometry))
    assert at == own
    np.testing.assert_array_equal(foot, drawn)


def test_a_mass_on_an_arm_is_that_of_the_frame(pair: tuple[Model, Model]) -> None:
    model, matrices = pair
    mass = 0.05 * model.total_mass
    joint = model.frame_structure.frame.joints[1].name
    for arm in ((0.1, 0.0, 0.0), (0.04, -0.07, 0.1)):
        point = fem.PointMass(fem.Place(joint=joint), mass, arm)
        found = OFFSET.extend(matrices, node_at(matrices, model, joint), [mass, *arm])
        truth = model.attach([point], [])
        np.testing.assert_allclose(hertz(found), hertz(truth), rtol=1e-9)
        assert found.total_mass == pytest.approx(truth.total_mass, rel=1e-9)


@pytest.mark.parametrize(
    ("effect", "values"), [(OFFSET, (0.01, 0.03, -0.02, 0.01)), (OSCILLATOR, (0.02, 30.0))]
)
def test_terms_are_what_the_matrices_change_by(
    pair: tuple[Model, Model], effect: FrameEffect, values: Sequence[float]
) -> None:
    matrices = pair[1]
    place = effect.places(matrices)[3]
    assert len(effect.parameters(matrices, place)) == len(values)
    changed = effect.extend(matrices, place, values)
    change = effect.change(matrices, place)  # type: ignore[attr-defined]
    factors = change.coefficients(np.array([values]))[0]
    for kind in ("mass", "stiffness"):
        unit = np.eye(changed.size)
        total = sum(
            f * term.operator.apply(unit)
            for f, term in zip(factors, change.terms, strict=True)
            if term.matrix == kind
        )
        own = getattr(matrices, kind).copy()
        own.resize(changed.stiffness.shape)
        gap = abs(getattr(changed, kind).toarray() - own.toarray() - total).max()
        assert gap < 1e-12 * abs(own).max()


def test_a_strut_ties_no_two_nodes_of_one_bar() -> None:
    """As of the frame: along a member it is a stiffener, across a corner it is a brace."""
    section, material = Section.rectangular_tube(0.04, 0.03, 0.002), Material(70e9, 0.3, 2700.0)
    model = Model.of(replace(clamped_portal(4, section, material), supports=(), free=True))
    matrices, frame = as_matrices(model), model.frame_structure.frame
    found = {frozenset(ModelPlaces(matrices).node_pairs(p)[0]) for p in BRACE.places(matrices)}
    names = {j.name: node_at(matrices, model, j.name) for j in frame.joints}
    for place in BRACE.places(model):
        assert {names[end] for end in ModelPlaces(model).node_pairs(place)[0]} in found
    nodes = ModelPlaces(matrices).nodes
    on = {"left": (0, 0.0), "right": (0, 1.2), "beam": (2, 1.0)}
    for axis, at in on.values():
        along = {name for name, xyz in nodes.items() if abs(xyz[axis] - at) < 1e-9}
        assert len(along) == 5
        assert not [pair for pair in found if pair <= along]


def test_nodes_and_pairs_of_them_are_drawn(pair: tuple[Model, Model]) -> None:
    matrices = pair[1]
    at = {name: to_point(xyz) for name, xyz in ModelPlaces(matrices).nodes.items()}
    drawn = find_wireframe(matrices, ["n1-n4", "n2:y", "n2:y:free", "group:none"])
    for word, kind, ends in (
        ("n1-n4", "pair", ("n1", "n4")), ("n2:y", "joint", ("n2",)),
        ("n2:y:free", "joint", ("n2",)), ("group:none", "elsewhere", ()),
    ):  # fmt: skip
        place = drawn.place(word)
        assert (place.kind, place.points) == (kind, tuple(at[end] for end in ends))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Return shells in groups, base, upright and rib, in a basis, with a test of ten nodes."""
    file = write_shells(tmp_path_factory.mktemp("folded") / "model.inp")
    model = femubench.read_model(file, unit="mm")
    assert isinstance(model.geometry, MatrixGeometry)
    names = [str(n) for n in range(1, 600, 60)]
    xyz = np.array([model.geometry.places[name] for name in names])
    sensors = Sensors(tuple(names), xyz, ("z",) * len(names))
    return reduce_case(case_of(model, modes_at(model, sensors, 8), 6))


@pytest.mark.parametrize("effect", [BRACE, OSCILLATOR, OFFSET], ids=lambda e: e.name)
def test_in_a_basis_it_is_as_in_the_whole_and_goes_back(small: Case, effect: FrameEffect) -> None:
    model = small.whole
    assert model is not None
    places = effect.places(small.model)
    if effect is OFFSET:  # the others are offered at few nodes of a whole model
        assert set(places) <= set(effect.places(model))
    for place in (places[0], places[-1]):
        values = [0.3 * p.scale + (p.neutral or 0.0) for p in effect.parameters(model, place)]
        own, whole = (effect.extend(m, place, values) for m in (small.model, model))
        np.testing.assert_allclose(hertz(own, 8), hertz(whole, 8), rtol=1e-3)
        back = expand_model(small, own)
        for kind in ("stiffness", "mass"):
            gap = abs(getattr(back, kind) - getattr(whole, kind)).max()
            assert gap < 1e-6 * abs(getattr(whole, kind)).max()
        np.testing.assert_allclose(hertz(back, 8), hertz(whole, 8), rtol=1e-7)


TIED: Boxes = {  # mm
    "FOOT": ((0, 0, 0), (60, 60, 20)), "POST": ((20, 20, 20), (40, 40, 300)),
    "HEAD": ((20, 20, 300), (340, 40, 320)), "LEG": ((320, 20, 20), (340, 40, 300)),
    "FOOT2": ((300, 0, 0), (360, 60, 20)),
}  # fmt: skip
RUBBER = {"FOOT": 7e4, "FOOT2": 7e4}
SEEN: list[Point] = [
    (20, 30, 230, "x"), (60, 20, 310, "y"),
    *((x, 30, z, "x") for x in (20, 340) for z in (90, 160)), (340, 30, 230, "x"),
    *((x, 20, z, "y") for x in (30, 330) for z in (90, 160, 230)),
    *((x, 30, 320, "z") for x in (60, 120, 180, 240, 300)),
    *((x, 20, 310, "y") for x in (180, 300)),
]  # fmt: skip


@pytest.mark.nightly
def test_a_rod_between_two_posts_leads_from_files_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(test_chain, "FACES", SEEN)  # the hammer hits the first two
    write_deck(Path("model.inp"), "C3D20", 20.0, 1.0, TIED, RUBBER)
    write_deck(Path("truth.inp"), "C3D20", 10.0, 1.0, TIED, RUBBER)
    truth = femubench.read_model(Path("truth.inp"), unit="mm")
    ends = {name for name, xyz in ModelPlaces(truth).nodes.items()
            if any(np.allclose(xyz, (x, 0.03, 0.16)) for x in (0.04, 0.32))}  # fmt: skip
    stiffness = 210e9 * 16e-6 / 0.28
    truth = BRACE.extend(truth, "-".join(sorted(ends)), [stiffness])
    write_responses(Path("test.uff"), truth, SEEN, 0)
    assert diagnose_files("model.inp", "test.uff")[0] == "named"
    (found,) = json.loads(Path("found.json").read_text())["causes"]
    assert found["effect"] == "brace-spring"
    nodes = ModelPlaces(femubench.read_case("case").model).nodes
    at = np.array([nodes[name] for name in found["place"].split("-")])
    np.testing.assert_allclose(at[:, 2], 0.16)
    value = found["parameters"][0]
    assert abs(value["value"] - stiffness) < 2.0 * value["std"] < stiffness
