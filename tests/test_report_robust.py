"""`bench report` on stores that are damaged, half written or hostile, and in every format."""

from __future__ import annotations

import csv
import io
import json
import re
import sys
import webbrowser
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from synthetic_run import synthetic_run
from test_page_data import data_in

from femubench.core.cli.main import bench
from femubench.core.run.upkeep import exported
from femubench.reports.csvs import CsvReporter
from femubench.reports.htmls import HtmlReporter
from femubench.reports.runs import MarkdownReporter, TerminalReporter
from femubench.results import Run, Store, results_frame, run_to_json

RUN = synthetic_run(4, 6)
RUN_ID = RUN.meta["run"]
EVIL = "<script>alert(1)</script>"
TITLE = "\"quoted\" & 'so' </table></script> | `x` [l](javascript:alert(1))"

Report = Callable[..., Result]


def stored(folder: Path, run: Run = RUN, *, end: bool = True) -> Path:
    """Write a run into a store and return the file."""
    store = Store(folder)
    began = {k: v for k, v in run.meta.items() if k not in ("finished", "interrupted", "notes")}
    store.begin(began)
    for result in run.results:
        store.append(run.meta["run"], result)
    if end:
        store.end(run.meta["run"], {"finished": run.meta["finished"], "interrupted": False})
    return store.file_of(run.meta["run"])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    stored(tmp_path / "store")
    return tmp_path / "store"


@pytest.fixture
def report(folder: Path) -> Report:
    def call(*words: object) -> Result:
        return CliRunner().invoke(bench, ["report", "--store", str(folder), *map(str, words)])

    return call


def lines_of(folder: Path) -> list[str]:
    return Store(folder).file_of(RUN_ID).read_text(encoding="utf-8").splitlines()


def put(folder: Path, lines: list[str], end: str = "\n") -> None:
    Store(folder).file_of(RUN_ID).write_text("\n".join(lines) + end, encoding="utf-8")


def put_earlier(folder: Path, change: Callable[[int, str], str]) -> list[str]:
    """Write the store as version 0.1 did, with changed lines, and return these."""
    records = [json.loads(line) for line in exported(Store(folder), RUN_ID, [])]
    lines = [json.dumps({"schema": 1, **record}) for record in records]
    lines = [change(place, line) for place, line in enumerate(lines)]
    Store(folder).file_of(RUN_ID).unlink()
    (folder / "results.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return lines


def told(report: Report, folder: Path) -> list[str]:
    """Return the notes of the page."""
    result = report("-f", "html")
    assert result.exit_code == 0, result.output
    page = data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))
    return [note for note in page["notes"] if "to draw" not in note]


