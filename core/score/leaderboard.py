"""The leaderboard: one row a strategy over all structures and seeds of a run."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.garbage import pause_collection
from femubench.core.schema.results import BLOCKS, UNSEEN, JobResult, Run
from femubench.core.score import predictive
from femubench.core.score.counting import (
    WHOLE,
    References,
    Weights,
    block_weights,
)
from femubench.core.score.ranking import (
    OFFSET_PERCENT,
    SCORE_OF_FAILURE,
    rank_items,
    rank_results,
    score_in,
)
from femubench.core.score.statistics import FEWEST, interval_over_structures, structures_of
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    import pandas as pd

TESTED = "published test"  # the class of a scenario whose data were measured
# What is added to all errors; ranks that move within are no ranks.
FLOORS = (0.005, 0.02, OFFSET_PERCENT, 0.1, 0.2)  # percent
_RESAMPLES = 999
COLUMNS = (
    *("rank", "strategy", "skill", "skill_low", "skill_high", "skill_drawn", "skill_tests"),
    *(f"{block}_percent" for block in BLOCKS),
    *predictive.COLUMNS,
    *("rigid_modes_lost", "negative_eigenvalues", "parameters", "evaluations", "seconds"),
    *("ok", "not_applicable", "total", "unphysical"),
)


@dataclass(frozen=True)
class _Grid:
    """All (case, block, seed) that a strategy is expected to have a result for.

    Arguments:
        cases: of the run.
        weights: how much a block counts among those of its structure.
        seeds: of the run.
        structures: by case; one that is not named is a structure of its own.
        reference: rms error of the nominal model in percent by case and block.
    """

    cases: tuple[str, ...]
    weights: Weights
    seeds: tuple[int, ...]
    structures: dict[str, str]
    reference: References

    @classmethod
    def of(cls, run: Run) -> _Grid:
        reference = run.meta.get("reference") or {}
        cases = dict.fromkeys((*reference, *(result.case for result in run.ranked)))
        seeds = {*run.meta.get("seeds", ()), *(result.seed for result in run.results)}
        structures = structures_of(run)
        weights = block_weights(reference, structures)
        weights |= {(case, WHOLE): 1.0 for case in cases if case not in reference}
        return cls(tuple(cases), weights, tuple(sorted(seeds)), structures, reference)

    def of_cases(self, cases: Iterable[str]) -> _Grid:
        """Return what is expected on some of the cases."""
        chosen = frozenset(cases)
        weights = {unit: w for unit, w in self.weights.items() if unit[0] in chosen}
        return _Grid(self.cases, weights, self.seeds, self.structures, self.reference)

    @property
    def members(self) -> FloatArray:
        """Return how much every block is of its structure's mean; (structures, blocks)."""
        owners = [self.structures.get(case, case) for case, _ in self.weights]
        names = {name: place for place, name in enumerate(dict.fromkeys(owners))}
        member = np.zeros((len(names), len(owners)))
        member[[names[name] for name in owners], range(len(owners))] = list(self.weights.values())
        return np.asarray(member / member.sum(axis=1, keepdims=True))

    def logs(self, results: Iterable[JobResult], floor_percent: float) -> FloatArray:
        """Return the logarithms of a strategy's scores; (structures, seeds).

        What is missing counts as a failure.
        """
        found = {(result.case, result.seed): result for result in results}
        scores = [
            SCORE_OF_FAILURE
            if (result := found.get((case, seed))) is None
            else score_in(result, block, self.reference.get(case) or {}, floor_percent)
            for case, block in self.weights
            for seed in self.seeds
        ]
        shape = len(self.weights), len(self.seeds)
        logs = np.log(np.array(scores, dtype=float)).reshape(shape)
        return np.asarray(self.members @ logs)

    @property
    def interval(self) -> str:
        """Return what the intervals of the skills are over; nothing where there are none."""
        count = len({self.structures.get(case, case) for case, _ in self.weights})
        return "structures" if count >= FEWEST else "seeds" if len(self.seeds) > 1 else ""


def interval_kind(run: Run) -> str:
    """Return what the intervals of the skills are over: ``structures``, ``seeds`` or nothing.

    Examples:
        >>> results.interval_kind(run)
        ''
    """
    return _Grid.of(run).interval


