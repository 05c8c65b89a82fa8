"""The plain look: every warning where it belongs, and its changes against full solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from femubench import Measurement, Model, Sensors
from femubench.core.fem.frame import (
    Factor,
    Frame,
    GroundSpring,
    Joint,
    Link,
    Material,
    Member,
    Place,
    PointMass,
    Preload,
    Support,
)
from femubench.core.fem.joints import whole_members
from femubench.core.fit.mesh_error import mesh_bias, refine_mesh
from femubench.core.look import look as core_look
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.diagnosis import list_effects
from femubench.effect import LookWarning
from femubench.fem import FloatArray, Property, Section, Structure
from femubench.plugins.effects.torsion_constant import estimate_torsion_constant, is_round
from tests.simulated import modes_at, sensors_along

FrameBuilder = Callable[..., Frame]


def frequencies(frame: Frame, count: int) -> FloatArray:
    return np.asarray(elastic_modes(Model.of(frame), count).natural_frequencies[:count])


def with_section(frame: Frame, section: Section) -> Frame:
    return replace(frame, members=tuple(replace(m, section=section) for m in frame.members))


def of_effect(warnings: tuple[LookWarning, ...], effect: str) -> LookWarning:
    (found,) = [warning for warning in warnings if warning.effect == effect]
    return found


@pytest.fixture
def clean(ladder: FrameBuilder) -> Frame:
    """Return a slender ladder with nothing to complain of: shear, rotary inertia, Bredt's J."""
    return ladder("timoshenko", polar=False, elements=8)


def test_nothing_is_found_in_a_good_model(clean: Frame) -> None:
    model = Model.of(clean)
    assert look(model, replace(measured(model), total_mass=(model.total_mass, 0.001))) == ()


def test_a_polar_moment_for_a_torsion_constant_is_found(ladder: FrameBuilder) -> None:
    frame = ladder()
    model = Model.of(frame)
    warning = of_effect(look(model, measured(model)), "torsion-constant")
    assert warning.where == "all"
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    repaired = frequencies(with_section(frame, tube), 5) / frequencies(frame, 5) - 1.0
    assert [mode for mode, _ in warning.changes] == [1, 2, 3, 4, 5]
    np.testing.assert_allclose([p for _, p in warning.changes], 100.0 * repaired, rtol=1e-9)
    assert min(repaired) < -0.1  # 0.113 at the first mode


@pytest.mark.parametrize(
    "section", [Section.round_tube(0.03, 0.002), Section.rectangular_tube(0.03, 0.02, 0.002)]
)
def test_sections_with_their_own_constant_raise_no_warning(
    ladder: FrameBuilder, section: Section
) -> None:
    model = Model.of(with_section(ladder(), section))
    assert not texts(look(model, measured(model)), "torsion")


def numbers(section: Section, J: float) -> Section:
    return Section(A=section.A, Iy=section.Iy, Iz=section.Iz, J=J, Jp=section.Iy + section.Iz)


@pytest.mark.parametrize(
    ("section", "accuracy"),
    [
        (Section.rectangular_tube(0.0254, 0.0254, 0.00238), 1e-9),
        (Section.solid_rectangle(0.04, 0.02), 0.10),
    ],
)
def test_numbers_alone_give_nearly_the_constant_of_the_shape(
    section: Section, accuracy: float
) -> None:
    estimate = estimate_torsion_constant(numbers(section, section.Jp))
    assert estimate is not None
    assert estimate[0] == pytest.approx(section.J, rel=accuracy)


def test_numbers_alone_tell_circles_as_far_as_they_can() -> None:
    full, hollow = Section.round_tube(0.03, 0.015), Section.round_tube(0.03, 0.002)
    assert is_round(numbers(full, full.J)) is True
    assert is_round(numbers(hollow, hollow.J)) is None  # a square tube has the same A, Iy, Iz
    assert is_round(numbers(Section.solid_rectangle(0.02, 0.02), 1.0)) is False
    assert is_round(numbers(Section.rectangular_tube(0.06, 0.03, 0.001), 1.0)) is False


@pytest.mark.parametrize(("factor", "word"), [(5.0, "exceeds"), (0.2, "times that of its shape")])
def test_impossible_and_far_off_constants_are_found(
    ladder: FrameBuilder, factor: float, word: str
) -> None:
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    model = Model.of(with_section(ladder(), replace(tube, J=factor * tube.J)))
    assert texts(look(model, measured(model)), word)


