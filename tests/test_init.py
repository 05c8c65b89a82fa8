"""`bench init` from the files of a model and of a test: a folder that runs, or nothing."""

from __future__ import annotations

import re
import shlex
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
import scipy.io
import scipy.sparse as sp
from click.testing import Result

import femubench
import femubench.plot
from femubench.core.case.case import Match
from femubench.core.case.matching import Alignment
from femubench.core.case.records import mean_record
from femubench.core.case.turns import propose_axes
from femubench.modal import FrequencyResponses
from tests.command import call_bench
from tests.frf_problems import write_universal

DOCS = Path(__file__).parents[1] / "docs"
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


def universal(folder: Path, axis: int = 3, count: int = 6, **nodes: np.ndarray) -> Path:
    """Write a test in mm of the chain, which lies along y, 3 mm off, and moves along an axis."""
    hertz, shapes = chain(folder)
    zero, x = np.zeros(SPANS), 0.2 * np.arange(1.0, SPANS + 1.0)
    place = {"x": zero + 3.0, "y": 1e3 * x, "z": zero} | nodes
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
            "node_nums": numbers,
            **{f"r{own}": shapes[:, k] if own == axis else zero for own in (1, 2, 3)},
        }
        for k in range(count)
    ]  # fmt: skip
    path = folder / "test.uff"
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return path


def init(folder: Path, *more: str) -> Result:
    files = {"--model": "K.mtx", "--mass": "M.mtx", "--dofs": "dofs.csv", "--modes": "test.uff"}
    files = {key: name for key, name in files.items() if key not in more}
    words = [word for key, name in files.items() for word in (key, str(folder / name))]
    return call_bench("init", folder / "case", *words, *more, code=None)


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
        found = call_bench(*words)
        assert "coordinates were taken in mm" in " ".join(found.output.split())


def test_directions_of_sensors_that_are_wrong_are_seen_by_shapes(tmp_path: Path) -> None:
    """The chain moves along its z; along y springs of a slope, other at every mass, hold it."""
    universal(tmp_path, axis=1)
    other = STIFFNESS * sp.diags_array(np.linspace(0.5, 3.0, SPANS))
    for name, more in (("K", other), ("M", MASS * sp.eye_array(SPANS))):
        both = sp.block_diag([scipy.io.mmread(tmp_path / f"{name}.mtx"), more])
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(both), symmetry="symmetric")
    rows = (tmp_path / "dofs.csv").read_text()
    for line in rows.splitlines()[1:]:
        row, node, _, *xyz = line.split(",")
        rows += ",".join([str(int(row) + SPANS), node, "y", *xyz]) + "\n"
    (tmp_path / "dofs.csv").write_text(rows)
    done = init(tmp_path, "--frame", "y,-x,z")
    stated = " ".join(done.output.split())
    (remedy,) = re.findall(
        r'like the model\'s with frame = "(\S+)": mean MAC 1, not 0\.\d+', stated
    )
    assert remedy in (tmp_path / "case" / "case.toml").read_text()
    for words in (["--frame", remedy], ["--frame", "y,-x,z", "--directions", remedy]):
        (tmp_path / "case").rename(tmp_path / words[-2])
        done = init(tmp_path, *words)
        assert " ".join(done.output.split()).count("1.000") == 6  # MAC
        assert "shapes are like" not in done.output


def test_places_of_a_table_in_mm_are_seen(tmp_path: Path) -> None:
    universal(tmp_path)
    rows = "".join(f"{k + 1}:z,{200 * (k + 1)},0,0,z\n" for k in range(SPANS))
    (tmp_path / "places.csv").write_text(f"label,x,y,z,direction\n{rows}")
    done = init(tmp_path, "--sensors", str(tmp_path / "places.csv"))
    assert "places.csv: coordinates were taken in mm" in " ".join(done.output.split())
    assert done.output.count("1.000") == 6  # MAC


def test_directions_alone_that_are_wrong_are_named() -> None:
    case = femubench.cases["suite/portal"]
    own = case.measurement.sensors
    places = tuple(Match(label, "", x, x) for label, x in zip(own.labels, own.xyz, strict=True))
    case, as_stated = replace(case, matches=places), Alignment(None, np.eye(3), 0.01)
    assert propose_axes(case, as_stated) == ""
    axes = own.axes[:, [2, 1, 0, 5, 4, 3]]
    turned = femubench.Sensors.along(own.labels, own.xyz, axes)
    case = replace(case, measurement=replace(case.measurement, sensors=turned))
    assert 'with directions = "z,-y,x": mean MAC 0.99' in propose_axes(case, as_stated)


