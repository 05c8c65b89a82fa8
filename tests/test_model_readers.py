"""Models of other programs: read, updated, written in the format that they came in."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import femubench
from femubench import InputError, Model
from femubench.core.case.starting import sizes_of
from femubench.core.case.units import in_si
from femubench.core.plugin.loader import load_plugins
from femubench.fem import LowRank, MatrixGeometry, matrix_model
from femubench.plugins.readers.calculix import CalculixReader
from tests.command import call_bench

FORMATS = Path(__file__).parent / "formats"
PLATES = Path(__file__).parents[1] / "examples" / "plates"
JOB = FORMATS / "calculix" / "job.inp"
CCX = shutil.which("ccx")
READERS = tuple(load_plugins().readers.values())
NUMBERS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}
Files = dict[str, str]  # of read_model: model, mass, dofs


def base() -> Model:
    """Return a model with numbered nodes, a group and rotations, of which some are massless."""
    model = femubench.read_model(JOB)
    n = model.size
    rng = np.random.default_rng(3)
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    nodes = [geometry.names[node] for node in model.dofs.node] + ["77", "77"]
    mass = sp.block_diag([model.mass, np.diag([2e-6, 0.0])])
    turns = sp.csc_array(([3.0, -1.0, -1.0, 2.0], ([0, 0, 1, 1], [0, 1, 0, 1])))
    corner = rng.standard_normal((2, n)) * (rng.random((2, n)) < 0.2)
    stiffness = sp.block_array([[model.stiffness, corner.T], [corner, 9.0 * turns]])
    part = sp.block_diag([0.0 * sp.eye_array(n), turns], format="csc")
    xyz = np.vstack([model.dofs.xyz, np.full((2, 3), [30.0, 4.0, 1.0])])
    directions = (*model.dofs.direction, "rx", "rz")
    return matrix_model(mass, stiffness, nodes, directions, xyz, {"turns": part})


def rounded(model: Model) -> Model:
    """Return a model with the ten digits that a card holds."""

    def short(matrix: sp.csc_array) -> sp.csc_array:
        return matrix_like(matrix, np.array([float(f"{v:.9E}") for v in matrix.data]))

    def matrix_like(matrix: sp.csc_array, data: np.ndarray) -> sp.csc_array:
        return sp.csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)

    return replace(model, mass=short(model.mass), stiffness=short(model.stiffness))


def rows_of(model: Model) -> list[tuple[str, str]]:
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    pairs = zip(model.dofs.node, model.dofs.direction, strict=True)
    return [(geometry.names[node], direction) for node, direction in pairs]


def dofs_csv(model: Model, file: Path) -> str:
    lines = ["row,node,direction,x,y,z"]
    for i, ((node, direction), xyz) in enumerate(zip(rows_of(model), model.dofs.xyz, strict=True)):
        lines.append(",".join([str(i + 1), node, direction, *map(repr, map(float, xyz))]))
    file.write_text("\n".join(lines))
    return str(file)


def nodes_csv(model: Model, file: Path) -> str:
    places = {node: xyz for (node, _), xyz in zip(rows_of(model), model.dofs.xyz, strict=True)}
    lines = [",".join([node, *map(repr, map(float, xyz))]) for node, xyz in places.items()]
    file.write_text("\n".join(["node,x,y,z", *lines]))
    return str(file)


def nodes_inp(model: Model, folder: Path) -> None:
    nodes_csv(model, folder / "mesh.inp")
    text = (folder / "mesh.inp").read_text().replace("node,x,y,z", "*NODE")
    (folder / "mesh.inp").write_text(text)
    (folder / "job.inp").write_text("*HEADING\n*INCLUDE, INPUT=mesh.inp\n*NODE PRINT\nU\n")


def labels(model: Model) -> dict[str, object]:
    return {
        "node": np.array([int(node) for node, _ in rows_of(model)]),
        "direction": np.array([direction for _, direction in rows_of(model)]),
        "xyz": model.dofs.xyz,
    }


def matrix_market(model: Model, folder: Path) -> Files:
    for name in ("stiffness", "mass"):
        matrix = sp.coo_array(getattr(model, name))
        scipy.io.mmwrite(folder / f"{name}.mtx", matrix, symmetry="symmetric")
    files = {"file": "stiffness.mtx", "mass": "mass.mtx"}
    return files | {"dofs": dofs_csv(model, folder / "dofs.csv")}


def npz(model: Model, folder: Path) -> Files:
    parts = ("data", "indices", "indptr", "shape")
    sparse = {f"K.{part}": getattr(model.stiffness, part) for part in parts}
    np.savez(
        folder / "model.npz",
        M=model.mass.toarray(),
        K_turns=model.groups["turns"].toarray(),
        **sparse,
        **labels(model),  # type: ignore[arg-type]
    )
    return {"file": "model.npz"}


def pair_of_npz(model: Model, folder: Path) -> Files:
    sp.save_npz(folder / "K.npz", model.stiffness)
    sp.save_npz(folder / "M.npz", model.mass)
    return {"file": "K.npz", "mass": "M.npz", "dofs": dofs_csv(model, folder / "dofs.csv")}


def hdf5(model: Model, folder: Path) -> Files:
    import h5py

    with h5py.File(folder / "model.h5", "w") as file:
        for name in ("data", "indices", "indptr"):
            file[f"stiffness/{name}"] = getattr(model.stiffness, name)
        file["mass"] = model.mass.toarray()
        file["groups/turns"] = model.groups["turns"].toarray()
        for name, column in labels(model).items():
            words = np.asarray(column)
            file[name] = words.astype("S") if words.dtype.kind == "U" else words
        file["remark"] = "stays as it is"
    return {"file": "model.h5"}


def matlab(model: Model, folder: Path) -> Files:
    variables = {"K_whole": model.stiffness, "M0": model.mass.toarray()}
    cells = labels(model) | {"direction": np.array(labels(model)["direction"], dtype=object)}
    groups = {"K_turns": model.groups["turns"]}
    scipy.io.savemat(folder / "model.mat", {**variables, **cells, **groups, "remark": "as it is"})
    return {"file": "model.mat"}


def matlab_73(model: Model, folder: Path) -> Files:
    import h5py

    with h5py.File(folder / "model.mat", "w", userblock_size=512) as file:
        group = file.create_group("K")
        group.attrs["MATLAB_class"], group.attrs["MATLAB_sparse"] = np.bytes_("double"), model.size
        for name, part in (("data", "data"), ("ir", "indices"), ("jc", "indptr")):
            group[name] = getattr(model.stiffness, part)
        numbers = [NUMBERS[direction] for _, direction in rows_of(model)]
        plain = {"M": model.mass.toarray(), "K_turns": model.groups["turns"].toarray(),
                 "node": [[float(node) for node, _ in rows_of(model)]],
                 "direction": [[float(number) for number in numbers]],
                 "xyz": model.dofs.xyz.T}  # fmt: skip
        for name, value in plain.items():
            file[name] = np.asarray(value)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    return {"file": "model.mat"}


def op4(model: Model, folder: Path, binary: bool = True) -> Files:
    from pyyeti.nastran import op4

    matrices = [model.stiffness.toarray(), model.mass]
    op4.write(str(folder / "model.op4"), ["KAA", "MAA"], matrices, binary=binary)
    return {"file": "model.op4", "dofs": dofs_csv(model, folder / "dofs.csv")}


def op4_text(model: Model, folder: Path) -> Files:
    return op4(model, folder, binary=False)


def pair_of_op4(model: Model, folder: Path) -> Files:
    from pyyeti.nastran import op4

    for name, matrix in (("K", model.stiffness), ("M", model.mass)):
        op4.write(str(folder / f"{name}.op4"), [name], [matrix])
    return {"file": "K.op4", "mass": "M.op4", "dofs": dofs_csv(model, folder / "dofs.csv")}


def dmig(model: Model, folder: Path) -> Files:
    import pandas as pd
    from pyyeti.nastran import bulk

    pairs = [(int(node), NUMBERS[direction]) for node, direction in rows_of(model)]
    rows = pd.MultiIndex.from_tuples(pairs, names=["id", "dof"])
    frames = {
        name: pd.DataFrame(matrix.toarray(), index=rows, columns=rows)
        for name, matrix in (("kaax", model.stiffness), ("maax", model.mass))
    }
    bulk.wtdmig(str(folder / "model.pch"), frames)
    return {"file": "model.pch", "dofs": nodes_csv(model, folder / "nodes.csv")}


def abaqus(model: Model, folder: Path) -> Files:
    rows = [(int(node), NUMBERS[direction]) for node, direction in rows_of(model)]
    for name, matrix in (("job_STIF2", model.stiffness), ("job_MASS2", model.mass)):
        part = sp.coo_array(sp.tril(matrix))
        entries = zip(part.row, part.col, part.data, strict=True)
        lines = [f"{rows[i][0]},{rows[i][1]}, {rows[j][0]},{rows[j][1]}, {v!r}\n"
                 for i, j, v in ((i, j, float(v)) for i, j, v in entries)]  # fmt: skip
        held = "99,1, 99,1, 1.0e36\n" if name == "job_STIF2" else ""
        (folder / f"{name}.mtx").write_text("".join(lines) + held)
    nodes_inp(model, folder)
    return {"file": "job_STIF2.mtx", "mass": "job_MASS2.mtx", "dofs": str(folder / "job.inp")}


def calculix(model: Model, folder: Path) -> Files:
    nodes_inp(model, folder)
    (folder / "mesh.inp").rename(folder / "job.inp")
    CalculixReader().write_model(model, folder / "job.inp", JOB)
    return {"file": "job.inp"}


WRITERS: dict[str, Callable[[Model, Path], Files]] = {
    f.__name__: f
    for f in (matrix_market, npz, pair_of_npz, hdf5, matlab, matlab_73, op4, op4_text,
              pair_of_op4, dmig, abaqus, calculix)
}  # fmt: skip


def read(folder: Path, files: Files, unit: str = "m") -> Model:
    named = {key: folder / name for key, name in files.items()}
    return femubench.read_model(**named, unit=unit)  # type: ignore[arg-type]


def check_same(one: Model, other: Model, tolerance: float = 1e-12) -> None:
    order = [rows_of(other).index(row) for row in rows_of(one)]
    assert len(order) == other.size
    np.testing.assert_allclose(other.dofs.xyz[order], one.dofs.xyz, rtol=1e-12, atol=1e-15)
    for role in ("mass", "stiffness"):
        first, second = getattr(one, role), getattr(other, role)[order][:, order]
        assert abs(first - second).max() <= tolerance * abs(first).max()
    for name in other.groups:
        second = other.groups[name][order][:, order]
        assert abs(one.groups[name] - second).max() <= tolerance * abs(second).max()


def updated(model: Model) -> Model:
    """Return a model with other matrices, one change of low rank, another group."""
    rng = np.random.default_rng(1)
    basis = rng.standard_normal((model.size, 2)) * abs(model.stiffness).max() ** 0.5
    change = LowRank(basis, np.diag([1.0, 0.1]))
    groups = {name: 3.0 * part for name, part in model.groups.items()}
    mass = 1.25 * model.mass
    return replace(model, mass=mass, stiffness_change=change, groups=groups)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_model_goes_in_and_out_again(kind: str, tmp_path: Path) -> None:
    model = rounded(base()) if kind == "dmig" else base()
    (tmp_path / "new").mkdir()
    files = WRITERS[kind](model, tmp_path)
    # In another unit, so that what is written is in that of the file.
    first = read(tmp_path, files, "mm")
    check_same(in_si(model, "mm"), first)
    assert kind not in ("npz", "hdf5", "matlab", "matlab_73") or list(first.groups) == ["turns"]
    there = updated(first)
    named = {key: tmp_path / name for key, name in files.items()}
    named.pop("dofs", None)
    femubench.write_model(there, tmp_path / "new", like=named.pop("file"), **named, unit="mm")  # type: ignore[arg-type]
    for name in files.values():
        if not (tmp_path / "new" / name).exists():
            shutil.copy(tmp_path / name, tmp_path / "new")
    back = read(tmp_path / "new", files, "mm")
    whole = replace(
        there,
        stiffness=there.stiffness + sp.csc_array(there.stiffness_change.toarray()),
        stiffness_change=None,
    )
    check_same(whole, back, 1e-9 if kind == "dmig" else 1e-12)


DENSITY, SIDES, CENTRE = 2.7e-9, np.array([20.0, 10.0, 2.0]), np.array([10.0, 5.0, 1.0])
LUMP, TURNS, ARM = 4e-7, np.array([3.0, 1.0, 2.0]) * 1e-5, np.array([20.0, -1.0, 4.0])


def free_body(folder: Path) -> Model:
    """Return the two bricks of the job in mm without what holds them, a lump on springs with it."""
    deck, _, step = JOB.read_text().partition("*BOUNDARY")
    (folder / "body.inp").write_text(deck + step[step.index("*STEP") :])
    solid = femubench.read_model(folder / "body.inp")
    mass = sp.block_diag([solid.mass, np.diag([LUMP] * 3 + TURNS.tolist())])
    stiffness = sp.block_diag([solid.stiffness, np.eye(6)])
    nodes = [node for node, _ in rows_of(solid)] + ["77"] * 6
    xyz = np.vstack([solid.dofs.xyz, np.tile(CENTRE + ARM, (6, 1))])
    parts = {"turns": sp.block_diag([0.0 * solid.stiffness, np.eye(6)], format="csc")}
    return matrix_model(mass, stiffness, nodes, (*solid.dofs.direction, *NUMBERS), xyz, parts)


def inertia(mass: float, turns: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return the kinetic energy of six motions about a point of a body at the end of an arm."""
    carried = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
    return mass * carried.T @ carried + np.diag([0.0, 0.0, 0.0, *turns])


