"""Indicators of the place of an error: do they point where something was changed?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from femubench import Measurement, Model, Sensors
from femubench.core.look.localisation import locate
from femubench.core.look.shape_expansion import expand
from femubench.core.modal.eigen import dense_matrices, solve_modes
from femubench.core.schema.diagnosis import LocationRow
from femubench.effect import Seen
from femubench.fem import Factor, Frame, JointSpring, MatrixGeometry, Place, PointMass, Property
from tests.simulated import modes_at, sensors_along

FrameBuilder = Callable[..., Frame]
ELEMENTS = 4
Rows = tuple[LocationRow, ...]


def measured(
    truth: Frame, seed: int | None, *, f_std: float, std: float, count: int = 6, parts: int = 2
) -> Measurement:
    """Return elastic modes of a truth, with noise at the deviations where there is a seed."""
    model, sensors = Model.of(truth), sensors_along(truth, parts)
    data = modes_at(model, sensors, count, hertz_std=f_std, shape_std=std)
    return data if seed is None else data.with_noise(np.random.default_rng([seed, 7]))


def damaged(frame: Frame, rng: np.random.Generator) -> tuple[Frame, str]:
    """Return a frame on twice the elements with one element of the nominal mesh 10-30 % softer."""
    member = frame.members[rng.integers(len(frame.members))].name
    k = int(rng.integers(1, ELEMENTS + 1))
    soft = Factor("E", (f"{member}/{2 * k - 1}", f"{member}/{2 * k}"), 1.0 - rng.uniform(0.1, 0.3))
    return replace(frame, factors=(soft,)), f"{member}/{k}"


def ranking(rows: Rows, indicator: str, names: tuple[str, ...]) -> list[str]:
    return [row.place for row in rows if row.indicator == indicator and row.place in names]


def members_of(frame: Frame) -> tuple[str, ...]:
    return tuple(member.name for member in frame.members)


def elements_of(frame: Frame) -> tuple[str, ...]:
    return tuple(f"{m.name}/{k + 1}" for m in frame.members for k in range(m.elements))


def hits(ladder: FrameBuilder, *, noise: bool, cases: int = 10) -> dict[str, int]:
    """Return how often the damaged member comes first, and the element, by indicator."""
    nominal = ladder(polar=False)
    model, members, elements = Model.of(nominal), members_of(nominal), elements_of(nominal)
    found = dict.fromkeys(("force-residual", "energy-error", "mdlac"), 0)
    found |= {f"{name} element": 0 for name in found}
    for seed in range(cases):
        truth, place = damaged(
            ladder(polar=False, elements=2 * ELEMENTS), np.random.default_rng(seed)
        )
        if noise:
            data = measured(truth, seed, f_std=1e-3, std=0.01)
        else:
            data = measured(truth, None, f_std=1e-4, std=1e-4)
        rows = locate(model, data)
        for name in ("force-residual", "energy-error", "mdlac"):
            found[name] += ranking(rows, name, members)[0] == place.partition("/")[0]
            found[f"{name} element"] += ranking(rows, name, elements)[0] == place
    return found


def test_a_softer_element_is_found_without_noise(ladder: FrameBuilder) -> None:
    found = hits(ladder, noise=False)
    assert found["force-residual"] == 10
    assert found["energy-error"] == 10
    assert found["energy-error element"] == 10


def test_a_softer_element_is_found_in_one_percent_noise(ladder: FrameBuilder) -> None:
    found = hits(ladder, noise=True)
    assert found["force-residual"] >= 8
    assert found["energy-error"] >= 8


def test_frequencies_alone_find_the_class_of_mirror_images(asymmetric_ladder: FrameBuilder) -> None:
    nominal = asymmetric_ladder(polar=False)
    model, right = Model.of(nominal), 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        truth, place = damaged(asymmetric_ladder(polar=False, elements=2 * ELEMENTS), rng)
        data = measured(truth, None, f_std=1e-4, std=1e-4, count=8)
        bare = replace(
            data,
            sensors=Sensors((), np.zeros((0, 3)), ()),
            shapes=np.zeros((0, 8)),
            shape_std=np.zeros((0, 8)),
        )
        rows = locate(model, bare)
        assert {row.indicator for row in rows} == {"mdlac"}
        right += place in ranking(rows, "mdlac", elements_of(nominal))[:4]
    assert right >= 8


@pytest.mark.parametrize("joint", [0, 4])
def test_an_added_mass_shows_at_its_joint(ladder: FrameBuilder, joint: int) -> None:
    nominal, name = ladder(polar=False, accelerometer=False), "ABCDEF"[joint]
    fine = ladder(polar=False, accelerometer=False, elements=8)
    truth = replace(fine, masses=(PointMass(Place(joint=name), 0.05),))
    rows = locate(Model.of(nominal), measured(truth, None, f_std=1e-4, std=1e-3))
    assert ranking(rows, "force-residual", tuple("ABCDEF"))[0] == name
    near = {f"s{joint}"} | {f"s{6 + k}" for k, m in enumerate(nominal.members) if name in m.ends}
    sensors = tuple(f"s{k}" for k in range(13))
    assert ranking(rows, "ecomac", sensors)[0] in near


@pytest.fixture
def noisy(ladder: FrameBuilder) -> Seen:
    truth, _ = damaged(ladder(elements=2 * ELEMENTS), np.random.default_rng(1))
    return Seen(Model.of(ladder()), measured(truth, 3, f_std=1e-3, std=0.01))


def test_the_gap_obeys_its_equations(noisy: Seen) -> None:
    expansion, shapes = expand(noisy), noisy.measurement.shapes
    mass, stiffness = dense_matrices(noisy.model)
    rows = noisy.model.observe(noisy.measurement.sensors)
    for j, eigenvalue in enumerate(expansion.eigenvalues):
        u, gap, seen = expansion.shapes[:, j], expansion.gaps[:, j], rows @ expansion.shapes[:, j]
        assert u @ mass @ u == pytest.approx(1.0)
        residual = stiffness @ u - eigenvalue * (mass @ u)
        assert la.norm(stiffness @ gap - residual) < 1e-6 * la.norm(stiffness @ u)
        # 13 sensors and a free scale: the misfit is that of noise, 12 in chi-square.
        factor = (seen @ shapes[:, j]) / (seen @ seen)
        assert 8.0 < np.square((shapes[:, j] - factor * seen) / 0.01).sum() < 12.1


def test_no_other_shape_with_these_readings_has_a_smaller_error(noisy: Seen) -> None:
    expansion = expand(noisy)
    mass, stiffness = dense_matrices(noisy.model)
    modes = solve_modes(noisy.model)
    elastic, rigid = modes.elastic, modes.shapes[:, modes.rigid]
    seen = np.vstack([noisy.model.observe(noisy.measurement.sensors).toarray(), rigid.T @ mass])
    blind = la.null_space(seen / la.norm(seen, axis=1)[:, None])
    assert blind.shape == (81, 81 - 13 - 3)
    rng = np.random.default_rng(0)
    for j, eigenvalue in enumerate(expansion.eigenvalues):
        weight = np.square(elastic.eigenvalues - eigenvalue) / elastic.eigenvalues
        coordinates = elastic.shapes.T @ mass
        u, gap = expansion.shapes[:, j], expansion.gaps[:, j]
        least = weight @ np.square(coordinates @ u)
        assert least == pytest.approx(gap @ stiffness @ gap, rel=1e-4)
        for _ in range(10):
            step = blind @ rng.standard_normal(blind.shape[1])
            step *= 1e-3 * la.norm(u) / la.norm(step)
            assert weight @ np.square(coordinates @ (u + step)) > least
            assert weight @ np.square(coordinates @ (u - step)) > least


def test_a_soft_joint_shows_in_its_springs(ladder: FrameBuilder) -> None:
    def jointed(elements: int, soft: float) -> Frame:
        frame = ladder(polar=False, elements=elements, accelerometer=False)
        springs = tuple(
            JointSpring(joint, m.name, {"rx": k, "ry": k})
            for m in frame.members
            for joint in m.ends
            for k in [soft * 2e4 if (joint, m.name) == ("D", "DE") else 2e4]
        )
        return replace(frame, joint_springs=springs)

    data = measured(jointed(8, 0.5), None, f_std=1e-4, std=1e-3)
    rows = locate(Model.of(jointed(4, 1.0)), data)
    assert ranking(rows, "energy-error", tuple("ABCDEF"))[0] == "D"


def test_an_exact_model_has_no_place(ladder: FrameBuilder) -> None:
    frame = ladder()
    # The correction for the mesh would be an error of its own here: the truth has this mesh.
    data = measured(frame, None, f_std=1e-4, std=1e-3)
    rows = locate(replace(Model.of(frame), structure=None), data)
    assert rows == ()


def test_missing_readings_are_left_out(ladder: FrameBuilder) -> None:
    frame = ladder(polar=False)
    truth, place = damaged(ladder(polar=False, elements=8), np.random.default_rng(4))
    data = measured(truth, None, f_std=1e-4, std=1e-3)
    shapes = data.shapes.copy()
    shapes[0], shapes[3, :2], shapes[:, 5] = np.nan, np.nan, np.nan
    rows = locate(Model.of(frame), replace(data, shapes=shapes))
    assert ranking(rows, "energy-error", members_of(frame))[0] == place.partition("/")[0]
    assert "s0" not in [row.place for row in rows if row.indicator == "ecomac"]


def test_a_pair_of_matrices_has_nodes_and_groups(ladder: FrameBuilder) -> None:
    nominal = Model.of(ladder(polar=False, accelerometer=False))
    structure, n = nominal.frame_structure, 28
    names = tuple(f"n{k}" for k in range(len(structure.mesh.xyz)))
    groups = {
        m.name: Model.of(
            structure.with_values([_softer(structure.member_labels[m.name])], [2.0])
        ).stiffness
        - nominal.stiffness
        for m in structure.frame.members
    }
    model = replace(
        nominal, structure=None, geometry=MatrixGeometry(names, nominal.dofs), groups=groups
    )
    lump = PointMass(Place(joint="C"), 0.05)
    truth = replace(ladder(polar=False, accelerometer=False), masses=(lump,))
    heavy = locate(model, measured(truth, None, f_std=1e-4, std=1e-3))
    # The sensors are half a member apart: the residual is known no finer.
    first = int(ranking(heavy, "force-residual", names)[0].removeprefix("n"))
    gap = la.norm(structure.mesh.xyz[first] - structure.mesh.xyz[2])
    assert gap < 0.51 * 0.2921
    soft, place = damaged(
        ladder(polar=False, accelerometer=False, elements=8), np.random.default_rng(3)
    )
    rows = locate(model, measured(soft, None, f_std=1e-4, std=1e-3))
    places = tuple(f"group:{name}" for name in groups)
    assert ranking(rows, "energy-error", places)[0] == f"group:{place.partition('/')[0]}"
    assert len(structure.properties) == n


def _softer(labels: tuple[str, ...]) -> Property:
    return Property("E", "E", labels)
