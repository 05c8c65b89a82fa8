"""The verb `reproduce`: what it asks for, prints, writes and returns."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reproduction_toys as toys
from click.testing import CliRunner, Result

import femubench.papers
from femubench.core.cli.main import bench
from femubench.core.errors import StrategyFailure
from femubench.core.reproduction.study import cells_to_json
from femubench.reproduction import VERDICTS, Page, Study, Workbench

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
    return lambda *words: CliRunner().invoke(bench, ["reproduce", *words])


class TestAsking:
    def test_both_papers_by_default(self, invoke: Invoke, papers: Papers) -> None:
        result = invoke()
        assert (result.exit_code, result.stderr) == (0, "")
        assert [paper for paper, _ in papers.asked] == ["frame", "hframe"]
        assert result.stdout.splitlines()[0] == BOTH

    def test_one_paper_with_its_cases_and_strategies(self, invoke: Invoke, papers: Papers) -> None:
        result = invoke("hframe")
        ((paper, workbench),) = papers.asked
        assert paper == "hframe"
        assert tuple(workbench.cases) == femubench.papers.PAPERS["hframe"]
        assert {"spring", "offset", "global", "local"} <= set(workbench.strategies)
        assert result.stdout.splitlines()[0] == ONE

    def test_cells_that_do_not_follow_are_no_failure(self, invoke: Invoke) -> None:
        assert invoke("frame").exit_code == 0

    def test_nothing_is_drawn_for_the_screen(self, invoke: Invoke, papers: Papers) -> None:
        """Drawing takes longer than all the rest."""
        invoke("frame")
        invoke("frame", "-f", "markdown")
        assert papers.drawings == []


class TestPrint:
    def test_screen_is_80_wide_but_for_the_counts(self, invoke: Invoke) -> None:
        _, *lines = invoke().stdout.splitlines()
        assert max(map(len, lines)) <= 80

    def test_markdown(self, invoke: Invoke) -> None:
        text = invoke("frame", "--format", "markdown").stdout
        assert text.splitlines()[0] == f"# {ONE}"
        assert "figures/" not in text

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

    def test_a_search_says_how_many_it_tried(self, invoke: Invoke) -> None:
        cells = json.loads(invoke("frame", "--json", "-").stdout)
        assert {(c["verdict"], c["tried"]) for c in cells if c["tried"]} == {("searched", 2208)}

    def test_dash_prints_it_and_nothing_else(self, invoke: Invoke) -> None:
        cells = json.loads(invoke("frame", "--json", "-").stdout)
        first, missing = cells[0], cells[4]
        assert first["deviation_percent"] == pytest.approx(100.0 * 0.03 / 255.8)
        assert (missing["ours"], missing["deviation_percent"]) == (None, None)

    def test_a_value_that_is_none_is_null(self) -> None:
        cell = Page("frame", "1", (toys.FREE,)).cell("a", "b", 1.0, float("nan"))
        (found,) = cells_to_json([Study("frame", "", "", (), (cell,))])
        assert (found["ours"], found["deviation_percent"]) == (None, None)
        assert found["verdict"] == "does-not-follow"

    def test_deviation_of_a_percentage_is_in_points(self, invoke: Invoke) -> None:
        cells = json.loads(invoke("frame", "--json", "-").stdout)
        (cell,) = [cell for cell in cells if cell["printed"] == 12.8]
        assert cell["deviation_percent"] == pytest.approx(15.0 - 12.8)


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

    def test_markdown_links_to_every_figure_by_its_title(self, invoke: Invoke) -> None:
        invoke("--output", "out")
        text = Path("out/reproduce.md").read_text(encoding="utf-8")
        links = re.findall(r"^!\[(.+)\]\((.+)\)$", text, re.MULTILINE)
        assert len(links) == 4
        assert all(title and (Path("out") / target).is_file() for title, target in links)

    def test_existing_folder_keeps_what_else_is_in_it(self, invoke: Invoke) -> None:
        Path("out").mkdir()
        Path("out/mine.txt").write_text("mine")
        assert invoke("frame", "-o", "out").exit_code == 0
        assert invoke("frame", "-o", "out").exit_code == 0
        assert Path("out/mine.txt").read_text() == "mine"
        assert not list(Path("out").rglob(".*"))

    def test_each_figure_is_drawn_once_for_the_files(self, invoke: Invoke, papers: Papers) -> None:
        invoke("frame", "-o", "out")
        assert papers.drawings == ["frame-curve", "frame-bars"]


class TestWrongInput:
    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (["hfram"], "no paper 'hfram'; did you mean 'hframe' or 'frame'?"),
            (["frane"], "no paper 'frane'; did you mean 'frame'"),
            (["zebra"], "no paper 'zebra'; there are frame, hframe"),
            ([""], "no paper ''"),
            (["frame", "hframe"], "unexpected extra argument"),
            (["--json", "no/such.json"], "no: folder does not exist"),
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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return what the verb writes on the ladder frame, and what it prints."""
    folder = tmp_path_factory.mktemp("real") / "out"
    result = CliRunner().invoke(bench, ["reproduce", "frame", "-o", str(folder)])
    assert (result.exit_code, result.stderr) == (0, "")
    (folder / "screen.txt").write_text(result.stdout, encoding="utf-8")
    return folder


# As the first line names them.
ORDER = (
    *("independent", "under-convention", "searched", "fitted"),
    *("input", "cannot-be-checked", "misprint", "does-not-follow"),
)


@pytest.mark.slow(10)
class TestRealPaper:
    """The ladder frame in earnest: everything that the study holds comes through."""

    def test_first_line_counts_the_cells(self, folder: Path) -> None:
        cells = json.loads((folder / "reproduce.json").read_text(encoding="utf-8"))
        verdicts = [cell["verdict"] for cell in cells]
        first = (folder / "screen.txt").read_text(encoding="utf-8").splitlines()[0]
        independent, whole, different, *others = map(int, re.findall(r"\d+", first))
        assert (independent, *others) == tuple(verdicts.count(verdict) for verdict in ORDER)
        assert whole == len(cells)
        assert different <= independent
        assert first.startswith(f"{verdicts.count('independent')} of {len(cells)} printed cells")
        assert all(cell["note"] for cell in cells)

    def test_screen_is_80_wide_but_for_commands(self, folder: Path) -> None:
        _, *lines = (folder / "screen.txt").read_text(encoding="utf-8").splitlines()
        wide = [line for line in lines if len(line) > 80]
        assert all(":" in line and " " not in line.strip() for line in wide)

    def test_document_holds_every_figure(self, folder: Path) -> None:
        source = (folder / "reproduce.html").read_text(encoding="utf-8")
        drawings = list((folder / "figures").iterdir())
        assert len(drawings) >= 9
        assert source.count("<svg") == source.count("</svg>") == len(drawings)
        ids = re.findall(r'\sid="([^"]+)"', source)
        assert len(ids) == len(set(ids))
        assert set(re.findall(r"(?:url\(#|href=\"#)([^)\"]+)", source)) <= set(ids)
        assert not re.search(r"<script|<link|<img|@import|url\((?!#)|src=", source)
        for words in re.findall(r'aria-labelledby="([^"]+)"', source):
            assert set(words.split()) <= set(ids)