@pytest.mark.parametrize("kind", WRITERS)
def test_mass_centre_and_inertia_are_those_of_the_body(kind: str, tmp_path: Path) -> None:
    files = WRITERS[kind](free_body(tmp_path), tmp_path)
    (tmp_path / "body.inp").unlink()
    model = read(tmp_path, files, "mm")
    shifts, turns = model.dofs.motions[:, :3], model.dofs.motions[:, 3:]
    arms = 1e3 * model.dofs.xyz - CENTRE  # in mm, as rotations are in 1/mm
    motions = np.hstack([shifts, np.cross(arms, shifts) + 1e3 * turns])
    weight = DENSITY * SIDES.prod()
    of_brick = weight / 12.0 * (np.square(SIDES).sum() - np.square(SIDES))
    expected = inertia(weight, of_brick, np.zeros(3)) + inertia(LUMP, TURNS, ARM)
    np.testing.assert_allclose(
        1e-3 * motions.T @ model.mass @ motions, expected, rtol=1e-6, atol=1e-6 * weight
    )
    assert model.total_mass == pytest.approx(1e3 * (weight + LUMP), rel=1e-6)


def test_a_held_job_has_the_mass_of_its_free_rows(tmp_path: Path) -> None:
    held, body = femubench.read_model(JOB), free_body(tmp_path)
    rows = {row: k for k, row in enumerate(rows_of(body))}
    for direction in "xyz":
        along = [row for row in rows_of(held) if row in rows and row[1] == direction]
        theirs, ours = [rows_of(held).index(row) for row in along], [rows[row] for row in along]
        mass, expected = held.mass[theirs][:, theirs].sum(), body.mass[ours][:, ours].sum()
        assert mass == pytest.approx(expected, rel=1e-6)
        assert mass < 0.95 * DENSITY * SIDES.prod()
    assert sizes_of(held).endswith(" kg, without held rows if it has any")
    assert sizes_of(femubench.read_model(tmp_path / "body.inp")).endswith(" kg")


