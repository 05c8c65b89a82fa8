"""Words on a diagnosis; `data` is all, or an entry, of the JSON of ``bench diagnose``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from femubench.reports.cells import (
    NOTHING,
    chance,
    estimate,
    figure,
    first_of,
    format_signed,
    plain,
)

Data = Mapping[str, Any]

MEANINGS = {
    "none": "the data show nothing beyond noise and what models of this kind get wrong; anything "
    "smaller than the sizes listed below would not have shown",
    "named": "one explanation stands alone, or all that stand share it",
    "ambiguous": "several explanations stand, and these data cannot tell them apart",
    "unknown": "even the best explanation leaves more than noise: something is missing that no "
    "effect in the list describes; the causes below are a guess, not a finding",
    "not-confirmed": "the best explanation fits the data it was found with, and does not help as "
    "it ought to on data held back; the causes below are a guess, not a finding",
}
CAUSES = {
    "named": "What is missing",
    "ambiguous": "Candidates, among which these data cannot decide",
    "unknown": "Best guess, which does not explain the data",
    "not-confirmed": "Best guess, which data held back do not confirm",
}
FAULTS = "What is wrong with the data, or was typed in wrongly"
GAINS = {
    "held_out_percent": "held-out modes",
    "modified_percent": "modified structure",
    "cross_validated_percent": "used modes, each left out in turn",
    "used_percent": "used modes",
    "change_percent": "change since the reference",
}
INDICATORS = {
    "force-residual": "forces that the measured shapes would need in the model",
    "energy-error": "strain energy of the error in the constitutive relation",
    "mdlac": "match of the frequency changes with those that a softer element would make",
    "ecomac": "difference of measured and predicted shapes at every sensor",
}
_MOST_CHANGES, _MOST_PLACES = 8, 5
_FAR = 3.0  # times its error is what a drawing hides at least
_BY_MODE = "percent", "std"
_MOST_LINES, _LEAST_SHARE, _SURE = 4, 0.1, 2.0  # of a budget; of its largest; deviations
_NOISE, _LIMIT = 0.05, 1e-3
_NOTABLE, _MOST_MOVED = 3.0, 3  # deviations; modes
_LARGEST_ODDS = 1e6


def states(found: Data) -> str:
    """Return in a sentence how two measurements differ, or that they agree."""
    modes, p, zeros = found["modes"], figure(found["p"], 2), found["zeros"]
    of_zeros = f"{len(zeros)} antiresonance{'s' * (len(zeros) != 1)}"
    if found["verdict"] == "agrees":
        among = f"in {len(modes)} mode{'s' * (len(modes) != 1)}{f' and {of_zeros}' * bool(zeros)}"
        return f"The two measurements agree {among} (probability {p})."
    rows = sorted(modes, key=lambda row: -abs(row["deviations"] or 0.0))
    changed = [said for row in rows if (said := _changed(row))]
    parts = [first_of(changed, _MOST_MOVED)] if changed else []
    mass, std = found["mass_change"] or (0.0, 0.0)
    if std and abs(mass / std) >= _NOTABLE:
        parts.append(f"the weighed mass {_moved(mass, mass / std, 'kg')}")
    for key, became in (("lost", "of the reference, {} Hz, is gone"), ("new", "at {} Hz is new")):
        alone = [f"mode {m['mode']} {became.format(figure(m['hz']))}" for m in found[key]]
        parts += [first_of(alone, 1)] if alone else []
    if zeros and found["zeros_p"] < _LIMIT:
        most = max(zeros, key=lambda row: abs(row["deviations"]))
        where = f"near {figure(most['present_hz'])} Hz at {most['response']}"
        moved = _moved(most["change_percent"], most["deviations"], "%")
        sure = figure(found["zeros_p"], 2)
        parts.append(f"of {of_zeros} (probability of all {sure}) that {where} {moved}")
        parts += ["the modes agree"] * (len(parts) == 1)
    parts = parts or [f"all data together (probability {p}), no mode alone"]
    rest = "the other agrees" if len(modes) == len(changed) + 1 else "the others agree"
    parts += [rest] if 0 < len(changed) < len(modes) else []
    return f"The two measurements differ: {'; '.join(parts)}."


def budget(data: Data) -> str:
    """Return in a few sentences how far the drawing is off, why, and what that hides."""
    modes, lines = data["budget_modes"], data["budget"]
    used, others = ([m for m in modes if m["used"] is known] for known in (True, False))

    def off(key: str) -> str:
        named = (("the used modes", used), ("the others", others))
        return " and ".join(
            f"{figure(root_mean_square(row[key] for row in rows), 2)} % in {name}"
            for name, rows in named
            if rows
        )

    near = [_of_modes(line, [mode["used"] for mode in modes]) for line in lines]
    least = _LEAST_SHARE * max((abs(line["rms_percent"]) for line in near), default=0.0)
    near.sort(key=lambda line: -abs(line["rms_percent"]))
    large = [x for x in near if abs(x["rms_percent"]) >= max(least, x["rms_std"])]
    sure = [x for x in large if abs(x["rms_percent"]) >= _SURE * x["rms_std"]]
    said = first_of([*map(budget_line, sure)], _MOST_LINES)
    maybe = first_of([budget_line(x) for x in large if x not in sure], _MOST_LINES)
    parts = [f"The drawing is off by {off('error_percent')} (rms)."]
    # Lines of a drawing that is as near as any may cancel each other.
    off_by = root_mean_square(row["error_percent"] for row in used)
    if (sure or maybe) and _FAR * off_by >= (data["hidden_percent"] or 0.0):
        perhaps = f", and perhaps {maybe}" if maybe else ""
        parts.append(f"It lacks {said}{perhaps}." if sure else f"Perhaps it lacks {maybe}.")
    parts.append(f"This leaves {off('left_percent')}.")
    vague = max(others, key=lambda m: m["std_percent"], default=None)
    if vague is not None and vague["std_percent"] >= _SURE * root_mean_square(
        m["std_percent"] for m in used
    ):
        size = figure(vague["std_percent"], 2)
        parts.append(f"Mode {vague['mode']} is predicted to ± {size} % only.")
    hidden = figure(data["hidden_percent"], 2)
    parts.append(f"Next to that no defect shows that moves frequencies by less than {hidden} %.")
    return " ".join(parts)


def _of_modes(line: Data, wanted: Sequence[bool]) -> Data:
    """Return a line of a budget with the figures of some modes alone, as rms over them."""
    sizes, stds = ([v for v, own in zip(line[k], wanted, strict=True) if own] for k in _BY_MODE)
    size = math.copysign(root_mean_square(sizes), sum(sizes))
    return {**line, "rms_percent": size, "rms_std": root_mean_square(stds)}


def budget_line(line: Data) -> str:
    """Return a class of a budget with its place and size."""
    where = "" if line["place"] == "all" else f" at {line['place']}"
    value, std = abs(line["rms_percent"]), line["rms_std"]
    size = estimate(value, std) if std else figure(value, 2)
    sign = "-" if line["rms_percent"] < 0.0 else "+"
    what = {"mesh": "a finer mesh"}.get(line["class"], line["class"])
    return f"{what}{where} ({sign}{size} %)"


def as_drawn(lines: Iterable[Data], least: float) -> list[str]:
    """Return which lines of a budget stay as drawn, and how far off the drawing may be there."""
    small = [x for x in lines if abs(x["rms_percent"]) < least <= x["rms_std"]]
    places: dict[str, list[str]] = {}
    for x in sorted(small, key=lambda x: -x["rms_std"]):
        said = place(x["place"]) if x["place"] == "all" else f"at {x['place']}"
        places.setdefault(x["class"], []).append(f"{said} ± {figure(x['rms_std'], 2)} %")
    found = [f"{kind} {first_of(said, _MOST_LINES)}" for kind, said in places.items()]
    return [f"As drawn, for these modes do not say otherwise: {'; '.join(found)}."] * bool(found)


def root_mean_square(values: Iterable[float]) -> float:
    """Return the root mean square of some numbers, 0 of none."""
    found = [*values]
    return math.sqrt(sum(value**2 for value in found) / max(len(found), 1))


def _changed(row: Data) -> str:
    """Return what became of a mode; nothing where it hardly changed."""
    parts = []
    if abs(row["deviations"] or 0.0) >= _NOTABLE:
        parts.append(_moved(row["change_percent"], row["deviations"], "%"))
    if row["shape_p"] is not None and row["shape_p"] < _LIMIT:
        parts.append(f"changed its shape (MAC {figure(row['mac'], 2)})")
    return f"mode {row['mode']} {' and '.join(parts)}" if parts else ""


def _moved(change: float, deviations: float, unit: str) -> str:
    rose, times = ("rose" if change > 0.0 else "fell"), figure(abs(deviations), 2)
    return f"{rose} by {figure(abs(change), 2)} {unit} ({times} deviations)"


def percent(value: float | None) -> str:
    """Return an error in percent."""
    return NOTHING if value is None else f"{figure(value, 3)} %"


def times(before: float | None, after: float | None) -> str:
    """Return by how much an error fell or rose."""
    if before is None or after is None or min(before, after) <= 0.0:
        return ""
    if 0.95 < before / after < 1.05:
        return "about the same"
    word = "smaller" if before > after else "larger"
    return f"{figure(max(before, after) / min(before, after), 2)} times {word}"


def adequacy(data: Data) -> tuple[str, str]:
    """Return in two words, and in a sentence, whether what is left is noise."""
    p = data["adequacy_p"]
    if p is None:
        return NOTHING, "whether it is noise was not tested"
    said = f"noise alone leaves as much with probability {chance(p)}"
    if any(row["less_p"] < _LIMIT for row in data["scatter"] if row["warning"]):
        return "less than noise", f"of the stated size; {said}"
    if p >= _NOISE:
        return "noise", said
    return ("a little more than noise" if p >= _LIMIT else "more than noise"), said


def chi_square(data: Data) -> str:
    """Return how much is left of the data."""
    before, after = map(figure, data["chi2"])
    error = " and the model error" if data["model_error"] else ""
    return (
        f"Chi-square, with the ordinary scatter of the elements{error} counted as noise: {before} "
        f"before, {after} after, {data['data_count']} data. What is left is "
        f"{': '.join(adequacy(data))}."
    )


def place(name: str) -> str:
    """Return where something sits."""
    return "everywhere" if name == "all" else name


def at(name: str) -> str:
    """Return where something sits, as it follows what it is."""
    return f"at {name}" if name not in ("", "all") else place(name)


def pair_at(rival: Data) -> str:
    """Return the effects of a combination, each with its place."""
    effects, places = rival["effect"].split(" + "), rival["place"].split(" + ")
    if len(effects) != len(places):
        effects, places = [rival["effect"]], [rival["place"]]
    return " + ".join(f"{what} {at(p)}".strip() for what, p in zip(effects, places, strict=True))


def weight(row: Data) -> str:
    """Return what data and prior say for the first explanation against another one."""
    against = "no cause at all" if row["against"] == "nothing" else plain(row["against"])
    return (
        f"Against {against}, the data add {format_signed(row['data'])} to the logarithm of the "
        f"odds, the prior {format_signed(row['prior'])}."
    )


def elsewhere(cause: Data) -> str:
    """Return how many places mirror that of a cause, and where else it may sit."""
    mirrors = len(cause["mirrors"])
    parts = [f"one of {mirrors + 1} mirror places"] if mirrors else []
    others = [f"{name} {chance(p)}" for name, p in cause["places"] if name != cause["place"]]
    if others and cause["place"] != "all":
        parts.append(f"else at {first_of(others, _MOST_PLACES)}")
    return "; ".join(parts)


def parameter(item: Data) -> str:
    """Return the value of a parameter with its deviation, a relative change in percent too."""
    value, std = item["value"], item["std"]
    text = f"{estimate(value, std)} {item['unit']}".strip()
    if item["wording"] != "change" or value is None or not abs(value) < 10.0:
        return text
    spread = "" if std is None else f" ± {figure(100.0 * std, 2)}"
    return f"{text} ({format_signed(100.0 * value)}{spread} %)"


def unit_of(size: Data) -> str:
    """Return the unit of an effect's size; in percent where it is a share of something."""
    if size["wording"] == "value" or size["size"] is None:
        return str(size["unit"])
    return f"{size['unit']} ({figure(100.0 * size['size'], 2)} %)".strip()


def odds(separation: float | None) -> str:
    """Return the odds that a distance in squared standard deviations stands for."""
    if separation is None or separation < 0.0:
        return NOTHING
    against = math.exp(min(separation, 60.0) / 2.0)
    return "over a million to 1" if against > _LARGEST_ODDS else f"{figure(against, 2)} to 1"


def look(found: Data) -> str:
    """Return what is odd about a model, and how the frequencies change if it is corrected."""
    effect = f" ({found['effect']})" if found["effect"] else ""
    changes = [
        f"mode {change['mode']} {format_signed(change['percent'], 2)} %"
        for change in found["changes"]
        if change["percent"] is not None
    ]
    corrected = f" If corrected{effect}: {first_of(changes, _MOST_CHANGES)}." if changes else effect
    return f"{found['what']}{corrected}"


def strongest(rows: Iterable[Data], least: float) -> str:
    """Return where an indicator is largest, and its values."""
    known = [row for row in rows if (row["value"] or 0.0) >= least]
    best = sorted(known, key=lambda row: -row["value"])[:_MOST_PLACES]
    return ", ".join(f"{row['place']} {row['value']:.2f}" for row in best) or NOTHING
