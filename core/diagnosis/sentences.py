"""Verdicts as sentences."""

from __future__ import annotations

from collections.abc import Sequence

from femubench.core.diagnosis.result import Cause, Gain, Verdict


def percent(probability: float) -> str:
    """Return a probability as a percentage that never claims certainty."""
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return f"{100.0 * probability:.3g} %"


def named(cause: Cause) -> str:
    """Return a cause, or several as one, with places."""
    pairs = zip(cause.effect.split(" + "), cause.place.split(" + "), strict=True)
    return " with ".join(f"{e} at {p}" if p != "all" else e for e, p in pairs)


def listed(names: Sequence[str], last: str = "and") -> str:
    """Return names as in a sentence."""
    names = tuple(dict.fromkeys(names))
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {last} {names[-1]}"


def sentence_of(
    verdict: Verdict, causes: Sequence[Cause], nothing: float, probability: float, gain: Gain
) -> str:
    """Return the verdict in one sentence.

    Arguments:
        verdict: what was decided.
        causes: named, or best guess.
        nothing: probability that nothing is missing.
        probability: of the name.
        gain: before and after.
    """
    names = listed([named(cause) for cause in causes])
    if verdict == "none":
        return f"The data show nothing that the model lacks (probability {percent(nothing)})."
    if verdict == "named":
        return f"The model lacks {names} (probability {percent(probability)}){_gain(gain)}."
    if verdict == "ambiguous":
        options = listed([named(cause) for cause in causes], "or")
        return f"The model lacks something, and these data cannot tell which: {options}."
    guess = f"; the nearest is {names}" if causes else ""
    if verdict == "unknown":
        return f"No known effect explains what the model gets wrong{guess}."
    return f"What fits the used data best does not hold on data that it has not seen{guess}."


def _gain(gain: Gain) -> str:
    for label, pair in (
        ("held-out modes", gain.held_out_percent),
        ("modified structure", gain.modified_percent),
        ("modes left out in turn", gain.cross_validated_percent),
    ):
        if pair is not None:
            return f"; the error on {label} falls from {pair[0]:.3g} to {pair[1]:.3g} %"
    return ""
