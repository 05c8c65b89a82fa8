"""Third-party files: no way out of a case folder, no waiting, no code in data, limits on size."""

from __future__ import annotations

import ast
import gzip
import json
import os
import re
import shutil
from itertools import product
from pathlib import Path

import pytest
from seeds import a_run, matrix_case, run_text, universal_case

import femubench
from femubench import InputError, read_case
from femubench.core.case import files, matrices as matrix_text
from femubench.core.case.files import LARGEST_FILE, LARGEST_TEXT
from femubench.core.case.reader import read_case as read_folder
from femubench.core.schema import records as schema
from femubench.core.schema.records import read_run, run_from_json
from femubench.plugins.readers.universal import UniversalReader
from femubench.reports.cells import plain
from femubench.reports.markdown import escape
from tests.command import call_bench, run_python

ROOT = Path(__file__).parents[1]
ROOMS = ("core", "papers", "plugins", "reports", "scenarios")
CASE = ROOT / "tests" / "cases" / "in-plane"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    return Path(shutil.copytree(CASE, tmp_path / "case"))


def refusal(folder: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        read_case(folder, readers=(UniversalReader(),))
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) < 2500
    return caught.value


def renamed(case: Path, name: str) -> None:
    """Let the case name another file for its sensors."""
    text = (case / "case.toml").read_text()
    (case / "case.toml").write_text(text.replace('"sensors.csv"', json.dumps(name)))


@pytest.mark.parametrize(
    "name",
    ["/etc/passwd", "../sensors.csv", "a/../../sensors.csv", "..", "C:\\x.csv", "\\\\host\\x.csv",
     "..\\sensors.csv", "//host/x.csv", "c:x.csv"],
)  # fmt: skip
def test_names_that_lead_out(case: Path, name: str) -> None:
    shutil.copy(case / "sensors.csv", case.parent / "sensors.csv")
    renamed(case, name)
    error = refusal(case)
    assert "leads out of the case folder" in error.what
    assert error.key == "measurement.sensors"
    assert error.line is not None


@pytest.mark.parametrize("file", ["case.toml", "modified.csv"])
def test_a_link_that_leads_out(case: Path, file: str) -> None:
    (case / file).rename(case.parent / file)
    (case / file).symlink_to(Path("..") / file)
    assert "link that leads out" in refusal(case).what


def test_a_folder_that_is_a_link_out(case: Path) -> None:
    (case.parent / "elsewhere").mkdir()
    (case / "sensors.csv").rename(case.parent / "elsewhere" / "sensors.csv")
    (case / "data").symlink_to(case.parent / "elsewhere")
    renamed(case, "data/sensors.csv")
    assert "link that leads out" in refusal(case).what


def test_an_installed_scenario_may_be_made_of_links(case: Path) -> None:
    (case.parent / "farm").mkdir()
    for file in case.iterdir():
        (case.parent / "farm" / file.name).symlink_to(file)
    found = read_folder(case.parent / "farm", installed=True)
    assert found.digest == read_case(CASE).digest
    assert "link that leads out" in refusal(case.parent / "farm").what


@pytest.mark.parametrize("target", ["sensors.csv", "missing.csv"])
def test_a_link_in_a_circle_or_to_nothing(case: Path, target: str) -> None:
    (case / "sensors.csv").unlink()
    (case / "sensors.csv").symlink_to(target)
    assert "nowhere" in refusal(case).what


def test_links_that_stay_inside_and_a_linked_folder_are_fine(case: Path) -> None:
    (case / "data").mkdir()
    (case / "sensors.csv").rename(case / "data" / "real.csv")
    (case / "sensors.csv").symlink_to("data/real.csv")
    (case.parent / "mine").symlink_to(case)
    assert read_case(case.parent / "mine").digest == read_case(CASE).digest


@pytest.mark.parametrize("file", ["case.toml", "modes.csv"])
def test_a_pipe_is_not_waited_for(case: Path, file: str) -> None:
    (case / file).unlink()
    os.mkfifo(case / file)
    assert "pipe or a device" in refusal(case).what


def test_a_folder_and_a_device_are_no_files(case: Path) -> None:
    (case / "sensors.csv").unlink()
    (case / "sensors.csv").mkdir()
    assert "is a folder" in refusal(case).what
    with pytest.raises(InputError, match="pipe or a device"):
        read_run(Path("/dev/zero"))


@pytest.mark.parametrize("name", ["é" * 200 + ".csv", "x" * 250 + ".csv", "a\\u0000b.csv"])
def test_impossible_names(case: Path, name: str) -> None:
    renamed(case, name)
    assert refusal(case).key == "measurement.sensors"