def test_what_an_update_does_not_change_is_kept(tmp_path: Path) -> None:
    import h5py

    model = base()
    hdf5(model, tmp_path)
    matlab(model, tmp_path)
    for name in ("model.h5", "model.mat"):
        femubench.write_model(updated(model), tmp_path / "new", like=tmp_path / name)
    with h5py.File(tmp_path / "new" / "model.h5") as file:
        assert file["remark"].asstr()[()] == "stays as it is"
    assert scipy.io.loadmat(tmp_path / "new" / "model.mat")["remark"] == ["as it is"]


def frequencies(model: Model, count: int) -> np.ndarray:
    eigenvalues = femubench.solve_modes(model, count).eigenvalues
    return np.sqrt(np.abs(eigenvalues)) / (2.0 * np.pi)


def own_frequencies(file: Path) -> np.ndarray:
    """Return the frequencies in Hz of the table that CalculiX prints."""
    table = [line.split() for line in file.read_text().splitlines()]
    return np.array([float(cells[3]) for cells in table if len(cells) == 5 and cells[0].isdigit()])


def test_calculix_jobs_have_calculix_frequencies() -> None:
    model = femubench.read_model(JOB, unit="mm")
    # Rows that *BOUNDARY holds are not there; nodes inside of elements lie amid these.
    assert ("1", "x") not in rows_of(model)
    inner = [xyz for (node, _), xyz in zip(rows_of(model), model.dofs.xyz, strict=True)
             if int(node) > 12]  # fmt: skip
    np.testing.assert_allclose(inner, np.tile([0.015, 0.005, 0.001], (9, 1)), atol=2e-3)
    expected = own_frequencies(JOB.with_name("frequencies.dat"))
    assert len(expected) == 3
    np.testing.assert_allclose(frequencies(model, 3), expected, rtol=1e-6)


