"""Words and figures on the page of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from femubench.reports.cells import NOTHING, plain
from femubench.reports.figures import chance, estimate, figure, signed

Data = Mapping[str, Any]

MEANINGS = {
    "none": "the data show nothing that the model lacks; anything smaller than the sizes listed "
    "below would not have shown",
    "named": "one explanation stands alone, or all that stand share it",
    "ambiguous": "several explanations stand, and these data cannot tell them apart",
    "unknown": "even the best explanation leaves more than noise: something is missing that no "
    "effect in the list describes; the causes below are a guess, not a finding",
    "not-confirmed": "the best explanation fits the data it was found with, and does not help as "
    "it ought to on data held back; the causes below are a guess, not a finding",
}
# A sign of its own for every verdict, so that colour is not needed.
MARKS = {"none": "✓", "named": "●", "ambiguous": "?", "unknown": "✕", "not-confirmed": "!"}
CAUSES = {
    "named": "What is missing",
    "ambiguous": "Candidates, among which these data cannot decide",
    "unknown": "Best guess, which does not explain the data",
    "not-confirmed": "Best guess, which data held back do not confirm",
}
FAULTS = "What is wrong with the data, or was typed in wrongly"
GAINS = {
    "used_percent": "used modes",
    "held_out_percent": "held-out modes",
    "modified_percent": "modified structure",
    "cross_validated_percent": "used modes, each left out in turn",
}
INDICATORS = {
    "force-residual": "forces that the measured shapes would need in the model",
    "energy-error": "strain energy of the error in the constitutive relation",
    "mdlac": "match of the frequency changes with those that a softer element would make",
    "ecomac": "difference of measured and predicted shapes at every sensor",
}
_MOST_CHANGES, _MOST_PLACES = 6, 5
_NOISE, _LIMIT = 0.05, 1e-3
_LARGEST_ODDS = 1e6


def numbered(causes: Sequence[Data], *, faults: bool = False) -> list[tuple[int, Data]]:
    """Return causes, or faults of the data and of what was typed in, with their numbers."""
    sides = ((i, cause, cause.get("side", "model")) for i, cause in enumerate(causes, 1))
    return [(i, cause) for i, cause, side in sides if (side != "model") is faults]


def percent(value: float | None) -> str:
    """Return an error in percent."""
    return NOTHING if value is None else f"{figure(value, 3)} %"


def times(before: float | None, after: float | None) -> str:
    """Return by how much an error fell or rose."""
    if before is None or after is None or min(before, after) <= 0.0:
        return ""
    ratio = before / after
    if 0.95 < ratio < 1.05:
        return "about the same"
    return (
        f"{figure(ratio, 2)} times smaller"
        if ratio > 1.0
        else f"{figure(1 / ratio, 2)} times larger"
    )


def adequacy(data: Data) -> tuple[str, str]:
    """Return in two words, and in a sentence, whether what is left is noise."""
    p = data["adequacy_p"]
    if p is None:
        return NOTHING, "whether it is noise was not tested"
    said = f"noise alone leaves as much with probability {chance(p)}"
    if any(row["less_p"] < _LIMIT for row in data.get("scatter") or () if row["warning"]):
        return "less than noise", f"of the stated size; {said}"
    if p >= _NOISE:
        return "noise", said
    return ("a little more than noise" if p >= _LIMIT else "more than noise"), said


def sentence(clause: str) -> str:
    """Return a clause with a capital and a full stop."""
    text = plain(clause)
    return text and f"{text[0].upper()}{text[1:]}" + ("" if text[-1] in ".!?" else ".")


def place_at(place: str) -> str:
    """Return a place as it follows an effect."""
    return "everywhere" if place == "all" else place


def weight(row: Data) -> str:
    """Return what data and prior say for the first explanation against another one."""
    against = "no cause at all" if row["against"] == "nothing" else plain(row["against"])
    return (
        f"against {against}, the data add {signed(row['data'])} to the logarithm of the odds, "
        f"the prior {signed(row['prior'])}"
    )


def sits(cause: Data) -> str:
    """Return how sure the place of a cause is, and where else it may sit."""
    if cause["place"] == "all" or cause["place_probability"] is None:
        return ""
    text = f"at this place {chance(cause['place_probability'])}"
    more = elsewhere(cause)
    return f"{text}; {more}" if more else text


def elsewhere(cause: Data) -> str:
    """Return how many places mirror that of a cause, and where else it may sit."""
    mirrors = len(cause["mirrors"])
    parts = [f"one of {mirrors + 1} mirror places"] if mirrors else []
    others = [f"{name} {chance(p)}" for name, p in cause["places"] if name != cause["place"]]
    more = len(others) - _MOST_PLACES
    if others and cause["place"] != "all":
        listed = ", ".join(others[:_MOST_PLACES]) + (f" and {more} more" if more > 0 else "")
        parts.append(f"else at {listed}")
    return "; ".join(parts)


def scale(row: Data) -> str:
    """Return the size of a model error with its unit."""
    return f"{figure(row['scale'], 2)} {row['unit']}".strip()


def pairs_of(rival: Data) -> list[tuple[str, str]]:
    """Return effects and places of a combination, each effect beside its place."""
    effects, places = rival["effect"].split(" + "), rival["place"].split(" + ")
    if len(effects) != len(places):
        return [(rival["effect"], rival["place"])]
    return list(zip(effects, places, strict=True))


def pair_at(rival: Data) -> str:
    """Return the effects of a combination, each with its place."""
    return " + ".join(_at(*pair) for pair in pairs_of(rival))


def _at(effect: str, place: str) -> str:
    words = effect.replace("-", " ")
    if place == "all":
        return f"{words} everywhere"
    return f"{words} at {place}" if place else words


def parameter(item: Data) -> str:
    """Return the value of a parameter with its deviation."""
    unit = f" {item['unit']}" if item["unit"] else ""
    return f"{estimate(item['value'], item['std'])}{unit}{_share(item)}"


def _share(item: Data) -> str:
    """Return a relative change in percent."""
    value, std = item["value"], item["std"]
    if item["wording"] != "change" or value is None or not abs(value) < 10.0:
        return ""
    spread = "" if std is None else f" ± {figure(100.0 * std, 2)}"
    return f" ({signed(100.0 * value)}{spread} %)"


def size(item: Data) -> str:
    """Return an effect's size, in percent too where it is a share of something."""
    text = f"{figure(item['size'], 3)} {item['unit']}".strip()
    share = item["wording"] != "value" and item["size"] is not None
    return text + (f" ({figure(100.0 * item['size'], 2)} %)" if share else "")


def width(value: float | None, most: float) -> str:
    """Return the length of a bar in percent of the longest one."""
    return "0" if value is None else f"{min(100.0, 100.0 * abs(value) / (most or 1.0)):.1f}"


def odds(separation: float | None) -> str:
    """Return the odds that a distance in squared standard deviations stands for."""
    if separation is None or separation < 0.0:
        return NOTHING
    against = math.exp(min(separation, 60.0) / 2.0)
    return "over a million to 1" if against > _LARGEST_ODDS else f"{figure(against, 2)} to 1"


def look_changes(look: Data) -> str:
    """Return how the frequencies change if the model is corrected."""
    known = [c for c in look["changes"] if c["percent"] is not None]
    text = ", ".join(f"mode {c['mode']} {signed(c['percent'])} %" for c in known[:_MOST_CHANGES])
    more = len(known) - _MOST_CHANGES
    return f"{text} and {more} more" if more > 0 else text
