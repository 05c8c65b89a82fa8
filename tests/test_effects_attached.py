"""Effects that hang on a structure or act on it as a whole: model and change agree; physics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
from diagnosis_problems import case_of, catalogue, effects_named, measured
from effect_checks import as_matrices, changed_matrices

from femubench import Model, NotApplicable, Sensors, diagnose, solve_modes
from femubench.core.challenge.structures import structure_named
from femubench.core.challenge.truth import finer
from femubench.core.change.hypothesis import by_themselves, finer as finer_hypotheses, hypothesis_at
from femubench.core.diagnosis.region import Regions
from femubench.core.diagnosis.tables import list_causes
from femubench.core.effect.places import Places, bare_place
from femubench.core.fit.projection import Projector
from femubench.core.inference.examine import examine
from femubench.core.modal.eigen import solve_dense
from femubench.effect import FrameEffect, ModelPlaces, elastic_band
from femubench.fem import FloatArray, Frame, GroundSpring, ModelError, Place, Support
from femubench.plugins.effects.added_mass import AddedMass
from femubench.plugins.effects.amplitude_dependent_stiffness import AmplitudeDependentStiffness
from femubench.plugins.effects.attached_oscillator import AttachedOscillator
from femubench.plugins.effects.axial_preload import AxialPreload
from femubench.plugins.effects.bending_torsion_coupling import BendingTorsionCoupling
from femubench.plugins.effects.brace_spring import BraceSpring
from femubench.plugins.effects.grounding_spring import GroundingSpring
from femubench.plugins.effects.joint_mass import JointMass
from femubench.plugins.effects.mass_eccentricity import MassEccentricity
from femubench.plugins.effects.mass_offset import MassOffset
from femubench.plugins.effects.temperature import Temperature, slope_of

FrameBuilder = Callable[..., Frame]
EXACT = 1e-9


@pytest.fixture(scope="module")
def models(ladder: FrameBuilder, hframe: FrameBuilder, portal: FrameBuilder) -> dict[str, Model]:
    """Return a frame of each plane."""
    frames = {"ladder": ladder(), "hframe": hframe(mesh=(4, 2, 4)), "portal": portal(3)}
    typed = tuple(
        replace(j, type="knee" if j.name in ("J1", "J2") else "") for j in frames["portal"].joints
    )
    frames["portal"] = replace(frames["portal"], joints=typed)
    return {name: Model.of(frame) for name, frame in frames.items()}


def sensors_of(frame: Frame) -> Sensors:
    """Return a sensor at every joint and at a third of every member, in the plane's first way."""
    ends = frame.corners[frame.member_ends]
    xyz = np.vstack([frame.corners, ends[:, 0] + (ends[:, 1] - ends[:, 0]) / 3.0])
    labels = tuple(f"s{i}" for i in range(len(xyz)))
    return Sensors(labels, xyz, ("x" if frame.plane == "3d" else "z",) * len(xyz))


def readings(mass: FloatArray, stiffness: FloatArray, rows: FloatArray, hertz: float) -> FloatArray:
    """Return what sensors read of a unit force at each of them, at one frequency."""
    omega = 2.0 * np.pi * hertz
    return np.asarray(rows @ la.solve(stiffness - omega**2 * mass, rows.T))


def assert_agree(effect: Any, model: Model, place: str, values: Sequence[float]) -> Model:
    """Compare the extended model with the nominal one and its change; return the former."""
    extended = effect.extend(model, place, values)
    mass, stiffness = changed_matrices(model, effect.change(model, place), values)
    assert extended.size == len(mass)
    exact = (extended.mass.toarray(), extended.stiffness.toarray())
    # The massless dofs of flexible joints have no eigenvalues of their own.
    own, other = (solve_dense(m, k)[0] for m, k in ((mass, stiffness), exact))
    count = 6 + int(np.sum(own < 1.0))
    scale = own[count - 1]
    np.testing.assert_allclose(own[:count], other[:count], rtol=EXACT, atol=1e-10 * scale)
    sensors = sensors_of(model.frame_structure.frame)
    rows = model.observe(sensors).toarray()
    rows = np.hstack([rows, np.zeros((len(rows), len(mass) - model.size))])
    for hertz in np.sqrt(scale) / (2.0 * np.pi) * np.array([0.11, 0.63]):
        expected = readings(*exact, extended.observe(sensors).toarray(), hertz)
        seen = readings(mass, stiffness, rows, hertz)
        np.testing.assert_allclose(seen, expected, atol=100.0 * EXACT * np.abs(expected).max())
    return extended


def sizes(effect: Any, model: Model, place: str, x: float = 1.3) -> list[float]:
    """Return the parameters at some coordinate."""
    return [float(p.value(np.array(x))) for p in effect.parameters(model, place)]