class TestDamage:
    def test_a_run_that_is_still_going(self, report: Report, folder: Path) -> None:
        lines = lines_of(folder)
        put(folder, lines[:12])
        (note,) = told(report, folder)
        assert note == f"the run has not ended: 10 of {len(RUN.results)} jobs are there"

    @pytest.mark.parametrize("name", ["terminal", "md", "json", "csv", "modes-csv", "parquet"])
    def test_every_format_tells(self, report: Report, folder: Path, name: str) -> None:
        """In the text itself, or on stderr where it has no room for notes."""
        put(folder, lines_of(folder)[:12])
        result = report("-f", name)
        assert result.exit_code == 0
        shown, other = result.stdout, result.stderr
        if name not in ("terminal", "md"):
            shown, other = other, shown
        said = f"the run has not ended: 10 of {len(RUN.results)} jobs are there"
        assert said in " ".join(shown.split())
        assert said not in other

    def test_a_last_line_that_is_cut(self, report: Report, folder: Path) -> None:
        lines = lines_of(folder)[:12]
        put(folder, [*lines, lines[-1][:200]], end="")
        notes = told(report, folder)
        assert any("13: the last line is cut short" in note for note in notes)
        assert any("10 of" in note for note in notes)

    @pytest.mark.parametrize(
        ("line", "message"),
        [
            ('{"schema": 1, "record": "result", "run"', "not JSON"),
            ("\x00\x01 nonsense", "not JSON"),
            ('{"schema": 1, "record": "else"}', "not a record"),
            ('{"schema": 0, "record": "result", "run": "x"}', "schema 0"),
            ('{"schema": 2, "record": "result", "run": "x"}', "schema 2"),
            ('{"schema": 1, "record": "result", "run": 5}', "no run id"),
        ],
    )
    def test_a_broken_line_in_the_middle(
        self, report: Report, folder: Path, line: str, message: str
    ) -> None:
        put_earlier(folder, lambda place, text: line if place == 5 else text)
        notes = told(report, folder)
        assert any(message in note and ":6" in note and "left out" in note for note in notes)
        assert f"1 of {len(RUN.results)} jobs are missing and score as failures" in notes

    def test_a_changed_bit(self, report: Report, folder: Path) -> None:
        lines = lines_of(folder)
        lines[5] = lines[5].replace("ok", "oj", 1)
        put(folder, lines)
        notes = told(report, folder)
        assert any(":6: damaged" in note and "left out" in note for note in notes)
        assert f"1 of {len(RUN.results)} jobs are missing and score as failures" in notes

    def test_a_result_of_another_shape(self, report: Report, folder: Path) -> None:
        def change(place: int, line: str) -> str:
            record = json.loads(line)
            if place == 3:
                record["result"]["used"] = {"rms_percent": "much"}
            return json.dumps(record)

        put_earlier(folder, change)
        assert any("rms_percent" in note and "left out" in note for note in told(report, folder))

    def test_a_first_line_that_is_lost_leaves_the_run(self, report: Report, folder: Path) -> None:
        put(folder, ["{broken", *lines_of(folder)[1:]])
        notes = told(report, folder)
        assert any(":1: damaged" in note for note in notes)
        page = data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))
        assert len(page["results"]) == len(RUN.results)
        assert Store(folder).load().meta["cases"] == RUN.meta["cases"]

    def test_both_first_lines_that_are_lost_leave_the_results(
        self, report: Report, folder: Path
    ) -> None:
        put(folder, ["{broken", "{broken", *lines_of(folder)[2:]])
        assert len([note for note in told(report, folder) if "damaged" in note]) == 2
        page = data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))
        assert len(page["results"]) == len(RUN.results)

    def test_a_store_of_an_older_version_is_one_line(self, report: Report, folder: Path) -> None:
        lines = put_earlier(folder, lambda _, line: line.replace('"schema": 1', '"schema": 0'))
        result = report("-f", "html")
        assert result.exit_code == 2
        assert "schema 0" in result.stderr
        assert f"{len(lines) - 3} more lines were left out" in result.stderr
        assert result.stderr.count("\n") == 1

    def test_lines_of_older_runs_do_not_hide_this_one(self, report: Report, folder: Path) -> None:
        old = ['{"schema": 0, "record": "result", "run": "old"}'] * 50
        (folder / "results.jsonl").write_text("\n".join(old) + "\n", encoding="utf-8")
        notes = told(report, folder)
        assert len(notes) == 4
        assert notes[-1].endswith("47 more lines were left out")

    def test_broken_exhibits(self, report: Report, folder: Path) -> None:
        drawn = folder / "exhibits"
        drawn.mkdir()
        digest = next(iter(RUN.meta["cases"].values()))["digest"]
        (drawn / f"case-{digest[:32]}.json").write_text("{", encoding="utf-8")
        assert report("-f", "html").exit_code == 0

    def test_whole_runs_have_no_notes(self) -> None:
        assert "Note:" not in TerminalReporter().render(RUN)
        assert "**Note**" not in MarkdownReporter().render(RUN)

    def test_notes_of_a_stranger_are_shown_or_left(self) -> None:
        for notes in (5, {"a": 1}, [EVIL, None]):
            run = Run({**RUN.meta, "notes": notes}, RUN.results)
            assert EVIL not in HtmlReporter().render(run)
            assert "<script>" not in MarkdownReporter().render(run)


def hostile() -> Run:
    """Return a run with names that no plugin could have."""
    run = synthetic_run(4, 6, names=[EVIL, "=HYPERLINK(1)"], failing=0.0)
    first = next(iter(run.meta["cases"]))
    cases = {**run.meta["cases"], first: {"title": TITLE, "digest": "0" * 64}}
    results = (
        replace(run.results[0], status="failed", reason=TITLE, blocks={}),
        *run.results[1:],
    )
    return Run({**run.meta, "cases": cases}, results)


class TestInjection:
    """What stands in a result file is text, wherever it is shown."""

    RUN = hostile()

    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        path = tmp_path / "r.json"
        path.write_text(json.dumps(run_to_json(self.RUN)), encoding="utf-8")
        return path

    def test_html(self, report: Report, file: Path) -> None:
        assert report(file, "-f", "html", "-o", file.parent).exit_code == 0
        html = (file.parent / f"{RUN_ID}.html").read_text(encoding="utf-8")
        assert EVIL not in html
        assert "</table>" not in html
        assert html.count("</script>") == 2
        found = data_in(html)
        assert found["strategies"][0]["name"] == EVIL
        assert found["cases"][0]["title"] == TITLE
        assert found["results"][0]["reason"] == TITLE

    def test_markdown(self, report: Report, file: Path) -> None:
        text = report(file, "-f", "md").stdout
        assert not re.search(r"<(?!br)", text)
        assert r"&lt;script&gt;alert(1)&lt;/script&gt;" in text
        assert r"&lt;/table&gt;&lt;/script&gt; \| \`x\` \[l\](javascript:alert(1))" in text

    def test_csv(self, report: Report, file: Path) -> None:
        text = report(file, "-f", "csv").stdout
        rows = list(csv.DictReader(io.StringIO(text)))
        assert rows[0]["strategy"] == EVIL
        assert rows[0]["reason"] == TITLE
        assert {row["strategy"] for row in rows} >= {"'=HYPERLINK(1)"}
        cells = [cell for row in csv.reader(io.StringIO(text)) for cell in row]
        assert not [cell for cell in cells if cell[:1] in "=+@\t\r" and cell]

    def test_run_id(self, report: Report, file: Path) -> None:
        data = json.loads(file.read_text(encoding="utf-8"))
        data["meta"]["run"] = f"../{EVIL}"
        file.write_text(json.dumps(data), encoding="utf-8")
        assert report(file, "-f", "html").exit_code == 0
        (page,) = file.parent.glob("*.html")
        assert page.name == "script-alert-1-script.html"
        assert EVIL not in page.read_text(encoding="utf-8")


