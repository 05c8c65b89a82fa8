"""The search for the ladder paper's open columns: its engine, and what its page says."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from equation_readings import Reading, predicted
from ladder_settings import FRAME
from open_cells import COLUMNS, PAGE, grid

from femubench import InputError, Strategy, read_case, solve_modes
from femubench.core.plugin.variants import strategy_of
from femubench.papers.frame import readings
from femubench.plugins.strategies.generic import GenericAdjusted, GenericLS
from femubench.plugins.strategies.nobari import Nobari
from femubench.plugins.strategies.physical import Physical

STRATEGIES: dict[str, Strategy] = {
    s.name: s for s in (Physical(), Nobari(), GenericLS(), GenericAdjusted())
}


def by_strategy(words: str) -> Any:
    case = read_case(FRAME, "frame", ())
    strategy = strategy_of(words, STRATEGIES)
    rng = np.random.default_rng(0)
    model = strategy.update(case.model, case.used_measurement(0), rng).model
    return solve_modes(model).natural_frequencies[:8]


@pytest.mark.parametrize(
    ("family", "words", "choices"),
    [
        ("physical", "", {}),
        ("nobari", "orthogonality=false", {"diagonal": 0.0, "cross": 0.0}),
        ("generic-ls", "expansion=force", {"expansion": "force", "start": "nominal"}),
        ("generic-adjusted", "frequencies=nominal", {"target": "nominal"}),
    ],
)
def test_engine_is_the_strategies(family: str, words: str, choices: dict[str, Any]) -> None:
    rigid, modes = predicted(Reading(family=family, **choices))
    ours = np.sort(np.append(rigid, modes))
    theirs = np.sort(by_strategy(f"{family}:{words}" if words else family))
    elastic = np.abs(theirs) > 1.0
    np.testing.assert_allclose(ours[elastic], theirs[elastic], rtol=1e-6)


def test_unknown_choices_are_refused() -> None:
    with pytest.raises(InputError, match="expansion is rotation or force"):
        strategy_of("physical:expansion=serep", STRATEGIES)
    with pytest.raises(InputError, match="measured or nominal"):
        strategy_of("physical:frequencies=mine", STRATEGIES)


def test_the_number_of_readings_tried_is_that_of_the_search() -> None:
    """What `bench reproduce` says of a cell that was found by trying, and of all before it."""
    assert {len(set(grid(family))) for family in COLUMNS} == {readings.TRIED}
    text = PAGE.read_text(encoding="utf-8")
    tried = re.search(r"^\| generic LS +\| [\d.]+ +\| \d+ of (\d+),.*\| \d+ of (\d+),", text, re.M)
    assert tried is not None
    assert sum(map(int, tried.groups())) == readings.TRIED
    assert f"about {readings.EXPLORED // 1000} 000 exploratory readings" in " ".join(text.split())
