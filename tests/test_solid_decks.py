"""Models of solids from an input file alone: matrices of CalculiX, sets as groups, refusals."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la

import femubench
from femubench import InputError, Model, fem
from femubench.core.case.faults import BadKey
from femubench.core.case.files import CaseFiles
from femubench.core.case.matrices import with_groups
from femubench.core.case.schema import GroupSpec
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.fem import FloatArray, MatrixGeometry
from femubench.plugins.readers.solid_elements import KINDS

CCX = shutil.which("ccx")
PLATES = Path(__file__).parents[1] / "examples" / "plates"
SECTION = """*MATERIAL, NAME=steel
*ELASTIC
2.1e11, 0.3
*DENSITY
7850.
*SOLID SECTION, ELSET=all, MATERIAL=steel
"""
# Two bricks one upon the other, held below.
COLUMN = """*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
9,0,0,2
10,1,0,2
11,1,1,2
12,0,1,2
*ELEMENT, TYPE=C3D8, ELSET=all
1, 1,2,3,4,5,6,7,8
2, 5,6,7,8,9,10,
11,12
*ELSET, ELSET=upper
2
*NSET, NSET=foot, GENERATE
1, 4, 1
*BOUNDARY
foot, 1, 3
"""


CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def element_of(kind: str, places: FloatArray) -> str:
    """Return an input file of one element that hangs free."""
    numbers = ",".join(map(str, range(len(places) + 1)[1:]))
    rows = [f"{i + 1}," + ",".join(map(repr, map(float, p))) for i, p in enumerate(places)]
    cells = f"1,{numbers}".split(",")
    lines = [",".join(cells[i : i + 10]) for i in range(0, len(cells), 10)]
    text = "\n".join(["*NODE", *rows, f"*ELEMENT, TYPE={kind}, ELSET=all", ",\n".join(lines)])
    return f"{text}\n{SECTION}"


def read(folder: Path, text: str) -> Model:
    """Return the model of an input file."""
    (folder / "job.inp").write_text(text)
    return femubench.read_model(folder / "job.inp")


def rows_of(model: Model) -> list[tuple[str, str]]:
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    nodes = [geometry.names[node] for node in model.dofs.node]
    return list(zip(nodes, model.dofs.direction, strict=True))


def dense(model: Model, rows: Iterable[tuple[str, str]]) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and mass in the order of rows; inner nodes follow without inertia."""
    own = rows_of(model)
    at = [own.index(row) for row in rows]
    inner = [i for i in range(model.size) if i not in at]
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    motion = np.zeros((model.size, len(at)))
    motion[at] = np.eye(len(at))
    if inner:
        coupling = stiffness[np.ix_(inner, at)]
        motion[inner] = -la.solve(stiffness[np.ix_(inner, inner)], coupling)
    return motion.T @ stiffness @ motion, motion.T @ mass @ motion


@pytest.mark.skipif(CCX is None, reason="CalculiX is not there")
@pytest.mark.parametrize("kind", KINDS)
def test_a_distorted_element_has_the_matrices_of_calculix(kind: str, tmp_path: Path) -> None:
    """Also with curved edges, and one whose inner modes are condensed."""
    places = KINDS[kind].places * [1.0, 0.8, 0.5]
    places += np.random.default_rng(5).normal(0.0, 0.03, places.shape)
    step = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"
    own = read(tmp_path, element_of(kind, places) + step)
    subprocess.run([str(CCX), "job"], cwd=tmp_path, capture_output=True, check=False)
    assert (tmp_path / "job.sti").exists()
    theirs = femubench.read_model(tmp_path / "job.inp")
    for a, b in zip(dense(own, rows_of(own)), dense(theirs, rows_of(own)), strict=True):
        assert abs(a - b).max() < 1e-12 * abs(b).max()


def bodies() -> dict[int, tuple[float, FloatArray, FloatArray]]:
    """Return volume, middle and means of x_i x_j of the reference elements by their corners."""
    wedge = np.array([[2.0, 1.0, 2.0], [1.0, 2.0, 2.0], [2.0, 2.0, 4.0]]) / 12.0
    return {
        4: (1.0 / 6.0, np.full(3, 0.25), (np.ones((3, 3)) + np.eye(3)) / 20.0),
        6: (0.5, np.array([1.0, 1.0, 1.5]) / 3.0, wedge),
        8: (1.0, np.full(3, 0.5), 0.25 + np.eye(3) / 12.0),
    }


