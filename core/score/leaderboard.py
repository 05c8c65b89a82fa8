"""The leaderboard: one row a strategy over all cases and seeds of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.schema.results import BLOCKS, JobResult, Run
from femubench.core.score import predictive
from femubench.core.score.ranking import (
    SCORE_OF_FAILURE,
    geometric_mean,
    rank_results,
    ranked,
    score_of,
)
from femubench.core.score.statistics import FEWEST, interval_over_structures, structures_of

if TYPE_CHECKING:
    import pandas as pd

_RESAMPLES = 999
COLUMNS = (
    *("rank", "strategy", "skill", "skill_low", "skill_high", "skill_unseen"),
    *(f"{block}_percent" for block in BLOCKS),
    *predictive.COLUMNS,
    *("rigid_modes_lost", "negative_eigenvalues", "parameters", "evaluations", "seconds"),
    *("ok", "not_applicable", "total", "unphysical"),
)


@dataclass(frozen=True)
class _Grid:
    """All (case, seed) that a strategy is expected to have a result for.

    Arguments:
        blocks: number of blocks by case.
        seeds: of the run.
        structures: by case; one that is not named is a structure of its own.
    """

    blocks: dict[str, int]
    seeds: tuple[int, ...]
    structures: dict[str, str]

    @classmethod
    def of(cls, run: Run) -> _Grid:
        reference = run.meta.get("reference") or {}
        blocks = {case: len(errors) for case, errors in reference.items()}
        for result in run.results:
            blocks[result.case] = max(blocks.get(result.case, 1), len(result.blocks))
        seeds = {*run.meta.get("seeds", ()), *(result.seed for result in run.results)}
        return cls(blocks, tuple(sorted(seeds)), structures_of(run))

    @property
    def interval(self) -> str:
        """Return what the intervals of the skills are over; nothing where there are none."""
        count = len({self.structures.get(case, case) for case in self.blocks})
        return "structures" if count >= FEWEST else "seeds" if len(self.seeds) > 1 else ""


def interval_kind(run: Run) -> str:
    """Return what the intervals of the skills are over: ``structures``, ``seeds`` or nothing.

    Examples:
        >>> results.interval_kind(run)
        ''
    """
    return _Grid.of(run).interval


def leaderboard(run: Run) -> pd.DataFrame:
    """Return one row a strategy, best first: physical, then unphysical, then without any model.

    Strategies of one skill share a rank.

    `skill` is the geometric mean over all blocks of all cases, and with several seeds the median
    over seeds, with a 95 % bootstrap interval in `skill_low` and `skill_high`: over structures
    where there are enough of them, else over the seeds of those there are; `skill_unseen` is
    that over all seeds without the block that the strategy was given. The three errors are the
    median over cases of the median over seeds of the rms error in percent, over the jobs that
    are ok; so are `parameters`, `evaluations` and `seconds`. Rigid-body modes lost and negative
    eigenvalues are sums. A job without result scores 10. `coverage90`, `crps_percent` and
    `log_score` are those of docs/scoring.md.

    Arguments:
        run: with `reference`, `seeds`, `seed` and `strategies` in its meta.

    Examples:
        >>> results.leaderboard(run)[["rank", "skill"]].round(2).values.tolist()
        [[1.0, 0.31], [2.0, 1.0]]
    """
    import pandas as pd

    grid = _Grid.of(run)
    seed = int(run.meta.get("seed", 0))
    reference = run.meta.get("reference") or {}
    scored = rank_results(run.results, reference or None, run.meta.get("baseline"))
    names = list(run.meta.get("strategies", ()))
    names += sorted({result.strategy for result in scored} - set(names))
    rows = [_row(n, [r for r in scored if r.strategy == n], grid, seed, reference) for n in names]
    listed = [{**row, "rank": rank} for rank, row in ranked(rows, _order)]
    return pd.DataFrame(listed, columns=list(COLUMNS))


def _order(row: dict[str, Any]) -> tuple[tuple[bool, bool], float, str]:
    """Put physical models first, then unphysical ones, then who never gave a model."""
    nothing = row["ok"] + row["not_applicable"] == 0
    return (nothing, row["unphysical"]), row["skill"], row["strategy"]


def _row(
    strategy: str,
    results: Sequence[JobResult],
    grid: _Grid,
    seed: int,
    reference: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    skills = _skills(results, grid)
    low, high = (
        _over_structures(results, grid)
        if grid.interval == "structures"
        else _over_seeds(skills, strategy, seed)
    )
    fine = [result for result in results if result.status == "ok"]
    return {
        "strategy": strategy,
        "skill": float(np.median(skills)),
        "skill_low": low,
        "skill_high": high,
        "skill_unseen": _unseen(results, grid, reference),
        **{f"{block}_percent": _median(fine, _error_in(block)) for block in BLOCKS},
        **predictive.scores(fine, grid.structures),
        "rigid_modes_lost": sum(result.rigid_modes_lost for result in fine),
        "negative_eigenvalues": sum(result.negative_eigenvalues or 0 for result in fine),
        "parameters": _median(fine, lambda result: result.parameter_count),
        "evaluations": _median(fine, lambda result: result.evaluations),
        "seconds": _median(fine, lambda result: result.seconds),
        "ok": len(fine),
        "not_applicable": sum(result.status == "not-applicable" for result in results),
        "total": len(grid.blocks) * len(grid.seeds),
        "unphysical": any(result.unphysical for result in results),
    }


def _skills(results: Sequence[JobResult], grid: _Grid) -> list[float]:
    """Return the skill of every seed; a case weighs as much as it has blocks."""
    scores = {(result.case, result.seed): result.score for result in results}
    skills = []
    for seed in grid.seeds:
        found = [scores.get((case, seed)) for case in grid.blocks]
        numbers = [SCORE_OF_FAILURE if score is None else score for score in found]
        skills.append(geometric_mean(numbers, grid.blocks.values()))
    return skills


def _unseen(
    results: Sequence[JobResult], grid: _Grid, reference: Mapping[str, Mapping[str, float]]
) -> float:
    """Return the skill over the blocks that the strategy was not given; nan without any."""
    found = {(result.case, result.seed): result for result in results}
    scores, weights = [], []
    for case, errors in reference.items():
        hidden = {name: error for name, error in errors.items() if name != "used"}
        for seed in grid.seeds if hidden else ():
            result = found.get((case, seed))
            scores.append(SCORE_OF_FAILURE if result is None else score_of(result, hidden))
            weights.append(len(hidden))
    return geometric_mean(scores, weights) if scores else float("nan")


def _over_structures(results: Sequence[JobResult], grid: _Grid) -> tuple[float, float]:
    """Return the bootstrap interval of the skill over structures, each with all its seeds."""
    scores = {(result.case, result.seed): result.score for result in results}
    sums: dict[str, list[float]] = {}
    for case, weight in grid.blocks.items():
        found = [scores.get((case, seed)) for seed in grid.seeds]
        logs = np.log([SCORE_OF_FAILURE if score is None else score for score in found])
        entry = sums.setdefault(grid.structures.get(case, case), [0.0, 0.0])
        entry[0] += weight * float(logs.mean())
        entry[1] += weight
    totals, weights = np.array(list(sums.values())).T
    return interval_over_structures(totals / weights, weights)


def _over_seeds(skills: Sequence[float], strategy: str, seed: int) -> tuple[float, float]:
    """Return the bootstrap interval of the median over seeds; nan with a single seed."""
    if len(skills) < 2:
        return float("nan"), float("nan")
    from scipy.stats import bootstrap

    random = np.random.default_rng(np.random.SeedSequence([seed, *strategy.encode()]))
    how: dict[str, Any] = {"method": "percentile", "n_resamples": _RESAMPLES}
    found = bootstrap((np.array(skills),), np.median, **how, random_state=random)
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def _error_in(block: str) -> Callable[[JobResult], float | None]:
    return lambda result: result.blocks[block].rms_percent if block in result.blocks else None


def _median(results: Sequence[JobResult], value: Callable[[JobResult], float | None]) -> float:
    """Return the median over cases of the median over seeds; nan where nothing has the value."""
    by_case: dict[str, list[float]] = {}
    for result in results:
        number = value(result)
        if number is not None:
            by_case.setdefault(result.case, []).append(float(number))
    return float(np.median([np.median(n) for n in by_case.values()])) if by_case else float("nan")
