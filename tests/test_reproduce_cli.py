"""The verb `reproduce`: what it asks for, prints, writes and returns."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reproduction_toys as toys
from click.testing import Result

import femubench.papers
from femubench.core.errors import StrategyFailure
from femubench.core.reproduction.ground import VERDICTS
from femubench.core.reproduction.study import cells_to_json
from femubench.reproduction import Study, Workbench
from tests.command import call_bench

Invoke = Callable[..., Result]
KEYS = [
    *("paper", "table", "row", "column", "printed", "ours", "deviation_percent"),
    *("verdict", "note", "tried"),
]
ONE = (
    "2 of 11 printed cells agree independently (2 different figures), 2 under a stated "
    "convention, 1 after a search and 1 after a fit; 1 are input, "
    "1 cannot be checked, 1 are misprints and 2 do not follow"
)
BOTH = (
    "4 of 22 printed cells agree independently (4 different figures), 4 under a stated "
    "convention, 2 after a search and 2 after a fit; 2 are input, "
    "2 cannot be checked, 2 are misprints and 4 do not follow"
)


class Papers:
    """Stands for the studies and for the drawing: notes what was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Workbench]] = []
        self.drawings: list[str] = []
        self.fault: Exception | None = None

    def study(self, paper: str, workbench: Workbench) -> Study:
        self.asked.append((paper, workbench))
        if self.fault is not None:
            raise self.fault
        return toys.study(paper)

    def drawn(self, figure: Any) -> str:
        self.drawings.append(figure.name)
        return toys.drawn(figure)


@pytest.fixture
def papers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Papers:
    stand_in = Papers()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(femubench.papers, "study", stand_in.study)
    monkeypatch.setattr("femubench.core.plot.figure.render_figure", stand_in.drawn)
    return stand_in


@pytest.fixture
def invoke(papers: Papers) -> Invoke:
    return lambda *words: call_bench("reproduce", *words, code=None)


class TestAsking:
    def test_both_papers_by_default(self, invoke: Invoke, papers: Papers) -> None:
        result = invoke()
        assert (result.exit_code, result.stderr) == (0, "")
        assert [paper for paper, _ in papers.asked] == ["frame", "hframe"]
        assert result.stdout.splitlines()[0] == BOTH

    def test_nothing_is_drawn_for_the_screen(self, invoke: Invoke, papers: Papers) -> None:
        """Drawing takes longer than all the rest."""
        invoke("frame")
        invoke("frame", "-f", "markdown")
        assert papers.drawings == []


class TestPrint:
    def test_html(self, invoke: Invoke, papers: Papers) -> None:
        text = invoke("frame", "-f", "html").stdout
        assert text.startswith("<!DOCTYPE html>")
        assert "<h1>3 of 11 printed figures do not come out again</h1>" in text
        assert f'<p class="counts">{ONE}.</p>' in text
        assert papers.drawings == ["frame-curve", "frame-bars"]

    def test_quiet(self, invoke: Invoke) -> None:
        result = invoke("-q", "--json", "cells.json", "-o", "out")
        assert (result.exit_code, result.output) == (0, "")
        assert Path("cells.json").is_file()
        assert Path("out/reproduce.md").is_file()


class TestJson:
    def test_is_the_list_of_cells(self, invoke: Invoke) -> None:
        result = invoke("--json", "cells.json")
        assert result.stdout.splitlines()[0] == BOTH
        cells = json.loads(Path("cells.json").read_text(encoding="utf-8"))
        assert cells == cells_to_json([toys.study("frame"), toys.study("hframe")])
        assert {tuple(cell) for cell in cells} == {tuple(KEYS)}
        assert {cell["verdict"] for cell in cells} == set(VERDICTS)


class TestOutput:
    def test_files(self, invoke: Invoke) -> None:
        result = invoke("--output", "new/out")
        folder = Path("new/out")
        names = [
            f"{paper}-{kind}.svg" for paper in ("frame", "hframe") for kind in ("bars", "curve")
        ]
        found = sorted(
            str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()
        )
        assert found == [
            *(f"figures/{name}" for name in names),
            *(f"reproduce.{suffix}" for suffix in ("html", "json", "md")),
        ]
        assert json.loads((folder / "reproduce.json").read_text())[0]["paper"] == "frame"
        last = " ".join(result.stdout.splitlines()[-2:])
        assert last.endswith(
            "new/out: reproduce.md, reproduce.html, reproduce.json, 4 figures in figures"
        )

    def test_existing_folder_keeps_what_else_is_in_it(self, invoke: Invoke) -> None:
        Path("out").mkdir()
        Path("out/mine.txt").write_text("mine")
        assert invoke("frame", "-o", "out").exit_code == 0
        assert invoke("frame", "-o", "out").exit_code == 0
        assert Path("out/mine.txt").read_text() == "mine"
        assert not list(Path("out").rglob(".*"))


class TestWrongInput:
    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (["hfram"], "no paper 'hfram'; did you mean 'hframe' or 'frame'?"),
            (["frane"], "no paper 'frane'; did you mean 'frame'"),
            (["zebra"], "no paper 'zebra'; there are frame, hframe"),
            ([""], "no paper ''"),
            (["frame", "hframe"], "unexpected extra argument"),
            (["--json", "no/such.json"], "no/such.json: its folder does not exist"),
            (["--json", "."], "is a directory"),
            (["--output", "file"], "is a file"),
            (["--output", "file/x"], "file: cannot be written to"),
            (["--format", "csv"], "'csv' is not one of"),
        ],
    )
    def test_is_one_line_and_asks_nothing(
        self, invoke: Invoke, papers: Papers, words: list[str], expected: str
    ) -> None:
        Path("file").touch()
        result = invoke(*words)
        assert (result.exit_code, result.stdout, papers.asked) == (2, "", [])
        (line,) = result.stderr.splitlines()
        assert expected in line
        assert [path.name for path in Path().iterdir()] == ["file"]

    def test_failure_of_a_study_leaves_nothing(self, invoke: Invoke, papers: Papers) -> None:
        papers.fault = StrategyFailure("no partner for mode 3")
        result = invoke("frame", "-o", "out", "--json", "x.json")
        assert (result.exit_code, result.stdout) == (1, "")
        assert result.stderr == "bench: no partner for mode 3\n"
        assert not list(Path().iterdir())
