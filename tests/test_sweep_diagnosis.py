"""The diagnosis on all blind cases against its bars, which docs/diagnosis-accuracy.md prints.

About ten minutes on two cores; `benchmarks/diagnosis_sweep.py` runs the same cases, keeps the
records and draws them.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import pytest
from blind_sweep import BARS, Goal, Record, SweepCase, run_task, tasks
from threadpoolctl import threadpool_limits

pytestmark = pytest.mark.nightly


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
def test_bars(records: list[Record], bar: Goal) -> None:
    hits, count = bar.counts(records)
    assert count > 0
    assert bar.reached(hits, count), f"{hits} of {count}"
