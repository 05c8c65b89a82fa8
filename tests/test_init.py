"""`bench init` from the files of a model and of a test: a folder that runs, or nothing."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import pyuff
import scipy.io
import scipy.sparse as sp
from click.testing import CliRunner, Result

import femubench
import femubench.plot
from femubench.core.cli.main import bench

SPANS, MASS, STIFFNESS = 8, 2.0, 4.0e6


def chain(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Write a chain of masses on a line of 1.6 m, and return its frequencies and shapes."""
    stiffness = STIFFNESS * sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(8, 8))
    mass = MASS * sp.eye_array(SPANS)
    scipy.io.mmwrite(folder / "K.mtx", sp.coo_array(stiffness), symmetry="symmetric")
    scipy.io.mmwrite(folder / "M.mtx", sp.coo_array(mass), symmetry="symmetric")
    rows = "".join(f"{i + 1},n{i + 1},z,{0.2 * (i + 1):g},0,0\n" for i in range(SPANS))
    (folder / "dofs.csv").write_text(f"row,node,direction,x,y,z\n{rows}")
    values, shapes = np.linalg.eigh(stiffness.toarray() / MASS)
    return np.sqrt(values) / (2.0 * np.pi), shapes


def universal(folder: Path, length: float = 1e3, count: int = 6, **nodes: np.ndarray) -> Path:
    """Write a test of the chain, in mm unless stated, its axis along the test's y, 3 mm off."""
    hertz, shapes = chain(folder)
    zero, x = np.zeros(SPANS), 0.2 * np.arange(1.0, SPANS + 1.0)
    place = {"x": zero + 0.003 * length, "y": length * x, "z": zero} | nodes
    numbers = np.arange(1, SPANS + 1)
    sets = [
        pyuff.prepare_151(model_name="chain", return_full_dict=True),
        {
            "type": 15,
            "node_nums": numbers,
            **place,
            **dict.fromkeys(("def_cs", "disp_cs", "color"), zero),
        },
        {"type": 82, "trace_num": 1, "id": "line", "color": 1, "nodes": numbers},
    ]
    sets += [
        {
            "type": 55, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 1,
            "mode_n": k + 1, "freq": 0.98 * hertz[k], "modal_damp_vis": 0.01,
            "node_nums": numbers, "r1": zero, "r2": zero, "r3": shapes[:, k],
        }
        for k in range(count)
    ]  # fmt: skip
    path = folder / "test.uff"
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return path


def init(folder: Path, *more: str) -> Result:
    files = {"--model": "K.mtx", "--mass": "M.mtx", "--dofs": "dofs.csv", "--modes": "test.uff"}
    words = [word for key, name in files.items() for word in (key, str(folder / name))]
    return CliRunner().invoke(bench, ["init", str(folder / "case"), *words, *more])


def test_folder_runs_and_says_what_was_done(tmp_path: Path) -> None:
    universal(tmp_path)
    done = init(tmp_path, "--frame", "y,-x,z")
    assert done.exit_code == 0, done.output
    stated = " ".join(done.output.split())
    assert "coordinates were taken in mm" in stated
    assert "along x, y, z and has a mass of" in stated
    assert "8 of the 8 sensors of test.uff were moved" in stated
    assert stated.count("1.000") == 6  # MAC
    assert stated.count("held out") == 2
    folder = tmp_path / "case"
    assert {path.name for path in folder.iterdir()} == {
        *("K.mtx", "M.mtx", "dofs.csv", "test.uff", "case.toml", "matches.csv", "matches.png")
    }
    assert (folder / "matches.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "matches.csv").read_text().splitlines()[1].startswith("1:z,z,n1,0.003,0.2,")
    keys = tomllib.loads((folder / "case.toml").read_text())
    assert keys["case"]["title"] == "chain"
    assert keys["measurement"]["used"] == [1, 2, 3, 4]
    assert keys["measurement"]["held_out"] == [5, 6]
    drawn = femubench.plot.wireframe_of(femubench.read_case(folder))
    assert drawn.elements == tuple((i, i + 1) for i in range(SPANS - 1))  # the test's trace line
    for words in (["run", str(folder), "-s", "unchanged", "--store", str(tmp_path / "r")],
                  ["diagnose", str(folder), "--no-pairs", "--effects", "added-mass"]):  # fmt: skip
        found = CliRunner().invoke(bench, words)
        assert found.exit_code == 0, found.output
        assert "coordinates were taken in mm" in " ".join(found.output.split())


@pytest.mark.parametrize(
    ("more", "nodes", "what"),
    [
        (["--unit", "m"], {}, 'unit = "mm"'),
        (["--tolerance", "0.0001"], {}, "off the structure, nearest n1"),
        (["--frame", "x,x,z"], {}, "no frame of axes"),
        (["--modes", "K.mtx"], {}, "K.mtx: no modes are read"),
        ([], {"y": 1e3 * np.array([0.2, 0.2, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6]), "x": np.arange(8.0)},
         "both lie nearest to n1, direction z"),
    ],
)  # fmt: skip
def test_nothing_is_left_where_something_is_wrong(
    tmp_path: Path, more: list[str], nodes: dict[str, np.ndarray], what: str
) -> None:
    universal(tmp_path, **nodes)
    more = [str(tmp_path / word) if word.endswith(".mtx") else word for word in more]
    done = init(tmp_path, *(more if "--frame" in more else ["--frame", "y,-x,z", *more]))
    assert done.exit_code == 2
    assert what in done.output
    assert str(tmp_path / "case") not in done.output.replace(str(tmp_path / "case") + "/", "")
    assert len(done.output.splitlines()) == 1
    assert not (tmp_path / "case").exists()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_refuses_to_overwrite(tmp_path: Path) -> None:
    universal(tmp_path)
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "mine").write_text("precious")
    done = init(tmp_path, "--frame", "y,-x,z")
    assert (done.exit_code, "is not empty" in done.output) == (2, True)
    assert [path.name for path in (tmp_path / "case").iterdir()] == ["mine"]


def test_table_of_modes_and_of_sensors(tmp_path: Path) -> None:
    hertz, shapes = chain(tmp_path)
    labels = [f"s{i}" for i in range(SPANS)]
    rows = [f"{k + 1},{hertz[k]},{','.join(map(str, shapes[:, k]))}" for k in range(3)]
    (tmp_path / "test.uff").write_text("")
    (tmp_path / "modes.csv").write_text("\n".join([",".join(["mode,frequency", *labels]), *rows]))
    places = [f"{label},{0.2 * (i + 1)},0.001,0,z" for i, label in enumerate(labels)]
    (tmp_path / "sensors.csv").write_text("\n".join(["label,x,y,z,direction", *places]))
    more = ["--modes", str(tmp_path / "modes.csv"), "--sensors", str(tmp_path / "sensors.csv")]
    done = init(tmp_path, *more)
    assert done.exit_code == 0, done.output
    case = femubench.read_case(tmp_path / "case")
    assert (case.used, case.held_out) == ((1, 2), (3,))
    assert case.title == "case"


def test_one_file_alone_is_not_enough(tmp_path: Path) -> None:
    done = CliRunner().invoke(bench, ["init", str(tmp_path / "a"), "--model", "K.mtx"])
    assert (done.exit_code, "--modes: is missing" in done.output) == (2, True)
    with pytest.raises(femubench.InputError, match="model: is missing"):
        femubench.init_case(tmp_path / "a", modes="test.uff")