class TestFormats:
    def test_html_goes_into_the_store(self, report: Report, folder: Path) -> None:
        result = report("-f", "html")
        assert result.stdout == f"html: {folder / RUN_ID}.html\n"
        assert data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))["run"] == RUN_ID

    def test_several_with_commas_and_short_names(self, report: Report, tmp_path: Path) -> None:
        result = report("-f", "html,md", "-f", "csv,md", "-o", tmp_path)
        suffixes = [line.rpartition(".")[2] for line in result.stdout.splitlines()]
        assert suffixes == ["html", "md", "csv"]

    def test_a_text_on_the_screen_stays_alone(self, report: Report) -> None:
        result = report("-f", "html,csv")
        assert result.stdout == CsvReporter().render(Store(folder_of(result)).load()) + "\n"
        assert result.stderr.startswith("html: ")

    def test_beside_a_result_file(self, report: Report, tmp_path: Path) -> None:
        file = tmp_path / "deep" / "r.json"
        file.parent.mkdir()
        file.write_text(json.dumps(run_to_json(RUN)), encoding="utf-8")
        assert report(file, "-f", "html").stdout == f"html: {file.parent / RUN_ID}.html\n"

    @pytest.mark.parametrize("shown", [True, False])
    def test_open(
        self, report: Report, folder: Path, monkeypatch: pytest.MonkeyPatch, shown: bool
    ) -> None:
        opened: list[str] = []
        monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or shown)
        result = report("--open")
        assert result.exit_code == 0
        page = folder / f"{RUN_ID}.html"
        assert opened == [page.resolve().as_uri()]
        assert page.exists()
        assert ("no browser" in result.stderr) is not shown

    def test_a_folder_that_cannot_be_written_to(self, report: Report, tmp_path: Path) -> None:
        file = tmp_path / RUN_ID
        (tmp_path / "store" / f"{RUN_ID}.html").mkdir()
        assert report("-f", "html").exit_code == 2
        assert not file.exists()

    def test_parquet_has_the_rows_of_the_frame(self, report: Report, folder: Path) -> None:
        parquet = pytest.importorskip("pyarrow.parquet")
        assert report("-f", "parquet").exit_code == 0
        table = parquet.read_table(folder / f"{RUN_ID}.parquet")
        assert json.loads(table.schema.metadata[b"femubench"]) == {"run": RUN_ID, "notes": []}
        expected = results_frame(Store(folder).load())
        assert table.to_pandas()["score"].tolist() == expected["score"].tolist()
        assert table.column_names == list(expected.columns)

    def test_parquet_without_its_library_is_one_line(
        self, report: Report, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        result = report("-f", "parquet")
        assert result.exit_code == 2
        assert result.stderr == (
            "bench: format parquet needs pyarrow (expected pip install 'femubench[parquet]')\n"
        )


def folder_of(result: Result) -> Path:
    return Path(result.stderr.removeprefix("html: ").strip()).parent


@pytest.mark.slow(5)
def test_a_diagnosis_is_reported_too(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    runner = CliRunner()
    words = ["diagnose", "frame", "--json", str(file), "-q", "--no-pairs"]
    assert runner.invoke(bench, words).exit_code == 0
    written = runner.invoke(bench, ["report", str(file), "-f", "html"])
    assert (written.exit_code, written.stdout) == (0, f"html: {tmp_path / 'found.html'}\n")
    assert "<html" in (tmp_path / "found.html").read_text()
    shown = runner.invoke(bench, ["report", str(file)])
    assert "torsion-constant" in shown.stdout
    wrong = runner.invoke(bench, ["report", str(file), "-f", "csv"])
    assert (wrong.exit_code, wrong.stdout) == (2, "")
    assert "a diagnosis has no format 'csv'" in wrong.stderr
    file.write_text(file.read_text().replace('"verdict": "', '"verdict": "x', 1))
    assert runner.invoke(bench, ["report", str(file)]).exit_code == 2