def test_calculix_jobs_are_written(tmp_path: Path) -> None:
    model = femubench.read_model(JOB, unit="mm")
    stiffness, mass = 1.1 * model.stiffness, 0.3 * model.mass
    model = replace(model, stiffness=stiffness, mass=mass, groups={"first": 0.5 * stiffness})
    femubench.write_model(model, tmp_path, like=JOB, unit="mm")
    shutil.copy(JOB, tmp_path)
    back = femubench.read_model(tmp_path / "job.inp", unit="mm")
    assert list(back.groups) == ["first"]
    check_same(model, back)


@pytest.mark.slow(5)
def test_ansys_files_have_the_frequencies_of_ansys(tmp_path: Path) -> None:
    # What the package brings is read in place; the frequencies are those of its documentation.
    package = find_spec("ansys.mapdl.reader")
    assert package is not None
    assert package.origin is not None
    full = Path(package.origin).parent / "examples" / "file.full"
    model = femubench.read_model(full, dofs=full.with_suffix(".rst"))
    assert model.size == 963 - 63  # without what is held
    expected = [1283.200, 1283.200, 5781.975, 6919.399]
    np.testing.assert_allclose(frequencies(model, 4), expected, atol=6e-4)
    # Of ten elements of 20 nodes in a row the first is held at its face: a fifth of it is lost.
    assert model.total_mass == pytest.approx(4.1408e-4 * 5.0 * (1.0 - 0.2 / 10.0), rel=1e-6)
    with pytest.raises(InputError, match="IMPORT,MMF"):
        femubench.write_model(model, tmp_path / "new" / "folder", like=full)
    assert not (tmp_path / "new").exists()


