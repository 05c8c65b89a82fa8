"""Large models with groups: the basis in which groups stay groups, and the way back from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence

import femubench
from femubench import Case, InputError, Measurement, Model, Sensors, solve_modes
from femubench.core.case.case import Modification
from femubench.core.case.reader import read_case
from femubench.core.case.reducing import expand_model, reduce_case
from femubench.core.case.writing import write_case
from femubench.core.change.terms import ElementOperator
from femubench.core.errors import ModelError
from femubench.core.fem.beam import BeamProperties
from femubench.core.modal import grouped_reduction
from femubench.core.modal.grouped_reduction import reduce_groups
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.typing import FloatArray, SparseArray
from femubench.fem import (
    Frame,
    Groups,
    Joint,
    Material,
    Member,
    Place,
    PointMass,
    Property,
    Section,
    matrix_model,
)
from femubench.plugins.readers import solid_elements
from tests.simulated import modes_at

STEEL = Material(2.1e11, 0.3, 7850.0)
BAR = Section(4e-4, 1.2e-8, 2.4e-8, 2e-8, 3.6e-8)
NODES = ("A", "B", "C", "D", "left 7", "beam 9", "right 20", "beam 20", "left 20")
JOINT, PART = "joint B", "left"


def frame() -> Frame:
    """Return a portal of three members of thirty elements, free in space."""
    places = {"A": (0, 0, 0), "B": (0, 0, 0.9), "C": (1.2, 0.2, 0.9), "D": (1.2, 0.2, 0)}
    joints = tuple(Joint(name, tuple(map(float, xyz))) for name, xyz in places.items())
    ends = {"left": ("A", "B"), "beam": ("B", "C"), "right": ("C", "D")}
    members = tuple(Member(name, pair, 30, BAR, STEEL) for name, pair in ends.items())
    return Frame("3d", "euler-bernoulli", joints, members, free=True)


def large() -> Model:
    """Return it as matrices: a group of stiffness and mass a member, two joints of an element."""
    model = Model.of(frame())
    structure = model.frame_structure

    def part(of: Callable[[BeamProperties], FloatArray], *elements: int) -> SparseArray:
        own = np.array(elements)
        blocks = of(structure.properties.take(own))
        rows = ElementOperator(structure, own, blocks).local_rows
        return sp.csc_array(rows.T @ sp.block_diag(blocks, format="csc") @ rows)

    rows = {m: tuple(range(30 * i, 30 * i + 30)) for i, m in enumerate(("left", "beam", "right"))}
    joints = {JOINT: 29, "joint C": 60}
    groups = {
        name: part(BeamProperties.stiffness_matrices, *sorted({*own}.difference(joints.values())))
        for name, own in rows.items()
    }
    groups |= {
        name: part(BeamProperties.stiffness_matrices, element) for name, element in joints.items()
    }
    heavy = {name: part(BeamProperties.mass_matrices, *own) for name, own in rows.items()}
    mass, stiffness = sum(heavy.values()), sum(groups.values())
    kinds = structure.mesh.node_keys(4)
    label = ["ABCD"[w] if p == -1 else f"{frame().members[p].name} {n}" for n, (p, w, _) in
             enumerate(kinds)]  # fmt: skip
    first = {m: min(n for n, name in enumerate(label) if name.startswith(m)) for m in rows}
    names = [n if len(n) == 1 else f"{n.split()[0]} {int(n.split()[1]) - first[n.split()[0]]}"
             for n in label]  # fmt: skip
    dofs = model.dofs
    found = matrix_model(
        mass, stiffness, [names[n] for n in dofs.node], dofs.direction, dofs.xyz, groups
    )
    priors = {JOINT: 5.0, "joint C": 5.0}
    return replace(found, mass_groups=heavy, group_priors=priors, free=True)


MODEL = large()
GEOMETRY = MODEL.geometry
KEPT = np.array([row for node in NODES for row in GEOMETRY.rows_of[node]])  # type: ignore[attr-defined]


def measured(truth: Model, count: int = 8) -> Measurement:
    """Return the lowest modes of a model at three directions of the kept nodes."""
    rows = [row for row in KEPT if truth.dofs.direction[row] in "xyz"]
    directions = tuple(truth.dofs.direction[i] for i in rows)
    sensors = Sensors(tuple(f"S{i}" for i in rows), truth.dofs.xyz[rows], directions)
    return modes_at(truth, sensors, count, shape_std=0.01)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a case in which a joint is softer by a third and a leg lighter."""
    truth = Groups(MODEL).with_factors(
        [Property("k", "E", (f"group:{JOINT}",)), Property("m", "density", (f"group:{PART}",))],
        [0.02, 0.9],
    )
    mass = (PointMass(Place(joint="D"), 0.4),)
    change = Modification("0.4 kg at D", mass, (), measured(truth.attach(mass, ())))
    case = Case(
        *("portal", "portal", "", Path(), MODEL, measured(truth)),
        *((1, 2, 3, 4, 5), (6, 7, 8), (change,)),
    )
    made = tmp_path_factory.mktemp("grouped") / "portal"
    write_case(made, case)
    return made


