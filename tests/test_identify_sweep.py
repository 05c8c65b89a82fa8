"""The bar of identification: 100 synthetic sets that nothing was tuned on."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import pytest

from benchmarks.identify_sweep import one
from tests.identify_score import NAMES, covered


@pytest.mark.nightly
def test_a_hundred_fresh_sets() -> None:
    with ProcessPoolExecutor(2) as pool:
        scores = list(pool.map(one, [(seed, 3) for seed in range(1000, 1100)]))
    assert sum(item.missed == 0 for item in scores) >= 95
    assert sum(item.within for item in scores) >= 95
    for name in NAMES:
        assert 0.85 <= covered(scores, name) <= 0.97