def test_real_files_of_nastran() -> None:
    from femubench.plugins.readers.dmig import DmigReader
    from femubench.plugins.readers.op4 import Op4Reader

    matrices = Op4Reader().variables(FORMATS / "ascii_fabiola.op4")
    assert list(matrices) == ["maa", "ll", "dd"]
    assert matrices["maa"][0, 0] == 1.1700000592639120e-05
    with pytest.raises(InputError, match="the stiffness; there are"):
        DmigReader().read_model(FORMATS / "matrix_factory.pch")


@pytest.fixture(scope="module")
def plates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if CCX is None:
        pytest.skip("ccx is not installed")
    folder = tmp_path_factory.mktemp("ccx") / "plates"
    shutil.copytree(PLATES, folder)
    deck = (folder / "plates.inp").read_text().replace(", SOLVER=MATRIXSTORAGE", "")
    (folder / "frequencies.inp").write_text(deck)
    for job in ("plates", "plates_left", "plates_right", "frequencies"):
        subprocess.run([CCX, job], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.slow(5)
def test_a_solid_has_the_frequencies_of_calculix(plates: Path) -> None:
    model = femubench.read_model(plates / "plates.inp", unit="mm")
    assert model.size == 2655
    assert list(model.groups) == ["left", "right"]
    expected = own_frequencies(plates / "frequencies.dat")
    # The first six are rigid.
    np.testing.assert_allclose(frequencies(model, 20)[6:], expected[6:], rtol=1e-6)
    weight = 7850.0 * (3 * 160.0 * 60.0 * 6.0 + 2 * 2 * 40.0 * 15.0) * 1e-9
    assert model.total_mass == pytest.approx(weight, rel=1e-3)


@pytest.mark.nightly
def test_four_commands_lead_from_a_deck_to_an_updated_one(tmp_path: Path) -> None:
    """Those of docs/readers.md, word for word, and what it says of their answers."""
    folder = Path(shutil.copytree(PLATES, tmp_path / "plates"))
    text = (PLATES.parents[1] / "docs" / "readers.md").read_text(encoding="utf-8")
    section = text.partition("### Three bolted plates")[2].partition("\n## ")[0]
    (block,) = re.findall(r"```console\n(.*?)```", section, re.DOTALL)
    said = {}
    for line in block.splitlines():
        bench, verb, *words = shlex.split(line.removeprefix("$ "))
        ours = [sys.executable, "-m", "femubench", verb, *words]
        done = subprocess.run(ours, cwd=folder, capture_output=True, text=True, check=False)
        assert (bench, done.returncode) == ("bench", 0), done.stderr
        said[verb] = " ".join(done.stdout.split())
    assert list(said) == ["init", "diagnose", "run", "update"]
    case = femubench.read_case(folder / "case", readers=READERS)
    assert list(case.model.groups) == ["LEFT", "RIGHT", "PLATES"]
    assert len(case.measurement.sensors) == 90
    assert np.ptp(case.model.dofs.xyz, axis=0) == pytest.approx([0.4, 0.06, 0.013])
    before, after = re.findall(r"falls\s+from ([\d.]+) to ([\d.]+) %", section)[0]
    assert "lacks member-stiffness at group:LEFT" in said["diagnose"]
    assert f"falls from {before} to {after}" in said["diagnose"]
    (change,) = re.findall(r"names the left joint, (-[\d.]+ ± [\d.]+ %)", section)
    assert change in said["diagnose"]
    assert re.search(r" 1 +constitutive-er", said["run"])
    assert said["run"].endswith(f"Next: {block.splitlines()[-1].removeprefix('$ ')}")
    refused = call_bench("update", folder / "case", "-s", "diagnosed", "-o", folder / "new", code=2)
    assert "diagnosed:meet_frequencies=false changes parameters alone" in refused.output
    (left,) = re.findall(r"the left joint at ([\d.]+) of its", section)
    assert re.search(rf"LEFT: 1 → {left}", said["update"])
    assert (folder / "updated" / "plates.inp").is_file()


_CASE = """\
[case]
name = "bricks"
[model]
kind = "file"
file = "job.inp"
unit = "mm"
[[model.groups]]
name = "tip"
dofs = ["9", "10:x", "11:z"]
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1, 2]
"""


def test_bench_update_writes_a_job_with_the_measured_frequencies(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    folder.mkdir()
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        shutil.copy(JOB.with_suffix(suffix), folder)
    model = femubench.read_model(JOB, unit="mm")
    modes = femubench.solve_modes(model, 2)
    places = [(node, d) for node in ("9", "10", "11", "12") for d in ("y", "z")]
    rows = [rows_of(model).index(place) for place in places]
    labels = [f"{node}{d}" for node, d in places]
    sensors = [f"{label},{node},{d}" for label, (node, d) in zip(labels, places, strict=True)]
    (folder / "sensors.csv").write_text("\n".join(["label,at,direction", *sensors]))
    measured = 0.97 * frequencies(model, 2)
    lines = [",".join(["mode", "frequency", *labels])]
    lines += [",".join(map(repr, [i + 1, float(measured[i]), *modes.shapes[rows, i].tolist()]))
              for i in range(2)]  # fmt: skip
    (folder / "modes.csv").write_text("\n".join(lines))
    (folder / "case.toml").write_text(_CASE)
    before = femubench.read_case(folder, readers=READERS)
    assert before.model.groups["tip"].nnz > 0
    new = tmp_path / "new"
    done = call_bench("update", folder, "-s", "baruch", "-o", new)
    assert f"wrote {new / 'job.sti'}" in done.output
    shutil.copy(JOB, new)
    np.testing.assert_allclose(
        frequencies(femubench.read_model(new / "job.inp", unit="mm"), 2), measured, rtol=1e-6
    )
    # All files that were read are in the digest.
    (folder / "job.mas").write_text((folder / "job.mas").read_text() + "\n")
    assert femubench.read_case(folder, readers=READERS).digest != before.digest


def test_files_outside_of_the_case_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    folder.mkdir()
    for suffix in (".sti", ".mas", ".dof"):
        shutil.copy(JOB.with_suffix(suffix), folder)
    (tmp_path / "mesh.inp").write_text(JOB.read_text())
    (folder / "job.inp").write_text("*INCLUDE, INPUT=../mesh.inp\n")
    (folder / "case.toml").write_text(_CASE)
    with pytest.raises(InputError, match="leads out of the folder"):
        femubench.read_case(folder, readers=READERS)


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("femubench.plugins.readers.reading.find_spec", lambda name: None)
    for name, extra in (("K.op4", "nastran"), ("K.h5", "hdf5"), ("K.full", "ansys")):
        (tmp_path / name).write_bytes(b"x")
        with pytest.raises(InputError, match=rf"pip install 'femubench\[{extra}\]'"):
            femubench.read_model(tmp_path / name)


def test_rows_without_labels_or_places_are_said(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", K=np.eye(2), M=np.eye(2))
    with pytest.raises(InputError, match=r"no labels.*row,node,direction"):
        femubench.read_model(tmp_path / "a.npz")
    labels = {"node": [7, 8], "direction": ["x", "y"]}
    np.savez(tmp_path / "b.npz", K=np.eye(2), M=np.eye(2), **labels)
    with pytest.raises(InputError, match=r"node '7' has no coordinates.*node,x,y,z"):
        femubench.read_model(tmp_path / "b.npz")
    (tmp_path / "nodes.csv").write_text("node,x,y,z\n7,0,0,0\n8,1,0,0\n")
    model = femubench.read_model(tmp_path / "b.npz", dofs=tmp_path / "nodes.csv", unit="cm")
    np.testing.assert_allclose(model.dofs.xyz[1], [0.01, 0.0, 0.0])
    np.savez(tmp_path / "c.npz", K=np.eye(2), M=np.eye(2), node=[1], direction=["x"])
    with pytest.raises(InputError, match="size"):
        femubench.read_model(tmp_path / "c.npz")


def test_data_in_other_files_is_refused(tmp_path: Path) -> None:
    import h5py

    (tmp_path / "secret").write_bytes(np.eye(2).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["M"] = np.eye(2)
        file.create_dataset("K", (2, 2), float, external=[(str(tmp_path / "secret"), 0, 32)])
    with pytest.raises(InputError, match="'K' is kept in another file"):
        femubench.read_model(tmp_path / "a.h5")


def test_a_punch_of_extseout_is_found_by_the_number_of_its_superelement(tmp_path: Path) -> None:
    import pandas as pd
    from pyyeti.nastran import bulk

    from femubench.plugins.readers.dmig import DmigReader

    path = tmp_path / "punch.pch"
    points = pd.MultiIndex.from_product([(1, 2), (1, 2)], names=["id", "dof"])
    K, M, other = (scale * np.diag([1.0, 2.0, 3.0, 4.0]) for scale in (5.0, 0.1, 9.0))
    for names in (("k10", "m10"), ("kaa10", "maa10"), ("kaax", "maax")):
        frames = dict(zip((*names, "mug1t"), (K, M, other), strict=True))
        tables = {n: pd.DataFrame(m, index=points, columns=points) for n, m in frames.items()}
        bulk.wtdmig(str(path), tables)
        found = DmigReader().read_model(path)
        np.testing.assert_allclose(found.stiffness.toarray(), K)
        np.testing.assert_allclose(found.mass.toarray(), M)
    path.write_text("$ a punch\nGRID,1\nENDDATA\n")
    with pytest.raises(InputError, match="there are no DMIG cards"):
        DmigReader().read_model(path)
