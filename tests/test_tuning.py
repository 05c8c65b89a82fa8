"""`benchmarks/tuning.py` and `ablation.py`: chosen on one half, stated on the other."""

from __future__ import annotations

import math

import pytest
from tuning import tuned
from unseen import mean_ratio, unseen_logs

from femubench.results import Block, JobResult, Run

CASES = {"a": "one", "b": "two", "b-changed": "two", "c": "three"}
REFERENCE = {"used": 1.0, "higher": 2.0, "modified": 4.0}


def job(case: str, strategy: str, factor: float | None, status: str = "ok") -> JobResult:
    """Return errors of so many times the textbook model's, to which 0.05 % are added."""
    blocks = {
        name: Block((error + 0.05) * factor - 0.05, None, ())
        for name, error in REFERENCE.items()
        if factor is not None
    }
    found = [{"name": f"{name} all: size"} for name in ("density", "density", "torsion-constant")]
    return JobResult(case, strategy, 0, status, blocks=blocks, parameters=tuple(found))  # type: ignore[arg-type]


def run_of(*results: JobResult) -> Run:
    zeros = [job(case, "textbook", 1.0) for case in CASES]
    meta = {"structures": CASES, "reference": dict.fromkeys(CASES, REFERENCE)}
    return Run(meta, (*zeros, *results))


def test_errors_are_those_of_unseen_data_and_of_structures() -> None:
    run = run_of(
        job("a", "x", 0.5),
        job("b", "x", 0.25),
        job("b-changed", "x", 1.0),
        job("c", "x", None, "failed"),
        job("c", "y", None, "not-applicable"),
    )
    logs = unseen_logs(run)
    found = {name: math.exp(value) for name, value in logs["x"].items()}
    assert found == pytest.approx({"one": 0.5, "two": 0.5, "three": 1.0}, rel=0.02)
    assert logs["y"] == pytest.approx({"three": 0.0})
    assert mean_ratio(logs["x"], ["one", "two"]) == pytest.approx(0.5)


def test_a_setting_is_chosen_on_one_half_and_told_on_the_other() -> None:
    names = ("x", "x:lucky=true", "x:good=true")
    factors = {"x": (1.0, 1.0), "x:lucky=true": (0.2, 3.0), "x:good=true": (0.5, 0.5)}
    logs = {
        name: {s: math.log(pair[i]) for i, half in enumerate(("ab", "cd")) for s in half}
        for name, pair in factors.items()
    }
    found = tuned("x", names, logs, {"a", "b"})
    assert (found.best, found.default, found.tuned) == ("lucky=true", 1.0, pytest.approx(3.0))
    assert found.best_of_all == ("good=true", pytest.approx(0.5), 1.0)
    assert found.gain == "-"  # two structures give no interval
