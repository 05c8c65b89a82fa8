"""The role of an effect: its parameters with their prior, and effects on frames."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from femubench.core.effect.reading import Reading
from femubench.core.effect.sizes import Size
from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.roles import Effect, Scaling, Wording

_NOTHING = -1.0 + 1e-12  # a factor is positive


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect, and what is known of it before any measurement.

    The diagnosis works in a coordinate x that is standard normal a priori (half normal where
    `one_sided`), x = 0 for a model without the effect:

    - ``linear``: value = neutral + scale x
    - ``exponential``: value = neutral + scale (exp |x| - 1) sign x, for sizes over decades
    - ``compliance``: value = scale / (exp x - 1), for springs that are rigid at x = 0
    - ``factor``: value = neutral + exp (scale x) - 1, for the change of a log-normal factor

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
            which have no unit and are told in percent too.
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

    def value(self, x: Any) -> Any:  # noqa: ANN401 - numbers, arrays and complex steps alike
        """Return the value at a coordinate, bounds not applied; any shape."""
        if self.scaling == "linear":
            return self.neutral + self.scale * x
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
        share = (value - self.neutral) / self.scale
        if self.scaling == "linear":
            return float(share)
        return float(np.sign(share) * np.log1p(abs(share)))

    @property
    def range(self) -> tuple[float, float]:
        """Return the smallest and the largest x that the bounds allow, within 6 deviations."""
        if self.scaling == "compliance":
            low, high = self.coordinate(self.upper), self.coordinate(max(self.lower, 1e-300))
        else:
            low, high = self.coordinate(self.lower), self.coordinate(self.upper)
        if self.one_sided:
            low = 0.0 if self.least is None else self.coordinate(self.neutral + self.least)
        return max(low, -6.0), min(high, 6.0)


class FrameEffect(Effect):
    """Base class of effects on frames: override `places`, `parameters` and `frame`.

    Attributes:
        name: a slug such as ``"loose-bolt"``.
        summary: what the model lacks, as a clause: ``"a bolt is loose"``.
        caution: a sentence for whoever finds this effect named; a note of the diagnosis.
        softens: whether its stiffness may fall with the level of excitation, so that a second
            level is worth measuring.
        innate: whether it is there from the day that the structure was built, so that it cannot
            be what differs from a reference.
        handbook: whether handbooks give its values without any fit.
        refines: the slug of an effect of which it tells more at the same place: it is tried where
            that one is likely, and weighed with it.
        reading: the instrument that reads it directly; a proposal of the advice.
        sizes: how large it is in hidden cases, one range a parameter; of more parameters the last
            range goes on. Without one it is drawn from half a deviation of its prior to two.
    """

    name: ClassVar[str]
    summary: ClassVar[str] = ""
    caution: ClassVar[str] = ""
    softens: ClassVar[bool] = False
    innate: ClassVar[bool] = False
    handbook: ClassVar[bool] = False
    refines: ClassVar[str | None] = None
    reading: ClassVar[Reading | None] = None
    sizes: ClassVar[Sequence[Size]] = ()

    @abstractmethod
    def places(self, model: Model) -> Sequence[str]:
        """Return where the effect may sit in this model; nothing where it does not apply."""

    @abstractmethod
    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return its parameters there."""

    @abstractmethod
    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the effect in it, written as ordinary keys of a case."""

    def in_half(self, values: Sequence[float]) -> Sequence[float] | None:
        """Return what half an element needs for as much effect as `values` have in the whole.

        None, as here, where a hidden effect cannot fill one half of its element alone.
        """
        return None

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the effect in it.

        Raises:
            NotApplicable: when the model came as matrices.
        """
        if model.structure is None:
            raise NotApplicable(f"{self.name} needs a frame, not a pair of matrices")
        structure = model.structure
        return Model.of(structure.rebuilt(self.frame(structure.frame, place, values)))