@pause_collection()
def leaderboard(run: Run, floor_percent: float = OFFSET_PERCENT) -> pd.DataFrame:
    """Return one row a strategy, best first: physical, then unphysical, then without any model.

    Strategies of one skill share a rank.

    `skill` is the part of the textbook model's error on unseen data that the strategy takes away:
    1 leaves nothing of it, 0 is no better, less than 0 is worse. It is 1 - r, with r the geometric
    mean over structures, each the mean of its unseen blocks, of (rms + 0.05 %) / (rms of the
    textbook model + 0.05 %), with several seeds the median over them. A job without result counts
    as 10 in r. `skill_low` and `skill_high` are its 95 % bootstrap interval: over structures where
    there are enough of them, else over the seeds of those there are. `skill_drawn` is the skill
    with which the strategy starts from the models as drawn, `skill_tests` that on tests alone,
    without computed truths; nan where there is no such difference. The three errors are the median
    over cases of the median over seeds of the rms error in percent, over the jobs that are ok; so
    are `parameters`, `evaluations` and `seconds`. Rigid-body modes lost and negative eigenvalues
    are sums. `coverage90`, `crps_percent` and `log_score` are those of docs/scoring.md.

    Arguments:
        run: with `reference`, `seeds`, `seed` and `strategies` in its meta.
        floor_percent: what is added to all errors.

    Examples:
        >>> results.leaderboard(run)[["rank", "skill"]].round(2).values.tolist()
        [[1.0, 0.47], [2.0, -1.97]]
    """
    import pandas as pd

    table = _RankTable.of(run, floor_percent)
    scored = run.ranked
    if any(block == WHOLE for _, block in table.grid.weights):
        reference = run.meta.get("reference") or None
        scored = rank_results(scored, reference, run.meta.get("baseline"))
    own: dict[str, list[JobResult]] = {name: [] for name in table.names}
    for result in scored:
        own[result.strategy].append(result)
    rows = [_row(name, results, table) for name, results in own.items()]
    listed = [{**row, "rank": rank} for rank, row in rank_items(rows, _order)]
    return pd.DataFrame(listed, columns=list(COLUMNS))


def row_of(run: Run, strategy: str) -> dict[str, Any]:
    """Return the row of one strategy on a leaderboard, without its rank; results have scores.

    Arguments:
        run: as for `leaderboard`.
        strategy: its name.
    """
    found = [result for result in run.ranked if result.strategy == strategy]
    return _row(strategy, found, _RankTable.of(run, OFFSET_PERCENT))


def ranks_by_floor(run: Run) -> dict[str, tuple[int, ...]]:
    """Return the ranks of every strategy for each of `FLOORS`, in the order of the leaderboard.

    Examples:
        >>> list(results.ranks_by_floor(run).values())
        [(1, 1, 1, 1, 1), (2, 2, 2, 2, 2)]
    """
    ranks = {floor: leaderboard(run, floor).set_index("strategy")["rank"] for floor in FLOORS}
    order = ranks[OFFSET_PERCENT].index
    return {name: tuple(int(found[name]) for found in ranks.values()) for name in order}


def find_basis(run: Run) -> str:
    """Return on what the skill of a run is measured: ``unseen`` data, or the ``given`` modes.

    Examples:
        >>> results.find_basis(run)
        'unseen'
    """
    errors = run.meta.get("reference") or {}
    found = errors.values() if errors else (result.blocks for result in run.results)
    blocks = {name for listed in found for name in listed}
    return "unseen" if blocks & set(UNSEEN) else "given"


def is_test(classes: Sequence[str] | None) -> bool:
    """Tell whether a case was measured: what has no class is somebody's own structure.

    Arguments:
        classes: of its scenario.

    Examples:
        >>> results.is_test(["grid", "published test"]), results.is_test(["grid", "clamped"])
        (True, False)
    """
    return not classes or TESTED in classes


