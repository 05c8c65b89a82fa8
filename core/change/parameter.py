"""One number of a change: its coordinate, its value, and what is known of it beforehand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from femubench.core.roles import Scaling
from femubench.core.typing import Wording

_NOTHING = -1.0 + 1e-12  # a factor is positive


@dataclass(frozen=True)
class Parameter:
    """One number of a change, and what is known of it before any measurement.

    Whatever fits it works in a coordinate x, 0 for a model without the change:

    - ``linear``: value = neutral + scale x
    - ``exponential``: value = neutral + scale (exp |x| - 1) sign x, for sizes over decades
    - ``compliance``: value = scale / (exp x - 1), for springs that are rigid at x = 0
    - ``factor``: value = neutral + exp (scale x) - 1, for the change of a log-normal factor
    - ``log``: value = neutral exp (scale x), for a log-normal value

    The prior of x is normal with deviation `std` (half normal where `one_sided`): 1 of an effect,
    infinite where nothing is known.

    Arguments:
        name: for tables.
        unit: of the value; empty for a ratio.
        scale: of the value at x = 1.
        neutral: the value that leaves the model as it is; infinite for ``compliance``.
        lower, upper: bounds of the value.
        least: size from which on it is taken for what it is; a smaller one is not tried. None
            for any.
        scaling: how x becomes a value.
        one_sided: whether x >= 0.
        textbook: a value that physics gives without any fit, e.g. 1 for shear deformation.
        wording: how a size is worded: in its `unit`, or as a relative ``change`` or a ``share``,
            which have no unit and are stated in percent too.
        std: prior standard deviation of x.
        reach: largest |x| that is looked at, whatever the bounds of the value allow.
        fatal: whether an optimum at a bound is a divergence rather than a result.
    """

    name: str
    unit: str
    scale: float
    neutral: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    scaling: Scaling = "linear"
    one_sided: bool = False
    textbook: float | None = None
    wording: Wording = "value"
    least: float | None = None
    std: float = 1.0
    reach: float = 6.0
    fatal: bool = False

    def value(self, x: Any) -> Any:  # noqa: ANN401 - numbers, arrays and complex steps alike
        """Return the value at a coordinate, bounds not applied; any shape."""
        if self.scaling == "linear":
            return self.neutral + self.scale * x
        if self.scaling == "log":
            return self.neutral * np.exp(self.scale * x)
        if self.scaling == "compliance":
            return self.scale / np.expm1(np.maximum(x, 1e-9))
        if self.scaling == "factor":
            return self.neutral + np.expm1(self.scale * x)
        return self.neutral + self.scale * np.expm1(np.abs(x)) * np.sign(x)

    def coordinate(self, value: float) -> float:
        """Return x of a value."""
        if self.scaling == "compliance":
            if value <= 0.0:
                return np.inf
            return float(np.log1p(self.scale / value)) if np.isfinite(value) else 0.0
        if self.scaling == "factor":
            return float(np.log1p(max(value - self.neutral, _NOTHING)) / self.scale)
        if self.scaling == "log":
            return float(np.log(value / self.neutral) / self.scale)
        share = (value - self.neutral) / self.scale
        if self.scaling == "linear":
            return float(share)
        return float(np.sign(share) * np.log1p(abs(share)))

    def slope(self, x: float) -> float:
        """Return d value / dx at a coordinate."""
        if self.scaling == "linear":
            return self.scale
        if self.scaling == "log":
            return float(self.scale * self.value(x))
        if self.scaling == "compliance":
            grown = np.expm1(max(x, 1e-9))
            return float(-self.scale * (grown + 1.0) / grown**2)
        if self.scaling == "factor":
            return float(self.scale * np.exp(self.scale * x))
        return float(self.scale * np.exp(abs(x)))

    def widen(self, std: float) -> Parameter:
        """Return what is known of it where something has happened to the structure since a test.

        A relative change is that of a log-normal factor, where it was less free. What is put on, a
        size with a sign but no bound, spans decades up to far beyond what a drawing may forget.

        Arguments:
            std: standard deviation of ln(factor).
        """
        if self.one_sided and self.scaling == "linear" and np.isinf(self.upper):
            return replace(self, scale=self.scale / self.reach, scaling="exponential")
        if self.wording != "change" or self.scaling != "linear" or self.scale >= std:
            return self
        return replace(self, scale=std, scaling="factor")

    @property
    def range(self) -> tuple[float, float]:
        """Return the smallest and the largest x that the bounds allow, within reach."""
        if self.scaling == "compliance":
            low, high = self.coordinate(self.upper), self.coordinate(max(self.lower, 1e-300))
        else:
            low, high = self.coordinate(self.lower), self.coordinate(self.upper)
        if self.one_sided:
            low = 0.0 if self.least is None else self.coordinate(self.neutral + self.least)
        return max(low, -self.reach), min(high, self.reach)
