"""Every installed strategy on the frame of the first paper."""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from femubench.core.case.case import Case
from femubench.core.errors import NotApplicable, StrategyFailure
from femubench.core.plugin.loader import load_plugins

STRATEGIES = load_plugins().strategies


@pytest.mark.benchmark(group="strategies on the frame")
@pytest.mark.parametrize("name", sorted(STRATEGIES))
def test_strategy(benchmark: BenchmarkFixture, case: Case, name: str) -> None:
    strategy, measurement = STRATEGIES[name], case.used_measurement()

    def update() -> int:
        return strategy.update(case.model, measurement, np.random.default_rng(0)).model.size

    try:
        size = benchmark.pedantic(update, rounds=3)
    except (NotApplicable, StrategyFailure) as reason:
        pytest.skip(f"{name}: {reason}")
    assert size > 0
