"""The diagnosis on all blind cases gives what docs/diagnosis-accuracy.md prints of them.

About 25 minutes of processor time; `benchmarks/diagnosis_sweep.py` runs the same cases, keeps the
records and draws them.
"""

from __future__ import annotations

import multiprocessing
import re
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest
from blind_sweep import BARS, Goal, Record, SweepCase, run_task, tasks
from threadpoolctl import threadpool_limits

pytestmark = pytest.mark.nightly
PAGE = Path(__file__).parents[1] / "docs" / "diagnosis-accuracy.md"
TABLE = PAGE.read_text(encoding="utf-8").partition("<!-- blind-cases -->")[2].partition("<!--")[0]
PRINTED = {
    what: row
    for what, *row in (re.split(r" *\| *", line)[1:-1] for line in TABLE.split("\n")[4:-2])
}


def diagnosed(task: SweepCase) -> Record:
    from femubench.core.diagnosis.diagnose import diagnose

    with threadpool_limits(1):
        return run_task(task, diagnose)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        return list(pool.map(diagnosed, tasks(), chunksize=10))


def test_no_case_ends_in_an_error(records: list[Record]) -> None:
    assert len(records) == len(list(tasks())) >= 680
    assert [record for record in records if record["verdict"] == "error"] == []


@pytest.mark.parametrize("bar", BARS, ids=lambda bar: bar.what)
def test_the_page_prints_what_is_measured(records: list[Record], bar: Goal) -> None:
    """Bars that are missed, too."""
    hits, count = bar.counts(records)
    cases, _, interval, _, reached, _ = PRINTED[bar.what]
    assert (int(cases), reached) == (count, "yes" if bar.reached(hits, count) else "no")
    low, high = map(float, re.findall(r"[\d.]+", interval))
    assert low <= 100.0 * hits / count <= high, f"{hits} of {count}"
