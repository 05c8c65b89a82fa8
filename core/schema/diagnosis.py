"""Rows of a diagnosis: causes, rivals, residuals, gain; plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from femubench.core.roles import Side, Wording

Verdict = Literal["named", "none", "unknown", "ambiguous", "not-confirmed"]


@dataclass(frozen=True)
class CauseParameter:
    """A parameter of a cause.

    Arguments:
        std: standard deviation; None where the value is a textbook one that was not fitted.
        textbook: whether the value was taken from the textbook.
        wording: how a size is worded, as in `Parameter`.
    """

    name: str
    value: float
    std: float | None
    unit: str
    textbook: bool = False
    wording: Wording = "value"


@dataclass(frozen=True)
class Cause:
    """An effect at a place, with what it takes; `summary` says it as a clause.

    Arguments:
        probability: that the effect is part of what is missing, wherever it sits.
        place_probability: that it sits at this place, given that it is; nan where not known.
        places: the credible set, with the probability of each: the most probable places, 95 % or
            more together.
        mirrors: the other places that fit exactly as well, as images of this one by a symmetry
            of the structure that the data do not break.
        side: whether the model lacks it, or the data or what was typed in are wrong there.
    """

    effect: str
    place: str
    parameters: tuple[CauseParameter, ...]
    probability: float
    summary: str = ""
    place_probability: float = float("nan")
    places: tuple[tuple[str, float], ...] = ()
    mirrors: tuple[str, ...] = ()
    side: Side = "model"


@dataclass(frozen=True)
class Rival:
    """Another explanation.

    Arguments:
        effect: slug, or ``a + b`` for a pair; place likewise.
        delta_chi2: by how much it lowers chi-square.
        probability: of this effect at this place.
        angle: between its sensitivity subspace and the winner's in degrees; nan where unknown.
    """

    effect: str
    place: str
    delta_chi2: float
    probability: float
    angle: float = float("nan")


@dataclass(frozen=True)
class Evidence:
    """What speaks for the first explanation against another one, in ln of the odds.

    Arguments:
        against: ``nothing``, or a rival with its place.
        data: ln of the likelihood ratio at the best fits: what the data say.
        prior: what the prior adds: how many causes, effects, places, and how wide a range of
            sizes was open to each.
    """

    against: str
    data: float
    prior: float


@dataclass(frozen=True)
class Advice:
    """A measurement that one could make, and the distance in squared sigmas (d2) it creates."""

    measurement: str
    separation: float


@dataclass(frozen=True)
class SmallestVisible:
    """The smallest size of an effect, at its best place, that these data would have shown."""

    effect: str
    place: str
    size: float
    unit: str
    wording: Wording = "value"


@dataclass(frozen=True)
class ErrorScale:
    """How large a class of model error is beside the first explanation, standard deviation.

    Arguments:
        name: of the class.
        scale: of the perturbations of the class.
        unit: empty for a ratio.
    """

    name: str
    scale: float
    unit: str


@dataclass(frozen=True)
class ResidualRow:
    """One datum before and after, in standard deviations of the measurement.

    Arguments:
        kind: ``frequency``, ``shape`` or ``mass``.
        mode: label of the measured mode; None for the mass.
        sensor: its label for a shape, else empty.
        measured: in Hz, kg or the unit of the shape.
        before, after: (measured - predicted) / sigma; None where no predicted mode pairs.
    """

    kind: str
    mode: int | None
    sensor: str
    measured: float
    before: float | None
    after: float | None


@dataclass(frozen=True)
class LookWarning:
    """Something that a plain look at the model finds, before any fit.

    Arguments:
        what: one sentence.
        where: member, section or ``all``.
        effect: slug of the effect that would mend it; empty where there is none.
        changes: from the model's elastic mode number (from 1) to the change of its frequency in
            percent, were it mended.
    """

    what: str
    where: str
    effect: str
    changes: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class LocationRow:
    """An indicator of where the error sits, scaled to 1 at its largest.

    Arguments:
        indicator: ``evidence``, ``force-residual``, ``energy-error``, ``ecomac``, ...
        place: member, ``member/k``, joint or sensor label.
    """

    indicator: str
    place: str
    value: float


@dataclass(frozen=True)
class Scatter:
    """Whether what is left of one kind of data is as much as their stated scatter lets expect.

    Arguments:
        kind: ``all``, ``frequencies`` or ``shapes``.
        chi2: of what is left, noise model included.
        dof: data less what was fitted to them: the chi-square that is to be expected.
        less_p, more_p: probability that chance alone leaves so little, or so much.
        factor: by how much the standard deviations seem too large; below 1 too small.
        warning: one sentence where either is far too improbable, else empty.
    """

    kind: str
    chi2: float
    dof: int
    less_p: float
    more_p: float
    factor: float
    warning: str = ""


@dataclass(frozen=True)
class Gain:
    """Frequency errors in percent, before and after: medians, or root mean squares.

    Arguments:
        held_out, modified: None where the case holds none back.
        cross_validated: the same over modes left out in turn, where nothing is held out.
    """

    used_percent: tuple[float, float]
    held_out_percent: tuple[float, float] | None = None
    modified_percent: tuple[float, float] | None = None
    cross_validated_percent: tuple[float, float] | None = None
