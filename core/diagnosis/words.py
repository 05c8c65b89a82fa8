"""Verdicts as sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from femubench.core.diagnosis.verdict import Decision
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Cause, CauseParameter, Gain, Region

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")

_LACKS, _NOTHING = "The model lacks", "nothing that the model lacks"
_DIFFERS, _WRONG = "What differs from the reference is", "What the model gets wrong is"


def percent(probability: float) -> str:
    """Return a probability as a percentage that never claims certainty."""
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return f"{100.0 * probability:.3g} %"


def name_cause(cause: Cause) -> str:
    """Return a cause with its place."""
    return f"{cause.effect} at {cause.place}" if cause.place != "all" else cause.effect


def name_region(region: Region) -> str:
    """Return what is different in a region, where and by how much."""
    member, _, joint = region.place.rpartition("@")
    end = f"the end of {member} at {joint}" if member and joint[:2] != "0." else region.place
    what = f"{region.kind} {'everywhere' if end == 'all' else f'at {end}'}"
    if region.size is None or region.std is None:
        return what
    low, high = (max(region.size + k * region.std, 0.0) for k in (-1.0, 1.0))
    if region.unit:
        return f"{what}, {low:.2g} to {high:.2g} {region.unit}"
    return f"{what}, {100.0 * low:.2g} to {100.0 * high:.2g} %"


def _shared_region(options: Sequence[Sequence[Cause]]) -> Region | None:
    """Return the sure region, less than the whole, of the first cause of every option."""
    found = [option[0].region if option else None for option in options]
    sure = [r for r in found if r and r.place != "all" and r.probability >= settings.nearly_all]
    alike = len({(r.place, r.kind) for r in sure}) == 1
    return sure[0] if alike and len(sure) == len(found) else None


def where(cause: Cause) -> str:
    """Return how sure the place of a cause is; nothing for what is everywhere."""
    p = cause.place_probability
    if cause.place == "all" or not math.isfinite(p):
        return ""
    mirror = _mirrors(cause)
    return f"{percent(p)}, {mirror}" if mirror else percent(p)


def _mirrors(cause: Cause) -> str:
    count = len(cause.mirrors) + 1
    number = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    return f"one of {number} mirror places" if count > 1 else ""


def join_names(names: Iterable[str], last: str = "and") -> str:
    """Return names as in a sentence."""
    unique = tuple(dict.fromkeys(names))
    if len(unique) < 2:
        return "".join(unique)
    return f"{', '.join(unique[:-1])} {last} {unique[-1]}"


def sentence_of(
    decision: Decision,
    causes: Sequence[Cause],
    options: Sequence[Sequence[Cause]],
    probability: float,
    gain: Gain,
    *,
    reference: bool = False,
    agrees: bool = True,
) -> str:
    """Return the verdict in one sentence.

    Arguments:
        decision: what was decided.
        causes: named, or best guess.
        options: the causes of every explanation that stands.
        probability: of the first name.
        gain: before and after, as root mean squares.
        reference: whether it is what differs from a reference that was sought.
        agrees: whether the used frequencies are those of the model, but for noise.
    """
    names = join_names(name_cause(cause) for cause in causes)
    if decision.verdict == "none":
        nothing = "nothing that differs from the reference" if reference else _NOTHING
        # Where the measurements agree, no explanation of a difference has a probability.
        sure = f" (probability {percent(decision.nothing)})" if decision.nothing > 0.5 else ""
        if not (reference or agrees):
            off = f"The model is {gain.used_percent[0]:.2g} % off in the used modes (rms)"
            return f"{off}, and no hidden defect shows beyond what drawings of its kind lack{sure}."
        return f"The data show {nothing}{sure}."
    if decision.verdict == "named":
        lacks = _DIFFERS if reference else _LACKS
        sure = _sure(probability, causes) + "; unconfirmed" * decision.unconfirmed
        open_ = ", and these data cannot tell what else" * bool(decision.shared)
        return f"{lacks} {names} ({sure}){open_}{_gain(gain)}."
    if decision.verdict == "ambiguous":
        return _either(options, reference)
    guess = f"; the nearest is {names}" if causes else ""
    if decision.verdict == "unknown":
        if reference and not causes:
            return (
                "The structure differs from the reference; no cause in the catalogue explains it."
            )
        wrong = "what differs from the reference" if reference else "what the model gets wrong"
        return f"No known effect explains {wrong}{guess}."
    return f"What fits the used data best does not hold on data that it has not seen{guess}."


def _sure(probability: float, causes: Sequence[Cause]) -> str:
    """Return the sizes, how sure the name is, and how sure every place."""
    alone = len(causes) == 1
    sized = [(cause, ", ".join(map(_size, _fitted(cause)))) for cause in causes]
    sizes = [text if alone else f"{cause.effect}: {text}" for cause, text in sized if text]
    placed = [(cause, where(cause)) for cause in causes]
    words = [
        f"{'its place' if alone else f'the place of {cause.effect}'} {text}"
        for cause, text in placed
        if text
    ]
    return "; ".join([*sizes, f"probability {percent(probability)}", *words])


def _fitted(cause: Cause) -> list[CauseParameter]:
    """Return the sizes that were fitted; none where they are too many for a sentence."""
    fitted = [p for p in cause.parameters if p.std and math.isfinite(p.value + p.std)]
    return fitted if len(fitted) <= settings.of_a_kind else []


def _size(item: CauseParameter) -> str:
    """Return a fitted size to the second digit of its deviation; a ratio in percent."""
    ratio = item.wording != "value"
    value, std = (float(v or 0.0) * (100.0 if ratio else 1.0) for v in (item.value, item.std))
    last = math.floor(math.log10(std)) - 1
    if -6 <= last <= 6:
        digits = max(0, -last)
        sizes = [f"{round(v, -last):.{digits}f}" for v in (value, std)]
    else:
        sizes = [f"{value:.4g}", f"{std:.2g}"]
    sign = "+" * (item.wording == "change" and value > 0.0)
    name = item.name.removeprefix("change of ")
    return f"{name} {sign}{' ± '.join(sizes)} {'%' if ratio else item.unit}".strip()


def _either(options: Sequence[Sequence[Cause]], reference: bool) -> str:
    """Return what all options share, and what they leave open."""
    sets = [dict.fromkeys(name_cause(cause) for cause in option) for option in options]
    common = [name for name in sets[0] if all(name in other for other in sets)]
    mirrored = {name_cause(c): f" ({_mirrors(c)})" if c.mirrors else "" for c in options[0]}
    rest = [" with ".join(n for n in names if n not in common) for names in sets]
    open_ = join_names((words or "nothing more" for words in rest), "or")
    if common:
        shared = join_names(f"{name}{mirrored[name]}" for name in common)
        lacks = _DIFFERS if reference else _LACKS
        return f"{lacks} {shared}, and these data cannot tell what else: {open_}."
    if region := _shared_region(options):
        sure = f"probability {percent(region.probability)}"
        stated = f"{_DIFFERS if reference else _WRONG} {name_region(region)} ({sure})"
        return f"{stated}; these data cannot tell whether it is {open_}."
    something = "Something differs from the reference" if reference else f"{_LACKS} something"
    return f"{something}, and these data cannot tell which: {open_}."


def words_of_provisional(gain: Gain) -> str:
    """Return what a model gains that has all that its drawing lacks, while no name is sure."""
    said = f"Provisional, with all that the drawing lacks in the model{_gain(gain)}."
    return said.replace("model; ", "model: ")


def _gain(gain: Gain) -> str:
    if gain.change_percent is not None and gain.change_percent[0] > 0.0:
        change, left = gain.change_percent
        share = 100.0 * (1.0 - left / change)
        return f"; of the change in frequencies, {change:.3g} % rms, it explains {share:.0f} %"
    for label, pair in (
        ("held-out modes", gain.held_out_percent),
        ("modified structure", gain.modified_percent),
        ("modes left out in turn", gain.cross_validated_percent),
    ):
        if pair is not None:
            turn = "falls" if pair[1] <= pair[0] else "rises"
            return f"; the rms error on {label} {turn} from {pair[0]:.3g} to {pair[1]:.3g} %"
    return ""