def test_the_weighed_mass_is_compared(clean: Frame) -> None:
    model = Model.of(clean)
    mass = model.total_mass
    for weighed, expected in ((mass + 0.029, 0), (mass + 0.1, 1), (mass - 0.1, 1)):
        data = replace(measured(model), total_mass=(weighed, 0.01))
        assert len(texts(look(model, data), "on the scales")) == expected


def test_what_rests_on_supports_is_weighed_too(clean: Frame) -> None:
    held = Support(Place(joint=clean.joints[0].name), ("z", "rx", "ry"))
    model = Model.of(replace(clean, supports=(held,)))
    mass = Model.of(clean).total_mass
    data = replace(measured(model), total_mass=(mass, 1e-4 * mass))
    assert texts(look(model, data), "on the scales") == []
    assert model.total_mass == pytest.approx(mass, rel=1e-12)


def test_the_mass_warning_scales_members_and_not_lumps(clean: Frame) -> None:
    model = Model.of(clean)
    lump = sum(item.mass for item in clean.masses)
    data = replace(measured(model), total_mass=(1.1 * model.total_mass, 0.01))
    warning = of_effect(look(model, data), "density")
    factor = (data.total_mass[0] - lump) / (model.total_mass - lump)  # type: ignore[index]
    material = replace(clean.members[0].material, rho=factor * clean.members[0].material.rho)
    heavier = replace(clean, members=tuple(replace(m, material=material) for m in clean.members))
    expected = frequencies(heavier, 5) / frequencies(clean, 5) - 1.0
    np.testing.assert_allclose([p for _, p in warning.changes], 100.0 * expected, rtol=1e-6)


def test_shear_and_rotary_inertia_against_full_solutions(ladder: FrameBuilder) -> None:
    frame = ladder(polar=False, accelerometer=False)
    model = Model.of(frame)
    found = look(model, measured(model))
    plain = frequencies(frame, 5)
    shear = replace(frame, beam="timoshenko", rotary_inertia=False)
    rotary = replace(frame, rotary_inertia=True)
    for effect, other in (("shear-deformation", shear), ("rotary-inertia", rotary)):
        expected = 100.0 * (frequencies(other, 5) / plain - 1.0)
        np.testing.assert_allclose(
            [p for _, p in of_effect(found, effect).changes], expected, rtol=1e-9
        )
    assert "5/6" not in of_effect(found, "shear-deformation").what


def test_an_assumed_shear_coefficient_is_said(hframe: FrameBuilder) -> None:
    frame = hframe(mesh=(8, 4, 6), accelerometers=False)
    model = Model.of(frame)
    warning = of_effect(look(model, measured(model, 5)), "shear-deformation")
    assert "kappa = 5/6" in warning.what
    section = replace(frame.members[0].section, kappa=Section.constant_kappa(5.0 / 6.0))
    whole = replace(with_section(frame, section), beam="timoshenko", rotary_inertia=False)
    expected = 100.0 * (frequencies(whole, 5) / frequencies(frame, 5) - 1.0)
    got = [p for _, p in warning.changes]
    np.testing.assert_allclose(got, expected[: len(got)], rtol=1e-9)


def test_stubby_members_are_named(hframe: FrameBuilder) -> None:
    section = Section.rectangular_tube(0.05, 0.05, 0.003)
    model = Model.of(with_section(hframe(mesh=(6, 3, 5), accelerometers=False), section))
    (warning,) = texts(look(model, measured(model, 3)), "times their height")
    assert warning.where == "lower1, lower2"