@pytest.mark.parametrize("kind", KINDS)
def test_an_element_has_the_mass_of_its_body_and_six_motions_without_force(
    kind: str, tmp_path: Path
) -> None:
    """Mass, centre and moments of inertia, of an oblique element; those of a body in the field."""
    turn = np.array([[0.2, 0.03, 0.0], [0.0, 0.1, 0.02], [0.01, 0.0, 0.3]])
    model = read(tmp_path, element_of(kind, KINDS[kind].places @ turn.T))
    volume, middle, spread = bodies()[len(KINDS[kind].corners)]
    if kind in {"C3D4", "C3D6"}:  # one point across, as CalculiX has: no inertia about the middle
        flat = 3 if kind == "C3D4" else 2
        spread[:flat, :flat] = np.outer(middle, middle)[:flat, :flat]
    mass = 7850.0 * la.det(turn) * volume
    origin = model.dofs.xyz.mean(axis=0)
    centre = turn @ middle - origin
    second = turn @ spread @ turn.T - np.outer(turn @ middle, turn @ middle)
    second += np.outer(centre, centre)
    x, y, z = centre
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    body = np.block([[np.eye(3), -arm], [arm, np.trace(second) * np.eye(3) - second]])
    along = np.array(["xyz".index(d) for d in model.dofs.direction])
    turned = np.cross(np.eye(3)[None], (model.dofs.xyz - origin)[:, None])
    rigid = np.hstack([np.eye(3)[along], turned[np.arange(len(along)), :, along]])
    np.testing.assert_allclose(rigid.T @ (model.mass @ rigid), mass * body, atol=1e-9 * mass)
    values = la.eigvalsh(model.stiffness.toarray())
    assert (abs(values[:6]) < 1e-9 * values[-1]).all()
    # The reduced brick and the wedge of two points have six more, which neighbours hold.
    assert (values[12:] > 1e-6 * values[-1]).all()


def test_sets_of_elements_are_groups_and_supports_take_their_rows(tmp_path: Path) -> None:
    model = read(tmp_path, COLUMN + SECTION)
    assert model.size == 24
    assert set(model.groups) == {"upper", "rest"}
    parts = sum(part.toarray() for part in model.groups.values())
    np.testing.assert_allclose(parts, model.stiffness.toarray())
    masses = sum(part.toarray() for part in model.mass_groups.values())
    np.testing.assert_allclose(masses, model.mass.toarray())
    upper = np.flatnonzero(model.groups["upper"].toarray().any(axis=1))
    assert len(upper) == 24
    held = read(tmp_path, COLUMN.replace("foot, 1, 3", "foot, PINNED\n12, 3") + SECTION)
    assert held.size == 23


def test_a_group_of_the_file_takes_a_kind_by_its_name_alone(tmp_path: Path) -> None:
    model = read(tmp_path, COLUMN + SECTION)
    (tmp_path / "case.toml").touch()
    files = CaseFiles(tmp_path)
    specs = [GroupSpec(name="upper", kind="joint", prior=3.0)]
    found = with_groups(model, specs, files, ())
    assert (found.group_kinds, found.group_priors) == ({"upper": "joint"}, {"upper": 3.0})
    assert set(found.groups) == {"upper", "rest"}
    with pytest.raises(BadKey, match="a group without a part"):
        with_groups(model, [GroupSpec(name="lower")], files, ())
    for given in ({"name": "upper"}, {"name": "bolt", "mass": "m.mtx"}, {"name": "b", "dofs": [1]}):
        with pytest.raises(BadKey, match="a preload without its stiffness alone"):
            with_groups(model, [GroupSpec(kind="preload", **given)], files, ())


def test_a_part_of_abaqus_is_read_like_a_flat_file(tmp_path: Path) -> None:
    node, rest = COLUMN.partition("*NSET")[::2]
    mass = "*ELEMENT, TYPE=MASS, ELSET=tip\n3, 12\n*MASS, ELSET=tip\n7.0\n"
    part = f"*HEADING\n*PART, NAME=p\n{node}{mass}*SOLID SECTION, ELSET=all, MATERIAL=steel\n,\n"
    text = (
        f"{part}*END PART\n*ASSEMBLY, NAME=a\n*INSTANCE, NAME=p-1, PART=p\n*END INSTANCE\n"
        f"*NSET{rest.partition('*BOUNDARY')[0]}*END ASSEMBLY\n"
        f"{SECTION.partition('*SOLID')[0]}*BOUNDARY\nfoot, ENCASTRE\n"
    )
    flat, model = read(tmp_path, COLUMN + SECTION), read(tmp_path, text)
    assert abs(model.stiffness - flat.stiffness).max() == 0.0
    assert (model.mass - flat.mass).diagonal().sum() == pytest.approx(21.0)