CASES = [
    (JointMass, "portal", "knee"),
    (AddedMass, "ladder", "BE@0.25"),
    (AddedMass, "portal", "m4@0.5"),
    (MassOffset, "hframe", "upper1@0.5"),
    (MassOffset, "portal", "m4@0.5"),
    (GroundingSpring, "ladder", "AB@0.5"),
    (GroundingSpring, "hframe", "L2:x"),
    (BraceSpring, "portal", "J0-J6"),
    (AttachedOscillator, "ladder", "F"),
    (AttachedOscillator, "hframe", "horizontal@0.5:x"),
    (AttachedOscillator, "portal", "J2:y:free"),
    (AxialPreload, "portal", "m6"),
    (MassEccentricity, "hframe", "upper1"),
    (MassEccentricity, "portal", "m2"),
    (BendingTorsionCoupling, "ladder", "CF"),
    (BendingTorsionCoupling, "portal", "m8"),
    (Temperature, "portal", "all"),
    (Temperature, "portal", "all:y"),
]


@pytest.mark.parametrize(("effect", "name", "place"), CASES)
def test_model_and_change_agree(
    models: dict[str, Model], effect: type[FrameEffect], name: str, place: str
) -> None:
    made, model = effect(), models[name]
    assert bare_place(place) in made.places(model)
    for x in (0.4, 2.0):
        values = sizes(made, model, place, x)
        extended = assert_agree(made, model, place, values)
        assert extended.structure is not None
    parameters = made.parameters(model, place)
    neutral = [float(p.value(np.array(0.0))) for p in parameters]
    mass, stiffness = changed_matrices(model, made.change(model, place), neutral)
    size = model.size
    np.testing.assert_array_equal(mass[:size, :size], model.mass.toarray())
    np.testing.assert_array_equal(stiffness[:size, :size], model.stiffness.toarray())
    assert made.frame(model.frame_structure.frame, place, neutral) == model.frame_structure.frame


@pytest.mark.parametrize(
    ("effect", "place"),
    [
        (GroundingSpring, "J5:z"),
        (AxialPreload, "m0"),
        (MassEccentricity, "m5"),
        (BendingTorsionCoupling, "m5"),
        (BraceSpring, "J1-J6"),
        (AttachedOscillator, "J6:x"),
        (Temperature, "all:x"),
    ],
)
def test_flexible_joints_and_rigid_ends_do_no_harm(
    fitted_portal: FrameBuilder, effect: type[FrameEffect], place: str
) -> None:
    made, model = effect(), Model.of(fitted_portal(4))
    assert place in made.places(model)
    assert_agree(made, model, place, sizes(made, model, place))


def hertz(model: Model, count: int = 12) -> FloatArray:
    return solve_modes(model, count).natural_frequencies


def test_what_is_held_carries_nothing(ladder: FrameBuilder) -> None:
    supports = (Support(Place(joint="A"), ("z", "rx", "ry")),)
    model = Model.of(replace(ladder(accelerometer=False), supports=supports))
    for effect in (AddedMass(), GroundingSpring(), AttachedOscillator()):
        places = effect.places(model)
        assert "A" not in places
        assert "B" in places


def test_mass_between_nodes_is_interpolated(ladder: FrameBuilder) -> None:
    """The model splits the element, the change does not: on a fine mesh they agree."""
    model = Model.of(ladder(elements=16))
    extended = AddedMass().extend(model, "AB@0.29", [0.02])
    assert extended.size > model.size
    mass, stiffness = changed_matrices(model, AddedMass().change(model, "AB@0.29"), [0.02])
    own = la.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[3, 8])
    exact = solve_modes(extended, 9).eigenvalues[3:]
    np.testing.assert_allclose(own, exact, rtol=1e-6)
    assert np.abs(own / solve_modes(model, 9).eigenvalues[3:] - 1.0).max() > 1e-2


def test_stiff_oscillator_is_a_mass_and_a_soft_one_rides_along(models: dict[str, Model]) -> None:
    """In its own direction the mass counts only where the spring is stiff, across it always."""
    model, effect = models["hframe"], AttachedOscillator()
    stiff = effect.extend(model, "T1:x", [0.5, 1e6])
    mass = AddedMass().extend(model, "T1", [0.5])
    np.testing.assert_allclose(hertz(stiff)[3:], hertz(mass)[3:], rtol=1e-6)
    soft = effect.extend(model, "T1:x", [0.5, 1e-3])
    at, _ = ModelPlaces(model).directed_point("T1:x")
    across = ModelPlaces(model).translations(at, ["z"])
    carried = replace(model, mass=model.mass + 0.5 * (across.T @ across))
    # Three rigid modes and the mass that hangs on next to nothing.
    np.testing.assert_allclose(hertz(soft, 13)[4:], hertz(carried)[3:], rtol=1e-6)
    free = effect.extend(model, "T1:x:free", [0.5, 1e-3])
    np.testing.assert_allclose(hertz(free, 13)[4:], hertz(model)[3:], rtol=1e-6)


