"""What a re-run works with: cases and strategies by name, each combination computed once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from femubench.core.case.case import Case
from femubench.core.plugin.variants import strategy_of
from femubench.core.roles import StrategyRole
from femubench.core.update.strategy import UpdateResult


@dataclass(frozen=True)
class Workbench:
    """Run strategies on cases by the words of the command line.

    Arguments:
        strategies: by name.
        cases: by name.
        on_advance: called after each update that had to be computed.
    """

    strategies: Mapping[str, StrategyRole]
    cases: Mapping[str, Case]
    on_advance: Callable[[], None] = lambda: None
    _done: dict[tuple[str, str], UpdateResult] = field(default_factory=dict, repr=False)

    def update(self, case: str, words: str) -> UpdateResult:
        """Return what ``bench run CASE -s WORDS`` scores, from the used modes as recorded.

        Arguments:
            case: name of a case.
            words: ``strategy:option=value,...``.

        Raises:
            InputError: for an option that the strategy does not have.
            StrategyFailure: when the strategy fails.
        """
        key = case, words
        if key not in self._done:
            found = self.cases[case]
            strategy = strategy_of(words, self.strategies)
            rng = np.random.default_rng(0)
            result = strategy.update(found.model, found.used_measurement(0), rng)
            assert isinstance(result, UpdateResult), type(result)
            self._done[key] = result
            self.on_advance()
        return self._done[key]