COUPLING = """*SURFACE, NAME=head, TYPE=NODE
9
10, 1.
11,
12,
*COUPLING, CONSTRAINT NAME="tip@1", REF NODE=13, SURFACE=head
*DISTRIBUTING
1, 6
*ELEMENT, TYPE=MASS, ELSET=load
3, 13
*MASS, ELSET=load
20000.
*ELEMENT, TYPE=SPRING1, ELSET=prop
4, 13
*SPRING, ELSET=prop
6
4e9
"""
TIPPED = (COLUMN + COUPLING + SECTION).replace("12,0,1,2\n", "12,0,1,2\n13,0.4,0.5,2.6\n")


def test_a_reference_node_moves_as_the_body_that_fits_its_nodes_best(tmp_path: Path) -> None:
    """The mass and the spring to ground there act on the nodes by that fit, by least squares."""
    model, bare = read(tmp_path, TIPPED), read(tmp_path, COLUMN + SECTION)
    assert set(model.groups) == {"upper", "rest", "prop"}
    own = rows_of(bare)
    top = [(node, d) for node in ("9", "10", "11", "12") for d in "xyz"]
    arms = bare.dofs.xyz[[own.index(row) for row in top[::3]]] - [0.4, 0.5, 2.6]
    # u = t + theta x arm
    body = np.vstack([np.hstack([np.eye(3), -np.cross(np.eye(3), arm)]) for arm in arms])
    fit = np.zeros((6, bare.size))
    fit[:, [own.index(row) for row in top]] = np.linalg.lstsq(body, np.eye(len(body)))[0]
    mass = bare.mass.toarray() + 20000.0 * fit[:3].T @ fit[:3]
    stiffness = bare.stiffness.toarray() + 4e9 * np.outer(fit[5], fit[5])
    expected = np.sqrt(la.eigvalsh(stiffness, mass)[:6]) / (2.0 * np.pi)
    found = femubench.solve_modes(model)
    np.testing.assert_allclose(found.natural_frequencies[:6], expected, rtol=3e-3)
    at = [rows_of(model).index(("tip@1", d)) for d in ("x", "y", "z", "rx", "ry", "rz")]
    moved = found.shapes[[rows_of(model).index(row) for row in own], :6]
    np.testing.assert_allclose(found.shapes[at, :6], fit @ moved, atol=3e-3 * abs(moved).max())


def test_an_updated_spring_is_written_into_its_deck(tmp_path: Path) -> None:
    model, target = read(tmp_path, TIPPED), tmp_path / "new"
    factors = [fem.Property(n, "E", (f"group:{n}",)) for n in ("prop", "upper")]
    updated = fem.Groups(model).with_factors(factors, [0.25, 1.1])
    target.mkdir()
    femubench.write_model(updated, target, like=tmp_path / "job.inp")
    again = femubench.read_model(target / "job.inp")
    assert "6\n1000000000.0\n" in (target / "job.inp").read_text()
    assert abs(again.stiffness - updated.stiffness).max() < 1e-9 * updated.stiffness.max()


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("TYPE=C3D8,", "TYPE=B31,", "elements of type B31.*C3D20R.*MATRIXSTORAGE"),
        ("TYPE=C3D8,", "TYPE=S4R,", r"elements of type S4R \(expected S4 in its place; or C3D4"),
        ("foot, 1, 3", "foot, 1, 3\n*COUPLING, REF NODE=1, SURFACE=head", "no surface HEAD"),
        ("foot, 1, 3", f"foot, 1, 3\n{COUPLING}", "node 13 of an element has no place"),
        ("foot, 1, 3", "foot, 1, 3\n*KINEMATIC\n1, 3", "KINEMATIC is not read"),
        ("*ELSET, ELSET=upper", "*TIE, NAME=glue\nupper, all\n*ELSET, ELSET=upper", "TIE is not"),
        ("*DENSITY\n7850.\n", "", "STEEL has no density"),
        ("2, 5,6,7,8,9,10,\n11,12", "2, 9,10,11,12,5,6,\n7,8", "element 2 is turned inside out"),
        ("12,0,1,2\n", "", "node 12 of an element has no place"),
        ("2, 5,6,7,8,9,10,\n11,12", "2, 5,6", "element 2 lacks nodes"),
        ("2, 5,6", "1, 5,6", "element 1 is there twice"),
        ("ELSET=all, MATERIAL", "ELSET=upper, MATERIAL", "element 1 has no section"),
        ("MATERIAL=steel", "MATERIAL=brass", "no material BRASS"),
        ("foot, 1, 3", "feet, 1, 3", "no set 'feet'"),
        ("foot, 1, 3", "foot, left", "first and last direction"),
        ("*ELASTIC\n", "*ELASTIC, TYPE=ORTHO\n", "TYPE=ISO"),
        ("2.1e11, 0.3", "steel, 0.3", "2 numbers"),
        ("*NSET", "*INSTANCE, NAME=p\n5., 0., 0.\n*NSET", "parts that are moved"),
    ],
)
def test_what_is_not_read_is_refused_with_the_reason(
    old: str, new: str, match: str, tmp_path: Path
) -> None:
    text = COLUMN + SECTION
    assert text.count(old) == 1
    with pytest.raises(InputError, match=match):
        read(tmp_path, text.replace(old, new))