@dataclass(frozen=True)
class _RankTable:
    """What the rows of a leaderboard are made from.

    Arguments:
        names: strategies.
        grid: of the ranks; `tests` of the cases whose truth is a test, None where all are or none.
        drawn: the results from the models as drawn, by strategy; None with one nominal model.
        seed: of the bootstrap.
        floor_percent: what is added to all errors.
    """

    names: tuple[str, ...]
    grid: _Grid
    tests: _Grid | None
    drawn: dict[str, list[JobResult]] | None
    seed: int
    floor_percent: float

    @classmethod
    def of(cls, run: Run, floor_percent: float) -> _RankTable:
        grid = _Grid.of(run)
        classes = run.meta.get("classes") or {}
        tests = [case for case in grid.cases if is_test(classes.get(case))]
        drawn: dict[str, list[JobResult]] | None = None
        if len(run.nominals) > 1:
            drawn = defaultdict(list)
            for result in run.started_from("drawn"):
                drawn[result.strategy].append(result)
        names = tuple(dict.fromkeys(run.meta.get("strategies", ())))
        names += tuple(sorted({result.strategy for result in run.results} - set(names)))
        both = 0 < len(tests) < len(grid.cases)
        seed = int(run.meta.get("seed", 0))
        return cls(names, grid, grid.of_cases(tests) if both else None, drawn, seed, floor_percent)


def _order(row: dict[str, Any]) -> tuple[tuple[bool, bool], float, str]:
    """Put physical models first, then unphysical ones, then who never gave a model."""
    nothing = row["ok"] + row["not_applicable"] == 0
    return (nothing, row["unphysical"]), 1.0 - row["skill"], row["strategy"]


def _row(strategy: str, results: Sequence[JobResult], table: _RankTable) -> dict[str, Any]:
    grid = table.grid
    logs = grid.logs(results, table.floor_percent)
    left = np.exp(logs.mean(axis=0))
    low, high = (
        interval_over_structures(logs.mean(axis=1))
        if grid.interval == "structures"
        else _over_seeds(left, strategy, table.seed)
    )
    fine = [result for result in results if result.status == "ok"]
    figures: dict[str, dict[str, list[float]]] = {
        name: defaultdict(list) for name in (*BLOCKS, *_FIGURES)
    }
    for result in fine:
        case = result.case
        for name, block in result.blocks.items():
            figures[name][case].append(block.rms_percent)
        for name, value in zip(_FIGURES, _figures(result), strict=True):
            if value is not None:
                figures[name][case].append(value)
    lost = sum(result.rigid_modes_lost for result in fine)
    negative = sum(result.negative_eigenvalues or 0 for result in fine)
    return {
        "strategy": strategy,
        "skill": 1.0 - float(np.median(left)),
        "skill_low": 1.0 - high,
        "skill_high": 1.0 - low,
        "skill_drawn": _skill(
            grid if table.drawn is not None else None,
            (table.drawn or {}).get(strategy, ()),
            table.floor_percent,
        ),
        "skill_tests": _skill(table.tests, results, table.floor_percent),
        **{f"{block}_percent": _median(figures[block]) for block in BLOCKS},
        **predictive.scores(fine, grid.structures),
        "rigid_modes_lost": lost,
        "negative_eigenvalues": negative,
        "parameters": _median(figures["parameter_count"]),
        "evaluations": _median(figures["evaluations"]),
        "seconds": _median(figures["seconds"]),
        "ok": len(fine),
        "not_applicable": sum(result.status == "not-applicable" for result in results),
        "total": len(grid.cases) * len(grid.seeds),
        "unphysical": any(result.unphysical for result in fine),
    }


def _skill(grid: _Grid | None, results: Sequence[JobResult], floor_percent: float) -> float:
    """Return a strategy's skill on a grid; nan where it is none or nothing on it counts."""
    if grid is None or not grid.weights:
        return math.nan
    return 1.0 - float(np.median(np.exp(grid.logs(results, floor_percent).mean(axis=0))))


def _over_seeds(left: FloatArray, strategy: str, seed: int) -> tuple[float, float]:
    """Return the bootstrap interval of the median over seeds; nan with a single seed."""
    if len(left) < 2:
        return math.nan, math.nan
    from scipy.stats import bootstrap

    random = np.random.default_rng(np.random.SeedSequence([seed, *strategy.encode()]))
    how: dict[str, Any] = {"method": "percentile", "n_resamples": _RESAMPLES}
    found = bootstrap((left,), np.median, **how, random_state=random)
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


_FIGURES = ("parameter_count", "evaluations", "seconds")
_figures = attrgetter(*_FIGURES)


def _median(by_case: Mapping[str, Sequence[float]]) -> float:
    """Return the median over cases of the median over seeds; nan where nothing has the value."""
    medians = [np.median(np.array(numbers, dtype=float)) for numbers in by_case.values()]
    return float(np.median(medians)) if medians else float("nan")
