"""The predictive board: CRPS and coverage of what models say of unseen frequencies, by band.

A prediction is a normal distribution of ln f about the model's. A measured mode without partner, or
with an imaginary one, is in no interval, and its CRPS is the cap of the rule, which none exceeds.

Source: Gneiting & Raftery (2007), J. Am. Stat. Assoc. 102, 359-378: the score is proper.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from femubench.core.garbage import pause_collection
from femubench.core.schema.results import UNSEEN, Block, RunData
from femubench.core.score.bounded_gain import MeasuredModes
from femubench.core.score.leaderboard import GainTable, mean_known
from femubench.core.score.statistics import FEWEST, interval_of_mean
from femubench.core.typing import FloatArray, IntArray

# Higher modes and modified ones above the highest given frequency, and modified ones below it.
BANDS = ("above", "band")
FIGURES = ("crps_percent", "coverage90", "skill")
LEVEL = 0.9
# Of ln f, from what a test repeats to what no pairing allows; a step of 6 % changes the mean CRPS
# near its least value by less than 0.1 %.
_DEVIATIONS = np.geomspace(1e-3, 1.0, 121)
_LOST = (math.nan, math.nan, 1.0)


@dataclass(frozen=True)
class Forecasts:
    """What a model predicts of the m unseen modes of a case, by partners and candidates, n in all.

    Arguments:
        error, std: ln(f_p / f_m) and its standard deviation, nan where there is none, (n,).
        weight: 1 in total for every mode, as in the rule of the ranks, (n,).
        mode: place of the measured mode; its partner comes first, (n,).
        band: place among `BANDS`, (m,).
        cap: largest CRPS.
    """

    error: FloatArray
    std: FloatArray
    weight: FloatArray
    mode: IntArray
    band: IntArray
    cap: float

    @classmethod
    def of(cls, modes: MeasuredModes, blocks: Mapping[str, Block]) -> Forecasts:
        """Return the forecasts of a model.

        Arguments:
            modes: that were measured of the case.
            blocks: what the model predicts.
        """
        rows: list[tuple[float, ...]] = []
        bands: list[int] = []
        for name, mode in ((n, m) for n in UNSEEN if n in blocks for m in blocks[n].modes):
            hz, own = mode.predicted_hz or 0.0, [_LOST]
            if hz > 0.0:
                own_std = mode.predicted_std_hz
                std = math.nan if own_std is None else max(own_std / hz, 1e-9)
                pairs = [(hz, 1.0), *((c.hz, c.weight) for c in modes.candidates_of(mode))]
                total = sum(weight for _, weight in pairs)
                own = [(math.log(f / mode.measured_hz), std, w / total) for f, w in pairs]
            rows += [(*row, len(bands)) for row in own]
            bands.append(int(modes.band_of(name, mode) == "band"))
        errors, stds, weights, places = np.array(rows, dtype=float).reshape(-1, 4).T
        band = np.array(bands, dtype=int)
        return cls(errors, stds, weights, places.astype(int), band, modes.rule.cap)

    @property
    def stated(self) -> bool:
        """Return whether the strategy gave an uncertainty with the model."""
        return bool(np.isfinite(self.std).any())

    def level(self, std: FloatArray) -> FloatArray:
        """Return the level of the partner's interval that just reaches what was measured, (m,).

        2 where no interval does.

        Arguments:
            std: of the forecasts, (n,).
        """
        first = np.flatnonzero(np.diff(self.mode, prepend=-1))
        reached = 2.0 * ndtr(np.abs(self.error[first]) / std[first]) - 1.0
        return np.asarray(np.nan_to_num(reached, nan=2.0))

    def mean_crps(self, std: FloatArray) -> FloatArray:
        """Return by band the mean CRPS with each of s common deviations, nan where unknown, (s, 2).

        Arguments:
            std: of ln f, for all forecasts alike, (s,).
        """
        each = np.fmin(crps_normal(self.error, std[:, None]), self.cap)
        count = np.bincount(self.band, minlength=2)
        shares = self.weight[:, None] * (self.band[self.mode][:, None] == np.arange(2))
        return np.where(count > 0, each @ shares / np.maximum(count, 1), math.nan)

    def figures(self, common: FloatArray) -> FloatArray:
        """Return by band mean CRPS and share in the 90 % intervals, nan where unknown, (2, 2).

        Arguments:
            common: deviation of ln f for a model that came with none, by band, (2,).
        """
        std = self.std if self.stated else common[self.band[self.mode]]
        each, found = np.fmin(crps_normal(self.error, std), self.cap), np.full((2, 2), math.nan)
        score = np.bincount(self.mode, each * self.weight, len(self.band))
        inside = self.level(std) <= LEVEL
        for place in np.unique(self.band):
            if self.stated or math.isfinite(common[place]):
                part = self.band == place
                found[place] = score[part].mean(), inside[part].mean()
        return found


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
    def of(cls, run: RunData) -> PredictiveBoard:
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
        scale, places = table.scale, {case: k for k, case in enumerate(table.cases)}
        if not places:
            return cls((), {})
        textbook = {case: Forecasts.of(scale.modes[case], scale.blocks[case]) for case in places}
        common = learn_deviations(table, textbook)
        lines = np.array([textbook[case].figures(common[k]) for case, k in places.items()])
        found: dict[tuple[str, int, int], list[FloatArray]] = defaultdict(list)
        stated: Counter[str] = Counter()
        for result in (result for result in run.ranked if result.case in places):
            place, own = places[result.case], textbook[result.case]
            if result.answered:
                own = Forecasts.of(scale.modes[result.case], result.blocks)
            stated[result.strategy] += own.stated
            job = result.strategy, place, table.seeds.index(result.seed)
            found[job].append(own.figures(common[place]))
        rows = []
        for name in table.names:
            values = np.repeat(lines[:, None], len(table.seeds), axis=1)
            for case, seed in np.ndindex(values.shape[:2]):
                if listed := found.get((name, case, seed)):
                    values[case, seed] = np.mean(listed, axis=0)
            score, line = values[..., :1], lines[:, None, :, :1]
            skill = (line - score) / np.maximum(np.maximum(line, score), scale.rule.floor)
            score *= 100.0  # a view of the values
            by_structure = table.by_structure(np.concatenate([values, skill], axis=-1))
            line_of = (run.meta.get("yardsticks") or {}).get(name)
            row: dict[str, Any] = {"strategy": name, "yardstick": line_of, "stated": stated[name]}
            row["total"] = len(places) * len(table.seeds)
            for k, band in enumerate(BANDS):
                part = mean_known(np.moveaxis(by_structure[:, :, k], 1, 0))
                row |= zip([f"{band}_{key}" for key in FIGURES], mean_known(part), strict=True)
                known = part[np.isfinite(part[:, -1]), -1]
                ends = interval_of_mean(known) if len(known) >= FEWEST else (math.nan, math.nan)
                row[f"{band}_low"], row[f"{band}_high"] = ends
            rows.append(row)
        rows.sort(key=lambda row: (-np.nan_to_num(row["above_skill"], nan=-2.0), row["strategy"]))
        least, most = (100.0 * common.min(axis=0)).tolist(), (100.0 * common.max(axis=0)).tolist()
        return cls(tuple(rows), {band: (least[k], most[k]) for k, band in enumerate(BANDS)})

    @staticmethod
    def levels(modes: MeasuredModes, blocks: Mapping[str, Block]) -> FloatArray | None:
        """Return the levels of the stated intervals that just reach the unseen modes of a result.

        None where nothing is stated.
        """
        found = Forecasts.of(modes, blocks)
        return found.level(found.std) if found.stated else None


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
    scores = [textbook[case].mean_crps(_DEVIATIONS) for case in table.cases]
    units, best = table.by_structure(np.array(scores)), {}
    for k, name in enumerate(table.units):
        others = np.delete(units, k, axis=0)
        enough = np.isfinite(others[:, 0]).sum(axis=0) >= FEWEST - 1
        least = np.nan_to_num(mean_known(others)).argmin(axis=0)
        best[name] = np.where(enough, _DEVIATIONS[least], math.nan)
    return np.array([best[name] for name in table.structures])


def crps_normal(error: FloatArray, std: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of normal forecasts; lower is better, (n,).

    Arguments:
        error: forecast mean minus what was measured, (n,).
        std: of the forecast, in the same unit, (n,).

    Source: Gneiting & Raftery (2007), section 4.2.
    """
    z = error / std
    density = np.exp(-0.5 * np.square(z)) / np.sqrt(2.0 * np.pi)
    return np.asarray(std * (z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1.0 / np.sqrt(np.pi)))
