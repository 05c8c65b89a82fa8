"""Cases that come as matrices: the same as the frame they were written from, or one clear line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from femubench import InputError, Model, read_case, solve_modes
from femubench.core.case.matrices import read_matrix
from femubench.core.fem.frame import Place

CASES = Path(__file__).parent / "cases"


def message(folder: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        read_case(folder)
    assert "\n" not in str(caught.value)
    return caught.value


def write_matrices(folder: Path, model: Model, first_row: int) -> None:
    """Write a model as a case of matrices; the nodes are called n0, n1, ..."""
    folder.mkdir()
    for name, matrix in (("mass", model.mass), ("stiffness", model.stiffness)):
        scipy.io.mmwrite(folder / f"{name}.mtx", matrix, symmetry="symmetric")
    rows = zip(model.dofs.node, model.dofs.direction, model.dofs.xyz, strict=True)
    lines = [
        f"{i + first_row},n{node},{direction},{x!r},{y!r},{z!r}"
        for i, (node, direction, (x, y, z)) in enumerate(
            (node, direction, map(float, xyz)) for node, direction, xyz in rows
        )
    ]
    (folder / "dofs.csv").write_text("\n".join(["row,node,direction,x,y,z", *lines[::-1]]))
    (folder / "sensors.csv").write_text("label,at,direction\ns,n1,-z\n")
    (folder / "modes.csv").write_text("mode,frequency,s\n1,20.0,1.0\n")
    (folder / "case.toml").write_text(
        f"""
