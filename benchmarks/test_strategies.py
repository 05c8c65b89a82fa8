"""Every installed strategy on the frame of the first paper."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femubench.core.plugin.loader import load_plugins
from femubench.core.update.strategy import UpdateResult


@pytest.mark.parametrize("name", sorted(load_plugins().strategies))
def test_strategy(name: str, strategy_speed: Callable[[str, str], UpdateResult]) -> None:
    assert strategy_speed(name, "frame").model.size > 0
