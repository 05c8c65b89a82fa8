"""Scripts of benchmarks: what they choose, what they keep, and the bar of identification."""

from __future__ import annotations

import json
import math
from concurrent.futures import ProcessPoolExecutor

import performance
import pytest
from tuning import tuned

from benchmarks.identify_sweep import one
from tests.identify_score import NAMES, covered


def test_a_setting_is_chosen_on_one_half_and_stated_on_the_other() -> None:
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


def test_the_page_of_performance_has_the_kept_figures() -> None:
    kept = json.loads(performance.KEPT.read_text(encoding="utf-8"))
    page = performance.PAGE.read_text(encoding="utf-8")
    shown = page.partition(performance._BEGIN)[2].partition(performance._END)[0]
    assert shown == performance.page_of(kept) + "\n"


@pytest.mark.nightly
def test_a_hundred_fresh_sets_are_identified() -> None:
    with ProcessPoolExecutor(2) as pool:
        scores = list(pool.map(one, [(seed, 3) for seed in range(1000, 1100)]))
    assert sum(item.missed == 0 for item in scores) >= 95
    assert sum(item.within for item in scores) >= 95
    for name in NAMES:
        assert 0.85 <= covered(scores, name) <= 0.97