def test_an_oscillator_is_tried_free_where_it_can_be_felt_across(models: dict[str, Model]) -> None:
    effect = AttachedOscillator()
    assert effect.finer(models["hframe"], "T1:x") == ("T1:x:free",)
    assert effect.finer(models["hframe"], "T1:x:free") == ()
    assert effect.finer(models["ladder"], "A") == ()  # out of plane there is one direction
    assert Places(models["hframe"].frame_structure.frame).match("T1:x:free", "T1:-x")


@pytest.mark.parametrize("place", ["T1:x", "T1:z:free"])
def test_on_a_scale_an_oscillator_weighs_its_mass(models: dict[str, Model], place: str) -> None:
    model, effect = models["hframe"], AttachedOscillator()
    seen = Projector(model, solve_modes(model, 9).shapes)(hypothesis_at(model, effect, place, 1))
    factors = seen.hypothesis.change.coefficients(np.array([[0.3, 50.0]]))[0]
    assert factors @ seen.weights == pytest.approx(0.3)
    (own,) = effect.frame(model.frame_structure.frame, place, [0.3, 50.0]).oscillators
    assert (own.crosswise, own.direction) == (not place.endswith("free"), place[3])


def test_known_eccentricity_is_gone_on_from(models: dict[str, Model]) -> None:
    effect = MassEccentricity()
    for name, place in (("ladder", "BE"), ("portal", "m2")):
        known = effect.extend(models[name], place, [0.002])
        assert_agree(effect, known, place, [0.003])


@pytest.mark.slow(5)
@pytest.mark.parametrize(
    ("name", "place", "widths", "stated"),
    [
        ("ladder", "rung-left@0.5", -0.5, "mass-offset"),
        ("portal", "left-upper@0.5", 0.0, "added-mass"),
    ],
)
def test_a_mass_next_to_the_axis_is_said_where_it_shows(
    name: str, place: str, widths: float, stated: str
) -> None:
    specimen, effect = structure_named(name), MassOffset()
    mass = 0.03 * specimen.model.total_mass
    offset = widths * effect.parameters(specimen.model, place)[1].scale
    truth = Model.of(effect.frame(finer(specimen.frame), place, [mass, offset]))
    rng = np.random.default_rng(3)
    test = measured(truth, specimen.frame, count=8, shapes=6, rng=rng)
    seen = examine(specimen.model, test, tuple(catalogue().values()), tolerance=0.002)
    (cause,) = list_causes(seen, seen.best, Regions(seen, ()))
    assert (cause.effect, cause.place) == (stated, place)
    included, known = seen.posterior.inclusion("added-mass"), seen.posterior.known
    assert cause.probability == pytest.approx(known * included)
    values = [p.value for p in cause.parameters]
    np.testing.assert_allclose(values, [mass, offset][: len(values)], rtol=0.15)


def test_an_offset_alone_is_tried_by_itself(models: dict[str, Model]) -> None:
    known = catalogue()
    offset, mass = known["mass-offset"], known["added-mass"]
    assert by_themselves([offset, mass]) == (mass,)
    assert by_themselves([offset]) == (offset,)
    here = hypothesis_at(models["ladder"], mass, "BE@0.25", 21)
    (more,) = finer_hypotheses(here, models["ladder"], [offset, mass])
    assert (more.effect, more.name, more.places) == (offset, "added-mass", 42)
    at_a_joint = hypothesis_at(models["ladder"], mass, "B", 21)
    assert finer_hypotheses(at_a_joint, models["ladder"], [offset, mass]) == []


def test_temperature_is_a_modulus(models: dict[str, Model]) -> None:
    for name, slope in (("ladder", -3.6e-4), ("hframe", -2.4e-4)):
        warm = Temperature().extend(models[name], "all", [25.0])
        before, after = solve_modes(models[name]).elastic, solve_modes(warm).elastic
        ratio = after.eigenvalues[:8] / before.eigenvalues[:8]
        np.testing.assert_allclose(ratio, 1.0 + 25.0 * slope, rtol=1e-8)


def test_amplitude_needs_levels(models: dict[str, Model]) -> None:
    effect, model = AmplitudeDependentStiffness(), models["ladder"]
    (parameter,) = effect.parameters(model, "all")
    assert effect.needs == "levels"
    assert parameter.one_sided
    soft = solve_modes(effect.extend(model, "all", [0.04])).elastic
    ratio = soft.eigenvalues[:6] / solve_modes(model).elastic.eigenvalues[:6]
    np.testing.assert_allclose(ratio, 0.96, rtol=1e-8)


