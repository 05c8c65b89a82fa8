"""Broken files of every format: read, or refused in one line; never anything else."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from mutations import changed_json, edits, json_edits, mutated
from seeds import CASES, matrix_case, run_text, universal_case
from watch import watched

from femubench import FemubenchError, read_case
from femubench.core.plugin.loader import load_plugins
from femubench.core.schema.records import read_run
from tests.command import call_bench

FEW, MANY = 0.006, 1.0  # share of the inputs in the tests of every day
INPUTS = {
    **{"toml": 24_000, "csv": 20_000, "mtx": 16_000, "universal": 14_000},
    "run": 8_000,
}
MOST_CHARACTERS = 2500
_CLI_SAMPLE = 12
READERS = tuple(load_plugins().readers.values())
REPORTERS = tuple(r for r in load_plugins().reporters.values() if r.name != "parquet")
_PAGE_SHARE = 10  # the page takes longer than all other reports: one input in ten gets it


@dataclass
class Tally:
    """What became of the inputs of one format."""

    outcomes: Counter[str] = field(default_factory=Counter)
    refused: list[bytes] = field(default_factory=list)

    def note(self, outcome: str, content: bytes) -> None:
        self.outcomes[outcome] += 1
        if outcome != "read" and len(self.refused) < _CLI_SAMPLE:
            self.refused.append(content)


def outcome_of(read: Callable[[], object], folder: Path, watch: bool = True) -> str:
    """Read, and check that a refusal is one clear line that names a file of the folder."""
    printed = StringIO()
    try:
        with watched(folder) if watch else nullcontext(), redirect_stdout(printed):
            read()
    except FemubenchError as error:
        text = str(error)
        assert text.isprintable()
        assert text == text.strip() != ""
        assert len(text) < MOST_CHARACTERS
        # Ranks are of a run, which may come from no file.
        assert str(folder) in text or text.startswith("the run keeps no candidate partners of case")
        return type(error).__name__
    finally:
        assert printed.getvalue() == ""
    return "read"


def fuzz(
    format: str, share: float, make: st.SearchStrategy[bytes], read: Callable[[bytes], str]
) -> Tally:
    tally = Tally()

    @settings(
        max_examples=int(share * INPUTS[format]),
        derandomize=share < MANY,
        deadline=None,
        database=None,
        print_blob=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(make)
    def check(content: bytes) -> None:
        tally.note(read(content), content)

    check()
    total = tally.outcomes.total()
    print(f"{format}: {total} inputs, {dict(tally.outcomes)}")
    assert total >= int(share * INPUTS[format])
    # Where all or none are refused, the mutations try nothing.
    assert 0.02 * total < tally.outcomes["read"] < 0.9 * total
    return tally


def refused_by_command(words: list[str]) -> None:
    result = call_bench(*words, code=None)
    assert "Traceback" not in result.output
    assert result.exit_code == 2, result.output
    assert len(result.output.splitlines()) == 1


def case_files(folder: Path, share: float, files: list[Path], format: str, commands: bool) -> None:
    """Fuzz files of case folders, each in a copy of its folder."""
    places: dict[Path, Path] = {}
    for i, file in enumerate(files):
        places[file] = Path(shutil.copytree(file.parent, folder / str(i))) / file.name
        read_case(file.parent, readers=READERS)
    texts = {file: file.read_text() for file in files}
    broken: list[tuple[Path, bytes]] = []

    def read(content: bytes) -> str:
        number, _, content = content.partition(b"|")
        file = places[files[int(number)]]
        whole = file.read_bytes()
        file.write_bytes(content)
        try:
            outcome = outcome_of(lambda: read_case(file.parent, None, READERS), file.parent)
        finally:
            file.write_bytes(whole)
        if outcome != "read" and len(broken) < _CLI_SAMPLE:
            broken.append((file, content))
        return outcome

    make = st.integers(0, len(files) - 1).flatmap(
        lambda i: edits().map(lambda e: b"%d|" % i + mutated(texts[files[i]], e))
    )
    fuzz(format, share, make, read)
    for file, content in broken if commands else ():
        whole = file.read_bytes()
        file.write_bytes(content)
        refused_by_command(["run", str(file.parent), "-s", "unchanged", "--store", str(folder)])
        file.write_bytes(whole)
    assert not commands or len(broken) == _CLI_SAMPLE


def case_format(folder: Path, share: float, format: str) -> None:
    own = folder / "origin"
    if format == "toml":
        files = [case / "case.toml" for case in CASES]
    elif format == "csv":
        files = [path for case in CASES for path in sorted(case.glob("*.csv"))]
        files += sorted(matrix_case(own).glob("*.csv"))
    elif format == "mtx":
        files = sorted(matrix_case(own).glob("*.mtx"))
    else:
        files = [universal_case(own) / "test.uff"]
    case_files(folder, share, files, format, commands=True)


def results_format(folder: Path, share: float, format: str) -> None:
    text = run_text()
    file = folder / "run.json"
    count = 0

    def report() -> None:
        nonlocal count
        run = read_run(file)
        count += 1
        for reporter in REPORTERS:
            if reporter.name == "html" and count % _PAGE_SHARE != 1:
                continue
            shown = reporter.render(run)
            if reporter.name in ("terminal", "markdown"):
                assert all(line.isprintable() for line in shown.split("\n"))
                assert reporter.name == "terminal" or "<script" not in shown

    file.write_text(text)
    report()  # whatever is imported late is imported now

    def read(content: bytes) -> str:
        file.write_bytes(content)
        return outcome_of(report, folder)

    def rewritten(changes: Any) -> bytes:
        return json.dumps(changed_json(json.loads(text), changes)).encode()

    make = json_edits().map(rewritten) | edits(2).map(lambda e: mutated(text, e))
    tally = fuzz(format, share, make, read)
    for content in tally.refused:
        file.write_bytes(content)
        refused_by_command(["report", str(file)])


FORMATS = ["toml", "csv", "mtx", "universal", "run"]


def check(folder: Path, share: float, format: str) -> None:
    (results_format if format == "run" else case_format)(folder, share, format)


@pytest.mark.slow(20)
@pytest.mark.parametrize(
    "format",
    ["toml", "run"]
    + [pytest.param(name, marks=pytest.mark.nightly) for name in ("csv", "mtx", "universal")],
)
def test_a_few(tmp_path: Path, format: str) -> None:
    check(tmp_path, FEW, format)


@pytest.mark.nightly
@pytest.mark.parametrize("format", FORMATS)
def test_many(tmp_path: Path, format: str) -> None:
    check(tmp_path, MANY, format)


def test_the_watch_sees_what_it_is_there_for(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "secret").write_text("x")
    for act in (
        lambda: (tmp_path / "secret").read_text(),
        lambda: (tmp_path / "inside" / "new").write_text("x"),
        lambda: (tmp_path / "inside" / "folder").mkdir(),
    ):
        with pytest.raises(AssertionError), watched(tmp_path / "inside"):
            act()