[case]
name = "matrices"
[model]
kind = "matrices"
mass = "mass.mtx"
stiffness = "stiffness.mtx"
dofs = "dofs.csv"
groups = [{{name = "some", dofs = [{first_row + 3}, "n2", "n1:z"]}},
          {{name = "whole", stiffness = "stiffness.mtx"}}]
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1]
[[modification]]
name = "mass on an arm and a spring"
masses = [{{at = "n1", mass = 0.5, offset = [0.02, 0.03, 0.0]}}]
springs = [{{at = "n2", direction = "-z", stiffness = 1e4}}]
modes = "modes.csv"
"""
    )


def test_matrices_give_the_frequencies_of_their_frame(tmp_path: Path) -> None:
    nominal = read_case(CASES / "out-of-plane").model
    write_matrices(tmp_path / "case", nominal, 0)
    case = read_case(tmp_path / "case")
    expected = solve_modes(nominal).natural_frequencies
    np.testing.assert_allclose(solve_modes(case.model).natural_frequencies, expected, rtol=1e-9)
    row = case.model.observe(case.measurement.sensors).toarray()
    n1_z = next(i for i in range(nominal.size) if nominal.dofs.node[i] == 1)
    assert row[0, n1_z] == -1.0
    assert np.abs(row).sum() == 1.0
    (change,) = case.modifications
    joints = [joint.name for joint in nominal.frame_structure.frame.joints]
    masses = [replace(mass, at=Place(joint=joints[1])) for mass in change.masses]
    springs = [replace(spring, at=Place(joint=joints[2])) for spring in change.springs]
    np.testing.assert_allclose(
        solve_modes(case.model.attach(change.masses, change.springs)).natural_frequencies,
        solve_modes(nominal.attach(masses, springs)).natural_frequencies,
        rtol=1e-9,
    )


def test_groups_are_parts_of_the_stiffness(tmp_path: Path) -> None:
    nominal = read_case(CASES / "out-of-plane").model
    write_matrices(tmp_path / "case", nominal, 1)
    model = read_case(tmp_path / "case").model
    whole, some = model.groups["whole"].toarray(), model.groups["some"].toarray()
    np.testing.assert_array_equal(whole, model.stiffness.toarray())
    node = nominal.dofs.node
    z1 = [i for i in range(model.size) if node[i] == 1 and nominal.dofs.direction[i] == "z"]
    inside = np.union1d(np.flatnonzero(node == 2), [3, *z1])
    np.testing.assert_array_equal(some[np.ix_(inside, inside)], whole[np.ix_(inside, inside)])
    some[np.ix_(inside, inside)] = 0.0
    assert not some.any()


MATRICES = """\
[case]
name = "two"
[model]
kind = "matrices"
mass = "mass.mtx"
stiffness = "stiffness.mtx"
dofs = "dofs.csv"
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1]
"""
CHANGE = """\
[[modification]]
name = "change"
masses = [{at = "a", mass = 1.0, offset = [0.1, 0, 0]}]
modes = "modes.csv"
"""


def two_masses(folder: Path) -> Path:
    """Write two masses on springs as a case of matrices."""
    folder.mkdir()
    (folder / "case.toml").write_text(MATRICES)
    scipy.io.mmwrite(folder / "mass.mtx", sp.csc_array([[2.0, 0.0], [0.0, 1.0]]))
    scipy.io.mmwrite(folder / "stiffness.mtx", sp.csc_array([[3e4, -1e4], [-1e4, 1e4]]))
    (folder / "dofs.csv").write_text("row,node,direction,x,y,z\n1,a,z,0,0,0\n2,b,z,1,0,0\n")
    (folder / "sensors.csv").write_text("label,x,y,z,direction\ns,1,0,0,z\n")
    (folder / "modes.csv").write_text("mode,frequency,s\n1,12.0,1.0\n")
    return folder


HEAD = "%%MatrixMarket matrix coordinate {} general\n{} {} {}\n"


@pytest.mark.parametrize(
    ("file", "content", "named", "what"),
    [
        ("dofs.csv", "row,node,direction,x,y,z\n1,a,z,0,0,0\n", "mass.mtx", "2 rows"),
        ("dofs.csv", "row,node,direction,x,y,z\n1,a,z,0,0,0\n1,b,z,1,0,0\n", "dofs.csv:3: row", ""),
        ("dofs.csv", "row,node,direction,x,y,z\n1,a,z,0,0,0\n2,a,z,0,0,0\n", "node", "twice"),
        ("dofs.csv", "row,node,direction,x,y,z\n1,a,z,0,0,0\n2,a,x,1,0,0\n", ":3: x", "two places"),
        ("dofs.csv", "row,node,direction,x,y,z\n1,a,z,0,0,0\n2,b,-z,1,0,0\n", "direction", "-z"),
        ("sensors.csv", "label,x,y,z,direction\ns,2,0,0,z\n", "sensors.csv:2: x", "1 m off"),
        ("sensors.csv", "label,x,y,z,direction\ns,1,0,0,x\n", ":2: direction", "no dof"),
        ("sensors.csv", "label,at,direction\ns,c,z\n", "sensors.csv:2: at", "no node 'c'"),
        ("mass.mtx", "rubbish\n", "mass.mtx", "Matrix Market"),
        ("mass.mtx", HEAD.format("complex", 2, 2, 1), "mass.mtx", "complex"),
        ("mass.mtx", HEAD.format("real", 10**9, 10**9, 1), "mass.mtx", "2 of both"),
        ("mass.mtx", HEAD.format("real", 2, 2, 1) + "1 9 3\n", "mass.mtx", "read"),
        ("mass.mtx", HEAD.format("real", 2, 2, 1) + "1 1 -2\n", "mass.mtx", "negative"),
        ("mass.mtx", HEAD.format("real", 2, 2, 0), "mass.mtx", "zero"),
        ("case.toml", MATRICES.replace("mass.mtx", "dofs.csv"), "dofs.csv", "kind of file"),
        ("case.toml", MATRICES + CHANGE, ":12: modification[0]", "no rotation ry"),
        ("case.toml", MATRICES + '[[model.groups]]\nname = "g"', ":12: model.groups[0]", "without"),
        (
            "case.toml",
            MATRICES + '[[model.groups]]\nname = "g"\ndofs = ["a", 3]',
            ":14: model.groups[0].dofs[1]",
            "no such row",
        ),
    ],
)
def test_broken_matrices(tmp_path: Path, file: str, content: str, named: str, what: str) -> None:
    folder = two_masses(tmp_path / "case")
    (folder / file).write_text(content)
    text = str(message(folder))
    assert named in text
    assert what in text


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ("1 1 1e300", r"entry \(1, 1\) is 1e\+300"),
        ("2 2 nan", r"entry \(2, 2\) is nan"),
        ("2 1 5.0", r"not symmetric at \(\d, \d\)"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path: Path, entries: str, says: str) -> None:
    file = tmp_path / "k.mtx"
    header = "%%MatrixMarket matrix coordinate real general\n2 2 3\n"
    file.write_text(f"{header}1 1 1.0\n2 2 1.0\n{entries}\n")
    with pytest.raises(InputError, match=says):
        read_matrix(file, 2, ())


class Careless:
    """A reader plugin that trips over its file."""

    name = "careless"
    suffixes = (".npz",)

    def read_matrix(self, path: Path) -> Any:
        raise KeyError("a")

    def read_modes(self, path: Path) -> Any:
        raise ZeroDivisionError("division by zero")


def test_a_reader_that_raises_is_named_with_its_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"k\.npz: reader 'careless' failed: KeyError: 'a'"):
        read_matrix(tmp_path / "k.npz", 2, (Careless(),))
