"""What was found on a structure, as every drawing shows it: causes, and what an update changed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from femubench.core.case.case import Case
from femubench.core.drawing.places import (
    DrawnPlace,
    PlacedWireframe,
    PlaceKind,
    Span,
    find_wireframe,
)
from femubench.core.drawing.wireframe import Point
from femubench.core.effect.places import split_direction
from femubench.core.fem.model import Model

Symbol = Literal["change", "spring", "mass", "fault"]
Data = Mapping[str, Any]
_Where = tuple[str, PlaceKind, tuple[Span, ...], tuple[Point, ...]]

_BETWEEN = "; "  # the places of one parameter, as results have them
_MOST_WORDS = 2000  # of an update; more places are no picture
_MOST_LABEL = 3  # parameters that the label of one place names
_CHANGE = "change of "
_SYMBOLS: tuple[tuple[str, Symbol], ...] = (
    *(("kg", "mass"), ("N/m", "spring"), ("N m/rad", "spring")),
)


@dataclass(frozen=True, slots=True)
class Finding(DrawnPlace):
    """Something at a place of a structure.

    Arguments:
        symbol: what kind of thing it is: a ``spring``, a ``mass``, a ``fault`` of the data; else a
            ``change`` of what is there.
        label: what it is, in a few words: ``"E +5.6 %"``.
        value: the relative change; None where it is no such thing.
        probability: of a cause; None for what an update reports.
        number: of a cause in its list, from 1; 0 for what an update reports.
    """

    symbol: Symbol = "change"
    label: str = ""
    value: float | None = None
    probability: float | None = None
    number: int = 0


def causes_found(data: Data, structure: PlacedWireframe) -> list[Finding]:
    """Return the causes of a diagnosis where they sit, and the faults of its data."""
    found = []
    for number, cause in enumerate(data["causes"], 1):
        place, fault = structure.place(cause["place"]), cause.get("side", "model") != "model"
        changes = [p["value"] for p in cause["parameters"] if p.get("wording") == "change"]
        symbol = "fault" if fault else symbol_of(p["unit"] for p in cause["parameters"])
        value = changes[0] if len(changes) == 1 and not fault else None
        label = str(cause.get("summary") or cause["effect"]) if fault else _cause_label(cause)
        finding = Finding(place.place, place.kind, place.spans, place.points, symbol, label, value)
        found.append(replace(finding, probability=cause["probability"], number=number))
    return found


def lacks_found(data: Data, structure: PlacedWireframe) -> list[Finding]:
    """Return the budget of a diagnosis where its lines sit, one finding a place."""
    found: dict[str, list[Data]] = {}
    for row in data["budget"]:
        found.setdefault(row["place"], []).append(row)
    findings = []
    for word, rows in found.items():
        at = structure.place(word)
        said = ", ".join(f"{row['class']} {percent(row['rms_percent'] / 100.0)}" for row in rows)
        label = f"{'everywhere' if at.kind == 'all' else word}: {said}"
        value = max((row["rms_percent"] for row in rows), key=abs) / 100.0
        findings.append(Finding(word, at.kind, at.spans, at.points, label=label, value=value))
    return findings


def changes_found(source: Case | Model, parameters: Sequence[Data]) -> list[Finding]:
    """Return what an update changed at each place; what stayed as it was is left out.

    Arguments:
        parameters: of the update, as a result has them: name, before, after, unit, places.
    """
    changed = [item for item in parameters if item["after"] != item["before"]]
    words = {word for item in changed for word in _words(item)}
    if len(words) > _MOST_WORDS:
        words = set()
    structure = find_wireframe(source, sorted(words))
    places = {place.place: place for place in structure.places}
    groups: dict[_Where, list[Data]] = {}
    for item in changed:
        own = [places[word] for word in _words(item) if word in places]
        spans = tuple(span for place in own for span in place.spans)
        kind = own[0].kind if own else "elsewhere"
        points = tuple(point for place in own for point in place.points)
        # Of an outline every two are a line.
        points = points if kind == "outline" else tuple(dict.fromkeys(points))
        where = _BETWEEN.join(dict.fromkeys(split_direction(place.place)[0] for place in own))
        groups.setdefault((where, kind, spans, points), []).append(item)
    found = []
    for place, items in groups.items():
        values = [value for item in items if (value := relative_change(item)) is not None]
        more = len(items) - _MOST_LABEL
        label = ", ".join(_estimate_label(item) for item in items[:_MOST_LABEL])
        label += f" and {more} more" if more > 0 else ""
        symbol = symbol_of(item["unit"] for item in items)
        found.append(Finding(*place, symbol, label, max(values, key=abs, default=None)))
    return found


def _words(item: Data) -> list[str]:
    return [word for word in str(item.get("places") or "").split(_BETWEEN) if word]


def symbol_of(units: Iterable[str]) -> Symbol:
    """Return what kind of thing has parameters in such units."""
    listed = list(units)
    return next((symbol for unit, symbol in _SYMBOLS if unit in listed), "change")


def relative_change(item: Data) -> float | None:
    """Return by how much a parameter changed, in its nominal value; None where it had none.

    Arguments:
        item: name, before, after and unit of a parameter.
    """
    before, after = item["before"], item["after"]
    if before is None or after is None or not (math.isfinite(before) and math.isfinite(after)):
        return None
    if str(item["name"]).rpartition(": ")[2].startswith(_CHANGE) and not item["unit"]:
        return float(after - before)
    # A length that changes its sign is no stiffness that fell by more than all of it.
    return float(after / before - 1.0) if before * after > 0.0 else None


def _estimate_label(item: Data) -> str:
    change = relative_change(item)
    name = str(item["name"]).rpartition(": ")[2].removeprefix(_CHANGE)
    if change is not None and symbol_of([item["unit"]]) == "change":
        return f"{name} {percent(change)}"
    return f"{name} {_size(item['after'], item['unit'])}"


def _cause_label(cause: Data) -> str:
    several = len(cause["parameters"]) > 1
    stated = []
    for item in cause["parameters"]:
        wording, name = item.get("wording", "value"), str(item["name"])
        if item["value"] is None:
            continue
        if item.get("textbook"):
            stated.append("textbook value")
        elif wording == "value":
            size = _size(item["value"], item["unit"])
            stated.append(f"{name} {size}" if several else size)
        elif wording == "share":
            stated.append(f"{name} {100.0 * item['value']:.2g} %")
        else:
            stated.append(f"{name.removeprefix(_CHANGE)} {percent(item['value'])}")
            if not several:
                return stated[0]
    effect = str(cause["effect"]).replace("-", " ")
    return f"{effect} {', '.join(dict.fromkeys(stated))}".strip()


def _size(value: float, unit: str) -> str:
    text = f"{value:.3g}"
    text = f"{float(text):.0f}" if "e" in text and 1.0 <= abs(value) < 1e7 else text
    text = text.replace("e+", "e").replace("e0", "e")
    return f"{text} {unit}".strip().replace("-", "\N{MINUS SIGN}", 1)


def percent(change: float) -> str:
    """Return a relative change with its sign, to two digits."""
    share = 100.0 * change
    decimals = 0 if abs(share) >= 9.95 else 1 if abs(share) >= 0.995 else 2
    return f"{share:+.{decimals}f} %".replace("-", "\N{MINUS SIGN}")
