"""Rows of a diagnosis: causes, rivals, residuals, gain; plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from msgspec import Struct, field

from femubench.core.schema.bounds import Number
from femubench.core.typing import Side, Wording

Verdict = Literal["named", "none", "unknown", "ambiguous", "not-confirmed"]
RegionKind = Literal["stiffness lost", "stiffness added", "mass lost", "mass added"]


@dataclass(frozen=True, slots=True)
class CauseParameter:
    """A parameter of a cause.

    Arguments:
        std: standard deviation; None where the value is a textbook one that was not fitted.
        textbook: whether the value was taken from the textbook.
        wording: how a size is worded, as in `Parameter`.
    """

    name: str
    value: Number
    std: Number | None
    unit: str
    textbook: bool = False
    wording: Wording = "value"


@dataclass(frozen=True, slots=True)
class Region:
    """Where something differs and of what kind, whichever of the competing effects it is.

    Arguments:
        place: end of a member, joint, member, family or ``all`` that holds all that competes.
        probability: of a cause of that kind there.
        size, std: kg, or a share of its stiffness; None where the causes state no common size.
    """

    place: str
    kind: RegionKind
    probability: Number
    size: Number | None = None
    std: Number | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True)
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
        region: that holds what competes with it; None for textbook values and faults.
    """

    effect: str
    place: str
    parameters: tuple[CauseParameter, ...]
    probability: Number
    summary: str = ""
    place_probability: Number = float("nan")
    places: tuple[tuple[str, Number], ...] = ()
    mirrors: tuple[str, ...] = ()
    side: Side = "model"
    region: Region | None = None


