"""`bench report` on stores that are damaged, half written or hostile, and in every format."""

from __future__ import annotations

import json
import re
import sys
import webbrowser
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from store_edits import change_data, edit
from synthetic_run import synthetic_run
from test_page_data import data_in

from femubench.core.run.frames import results_frame
from femubench.core.run.record_file import read_records, write_file
from femubench.reports.htmls import HtmlReporter
from femubench.reports.runs import MarkdownReporter
from femubench.results import RunData, Store, run_to_json
from tests.command import call_bench

RUN = synthetic_run(4, 6)
RUN_ID = RUN.meta["run"]
EVIL = "<script>alert(1)</script>"
TITLE = "\"quoted\" & 'so' </table></script> | `x` [l](javascript:alert(1))"

GOING = f"the run has not ended: 10 of {len(RUN.results)} jobs are there"

Report = Callable[..., Result]


def stored(folder: Path, run: RunData = RUN, *, end: bool = True) -> Path:
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
        return call_bench("report", "--store", folder, *words, code=None)

    return call


def file_in(folder: Path) -> Path:
    return Store(folder).file_of(RUN_ID)


def stated(report: Report, folder: Path) -> list[str]:
    """Return the notes of the page."""
    result = report("-f", "html")
    assert result.exit_code == 0, result.output
    page = data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))
    return [note for note in page["notes"] if "to draw" not in note]


class TestDamage:
    def test_a_run_that_is_still_going(self, report: Report, folder: Path) -> None:
        edit(file_in(folder), "DELETE FROM records WHERE number > 11")
        note = stated(report, folder)[-1]
        assert note.startswith(f"{GOING}; not run: ")
        assert note.endswith(f" and {len(RUN.results) - 15} more")

    @pytest.mark.parametrize("name", ["terminal", "json", "csv"])
    def test_every_format_tells(self, report: Report, folder: Path, name: str) -> None:
        """In the text itself, or on stderr where it has no room for notes."""
        edit(file_in(folder), "DELETE FROM records WHERE number > 11")
        result = report("-f", name)
        assert result.exit_code == 0
        shown, other = result.stdout, result.stderr
        if name not in ("terminal", "md"):
            shown, other = other, shown
        assert GOING in " ".join(shown.split())
        assert GOING not in other or name in ("json", "jsonl")  # in their meta data

    def test_a_changed_record(self, report: Report, folder: Path) -> None:
        change_data(file_in(folder), '"ok"', '"oj"', "number = 5")
        notes = stated(report, folder)
        assert any(":5: damaged" in note and "left out" in note for note in notes)
        said = f"1 of {len(RUN.results)} jobs are missing and count as the model that was given: "
        assert any(note.startswith(said) for note in notes)

    def test_a_result_of_another_shape(self, report: Report, folder: Path) -> None:
        file = file_in(folder)
        records = [*read_records(file, [])]
        records[4].data = re.sub(rb'("rms_percent":)[0-9.]+', rb'\1"much"', records[4].data)
        write_file(file, records)
        assert any("rms_percent" in note and "left out" in note for note in stated(report, folder))

    def test_a_first_record_that_is_lost_leaves_the_run(self, report: Report, folder: Path) -> None:
        change_data(file_in(folder), "{", "[", "number = 1")
        (note,) = stated(report, folder)
        assert "damaged: record 1 is not as it was written" in note
        page = data_in((folder / f"{RUN_ID}.html").read_text(encoding="utf-8"))
        assert len(page["results"]) == len(RUN.results)
        assert Store(folder).load().meta["cases"] == RUN.meta["cases"]

    def test_without_both_copies_of_the_start_there_is_no_gain_but_the_jobs(
        self, report: Report, folder: Path
    ) -> None:
        change_data(file_in(folder), "{", "[", "number = 1")
        edit(file_in(folder), "DELETE FROM copies")
        page = report("-f", "html")
        assert page.exit_code == 2
        assert "run it again" in page.stderr.splitlines()[-1]
        jobs = report("-f", "csv")
        assert jobs.exit_code == 0
        assert len(jobs.stdout.splitlines()) == 1 + len(RUN.results)

    def test_broken_exhibits(self, report: Report, folder: Path) -> None:
        drawn = folder / "exhibits"
        drawn.mkdir()
        digest = next(iter(RUN.meta["cases"].values()))["digest"]
        (drawn / f"case-{digest[:32]}.json").write_text("{", encoding="utf-8")
        assert report("-f", "html").exit_code == 0

    def test_notes_of_an_outsider_are_shown_or_left(self) -> None:
        for notes in (5, {"a": 1}, [EVIL, None]):
            run = RunData({**RUN.meta, "notes": notes}, RUN.results)
            assert EVIL not in HtmlReporter().render(run)
            assert "<script>" not in MarkdownReporter().render(run)


def hostile() -> RunData:
    """Return a run with names that no plugin could have."""
    run = synthetic_run(4, 6, names=[EVIL, "=HYPERLINK(1)"], failing=0.0)
    first = next(iter(run.meta["cases"]))
    cases = {**run.meta["cases"], first: {"title": TITLE, "digest": "0" * 64}}
    results = (replace(run.results[0], status="failed", reason=TITLE, blocks={}), *run.results[1:])
    return RunData({**run.meta, "cases": cases}, results)


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

    def test_run_id(self, report: Report, file: Path) -> None:
        data = json.loads(file.read_text(encoding="utf-8"))
        data["meta"]["run"] = f"../{EVIL}"
        file.write_text(json.dumps(data), encoding="utf-8")
        assert report(file, "-f", "html").exit_code == 0
        (page,) = file.parent.glob("*.html")
        assert page.name == "script-alert-1-script.html"
        assert EVIL not in page.read_text(encoding="utf-8")


class TestFormats:
    def test_open(self, report: Report, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        opened: list[str] = []
        monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url))
        result = report("--open")
        assert result.exit_code == 0
        page = folder / f"{RUN_ID}.html"
        assert opened == [page.resolve().as_uri()]
        assert page.exists()
        assert "no browser" in result.stderr

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
        assert table.to_pandas()["gain"].tolist() == expected["gain"].tolist()
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


@pytest.mark.slow(5)
def test_a_diagnosis_is_reported_too(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    effects = ("--effects", "torsion-constant,added-mass")
    call_bench("diagnose", "frame", "--json", file, "-q", "--no-pairs", *effects)
    written = call_bench("report", file, "-f", "html")
    assert written.stdout == f"html: {tmp_path / 'found.html'}\n"
    assert "<html" in (tmp_path / "found.html").read_text()
    assert "torsion-constant" in call_bench("report", file).stdout
    wrong = call_bench("report", file, "-f", "csv", code=2)
    assert wrong.stdout == ""
    assert "a diagnosis has no format 'csv'" in wrong.stderr
    file.write_text(file.read_text().replace('"verdict": "', '"verdict": "x', 1))
    call_bench("report", file, code=2)