def wing(cuts: int, width: float, height: float, *, link: bool = False) -> Frame:
    """Return a spar in many pieces, free, with a fuselage that it may stand off by a link."""
    names = [f"w{k}" for k in range(cuts + 1)]
    joints = [Joint(n, (0.0, 2.0 * k / cuts - 1.0, 0.1 * link)) for k, n in enumerate(names)]
    middle = names[cuts // 2]
    joints += [Joint("nose", (1.0, 0.0, 0.0)), Joint("tail", (-1.0, 0.0, 0.0))]
    spar, rod = Section.solid_rectangle(width, height), Section.solid_rectangle(0.04, 0.04)
    metal = Material(72e9, 0.3, 2700.0)
    members = [
        Member(f"m{k}", (a, b), 1, spar, metal, (0.0, 0.0, 1.0))
        for k, (a, b) in enumerate(pairwise(names))
    ]
    body = "body" if link else middle
    joints += [Joint("body", (0.0, 0.0, 0.0))] if link else []
    members += [Member(f"{end}-rod", (body, end), 4, rod, metal) for end in ("nose", "tail")]
    links = (Link("body", (middle,)),) if link else ()
    return Frame("3d", "timoshenko", tuple(joints), tuple(members), links=links)


def test_a_thin_wing_in_many_pieces_is_slender() -> None:
    model = Model.of(wing(38, 0.1, 0.01, link=True))
    assert len(whole_members(model.frame_structure.frame)) == 4
    assert not texts(look(model, measured(model, 3)), "times their height")


def test_the_height_is_that_of_the_direction_of_bending() -> None:
    flat, upright = (Model.of(wing(2, *sizes)) for sizes in ((0.16, 0.02), (0.02, 0.16)))
    assert not texts(look(flat, measured(flat, 3)), "times their height")
    (warning,) = texts(look(upright, measured(upright, 7)), "times their height")
    assert "2 of 4 members" in warning.what
    assert warning.where == "m0, m1"


def test_what_holds_a_structure_that_hangs_free_is_said() -> None:
    frame = replace(wing(4, 0.1, 0.01), free=True)
    for stiffness, held in ((20.0, False), (5e4, True)):
        springs = tuple(GroundSpring(Place(joint="w2"), d, stiffness) for d in "xyz")
        source = Model.of(replace(frame, springs=springs))
        for model in (source, replace(source, structure=None)):
            found = texts(look(model, measured(source, 8)), "hang free")
            assert bool(found) == held
    assert not texts(look(Model.of(frame), measured(Model.of(frame), 3)), "hang free")


@pytest.mark.parametrize(
    ("material", "word"),
    [(Material(68.0, 0.33, 2700.0), "E / rho"), (Material(68e9, 0.5, 2700.0), "Poisson")],
)
def test_materials_that_do_not_exist(clean: Frame, material: Material, word: str) -> None:
    members = tuple(replace(m, material=material) for m in clean.members)
    model = Model.of(replace(clean, members=members))
    assert [w.where for w in texts(look(model, measured(model)), word)] == ["all"]


def test_a_shear_coefficient_above_one(clean: Frame) -> None:
    section = replace(clean.members[0].section, kappa=Section.constant_kappa(1.3))
    model = Model.of(with_section(clean, section))
    assert len(texts(look(model, measured(model)), "shear coefficient")) == len(clean.members)


def test_a_pair_of_matrices_is_weighed_and_nothing_else(clean: Frame) -> None:
    frame = Model.of(clean)
    model = replace(frame, structure=None)
    mass = frame.total_mass
    data = replace(measured(frame), total_mass=(1.21 * mass, 0.01))
    (warning,) = look(model, data)
    assert warning.effect == "density"
    np.testing.assert_allclose([p for _, p in warning.changes], 100.0 * (1.0 / 1.1 - 1.0))
    assert mesh_bias(model, 5) is None


def look(
    model: Model, measurement: Measurement, band: tuple[float, float] | None = None
) -> tuple[LookWarning, ...]:
    """Return what a diagnosis would show: the looks of all effects included."""
    return core_look.look(model, measurement, band, list_effects())


def measured(model: Model, count: int = 5, sensors: Sensors | None = None) -> Measurement:
    """Return elastic modes of a model as if measured, 0.2 % and 1.5 %."""
    sensors = sensors_along(model.frame_structure.frame) if sensors is None else sensors
    return modes_at(model, sensors, count, hertz_std=0.002)


def texts(warnings: tuple[LookWarning, ...], word: str) -> list[LookWarning]:
    return [warning for warning in warnings if word in warning.what]


def test_a_finer_mesh_is_the_mesh_with_twice_the_elements(ladder: FrameBuilder) -> None:
    coarse, fine = ladder(elements=4), ladder(elements=8)
    bias = mesh_bias(Model.of(coarse), 12)
    assert bias is not None
    np.testing.assert_allclose(
        bias, frequencies(fine, 12) / frequencies(coarse, 12) - 1.0, atol=1e-12
    )
    assert (bias < 0.0).all()  # a conforming mesh is too stiff


def test_a_finer_mesh_keeps_factors_springs_ends_and_changes(fitted_portal: FrameBuilder) -> None:
    factors = (Factor("E", ("m2/1",), 0.5), Factor("density", ("m3",), 1.5))
    frame = fitted_portal(3, factors=factors, preloads=(Preload("m2", 1e3),))
    structure = Structure.build(frame).with_values(
        [Property("EI", "EI", ("m4/2",)), Property("a", "rigid", ("m8@J5",), "m")], [0.7, 0.025]
    )
    finer = structure.rebuilt(refine_mesh(structure))
    assert len(finer.properties) > 1.9 * len(structure.properties) - 2
    for name in ("EIy", "rhoA", "GJ"):
        for label, rows in structure.label_index.items():
            values = getattr(finer.properties, name)[finer.label_index[label]]
            np.testing.assert_allclose(values, getattr(structure.properties, name)[rows[0]])
    assert Model.of(finer).total_mass == pytest.approx(Model.of(structure).total_mass, rel=1e-9)
    bias = mesh_bias(Model.of(structure), 6)
    assert bias is not None
    assert np.abs(bias).max() < 0.01


def test_a_coarse_mesh_is_found_and_a_fine_one_is_not(ladder: FrameBuilder) -> None:
    for elements, expected in ((2, 1), (8, 0)):
        model = Model.of(ladder(polar=False, elements=elements))
        assert len(texts(look(model, measured(model)), "mesh is coarse")) == expected


def test_elements_out_of_proportion_are_found(ladder: FrameBuilder) -> None:
    frame = ladder()
    near = replace(frame, masses=(PointMass(Place(member="AB", s=0.256), 0.01),))
    model = Model.of(near)
    (warning,) = texts(look(model, measured(model)), "shorter than its neighbour")
    assert warning.where == "AB/2"


@pytest.mark.parametrize("relative", [1e-7, 0.4, np.nan])
def test_absurd_deviations_are_found(clean: Frame, relative: float) -> None:
    model = Model.of(clean)
    data = measured(model)
    std = data.frequency_std.copy()
    std[2] = relative * data.frequencies[2]
    found = texts(look(model, replace(data, frequency_std=std)), "of mode 3 ")
    assert len(found) == 1


def test_two_sensors_at_one_place(clean: Frame) -> None:
    model = Model.of(clean)
    s = sensors_along(clean)
    twice = Sensors(
        (*s.labels, "again"), np.vstack([s.xyz, s.xyz[3]]), (*s.directions[:-1], "z", "-z")
    )
    (warning,) = texts(look(model, measured(model, sensors=twice)), "same motion")
    assert warning.where == "again"
    assert "s3" in warning.what


@pytest.mark.parametrize(("sensor", "gain"), [(0, -1.0), (5, 0.3), (12, 10.0)])
def test_a_sensor_with_another_gain_is_found(
    asymmetric_ladder: FrameBuilder, sensor: int, gain: float
) -> None:
    model = Model.of(asymmetric_ladder(polar=False))
    truth = Model.of(asymmetric_ladder(softness=2.0, elements=8))  # also the wrong torsion constant
    data = measured(truth).with_noise(np.random.default_rng(0))
    data.shapes[sensor] *= gain
    (warning,) = texts(look(model, data), "other sensors")
    assert warning.where == f"s{sensor}"


@pytest.mark.parametrize("seed", range(4))
def test_no_sensor_is_blamed_for_an_error_of_the_model(ladder: FrameBuilder, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = ladder(polar=bool(seed % 2), elements=8)
    member = truth.members[rng.integers(7)].name
    soft = Factor("E", (f"{member}/{rng.integers(1, 9)}",), 0.5)
    lump = PointMass(Place(joint="ABCDEF"[rng.integers(6)]), 0.2)
    truth = replace(truth, factors=(soft,), masses=(*truth.masses, lump))
    data = measured(Model.of(truth)).with_noise(rng)
    assert not texts(look(Model.of(ladder()), data), "other sensors")


def test_more_modes_in_the_band_than_were_found(clean: Frame) -> None:
    model = Model.of(clean)
    data = measured(model, 5)
    band = (50.0, 1.1 * float(data.frequencies[-1]))
    assert not texts(look(model, data, band), "inside the band")
    (warning,) = texts(look(model, data.select([1, 2, 4, 5]), band), "inside the band")
    assert "mode 3 at" in warning.what