def test_models_from_matrices(models: dict[str, Model]) -> None:
    """What hangs on nodes goes without a frame; all else says that it does not apply."""
    frame, model = models["hframe"], as_matrices(models["hframe"])
    np.testing.assert_allclose(elastic_band(model), elastic_band(frame), rtol=1e-9)
    np.testing.assert_allclose(model.total_mass, frame.total_mass, rtol=1e-9)
    for effect, suffix in ((AddedMass(), ""), (GroundingSpring(), ":x")):
        place = f"n2{suffix}"
        assert place in effect.places(model)
        values = sizes(effect, model, place)
        mass, stiffness = changed_matrices(model, effect.change(model, place), values)
        extended = effect.extend(model, place, values)
        np.testing.assert_allclose(mass, extended.mass.toarray(), rtol=1e-12)
        np.testing.assert_allclose(stiffness, extended.stiffness.toarray(), rtol=1e-12)
        name = frame.frame_structure.frame.joints[2].name
        other = effect.extend(frame, name + suffix, values)
        np.testing.assert_allclose(extended.mass.toarray(), other.mass.toarray(), atol=1e-15)
    with pytest.raises(ModelError, match="no node"):
        AddedMass().change(model, "nowhere")
    for other_effect in (JointMass, AxialPreload, Temperature):
        assert not other_effect().places(model)
    with pytest.raises(NotApplicable):
        Temperature().extend(model, "all", [1.0])


def test_a_temperature_that_changes_along_an_axis_goes_with_the_elements(
    hframe: FrameBuilder,
) -> None:
    """By hand: in the middle 5 K, from end to end 20 K; upper and lower members lie across."""
    model, effect = Model.of(hframe(mesh=(4, 2, 4))), Temperature()
    frame = model.frame_structure.frame
    assert tuple(effect.places(model)) == ("all", "all:x", "all:z")
    low, high = (getattr(frame.corners[:, 2], f)() for f in ("min", "max"))
    slope = slope_of(frame.members[0].material.E)
    found = {at: f.factor for f in effect.frame(frame, "all:z", [5.0, 20.0]).factors for at in f.at}
    assert len(found) == sum(m.elements for m in frame.members)
    for member, (first, last) in zip(frame.members, frame.member_ends, strict=True):
        z = frame.corners[[first, last], 2]
        for k in range(member.elements):
            middle = z[0] + (k + 0.5) / member.elements * (z[1] - z[0])
            warmer = 5.0 + 20.0 * ((middle - low) / (high - low) - 0.5)
            assert found[f"{member.name}/{k + 1}"] == pytest.approx(1.0 + slope * warmer, abs=1e-9)
    even = effect.extend(model, "all:z", [25.0, 0.0])
    np.testing.assert_allclose(hertz(even)[3:], hertz(effect.extend(model, "all", [25.0]))[3:])


def test_where_it_was_warm_is_found_where_the_data_show_it(ladder: FrameBuilder) -> None:
    """A machine at one end: neither a modulus of all nor one member does as well."""
    model, effect, std = Model.of(ladder()), Temperature(), 1e-4
    finer, rng = Model.of(ladder(elements=16)), np.random.default_rng(4)
    truth = effect.extend(finer, "all:x", [10.0, 20.0])
    test = measured(truth, ladder(), count=8, rng=rng)
    exact = solve_modes(truth).elastic.natural_frequencies[:8]
    frequencies = exact * (1.0 + std * rng.normal(size=8))
    test = replace(test, frequencies=frequencies, frequency_std=std * frequencies)
    known = effects_named("youngs-modulus", "density", "temperature", "member-stiffness")
    found = diagnose(replace(case_of(model, test, 7), tolerance=0.0), known)
    cause = found.causes[0]
    assert (cause.effect, cause.place) == ("temperature", "all:x")
    for parameter, value in zip(cause.parameters, (10.0, 20.0), strict=True):
        assert parameter.std is not None
        assert abs(parameter.value - value) < 3.0 * parameter.std < 10.0


def test_suspension_does_not_set_the_scale(ladder: FrameBuilder) -> None:
    """Modes on a soft suspension are no elastic modes of the structure."""
    frame = ladder()
    springs = tuple(GroundSpring(Place(joint=name), "z", 500.0) for name in "ACDF")
    hung = Model.of(replace(frame, springs=springs))
    assert not solve_modes(hung).rigid.any()
    np.testing.assert_allclose(elastic_band(hung), elastic_band(Model.of(frame)), rtol=1e-2)
