"""How good predictive distributions of unseen frequencies are: coverage, CRPS, log score.

A prediction is a normal distribution about the model's frequency, or the mere frequency. All is in
percent of the measured frequency. A measured mode without partner, or with an imaginary one, counts
as an error of 100 % without a distribution: covered by no interval.

Source: Gneiting & Raftery (2007), J. Am. Stat. Assoc. 102, 359-378: both scores are proper.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter

import numpy as np
from scipy.special import ndtr

from femubench.core.schema.results import UNSEEN, JobResult
from femubench.core.typing import BoolArray, FloatArray, IntArray

COLUMNS = ("coverage90", "crps_percent", "log_score")
LEVEL = 0.9
LOST_PERCENT = 100.0  # the error of a mode that the model does not have
# A forecast never excludes the rest: it is mixed with so much of anything within 100 %. A lost mode
# then has a log score too, and one mode that is 50 deviations off does not outweigh all others.
ANYTHING = 0.01


@dataclass(frozen=True)
class Forecasts:
    """Predictions of unseen modes and what was measured.

    Arguments:
        error: predicted minus measured frequency in percent of the measured one, (n,).
        std: of the prediction in the same unit, nan where none was given, (n,).
        stated: whether the strategy gave an uncertainty with that model, (n,).
        structure: number of the structure, (n,).
    """

    error: FloatArray
    std: FloatArray
    stated: BoolArray
    structure: IntArray

    @classmethod
    def of(
        cls,
        results: Iterable[JobResult],
        structures: Mapping[str, str],
        blocks: Collection[str] = UNSEEN,
    ) -> Forecasts:
        """Return the forecasts of the unseen modes of jobs that are ok.

        Arguments:
            results: of one strategy.
            structures: by case; one that is not named is a structure of its own.
            blocks: those of them whose modes are taken.
        """
        listed = list(results)
        found = [result.blocks.get(name) for result in listed for name in UNSEEN]
        modes = [block.modes if block else () for block in found]
        hertz = np.array(list(map(_HERTZ, chain(*modes))), dtype=float).reshape(-1, 3).T
        counts = np.array(list(map(len, modes)), dtype=int)
        owner = np.repeat(np.arange(len(modes)) // len(UNSEEN), counts)
        stated = np.bincount(owner, ~np.isnan(hertz[2]), len(listed)) > 0.0
        numbers: dict[str, int] = {}
        names = (structures.get(result.case, result.case) for result in listed)
        places = np.array([numbers.setdefault(name, len(numbers)) for name in names], dtype=int)
        wanted = np.array([name in blocks for name in UNSEEN] * len(listed), dtype=bool)
        taken = np.repeat(wanted, counts)
        error, std = _percent(hertz[:, taken])
        return cls(error, std, stated[owner[taken]], places[owner[taken]])

    @property
    def weight(self) -> FloatArray:
        """Return weights of 1 in total, the same for all structures and all modes of one, (n,)."""
        counts = np.bincount(self.structure)
        return np.asarray(1.0 / (counts[self.structure] * np.count_nonzero(counts)))

    @property
    def uncertain(self) -> Forecasts:
        """Return those of models that came with an uncertainty."""
        own = self.stated
        return Forecasts(self.error[own], self.std[own], own[own], self.structure[own])

    @property
    def level(self) -> FloatArray:
        """Return the level of the central interval that just reaches the measured value, (n,).

        2 for a mode that no interval covers.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            reached = 2.0 * ndtr(np.abs(self.error) / self.std) - 1.0
        reached = np.where((self.std == 0.0) & (self.error == 0.0), 0.0, reached)
        return np.asarray(np.where(np.isnan(self.std), 2.0, reached))

    def coverage(self, level: float = LEVEL) -> float:
        """Return the share of modes in the central interval of a level; nan without any."""
        found = self.uncertain
        return float(found.weight @ (found.level <= level)) if len(found.error) else np.nan


def scores(results: Iterable[JobResult], structures: Mapping[str, str]) -> dict[str, float]:
    """Return coverage of 90 % intervals, CRPS in percent and log score of one strategy.

    Each is the mean over unseen modes, every structure with the same weight. Coverage and log
    score are those of models that came with an uncertainty, nan where none did; without one the
    CRPS is the absolute error.

    Arguments:
        results: of the strategy.
        structures: by case.
    """
    found = Forecasts.of(results, structures)
    some = found.uncertain
    crps = float(found.weight @ crps_normal(found.error, found.std)) if len(found.error) else np.nan
    log = float(some.weight @ log_score(some.error, some.std)) if len(some.error) else np.nan
    return dict(zip(COLUMNS, (found.coverage(), crps, log), strict=True))


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


def log_score(error: FloatArray, std: FloatArray) -> FloatArray:
    """Return -ln of the density of what was measured, per percent; lower is better, 9.9 the worst.

    The density is that of the forecast with a share of 0.01 of anything within 100 %. A std of
    nan stands for no forecast.

    Arguments:
        error: in percent, (n,).
        std: in percent, (n,).
    """
    s = np.where(std > 0.0, std, np.inf)
    density = np.exp(-0.5 * np.square(error / s)) / (np.sqrt(2.0 * np.pi) * s)
    return np.asarray(-np.log((1.0 - ANYTHING) * density + ANYTHING / (2.0 * LOST_PERCENT)))


_HERTZ = attrgetter("measured_hz", "predicted_hz", "predicted_std_hz")


def _percent(hertz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return errors and std of modes in percent of the measured frequencies.

    Arguments:
        hertz: measured and predicted frequency and std, nan where there is none, (3, n).
    """
    measured, predicted, std = hertz
    there = predicted > 0.0
    error = np.where(there, 100.0 * (predicted / measured - 1.0), LOST_PERCENT)
    return error, np.where(there, 100.0 * std / measured, np.nan)