@pytest.mark.parametrize(
    ("file", "size"), [("case.toml", 17 * 2**20), ("sensors.csv", LARGEST_TEXT + 1)]
)
def test_huge_texts(case: Path, file: str, size: int) -> None:
    os.truncate(case / file, size)  # sparse: takes no room on the disk
    assert refusal(case).what == "file is too large"


def test_huge_files_of_other_formats(tmp_path: Path) -> None:
    folder = matrix_case(tmp_path / "matrices")
    os.truncate(folder / "mass.mtx", LARGEST_FILE + 1)
    assert "1024 MiB" in (refusal(folder).expected or "")
    folder = universal_case(tmp_path / "universal")
    os.truncate(folder / "test.uff", 257 * 2**20)
    assert "256 MiB" in (refusal(folder).expected or "")


def test_a_packed_file_that_unpacks_to_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matrix_text, "LARGEST_FILE", 2**20)
    folder = matrix_case(tmp_path / "case")
    header = b"%%MatrixMarket matrix coordinate integer general\n"
    (folder / "packed.mtx.gz").write_bytes(gzip.compress(header + b"%\n" * 2**20))
    assert "once it is unpacked" in (refusal(folder).expected or "")
    (folder / "packed.mtx.gz").write_bytes(gzip.compress(header + b"4 4 1\n2 2 5\n")[:-9])
    assert "cannot be read" in refusal(folder).what


def test_the_header_of_a_matrix_is_not_believed(tmp_path: Path) -> None:
    folder = matrix_case(tmp_path / "case")
    header = "%%MatrixMarket matrix coordinate real symmetric\n"
    for entries, what in ((10**12, "entries"), (40_000_000, "cannot be read")):
        (folder / "mass.mtx").write_text(f"{header}4 4 {entries}\n1 1 1.0\n")
        assert what in refusal(folder).what


def test_an_end_that_the_library_reads_beyond(tmp_path: Path) -> None:
    """A crash must not take the tests with it."""
    folders = []
    for end, pack in product(
        ("2 2 2.5.5", "2 2 2.5x", "2 2 2.5 \0\n", "2 2 2.5", "2 2 \n"), (0, 1)
    ):
        folder = matrix_case(tmp_path / str(len(folders)))
        folders.append(str(folder))
        text = f"%%MatrixMarket matrix coordinate real general\n4 4 1\n{end}".encode()
        (folder / "general.mtx").write_bytes(text)
        (folder / "packed.mtx.gz").write_bytes(gzip.compress(text))
        (folder / ("general.mtx" if pack else "packed.mtx.gz")).unlink()
        toml = (folder / "case.toml").read_text().splitlines()
        at = toml.index(f'stiffness = "{"general.mtx" if pack else "packed.mtx.gz"}"')
        (folder / "case.toml").write_text("\n".join(toml[: at - 2] + toml[at + 1 :]))
    code = f"import femubench\nfor folder in {folders}:\n try: femubench.read_case(folder)\n"
    code += " except femubench.InputError as e: print(e)"
    run_python("-c", code)


def test_more_elements_than_memory(case: Path) -> None:
    text = (case / "case.toml").read_text()
    for count in (10**6, 10**9, 10**30):
        (case / "case.toml").write_text(
            re.sub(r"elements = \d+", f"elements = {count}", text, count=1)
        )
        assert (refusal(case).key or "").endswith("elements")


@pytest.mark.parametrize(
    ("file", "content", "what"),
    [
        ("sensors.csv", ",".join(f"c{i}" for i in range(10**6)) + "\n", "too many columns"),
        ("modes.csv", "mode,frequency\n1," + "9" * 100_000 + "\n", "too long"),
        ("sensors.csv", "label,at,direction\na,girder@" + "9" * 100_000 + ",z\n", "too long"),
        ("modes.csv", "mode,frequency\n\0,1\n", "not allowed"),
        ("sensors.csv", "label,x,y,z,direction\n\x1b[31m,0,0,1,z\n", "not a text"),
        ("case.toml", "a." * 200_000 + "b = 1\n", "nested too deeply"),
        ("case.toml", "x = " + "{a = " * 450 + "1" + "}" * 450, "unknown key"),
        ("case.toml", "a = 1\na = 2\n", "overwrite"),
        ("case.toml", '"a\\u001b[2J" = 1\n', "unknown key"),
        ("case.toml", '"' + "k" * 100_000 + '" = 1\n', "unknown key"),
    ],
)  # fmt: skip
def test_monsters(case: Path, file: str, content: str, what: str) -> None:
    if file == "case.toml":
        content += (case / file).read_text()
    (case / file).write_text(content)
    error = refusal(case)
    assert what in error.what.lower() or "nested" in error.what