X = 1e3 * 0.2 * np.arange(1.0, SPANS + 1.0)
CLOSE, WRONG = X.copy(), X.copy()
CLOSE[1], WRONG[5] = 195.0, 12000.0  # before the first node; typed for 1200
# The mistake, more words of `bench init`, coordinates of the test, what the message advises.
MISTAKES: dict[str, tuple[str, dict[str, np.ndarray], str]] = {
    "a unit of the test that is wrong": (
        "--frame y,-x,z --unit m",
        {},
        "--unit mm --frame y,-x,z` all fit",
    ),
    "a unit of the model that is wrong": (
        "--frame y,-x,z --model-unit mm",
        {},
        "--model-unit m --unit mm --frame y,-x,z` all",
    ),
    "other axes in the test": (
        "",
        {},
        "--unit mm --frame y,x,-z` all fit; by symmetry so they do with y,-x,z: compare",
    ),
    "a tolerance that is too small": (
        "--frame y,-x,z --tolerance 0.0001",
        {},
        "--tolerance 0.0022` all fit",
    ),
    "another origin in the test": ("--frame y,-x,z", {"y": X + 5e3}, "--frame y,-x,z --origin -5,"),
    "unit, axes and tolerance at once": (
        "--tolerance 1e-6 --unit ft",
        {"y": X / 25.4, "x": X / X},
        "--unit in --frame y",
    ),
    "one sensor with a wrong place": (
        "--frame y,-x,z",
        {"y": WRONG},
        "--frame y,-x,z --without 6:z` the",
    ),
    "two sensors that go to one place": (
        "--frame y,-x,z",
        {"y": CLOSE},
        "bench init --without 2:z",
    ),
    "the model of something else": (
        "--frame y,-x,z",
        {"y": X**2, "x": X**3},
        "is it the right model",
    ),
    "axes that are none": ("--frame x,x,z", {}, "each once and right-handed"),
    "an origin that is none": ("--origin 1,2", {}, "is no X,Y,Z in m"),
    "a matrix in place of modes": ("--modes @K.mtx", {}, "K.mtx: no modes are read"),
    "a kind of file that is not read": (
        "--modes @notes.docx",
        {},
        "a folder that `bench identify` writes",
    ),
    "a folder without modes": ("--modes @empty", {}, "`bench identify FILE --output"),
    "modes without places of sensors": ("--modes @modes.csv", {}, "bench init --sensors FILE"),
    "a folder that is in use": ("--frame y,-x,z", {"full": X}, "a new or an empty folder"),
}