def test_an_updated_model_is_a_deck_with_a_material_for_each_group(tmp_path: Path) -> None:
    source = PLATES / "plates.inp"
    model = femubench.read_model(source, unit="mm")
    assert set(model.groups) == {"PLATES", "LEFT", "RIGHT"}
    assert model.group_kinds == {"LEFT": "joint", "RIGHT": "joint"}
    factors = [fem.Property(n, "E", (f"group:{n}",)) for n in ("LEFT", "PLATES")]
    factors.append(fem.Property("mass", "density", ("group:RIGHT",)))
    updated = fem.Groups(model).with_factors(factors, [0.4, 1.02, 1.5])
    femubench.write_model(updated, tmp_path, like=source, unit="mm")
    assert [file.name for file in tmp_path.iterdir()] == ["plates.inp"]
    again = femubench.read_model(tmp_path / "plates.inp", unit="mm")
    assert set(again.groups) == set(model.groups)
    assert abs(again.stiffness - updated.stiffness).max() < 1e-12 * updated.stiffness.max()
    assert abs(again.mass - updated.mass).max() < 1e-12 * model.mass.max()


def test_a_model_that_no_factor_makes_is_written_as_matrices(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    model = read(tmp_path, COLUMN + SECTION)
    changed = model.stiffness.copy()
    changed[0, 0] *= 1.5
    other = fem.matrix_model(model.mass, changed, *zip(*rows_of(model), strict=True))
    femubench.write_model(other, tmp_path / "new", like=tmp_path / "job.inp")
    assert {file.suffix for file in (tmp_path / "new").iterdir()} == {".sti", ".mas", ".dof"}


def cantilever(kind: str, along: int, across: int) -> str:
    """Return a deck of a bar of 1 x 0.08 x 0.1 m of bricks, held at one end."""
    x, y, z = np.meshgrid(*(np.arange(n + 1) for n in (along, across, across)), indexing="ij")
    number = 1 + np.arange(x.size).reshape(x.shape)
    places = zip(
        x.ravel() / along, 0.08 * y.ravel() / across, 0.1 * z.ravel() / across, strict=True
    )
    rows = [f"{i},{a!r},{b!r},{c!r}" for i, (a, b, c) in enumerate(np.array([*places]).tolist(), 1)]
    corners = [number[i : along + i, j : across + j, k : across + k].ravel() for i, j, k in CORNERS]
    cells = [
        f"{e},{','.join(map(str, own))}" for e, own in enumerate(zip(*corners, strict=True), 1)
    ]
    held = ",".join(map(str, number[0].ravel()))
    blocks = ["*NODE", *rows, f"*ELEMENT, TYPE={kind}, ELSET=all", *cells, "*NSET, NSET=foot", held]
    return "\n".join([*blocks, "*BOUNDARY", "foot, 1, 3", SECTION])


@pytest.mark.parametrize(("kind", "along"), [("C3D8", 5), ("C3D8I", 7)])
def test_a_coarse_mesh_knows_by_how_much_it_is_off(kind: str, along: int, tmp_path: Path) -> None:
    """Bending, the fifth mode is torsion: its warping needs more than one layer of any element."""
    model = read(tmp_path, cantilever(kind, along, 1))
    fine = read(tmp_path, cantilever("C3D8I", 40, 4))
    coarse, true = (elastic_modes(m, 8).natural_frequencies for m in (model, fine))
    if kind == "C3D8":  # locked, so that the modes come in another order
        coarse, true = coarse[:2], true[:2]
    bias = mesh_bias(model, len(coarse))
    assert bias is not None
    off, left = (
        np.abs(f / true - 1.0)[[0, 1, 2, 3, 5][: len(true)]]
        for f in (coarse, coarse * (1.0 + bias))
    )
    assert np.abs(off).max() > 0.05
    assert np.abs(left).max() < 0.35 * np.abs(off).max()


@pytest.mark.nightly
def test_the_soft_joint_of_the_plates_is_named_from_deck_and_test_alone(tmp_path: Path) -> None:
    """The test is of a finer mesh with a left joint of 0.4 of the stiffness."""
    femubench.init_case(tmp_path / "case", PLATES / "plates.inp", PLATES / "test.unv")
    found = femubench.diagnose(tmp_path / "case")
    assert found.verdict == "named"
    assert [(cause.effect, cause.place) for cause in found.causes] == [
        ("member-stiffness", "group:LEFT")
    ]
    (size,) = found.causes[0].parameters
    assert size.std is not None
    assert abs(size.value + 0.6) < 2.0 * size.std