def test_marks_and_line_ends_of_other_systems_work(case: Path) -> None:
    for file in case.iterdir():
        text = file.read_text().replace("\n", "\r\n")
        file.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read_case(case).used == read_case(CASE).used


@pytest.mark.parametrize(
    "name", ["a\\u009b31m", "a\\u202eb", "a\\u001b[2J"], ids=["csi", "bidi", "escape"]
)
def test_no_name_moves_a_cursor(case: Path, name: str) -> None:
    text = (case / "case.toml").read_text()
    first = text.index('name = "') + 8
    (case / "case.toml").write_text(text[:first] + name + text[text.index('"', first) :])
    assert refusal(case).key == "case.name"


# --- results --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("cases", None), ("cases", ["frame"]), ("cases", {"frame": 3}), ("seeds", "all"),
        ("seeds", [-1]), ("seed", 0.5), ("strategies", {"a": 1}), ("strategies", ["a"] * 1001),
        ("reference", {"frame": 1.0}), ("reference", {"frame": {"used": -1.0}}),
        ("reference", {"frame": {"used": None}}), ("run", "x" * 1001), ("citations", ["x"]),
        ("rule", {"mac": 0}), ("rule", {"cpa": 1.0}), ("models", {}), ("models", {"frame": {}}),
    ],
)  # fmt: skip
def test_meta_data_are_checked(key: str, value: object) -> None:
    run = json.loads(run_text())
    run["meta"][key] = value
    with pytest.raises(InputError, match=f"run.json: meta.{key}"):
        run_from_json(run, file="run.json")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("seed", -1), ("seed", 2**63), ("gain", 1.5), ("gain", -1.5), ("rank", 0),
        ("status", "fine"), ("case", "x" * 1001), ("reason", "x" * 100_001), ("seconds", -1),
        ("evaluations", 10**30), ("used", {"rms_percent": 1e200, "modes": []}),
        ("used", {"rms_percent": 1, "modes": [{"measured_hz": 0, "predicted_hz": 1, "mac": 1}]}),
        ("used", {"rms_percent": 1, "modes": [{"measured_hz": 1, "predicted_hz": 1, "mac": 2}]}),
        ("history", [[1]]), ("diagnostics", {"a": "b"}), ("parameters", [{"a": [1]}]),
    ],
)  # fmt: skip
def test_results_are_checked(key: str, value: object) -> None:
    data = json.loads(run_text())
    data["results"][2][key] = value
    with pytest.raises(InputError, match=rf"run.json: results\[2\]\.{key}"):
        run_from_json(data, file="run.json")


def test_what_was_written_reads_back() -> None:
    run = run_from_json(json.loads(run_text()))
    assert run.meta == a_run().meta
    line = schema.encode_result(run.results[0])
    assert schema.decode_result(line) == run.results[0]
    with pytest.raises(InputError, match=r"seed: out of bounds \(expected a whole number >= 0\)"):
        schema.decode_result(line.replace(b'"seed":0', b'"seed":-1'))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[" * 100_000, "nested too deeply"), ('{"meta": NaN}', "not a number of JSON"),
        ("1" * 5000, "not JSON"), ("", "not JSON"), ("[1]", "run.json"), ("null", "run.json"),
        ('{"meta": {"x": ' + "[" * 100 + "]" * 100 + '}, "results": []}', "nested too deeply"),
    ],
)  # fmt: skip
def test_broken_json(tmp_path: Path, text: str, what: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError, match=what):
        read_run(tmp_path / "run.json")
    answer = call_bench("report", tmp_path / "run.json", code=2)
    assert len(answer.output.splitlines()) == 1


def test_a_result_file_has_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.json"
    file.touch()
    os.truncate(file, schema.LARGEST_RUN + 1)
    with pytest.raises(InputError, match="too large"):
        read_run(file)
    monkeypatch.setattr(schema, "_MOST_JOBS", 11)  # there are 3 * 2 * 2
    with pytest.raises(InputError, match="3 strategies on 2 cases with 2 seeds"):
        run_from_json(json.loads(run_text()))


def test_a_pipe_for_a_result_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    answer = call_bench("report", tmp_path / "pipe", code=2)
    assert "pipe or a device" in answer.output


EVIL = "\x1b[2J\x9b31m\u202e<script>alert(1)</script> | ![x](http://e) `a`\n# head\r"