@dataclass(frozen=True, slots=True)
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
    delta_chi2: Number
    probability: Number
    angle: Number = float("nan")


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for the first explanation against another one, in ln of the odds.

    Arguments:
        against: ``nothing``, or a rival with its place.
        data: ln of the likelihood ratio at the best fits: what the data say.
        prior: what the prior adds: how many causes, effects, places, and how wide a range of
            sizes was open to each.
    """

    against: str
    data: Number
    prior: Number


@dataclass(frozen=True, slots=True)
class Advice:
    """A measurement that one could make, and the distance in squared sigmas (d2) it creates."""

    measurement: str
    separation: Number


@dataclass(frozen=True, slots=True)
class SmallestVisible:
    """The smallest size of an effect, at its best place, that these data would have shown."""

    effect: str
    place: str
    size: Number
    unit: str
    wording: Wording = "value"


@dataclass(frozen=True, slots=True)
class LeftOut:
    """An effect that was tried at no place, or at some only.

    Arguments:
        places: at how many it was not.
        reason: as the end of a sentence that begins with "since".
    """

    effect: str
    places: int
    reason: str


class ErrorScale(Struct, frozen=True):
    """How large a class of model error is under the first explanation, standard deviation.

    Arguments:
        name: of the class; ``class`` in JSON.
        scale: of the perturbations of the class.
        unit: empty for a ratio.
    """

    name: str = field(name="class")
    scale: Number
    unit: str


class BudgetLine(Struct, frozen=True):
    """What a drawing lacks of one class at one place, in % of the frequencies, as ln ratios.

    Arguments:
        place: joint type, joint or ``all``.
        name: of the class; ``class`` in JSON.
        percent, std: by mode, in the order of `budget_modes`; positive where the drawing is too
            soft or too heavy there.
        rms_percent, rms_std: over the modes, with the sign of their sum.
        source: ``handbook``, ``data``, or ``drawing`` where the used modes see nothing of it.
        unseen: what the used modes do not see of it, which stays as drawn.
    """

    place: str
    name: str = field(name="class")
    percent: tuple[Number, ...]
    std: tuple[Number, ...]
    rms_percent: Number
    rms_std: Number
    source: Literal["handbook", "data", "drawing"]
    unseen: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class BudgetMode:
    """A measured mode in the budget of what a drawing lacks.

    Arguments:
        used: whether the budget was fitted to it.
        error_percent: of the drawing, 100 ln(measured / predicted).
        left_percent: what the budget leaves of it.
        std_percent: deviation of the prediction by all that data and drawing leave open.
    """

    mode: int
    used: bool
    error_percent: Number
    left_percent: Number
    std_percent: Number


@dataclass(frozen=True, slots=True)
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
    measured: Number
    before: Number | None
    after: Number | None


@dataclass(frozen=True, slots=True)
class LookWarning:
    """Something that a plain look at the model finds, before any fit.

    Arguments:
        what: one sentence.
        where: member, section or ``all``.
        effect: slug of the effect that would correct it; empty where there is none.
        changes: from the model's elastic mode number (from 1) to the change of its frequency in
            percent, were it corrected.
    """

    what: str
    where: str
    effect: str
    changes: tuple[tuple[int, Number], ...] = ()


@dataclass(frozen=True, slots=True)
class LocationRow:
    """An indicator of where the error sits, scaled to 1 at its largest.

    Arguments:
        indicator: ``evidence``, ``force-residual``, ``energy-error``, ``ecomac``, ...
        place: member, ``member/k``, joint or sensor label.
    """

    indicator: str
    place: str
    value: Number


@dataclass(frozen=True, slots=True)
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
    chi2: Number
    dof: int
    less_p: Number
    more_p: Number
    factor: Number
    warning: str = ""


@dataclass(frozen=True, slots=True)
class Gain:
    """Frequency errors in percent, before and after: medians, or root mean squares.

    Arguments:
        held_out, modified: None where the case holds none back.
        cross_validated: the same over modes left out in turn, where nothing is held out.
        change: rms change of the frequencies since the reference, as measured and what is left of
            it when that by the causes is taken away; None without a reference.
    """

    used_percent: tuple[Number, Number]
    held_out_percent: tuple[Number, Number] | None = None
    modified_percent: tuple[Number, Number] | None = None
    cross_validated_percent: tuple[Number, Number] | None = None
    change_percent: tuple[Number, Number] | None = None


@dataclass(frozen=True, slots=True)
class ModeChange:
    """A mode of the structure as it is, and the same mode of the reference.

    Arguments:
        change_percent, std_percent: of the frequency; the deviations of both states count.
        mac: of the two shapes, close modes turned; None where they cannot be compared.
        shape_p: probability of as large a difference of the shapes, were it noise.
    """

    mode: int
    reference_mode: int
    reference_hz: Number
    present_hz: Number
    change_percent: Number
    std_percent: Number
    deviations: Number
    mac: Number | None
    shape_p: Number | None


@dataclass(frozen=True, slots=True)
class LoneMode:
    """A mode, by its label, that only one of two measurements has."""

    mode: int
    hz: Number


@dataclass(frozen=True, slots=True)
class ZeroChange:
    """An antiresonance of the structure as it is, and the same one of the reference.

    Arguments:
        response, force: labels of the sensors where motion and force were measured.
        change_percent, deviations: of its frequency; the deviations of both states count.
    """

    response: str
    force: str
    reference_hz: Number
    present_hz: Number
    change_percent: Number
    deviations: Number


@dataclass(frozen=True, slots=True)
class States:
    """Whether two measurements of a structure differ, without a model.

    Arguments:
        verdict: ``differs`` where p < 0.001.
        p: probability of as large a chi-square, were all differences noise.
        chi2, count: of the differences, and how many data it has.
        modes: that both states have.
        lost, new: modes that only the reference, only the present state has, in the band of both.
        mass_change: of the weighed mass, and its deviation, kg; None where one was not weighed.
        zeros: antiresonances that the responses of both states show.
        zeros_p: probability of as large differences of these, were they noise.
    """

    verdict: Literal["differs", "agrees"]
    p: Number
    chi2: Number
    count: int
    modes: tuple[ModeChange, ...]
    lost: tuple[LoneMode, ...] = ()
    new: tuple[LoneMode, ...] = ()
    mass_change: tuple[Number, Number] | None = None
    zeros: tuple[ZeroChange, ...] = ()
    zeros_p: Number | None = None

    @property
    def differs(self) -> bool:
        """Tell whether the structure changed."""
        return self.verdict == "differs"


@dataclass(frozen=True, kw_only=True, slots=True, repr=False)
class DiagnosisReport:
    """What is missing in a model, where, how sure, and what it gains: all that JSON has of it.

    Arguments:
        case: name of the case.
        verdict: see the case for each in docs/diagnosis.md.
        sentence: the verdict in one sentence.
        causes: named effects; with ``ambiguous`` the members of the inseparable group, with
            ``unknown`` and ``not-confirmed`` a best guess, with ``none`` nothing.
        rivals: every other explanation worth a look, most probable first.
        reason: why the members of a group cannot be distinguished; empty without a group.
        advice: measurements that would separate them, best first.
        smallest_visible: one row an effect.
        residuals: every datum.
        gain: medians before and after.
        gain_rms: the same as root mean squares, as `bench run` has them.
        chi2: before and after, in the metric of the noise model.
        data_count: number of data behind chi2.
        adequacy_p: probability of a chi-square as large as the one after.
        nothing: probability that the model lacks nothing.
        looks: what the plain look found.
        locations: where the error sits.
        base: textbook effects that the names rest on, as ``effect`` slugs.
        notes: further remarks, one sentence each.
        seconds: spent.
        evidence: what the data say for the first explanation, and what the prior adds.
        model_error: what the drawing gets wrong, under the first explanation; empty where the
            structure is taken for a beam model.
        like_a_beam: probability that it is one, but for ordinary scatter.
        scatter: whether what is left is as much as the stated deviations let expect.
        states: how the measurement differs from the reference; None without one.
        left_out: effects that were no candidates, and why.
        budget: what the drawing lacks by place and class, largest first; empty with a reference
            and for a model from matrices.
        budget_modes: every measured mode in it.
        provisional: rms before and after with all that the drawing lacks in the model, which is
            then the extended one; None where a name stands alone or unseen data do not confirm it.
        hidden_percent: rms change of the frequencies below which no defect shows next to it.
    """

    case: str = ""
    verdict: Verdict
    sentence: str = ""
    causes: tuple[Cause, ...]
    rivals: tuple[Rival, ...]
    reason: str = ""
    advice: tuple[Advice, ...]
    smallest_visible: tuple[SmallestVisible, ...]
    residuals: tuple[ResidualRow, ...]
    gain: Gain
    gain_rms: Gain
    chi2: tuple[Number, Number] = (math.nan, math.nan)
    data_count: int = 0
    adequacy_p: Number
    nothing: Number = math.nan
    looks: tuple[LookWarning, ...] = ()
    locations: tuple[LocationRow, ...] = ()
    base: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: Number = math.nan
    evidence: tuple[Evidence, ...] = ()
    model_error: tuple[ErrorScale, ...] = ()
    like_a_beam: Number = 1.0
    scatter: tuple[Scatter, ...] = ()
    states: States | None = None
    left_out: tuple[LeftOut, ...] = ()
    budget: tuple[BudgetLine, ...] = ()
    budget_modes: tuple[BudgetMode, ...] = ()
    hidden_percent: Number = math.nan
    provisional: Gain | None = None