def assert_on_page(mistake: str, output: str, folder: Path) -> None:
    """Check that a message is one line, which the docs list under its mistake."""
    (line,) = output.splitlines()
    own = line.replace(f"{folder}/", "").removeprefix("bench: ").replace("|", "\\|")
    assert f"| {mistake} | {own} |\n" in (DOCS / "your-structure.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_names_its_remedy_and_leaves_nothing(tmp_path: Path, mistake: str) -> None:
    more, nodes, advice = MISTAKES[mistake]
    if full := "full" in nodes:
        (tmp_path / "case").mkdir()
        (tmp_path / "case" / "mine").write_text("precious")
    universal(tmp_path, **{key: value for key, value in nodes.items() if key != "full"})
    (tmp_path / "modes.csv").write_text("mode,frequency,a\n1,10,1\n")
    (tmp_path / "notes.docx").write_text("")
    (tmp_path / "empty").mkdir()
    done = init(tmp_path, *more.replace("@", f"{tmp_path}/").split())
    assert done.exit_code == 2, done.output
    assert advice in done.output
    assert_on_page(mistake, done.output, tmp_path)
    assert (tmp_path / "case").exists() == full
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    if mistake in (
        "another origin in the test",
        "unit, axes and tolerance at once",
        "one sensor with a wrong place",
    ):
        command = re.search("`(bench init .*?)`", done.output)
        assert command is not None
        call_bench(*shlex.split(command[1])[1:])


@pytest.mark.parametrize(
    ("mistake", "words", "advice"),
    [
        ("a verb that is none", "strategies list", "Did you mean plugins list?"),
        ("a case that is not there", "run nosuch", "`bench init` writes one"),
        ("a folder that is no case", "diagnose .", "which `bench init` writes"),
        ("a sensor between two nodes", "update portal -s baruch -o new", "node at every sensor"),
        ("one sensor over time", "identify one.csv", "two or more in one file"),
        ("a response in two files", "identify a.uff a.uff", "--modes A --modes B"),
    ],
)
def test_other_mistakes_name_their_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mistake: str, words: str, advice: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if "portal" in words:
        femubench.init_case("portal")
    if "a.uff" in words:
        write_universal(Path("a.uff"), responses(tmp_path))
    signal = np.random.default_rng(0).standard_normal(2100)
    rows = "".join(f"{0.01 * i:.2f};{v}\n".replace(".", ",") for i, v in enumerate(signal))
    Path("one.csv").write_text(f"time;1:z\n{rows}")
    done = call_bench(*words.split(), code=2)
    assert advice in done.output
    assert_on_page(mistake, done.output, tmp_path)


def responses(folder: Path, noise: float = 1e-3) -> FrequencyResponses:
    """Return receptances of the chain to a force at its second mass."""
    hertz, shapes = chain(folder)
    lines = np.arange(0.2 * hertz[0], 1.1 * hertz[-1], 0.5)
    modal = 1.0 / (hertz**2 - lines[:, None] ** 2 + 0.02j * hertz * lines[:, None])
    values = np.einsum("om,fm,im->foi", shapes, modal, shapes[[1, 2]]) / (4.0 * np.pi**2 * MASS)
    rng = np.random.default_rng(1)
    values = values * (1.0 + noise * rng.standard_normal(values.shape))
    xyz = np.outer(0.2 * np.arange(1.0, SPANS + 1.0), [1.0, 0.0, 0.0])
    every = femubench.Sensors(tuple(f"{k + 1}:z" for k in range(SPANS)), xyz, ("z",) * SPANS)
    two = femubench.Sensors(every.labels[1:3], xyz[1:3], ("z", "z"))
    return FrequencyResponses(every, two, lines, values, "receptance")


def test_responses_and_the_folder_of_an_identification(tmp_path: Path) -> None:
    measured = responses(tmp_path)
    write_universal(tmp_path / "test.uff", measured)
    done = init(tmp_path)
    assert done.exit_code == 0, done.output
    stated = " ".join(done.output.split())
    assert "0.2 % of the frequencies and 2 % of the shapes was added" in stated
    direct = femubench.read_case(tmp_path / "case")
    hertz, _ = chain(tmp_path)
    assert direct.measurement.frequencies == pytest.approx(hertz, rel=1e-3)
    assert direct.measurement.frequency_std / hertz == pytest.approx(0.002, rel=0.01)
    assert direct.measurement.shape_std == pytest.approx(0.02, rel=0.05)
    found = tmp_path / "found"  # has what `bench identify` writes
    (tmp_path / "case").rename(found)
    done = init(tmp_path, "--modes", str(found))
    assert done.exit_code == 0, done.output
    assert (tmp_path / "case" / "modes.csv").read_bytes() == (found / "modes.csv").read_bytes()
    (tmp_path / "case").rename(tmp_path / "other")
    done = init(tmp_path, "--modes", str(tmp_path / "other"), "--modes", str(found))
    assert done.exit_code == 0, done.output
    assert "means of 2 records of one state, 8 modes" in " ".join(done.output.split())
    assert b"frequency_std" in (tmp_path / "case" / "modes.csv").read_bytes()


def test_unit_of_a_model_follows_from_its_size_and_mass(tmp_path: Path) -> None:
    universal(tmp_path)
    for name in ("K.mtx", "M.mtx"):  # N/mm and tonnes
        scipy.io.mmwrite(tmp_path / name, 1e-3 * scipy.io.mmread(tmp_path / name))
    rows = "".join(f"{i + 1},n{i + 1},z,{x:g},0,0\n" for i, x in enumerate(X))
    (tmp_path / "dofs.csv").write_text(f"row,node,direction,x,y,z\n{rows}")
    done = init(tmp_path, "--frame", "y,-x,z")
    assert done.exit_code == 0, done.output
    assert "has a mass of 16 kg" in " ".join(done.output.split())
    assert 'unit = "mm"   # not stated' in (tmp_path / "case" / "case.toml").read_text()


def test_scatter_of_records_is_that_of_their_means() -> None:
    rng, count = np.random.default_rng(3), 40
    shapes, hertz = rng.standard_normal((12, 6)), 10.0 * np.arange(1.0, 7.0)
    largest = np.abs(shapes).max(axis=0)
    records = []
    for _ in range(count):
        f = hertz * (1.0 + 0.004 * rng.standard_normal(6))
        s = shapes + 0.03 * largest * rng.standard_normal(shapes.shape)
        sensors = femubench.Sensors(tuple(map(str, range(12))), np.zeros((12, 3)), ("z",) * 12)
        fit = (f, 1e-6 * f, np.full(6, np.nan), -2.0 * s, 1e-6 + 0.0 * s)
        record = femubench.Measurement(sensors, (1, 2, 3, 4, 5, 6), *fit)
        records.append(record.select([int(k) + 1 for k in rng.permutation(6)]))
    found, said = mean_record(records, [Path("a")] * count)
    at = np.argsort(found.frequencies)
    assert found.frequencies[at] == pytest.approx(hertz, rel=0.003)
    root = np.sqrt(count)
    assert root * found.frequency_std[at] / hertz == pytest.approx(0.004, rel=0.2)
    assert root * found.shape_std[:, at] / (2.0 * largest) == pytest.approx(0.03, rel=0.2)
    assert "40 records of one state, 6 modes in all" in said
    other = replace(records[1], sensors=replace(records[1].sensors, labels=tuple("abcdefghijkl")))
    with pytest.raises(femubench.InputError, match="not the sensors of a"):
        mean_record([records[0], other], [Path("a"), Path("b")])


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
    done = call_bench("init", tmp_path / "a", "--model", "K.mtx", code=None)
    assert (done.exit_code, "--modes: is missing" in done.output) == (2, True)
    with pytest.raises(femubench.InputError, match="model: is missing"):
        femubench.init_case(tmp_path / "a", modes="test.uff")