def test_a_name_neither_breaks_the_screen_nor_the_document(tmp_path: Path) -> None:
    data = json.loads(run_text())
    for result in data["results"]:
        result["strategy"], result["case"] = EVIL, EVIL
        result["reason"] = EVIL if result["status"] != "ok" else ""
    data["meta"] |= {"strategies": [EVIL], "cases": {EVIL: {"title": EVIL}}, "run": f"../{EVIL}"}
    data["meta"] |= {"citations": {EVIL: EVIL}, "machine": {EVIL: EVIL}, "reference": None}
    data["meta"]["models"] = {EVIL: data["meta"]["models"]["frame"]}
    file = tmp_path / "run.json"
    file.write_text(json.dumps(data))
    for name in ("terminal", "markdown"):
        answer = call_bench("report", file, "-f", name)
        assert all(line.isprintable() for line in answer.output.split("\n"))
        assert name == "terminal" or "<script" not in answer.output
        assert name == "terminal" or "![x](" not in answer.output
    words = ["report", str(file), "-f", "markdown", "-o", str(tmp_path / "out")]
    call_bench(*words)
    assert [path.parent.name for path in tmp_path.rglob("*.md")] == ["out"]
    assert plain(EVIL).isprintable()
    assert "<" not in escape(EVIL)


# --- no code in data ------------------------------------------------------------------------

# Only what this program has written itself goes through pickle: see each reason.
TRUSTED = {
    "core/run/jobs.py": "writes strategies; a worker reads the job that the parent has written",
    "core/run/schedule.py": "writes cases for the processes that judge",
    "core/run/slots.py": "writes jobs for its own workers",
    "core/run/cluster.py": "sends cases to workers of the same user, who send results as Dask does",
    "core/run/standing_judge.py": "reads cases that the parent has written",
    "core/child/confinement.py": "a child reads the requests that its parent has written",
    "core/conformance": "asks whether a strategy can be pickled, which is a rule of the contract",
}
# Arrays of one publication, from the folder that the user names for it; no case can ask for it.
# The reader of third parties' files reads them in a process of its own.
MATLAB = {"plugins/readers/matlab.py", "scenarios/matlab_footbridge.py"}
CODE = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "marshal", "shelve",
        "yaml", "ruamel", "jsonpickle", "dbm"}  # fmt: skip
CALLS = {"eval", "exec", "compile", "__import__", "read_pickle", "allow_pickle", "read_hdf",
         "loadmat", "literal_eval", "execfile", "run_path"}  # fmt: skip


def _without_pickle(call: ast.Call) -> bool:
    return any(
        keyword.arg == "allow_pickle"
        and isinstance(keyword.value, ast.Constant)
        and keyword.value.value is False
        for keyword in call.keywords
    )


def suspicious(source: str) -> set[str]:
    """Return what turns data into code in a source."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names} & CODE
        elif isinstance(node, ast.ImportFrom):
            found |= {(node.module or "").split(".")[0]} & CODE
            found |= {alias.name for alias in node.names} & CALLS
        elif isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            if isinstance(node.func, ast.Attribute):
                of_re = isinstance(node.func.value, ast.Name) and node.func.value.id == "re"
                name = "" if of_re else node.func.attr
                of_numpy = isinstance(node.func.value, ast.Name) and node.func.value.id == "np"
                if of_numpy and name == "load" and not _without_pickle(node):
                    found.add("np.load")
            found |= {name} & CALLS
            if not _without_pickle(node):
                found |= {keyword.arg or "" for keyword in node.keywords} & CALLS
    return found


def test_no_code_comes_from_data_files() -> None:
    for room in ROOMS:
        for path in (ROOT / room).rglob("*.py"):
            name = path.relative_to(ROOT).as_posix()
            found = suspicious(path.read_text(encoding="utf-8"))
            if any(name == known or name.startswith(f"{known}/") for known in TRUSTED):
                found -= {"pickle", "cloudpickle"}
            found -= {"loadmat"} if name in MATLAB else set()
            assert not found, f"{name}: {found}"


@pytest.mark.parametrize(
    "source",
    ["import pickle", "from yaml import load", "import numpy as np\nnp.load('x')", "eval('1')",
     "import pandas as pd\npd.read_pickle('x')", "f(allow_pickle=True)", "import shelve as s"],
)  # fmt: skip
def test_the_search_finds_what_it_looks_for(source: str) -> None:
    assert suspicious(source)


def test_limits_are_those_of_the_page() -> None:
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    for size in (files.LARGEST_CASE, files.LARGEST_TEXT, files.LARGEST_FILE, schema.LARGEST_RUN):
        assert f"{size // 2**20} MiB" in text
    assert femubench.__version__
