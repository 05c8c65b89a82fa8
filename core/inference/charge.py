"""A fault of the data, or of what was typed in, that is suspected at a place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np

from femubench.core.effect.suspect import Corrected, Suspect
from femubench.core.fem.model import Model
from femubench.core.inference.settings import settings
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Fault

_VALUES = ("frequencies", "shapes")


@dataclass(frozen=True, eq=False)
class Charge:
    """A suspect, and the model and the data that it was found in.

    Arguments:
        fault: the kind.
        suspect: the place.
        model, measurement: as they are.
        log_prior: ln of the odds of this fault here, against no fault at all.
        x: coordinate of its parameter, 0 without one.
        std: deviation of the coordinate.
    """

    fault: Fault
    suspect: Suspect
    model: Model
    measurement: Measurement
    log_prior: float
    x: float = 0.0
    std: float = 0.0

    def correct(self, x: float) -> Corrected:
        """Return model and data as they are right at a coordinate of the parameter."""
        parameter = self.suspect.parameter
        value = 0.0 if parameter is None else float(parameter.value(np.array(x)))
        return self.suspect.corrected(self.model, self.measurement, value)

    @cached_property
    def changed(self) -> int:
        """Return how many frequencies and readings mending it changes."""
        if self.fault.side == "input":
            return 0
        _, other = self.correct(1.0)
        pairs = ((getattr(self.measurement, name), getattr(other, name)) for name in _VALUES)
        return sum(
            int(((one != two) & ~(np.isnan(one) & np.isnan(two))).sum()) for one, two in pairs
        )

    @property
    def reweighs(self) -> bool:
        """Tell whether it is a matter of deviations alone."""
        return self.fault.side == "data" and self.changed == 0

    @property
    def loosens(self) -> float:
        """Return how many times as large as without the fault deviations are stated, at median."""
        _, other = self.repaired
        names = ("frequency_std", "shape_std")
        ratios = [(getattr(self.measurement, n) / getattr(other, n)).ravel() for n in names]
        known = np.concatenate(ratios)
        moved = known[np.isfinite(known) & (known != 1.0)]
        return float(np.median(moved)) if len(moved) else 1.0

    @property
    def single(self) -> bool:
        """Tell whether a parameter is to be found from a single datum."""
        return self.suspect.parameter is not None and self.changed == 1

    @property
    def repaired(self) -> Corrected:
        """Return model and data without the fault.

        A single datum cannot tell its own error: it is discounted, by what the error may be.
        """
        if not self.single:
            return self.correct(self.x)
        step = settings.slope_step
        (_, less), (_, more) = self.correct(-step), self.correct(step)
        wide = {
            std: np.hypot(
                getattr(self.measurement, std),
                np.nan_to_num(getattr(more, name) - getattr(less, name)) / (2.0 * step),
            )
            for name, std in (("frequencies", "frequency_std"), ("shapes", "shape_std"))
        }
        return self.model, replace(self.measurement, **wide)


@dataclass(frozen=True)
class Repaired:
    """A fault that was found, with the probability that it is this one at this place."""

    charge: Charge
    probability: float


def charges_of(model: Model, measurement: Measurement, faults: Iterable[Fault]) -> list[Charge]:
    """Return every suspect with its prior."""
    kinds = [(fault, fault.suspects(model, measurement)) for fault in faults]
    kinds = [(fault, suspects) for fault, suspects in kinds if suspects]
    each = log(settings.prior_fault / (1.0 - settings.prior_fault) / max(len(kinds), 1))
    return [
        Charge(fault, suspect, model, measurement, each - log(len(suspects)))
        for fault, suspects in kinds
        for suspect in suspects
    ]
