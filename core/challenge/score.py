"""Judge an answer to a blind case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from femubench.core.challenge.answer import Answer, AnswerParameter
from femubench.core.challenge.structures import structure_named
from femubench.core.challenge.truth import HiddenCause, Truth
from femubench.core.effect.places import Places
from femubench.core.fem.frame import Frame, split_half

TOO_SMALL = 12.0  # of chi-square: what lowers it by less cannot be seen
# More names than this are no answer: among 20 effects, such a group is right by itself.
LARGEST_GROUP = 6

Parts = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class SizeError:
    """An answered size and the true one.

    Arguments:
        effect, name, unit: of the parameter.
        true, stated: values.
        deviations: (stated - true) / std; None where no std was stated.
    """

    effect: str
    name: str
    unit: str
    true: float
    stated: float
    deviations: float | None

    @classmethod
    def of(cls, effect: str, true: float, unit: str, stated: AnswerParameter) -> SizeError:
        """Return how far a stated parameter is from the true value."""
        off = (stated.value - true) / stated.std if stated.std else None
        return cls(effect, stated.name, unit, true, stated.value, off)


@dataclass(frozen=True)
class Judgement:
    """What an answer is worth.

    Arguments:
        right: whether verdict and names are right; a group that holds the truth counts.
        names: whether all names are right; None where there was nothing to name.
        places: whether a right name also has the right place; None likewise.
        group: number of names in the answer's group, 0 without a group.
        found: number of true causes among the names.
        too_small: whether what is hidden lowers chi-square too little to be seen.
        false_alarm: whether anything but `none` was said of a model that lacks nothing.
        sizes: of causes whose name and place are right.
        reason: one sentence.
    """

    right: bool
    names: bool | None
    places: bool | None
    group: int
    found: int
    too_small: bool
    false_alarm: bool
    sizes: tuple[SizeError, ...]
    reason: str


def judge_answer(truth: Truth, answer: Answer, delta_chi2: Sequence[float]) -> Judgement:
    """Judge an answer.

    `none` is right where nothing is hidden, or nothing that can be seen. A name is right when it
    holds every visible cause and no other; with ``ambiguous``, when one member of the group does.
    For a cause outside the catalogue ``unknown`` and ``not-confirmed`` are right, and for a sensor
    that is wrong a fault of the data and no cause.

    Arguments:
        truth: what is hidden.
        answer: what is said.
        delta_chi2: by how much every true cause lowers chi-square given the others, one a
            cause; for a cause outside the catalogue by how much it raises it.
    """
    if truth.outside:
        too_small = min(delta_chi2, default=0.0) < TOO_SMALL
        right = answer.verdict in ("unknown", "not-confirmed")
        right = right or (too_small and answer.verdict == "none")
        in_data = bool(answer.causes) and all(cause.side == "data" for cause in answer.causes)
        right = right or (in_data and truth.outside.startswith("sensor"))
        reason = "the cause is outside the catalogue"
        reason = reason if right else f"{reason}, but it says {_said(answer)}"
        return Judgement(right, None, None, group_size(answer), 0, too_small, False, (), reason)
    group = group_size(answer)
    if not truth.causes:
        right = answer.verdict == "none"
        reason = "nothing is hidden" if right else f"nothing is hidden, but it says {_said(answer)}"
        alarm = answer.verdict != "none"
        return Judgement(right, None, None, group, 0, False, alarm, (), reason)
    frame = structure_named(truth.structure).frame
    pairs = list(zip(truth.causes, delta_chi2, strict=True))
    visible = frozenset(cause.effect for cause, delta in pairs if delta >= TOO_SMALL)
    every = frozenset(cause.effect for cause in truth.causes)
    possible = candidates(answer)
    named = [parts for parts in possible if parts and visible <= _effects(parts) <= every]
    if answer.verdict == "ambiguous":
        # The group as one: each visible cause is an entry of what these data cannot tell apart.
        whole = tuple(part for parts in possible if len(parts) == 1 for part in parts)
        among = tuple(part for part in whole if part[0] in every)
        named += [among] if among and visible <= _effects(among) else []
    placed = [parts for parts in named if _sit_right(frame, parts, truth.causes)]
    found = len(every & frozenset(effect for parts in possible for effect, _ in parts))
    too_small = not visible
    if answer.verdict == "none":
        reason = "too small to see" if too_small else f"it misses {truth}"
        names = None if too_small else False
        return Judgement(too_small, names, names, 0, 0, too_small, False, (), reason)
    names, places = bool(named), bool(placed)
    sizes = _sizes(frame, answer, truth.causes) if places else ()
    if group > LARGEST_GROUP:
        names = places = False
        reason = f"a group of {group} names says nothing"
    elif names:
        reason = "name and place are right" if places else f"the place is wrong: it is {truth}"
    else:
        reason = f"it says {_said(answer)}; hidden is {truth}"
    return Judgement(names, names, places, group, found, too_small, False, sizes, reason)


def candidates(answer: Answer) -> tuple[Parts, ...]:
    """Return every set of causes that the answer takes for possible."""
    if answer.verdict == "ambiguous":
        faults = faults_in(answer)
        return tuple(faults + cause.parts for cause in answer.causes if cause.side == "model")
    if answer.verdict == "named":
        return (tuple(part for cause in answer.causes for part in cause.parts),)
    return ()


def faults_in(answer: Answer) -> Parts:
    """Return the faults of data and input that an answer names, whatever it says of the model."""
    faults = (cause for cause in answer.causes if cause.side != "model")
    return tuple(part for cause in faults for part in cause.parts)


def _effects(parts: Parts) -> frozenset[str]:
    return frozenset(effect for effect, _ in parts)


def group_size(answer: Answer) -> int:
    """Return the number of different names in the answer's group; 0 without one."""
    if answer.verdict != "ambiguous":
        return 0
    return len({_effects(cause.parts) for cause in answer.causes if cause.side == "model"})


def _sit_right(frame: Frame, parts: Parts, causes: Sequence[HiddenCause]) -> bool:
    """Tell whether every effect named sits where it truly sits."""
    return all(
        any(effect == cause.effect and Places(frame).match(place, cause.place) for cause in causes)
        for effect, place in parts
    )


def _sizes(frame: Frame, answer: Answer, causes: Sequence[HiddenCause]) -> tuple[SizeError, ...]:
    """Return true and stated sizes wherever effect and place are right.

    What is stated of half an element is no size of the whole one.
    """
    return tuple(
        SizeError.of(cause.effect, value, unit, parameter)
        for cause in causes
        for said in answer.causes
        if said.effect == cause.effect and Places(frame).match(said.place, cause.place)
        if not split_half(said.place)[1]
        for name, value, unit in zip(cause.names, cause.values, cause.units, strict=True)
        for parameter in said.parameters
        if parameter.name == name
    )


def _said(answer: Answer) -> str:
    names = ", ".join(dict.fromkeys(cause.effect for cause in answer.causes))
    return f"{answer.verdict} ({names})" if names else answer.verdict
