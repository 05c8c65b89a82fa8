"""The predictive board: CRPS and coverage of what models say of unseen frequencies, by band.

A prediction is a normal distribution of ln f about the model's. A measured mode without partner, or
with an imaginary one, is in no interval, and its CRPS is the cap of the rule, which none exceeds.

Source: Gneiting & Raftery (2007), J. Am. Stat. Assoc. 102, 359-378: the score is proper.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from femubench.core.garbage import pause_collection
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import UNSEEN, Block, JobResult, Run
from femubench.core.score.bounded_gain import MeasuredModes, bound_gain
from femubench.core.score.leaderboard import GainTable, mean_known
from femubench.core.score.ranking import Scale
from femubench.core.score.statistics import FEWEST, interval_of_mean
from femubench.core.typing import BoolArray, FloatArray, IntArray

# Higher modes and modified ones above the highest given frequency, and modified ones below it.
BANDS = ("above", "band")
FIGURES = ("crps_percent", "coverage90", "skill")
LEVEL = 0.9
# Of ln f; from the repeatability of a test to more than any pairing allows. A step of 6 % changes
# the mean CRPS near its least value by less than 0.1 %.
_DEVIATIONS = np.geomspace(1e-3, 1.0, 121)


@dataclass(frozen=True)
class Forecasts:
    """What a model predicts of the m unseen modes of a case.

    Candidates follow the partner of their mode, as in the rule of the ranks: n in all.

    Arguments:
        error: ln(f_p / f_m), nan without a partner of a real frequency, (n,).
        std: of ln f, nan where none was given, (n,).
        weight: 1 in total for every mode, (n,).
        mode: place of the measured mode, (n,).
        above: whether a mode is above the given band, (m,).
        cap: largest CRPS.
    """

    error: FloatArray
    std: FloatArray
    weight: FloatArray
    mode: IntArray
    above: BoolArray
    cap: float

    @classmethod
    def of(cls, modes: MeasuredModes, blocks: Mapping[str, Block]) -> Forecasts:
        """Return the forecasts of a model.

        Arguments:
            modes: that were measured of the case.
            blocks: what the model predicts.
        """
        listed = [(name, m) for name in UNSEEN if name in blocks for m in blocks[name].modes]
        rows = [row for k, (_, mode) in enumerate(listed) for row in _rows_of(modes, k, mode)]
        error, std, weight, place = np.array(rows, dtype=float).reshape(-1, 4).T
        above = np.array([modes.band_of(*item) != "band" for item in listed], dtype=bool)
        return cls(error, std, weight, place.astype(int), above, modes.rule.cap)

    @property
    def stated(self) -> bool:
        """Return whether the strategy gave an uncertainty with the model."""
        return bool(np.isfinite(self.std).any())

    def crps(self, common: FloatArray) -> FloatArray:
        """Return the CRPS of every mode, the weighted mean over what may stand for it, (m,).

        Arguments:
            common: deviation of ln f for a model without an uncertainty, by band, (2,).
        """
        score = np.minimum(crps_normal(self.error, self._std(common)), self.cap)
        score = np.where(np.isnan(self.error), self.cap, score)
        return np.bincount(self.mode, score * self.weight, len(self.above))

    def level(self, common: FloatArray | None = None) -> FloatArray:
        """Return the level of the central interval that just reaches the measured value, (m,).

        The interval is the partner's, for which it was stated; 2 where none covers a mode.

        Arguments:
            common: as for `crps`; without it only what was stated counts.
        """
        first = np.flatnonzero(np.diff(self.mode, prepend=-1))
        error = np.abs(self.error[first])
        std = (self.std if common is None else self._std(common))[first]
        with np.errstate(divide="ignore", invalid="ignore"):
            reached = np.where((error == 0.0) & (std == 0.0), 0.0, 2.0 * ndtr(error / std) - 1.0)
        return np.asarray(np.where(np.isnan(error) | np.isnan(std), 2.0, reached))

    def figures(self, common: FloatArray) -> FloatArray:
        """Return mean CRPS, and share in the 90 % intervals, by band; nan where unknown, (2, 2)."""
        score, inside = self.crps(common), self.level(common) <= LEVEL
        known = [self.stated or np.isfinite(std) for std in common]
        parts = (self.above, ~self.above)
        found = np.full((2, 2), math.nan)
        for row, part, there in zip(found, parts, known, strict=True):
            if there and part.any():
                row[:] = score[part].mean(), inside[part].mean()
        return found

    def _std(self, common: FloatArray) -> FloatArray:
        own = np.where(self.above[self.mode], *common)
        return self.std if self.stated else np.asarray(own)


@dataclass(frozen=True)
class PredictiveBoard:
    """How good the stated uncertainties of a run are, apart from its ranks.

    Arguments:
        rows: one a strategy, the best skill above the given band first.
        common: by band the least and largest deviation of ln f, in percent, that stood for one not
            stated; nan where there are too few structures to learn it from.
    """

    rows: tuple[dict[str, Any], ...]
    common: Mapping[str, tuple[float, float]]

    @classmethod
    @pause_collection()
    def of(cls, run: Run) -> PredictiveBoard:
        """Return the predictive board of a run.

        Means over seeds, then over the cases of a structure, then over structures: `crps_percent`
        of ln f, `coverage90`, and `skill`, the bounded gain of the CRPS over that of the textbook
        model with the common deviation, with `low` and `high`, its 95 % interval over structures;
        each with `above_` and `band_` before it. `stated` of `total` jobs gave an uncertainty. A
        job without a possible model counts as the textbook one with the common deviation.

        Raises:
            InputError: when the run keeps too little to be scored.
        """
        table = GainTable.of(run, (), run.nominals[0])
        scale, cases = table.scale, {case: k for k, case in enumerate(table.cases)}
        textbook = {case: Forecasts.of(scale.modes[case], scale.blocks[case]) for case in cases}
        if not cases:
            return cls((), {})
        common = learn_deviations(table, textbook)
        lines = {case: textbook[case].figures(common[k]) for case, k in cases.items()}
        found: dict[tuple[str, str, int], list[FloatArray]] = defaultdict(list)
        stated: Counter[str] = Counter()
        for result in run.ranked:
            if result.case in cases:
                own = Forecasts.of(scale.modes[result.case], result.blocks)
                own = own if result.answered else textbook[result.case]
                stated[result.strategy] += own.stated
                figures = own.figures(common[cases[result.case]])
                found[result.strategy, result.case, result.seed].append(figures)
        rows = []
        for name in table.names:
            values = np.array([
                np.mean([_with_skill(own, lines[case], scale) for own in listed], axis=0)
                for case in cases
                for seed in table.seeds
                for listed in [found.get((name, case, seed)) or [lines[case]]]
            ]).reshape(len(cases), len(table.seeds), len(BANDS) * len(FIGURES))  # fmt: skip
            means = mean_known(np.moveaxis(table.by_structure(values), 1, 0))
            yardstick = (run.meta.get("yardsticks") or {}).get(name, "")
            row = {"strategy": name, "yardstick": yardstick, "stated": stated[name]}
            row["total"] = len(cases) * len(table.seeds)
            for band, part in zip(BANDS, np.split(means, len(BANDS), axis=1), strict=True):
                figures = dict(zip(FIGURES, mean_known(part).tolist(), strict=True))
                known = part[np.isfinite(part[:, -1]), -1]
                ends = interval_of_mean(known) if len(known) >= FEWEST else (math.nan, math.nan)
                figures |= dict(zip(("low", "high"), ends, strict=True))
                row |= {f"{band}_{key}": value for key, value in figures.items()}
            rows.append(row)
        rows.sort(key=lambda row: (-np.nan_to_num(row["above_skill"], nan=-2.0), row["strategy"]))
        ends = zip(100.0 * common.min(axis=0), 100.0 * common.max(axis=0), strict=True)
        return cls(tuple(rows), dict(zip(BANDS, ends, strict=True)))


def learn_deviations(table: GainTable, textbook: Mapping[str, Forecasts]) -> FloatArray:
    """Return by case and band the one deviation of ln f for all that state none, (cases, 2).

    It gives the textbook models of all other structures the least mean CRPS; nan with fewer than
    five of them. Of the textbook models, and not of the pooled errors of those that state none: a
    figure must not depend on who else runs, and in a run of one strategy the pool would be its own
    errors, so that it would be measured by what it has been fitted to.

    Arguments:
        table: of the run.
        textbook: forecasts of the textbook model by case.
    """
    scores = np.full((len(table.cases), len(_DEVIATIONS), 2), math.nan)
    for k, case in enumerate(table.cases):
        own = textbook[case]
        for place, std in enumerate(_DEVIATIONS):
            scores[k, place] = own.figures(np.array([std, std]))[:, 0]
    units = table.by_structure(scores)
    best = np.full((len(units), 2), math.nan)
    for k in range(len(units)):
        others = np.delete(units, k, axis=0)
        enough = np.isfinite(others[:, 0]).sum(axis=0) >= FEWEST - 1
        least = np.nan_to_num(mean_known(others)).argmin(axis=0)
        best[k] = np.where(enough, _DEVIATIONS[least], math.nan)
    return best[[table.units.index(name) for name in table.structures]].reshape(-1, 2)


def stated_coverage(
    results: Iterable[JobResult], scale: Scale, structures: Mapping[str, str], levels: FloatArray
) -> FloatArray | None:
    """Return the share of unseen modes in stated intervals by level, every structure alike.

    None where no job stated an uncertainty.

    Arguments:
        results: of one strategy; those that are ok count.
        structures: by case; one that is not named is a structure of its own.
        levels: of the intervals, (k,).
    """
    found: dict[str, list[FloatArray]] = defaultdict(list)
    for result in results:
        own = Forecasts.of(scale.modes[result.case], result.blocks)
        if result.status == "ok" and own.stated:
            found[structures.get(result.case, result.case)].append(own.level())
    shares = [(np.concatenate(r)[:, None] <= levels).mean(axis=0) for r in found.values()]
    return np.asarray(np.mean(shares, axis=0)) if shares else None


def crps_normal(error: FloatArray, std: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of normal forecasts, in the unit of both.

    Lower is better. A std of nan or 0 stands for a point: the score is the absolute error.

    Arguments:
        error: forecast mean minus what was measured, (n,).
        std: of the forecast, (n,).

    Source: Gneiting & Raftery (2007), section 4.2.
    """
    point = ~(std > 1e-12 * np.abs(error))
    s = np.where(point, 1.0, std)
    z = error / s
    density = np.exp(-0.5 * np.square(z)) / np.sqrt(2.0 * np.pi)
    spread = s * (z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1.0 / np.sqrt(np.pi))
    return np.asarray(np.where(point, np.abs(error), spread))


def _rows_of(
    modes: MeasuredModes, place: int, mode: PairedMode
) -> list[tuple[float, float, float, int]]:
    """Return error, std, weight and place of the partner of a mode and of what may stand for it."""
    hz = mode.predicted_hz
    if hz is None or hz <= 0.0:
        return [(math.nan, math.nan, 1.0, place)]
    std = math.nan if mode.predicted_std_hz is None else mode.predicted_std_hz / hz
    pairs = [(hz, 1.0), *((one.hz, one.weight) for one in modes.candidates_of(mode))]
    total = sum(weight for _, weight in pairs)
    return [(math.log(f / mode.measured_hz), std, w / total, place) for f, w in pairs]


def _with_skill(own: FloatArray, line: FloatArray, scale: Scale) -> FloatArray:
    """Return CRPS in percent, coverage and skill, a band after the other."""
    rows = zip(own.tolist(), line[:, 0].tolist(), strict=True)
    parts = [(100.0 * crps, c, bound_gain(crps, bar, scale.rule)) for (crps, c), bar in rows]
    return np.array(parts).ravel()