@pytest.fixture(scope="module")
def case(folder: Path) -> Case:
    """Return the case as it is read."""
    return reduce_case(read_case(folder), above=500)


def test_a_basis_that_does_not_converge_leaves_the_whole_model(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without(*_: object, **__: object) -> None:
        raise ArpackNoConvergence("no convergence", np.zeros(0), np.zeros((0, 0)))

    monkeypatch.setattr(grouped_reduction, "_DENSE", 10)
    monkeypatch.setattr(grouped_reduction, "eigsh", without)
    case = reduce_case(read_case(folder), above=500)
    assert case.whole is None
    assert case.model.size == MODEL.size
    assert case.notes[-1].endswith("modes of a group with its border held do not converge")


@pytest.mark.parametrize("name", [JOINT, "joint C", "left", "beam"])
def test_frequencies_of_the_basis_are_those_of_the_whole_model(name: str) -> None:
    found = reduce_groups(MODEL, KEPT, 12)
    assert len(found.mass) < 0.4 * MODEL.size
    assert found.moved < 1e-3
    for factor in (1e-3, 0.03, 0.3, 30.0) if "joint" in name else (0.4, 2.0):
        change = (factor - 1.0) * MODEL.groups[name]
        whole = solve_modes(replace(MODEL, stiffness=MODEL.stiffness + change), 18)
        small = la.eigh(
            found.stiffness + (factor - 1.0) * found.groups[name], found.mass, eigvals_only=True
        )
        own = np.sqrt(np.maximum(small[6:18], 0.0)) / (2.0 * np.pi)
        np.testing.assert_allclose(own, whole.elastic.natural_frequencies[:12], rtol=1e-3)


@pytest.fixture(scope="module")
def bar() -> Model:
    """Return a stepped bar of bricks, free in space: two parts, glued by a layer of bricks."""
    pytest.importorskip("skfem")
    x, y, z = (v.ravel() for v in np.indices((22, 5, 5)))
    kept = (x < 14) | (y < 4)
    x, y, z = x[kept], y[kept], z[kept]
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    corners = np.vstack([corners, corners + np.array([0, 0, 1])])
    at = (np.stack([x, y, z], axis=1)[:, None] + corners).reshape(-1, 3)
    nodes, cells = np.unique(at, axis=0, return_inverse=True)
    own = {"foot": x < 9, "glue": x == 9, "arm": x > 9}
    steel = np.tile([2.1e11, 0.3, 7850.0], (len(x), 1))
    parts = {
        name: solid_elements.assemble(
            "C3D8I", cells.reshape(-1, 8)[some], 0.01 * nodes * (1.0, 0.9, 1.1), steel[some]
        )
        for name, some in own.items()
    }
    found = matrix_model(
        sum(m for _, m in parts.values()), sum(k for k, _ in parts.values()),
        np.repeat(np.arange(len(nodes)), 3).astype(str).tolist(), list("xyz") * len(nodes),
        np.repeat(0.01 * nodes * (1.0, 0.9, 1.1), 3, axis=0), {n: k for n, (k, _) in parts.items()},
    )  # fmt: skip
    heavy = {name: m for name, (_, m) in parts.items()}
    return replace(found, mass_groups=heavy, group_kinds={"glue": "joint"}, free=True)


@pytest.mark.slow(20)
def test_borders_of_many_rows_keep_few_motions_and_the_frequencies(bar: Model) -> None:
    kept = np.array([0, 1, 2, bar.size - 3, bar.size - 2, bar.size - 1])
    found = reduce_groups(bar, kept, 12)
    assert bar.size > 1800
    assert len(found.mass) < 400
    assert found.moved < 1e-3
    nominal = la.eigh(found.stiffness, found.mass, eigvals_only=True)[6:36]
    whole = solve_modes(bar, 36).elastic.eigenvalues[:30]
    np.testing.assert_allclose(nominal, whole, rtol=1e-7)
    for name, factor in (("glue", 1e-3), ("glue", 0.1), ("foot", 0.3), ("arm", 3.0)):
        changed = bar.stiffness + (factor - 1.0) * bar.groups[name]
        whole = solve_modes(replace(bar, stiffness=changed), 18).elastic.eigenvalues[:12]
        change = (factor - 1.0) * found.groups[name]
        own = la.eigh(found.stiffness + change, found.mass, eigvals_only=True)[6:18]
        assert np.all(own > (1.0 - 1e-7) * whole)
        np.testing.assert_allclose(np.sqrt(own), np.sqrt(whole), rtol=1e-3)
    heavier = bar.mass + 2.0 * bar.mass_groups["arm"]
    whole = solve_modes(replace(bar, mass=heavier), 18).elastic.eigenvalues[:12]
    heavy = found.mass + 2.0 * found.mass_groups["arm"]
    own = la.eigh(found.stiffness, heavy, eigvals_only=True)[6:18]
    np.testing.assert_allclose(np.sqrt(own), np.sqrt(whole), rtol=1e-3)


def test_nominal_frequencies_are_exact(case: Case) -> None:
    whole = solve_modes(MODEL, 42).elastic.natural_frequencies[:30]
    own = solve_modes(case.model).elastic.natural_frequencies[:30]
    np.testing.assert_allclose(own, whole, rtol=1e-7)


def test_a_case_is_read_into_the_basis_and_weighs_what_it_weighed(case: Case) -> None:
    assert case.whole is not None
    assert case.whole.size == MODEL.size
    assert case.model.size < 300
    assert case.model.total_mass == pytest.approx(MODEL.total_mass, rel=1e-9)
    assert rigid_modes_of(case.model).shape[1] == 6
    assert set(case.model.groups) == set(MODEL.groups)
    assert any("coordinates instead of" in note for note in case.notes)
    assert set(case.model.geometry.places) >= set(NODES)  # type: ignore[attr-defined]
    assert "~" not in case.model.geometry.places  # type: ignore[attr-defined]


def test_masses_act_on_the_reduced_model_as_on_the_whole(case: Case) -> None:
    (change,) = case.modifications
    own = solve_modes(case.model.attach(change.masses, ())).elastic.natural_frequencies[:12]
    whole = solve_modes(MODEL.attach(change.masses, ()), 18).elastic.natural_frequencies[:12]
    np.testing.assert_allclose(own, whole, rtol=1e-5)


def test_an_update_finds_the_joint_and_goes_back_to_the_whole_model(
    case: Case, tmp_path: Path
) -> None:
    result = femubench.strategies["local"](changes="groups").update(
        case.model, case.used_measurement(), np.random.default_rng(0)
    )
    whole = expand_model(case, result.model)
    found = {p.name: p.after for p in result.parameters}
    factor = found[f"stiffness group:{JOINT}"]
    before, after = (model.groups[JOINT].toarray() for model in (MODEL, whole))
    np.testing.assert_allclose(after, factor * before, atol=1e-6 * np.abs(before).max())
    own = solve_modes(result.model).elastic.natural_frequencies[:8]
    full = solve_modes(whole, 14).elastic.natural_frequencies[:8]
    np.testing.assert_allclose(full, own, rtol=1e-3)
    write_case(tmp_path / "updated", case, result.model)
    assert read_case(tmp_path / "updated").model.size == MODEL.size


def test_what_is_added_at_kept_nodes_goes_back_too(case: Case) -> None:
    heavier = case.model.attach((PointMass(Place(joint="C"), 0.7),), ())
    whole = expand_model(case, heavier)
    assert whole.total_mass == pytest.approx(MODEL.total_mass + 0.7, rel=1e-9)


def test_matrices_changed_as_a_whole_cannot_go_back(case: Case, tmp_path: Path) -> None:
    other = replace(case.model, stiffness=case.model.stiffness @ case.model.stiffness)
    with pytest.raises(ModelError, match="as a whole"):
        expand_model(case, other)
    with pytest.raises(InputError, match="as a whole"):
        write_case(tmp_path / "other", case, other)


def test_a_basis_without_room_says_how_far_it_is_off() -> None:
    assert reduce_groups(MODEL, KEPT, 12, most=90).moved > 0.01


def test_what_leaves_no_small_model_leaves_the_whole_one(folder: Path) -> None:
    with pytest.raises(ModelError, match="coordinates of 60"):
        reduce_groups(MODEL, KEPT, 12, most=60)
    groups = {**MODEL.groups, "odd": -2.0 * MODEL.stiffness}
    read = read_case(folder)
    odd = replace(read, model=replace(read.model, groups=groups))
    kept = reduce_case(odd, above=500)
    assert (kept.whole, kept.model) == (None, odd.model)
    assert "times the stiffness of group 'odd' leaves no model" in kept.notes[-1]
