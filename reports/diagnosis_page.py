"""A diagnosis as one HTML page, from the data of ``bench diagnose --json``.

The argument `data` of all functions is what `diagnosis_from_json` gives, or `diagnosis_to_json`.
Files of an earlier version, which hold no structure, give a page without the map.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from markupsafe import Markup

from femubench import InputError
from femubench.plot import (
    MOST_ROWS,
    evidence,
    residual_dots,
    residuals,
    strongest_places,
    svg,
)
from femubench.reports import diagnosis_words as words
from femubench.reports.cells import NOTHING, plain
from femubench.reports.figures import chance, figure, signed
from femubench.reports.templating import asset, templates

Data = Mapping[str, Any]

_MOST_TOP, _MOST_TOLD = 5, 12
_MAP, _SMALL = (4.8, 3.7), (3.4, 2.4)  # inch


def diagnosis_html(data: Data) -> str:
    """Return a diagnosis as a document that needs nothing but itself; it reads without scripts."""
    room = templates().overlay(finalize=_shown)
    room.filters.update(chance=chance, figure=figure, signed=signed)
    indicators = dict.fromkeys(row["indicator"] for row in data["locations"])
    gains = _gains(data)
    titles = {"frequency": "Frequencies", "shape": "Mode shapes, rms over the sensors"}
    panels = [_panel(data, kind, title) for kind, title in titles.items()]
    return room.get_template("diagnosis.html").render(
        data=data,
        words=words,
        style=Markup(asset("page.css") + asset("diagnosis.css")),
        script=Markup(asset("diagnosis.js")),
        tiles=_tiles(data, gains),
        left=words.adequacy(data),
        warnings=[row["warning"] for row in (data.get("scatter") or ()) if row["warning"]],
        gains=gains,
        largest=max(
            [v for pair in gains.values() for v in pair["shown"] if v is not None], default=0.0
        ),
        panels=[panel for panel in panels if panel],
        **_where(data),
        indicators=[
            _indicator(data, name, number)
            for number, name in enumerate(indicators)
            if name != "evidence"
        ],
    )


def _gains(data: Data) -> dict[str, dict[str, Any]]:
    """Return the errors before and after, rms with the median beside it.

    Files of earlier versions have medians alone.
    """
    found = {}
    for key in words.GAINS:
        median, rms = data["gain"][key], (data.get("gain_rms") or {}).get(key)
        if median is not None:
            found[key] = {"shown": rms or median, "median": median if rms else None}
    return found


def _shown(value: object) -> object:
    """Return text on one line, a number and its percent sign together."""
    if isinstance(value, Markup):
        return value
    text = plain(value).replace(" %", "\N{NO-BREAK SPACE}%")
    return text.replace("> ", ">\N{NO-BREAK SPACE}").replace("< ", "<\N{NO-BREAK SPACE}")


def _tiles(data: Data, gains: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Return the figures that matter most, each with a title and what it is."""
    nothing, none = data["nothing"], data["verdict"] == "none"
    sure = nothing if none or nothing is None else 1.0 - nothing
    found = "Nothing is missing" if none else "Something is missing"
    tiles = [(found, chance(sure), "probability, before any name is given")]
    order = ("held_out_percent", "modified_percent", "cross_validated_percent", "used_percent")
    for key in order if not none else ():
        if key in gains:
            before, after = map(words.percent, gains[key]["shown"])
            kind = "rms" if gains[key]["median"] else "median"
            said = f"{kind} frequency error, before → after"
            tiles.append((f"Error on {words.GAINS[key]}", f"{before} → {after}", said))
            break
    tiles.append(("What is left", *words.adequacy(data)))
    tiles += [("Model error", words.scale(row), row["class"]) for row in data["model_error"]]
    return tiles


def _panel(data: Data, kind: Any, title: str) -> dict[str, Any] | None:  # noqa: ANN401
    """Return the residuals of one kind as a drawing; None where there are none."""
    dots = residual_dots(data, kind)
    if not dots:
        return None
    said = "; ".join(f"{dot.name} {dot.text}" for dot in dots[:_MOST_TOLD])
    draw = partial(residuals, data, kind=kind)
    size = 4.6, 1.0 + 0.27 * min(len(dots), MOST_ROWS)
    found = svg(draw, name=f"dots-{kind}", title=title, caption=said, size=size, themed=True)
    return {"title": title, "svg": Markup(found), "hidden": max(0, len(dots) - MOST_ROWS)}


def _where(data: Data) -> dict[str, Any]:
    """Return the map of the evidence with its places."""
    spots = strongest_places(data)
    listed = ", ".join(f"{spot.place} {spot.value:.2f}" for spot in spots[:_MOST_TOP])
    says = f"Evidence by place: {listed}." if listed else "No place stands out."
    return {"map": _map(data, "evidence", "map", "Evidence on the structure", says), "spots": spots}


def _map(data: Data, indicator: str, name: str, title: str, says: str) -> Markup | None:
    """Return the structure with an indicator; None where there is no geometry."""
    whole = indicator == "evidence"
    draw = partial(evidence, data, indicator=indicator, names=whole)
    size = _MAP if whole else _SMALL
    try:
        return Markup(svg(draw, name=name, title=title, caption=says, size=size, themed=True))
    except InputError:
        return None


def _indicator(data: Data, name: str, number: int) -> dict[str, Any]:
    rows = [
        (row["place"], row["value"])
        for row in data["locations"]
        if row["indicator"] == name and row["value"]
    ]
    rows.sort(key=lambda row: -row[1])
    top = ", ".join(f"{place} {value:.2f}" for place, value in rows[:_MOST_TOP]) or NOTHING
    drawn = _map(data, name, f"where-{number}", f"Indicator {name}", f"Highest: {top}.")
    return {"name": name, "top": top, "svg": drawn}
