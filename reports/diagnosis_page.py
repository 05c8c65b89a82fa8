"""A diagnosis as one HTML page, from the data of ``bench diagnose --json``.

The argument `data` of all functions is what `diagnosis_from_json` gives, or `diagnosis_to_json`.
Files of an earlier version, which hold no structure, give a page without the map.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib.resources import files
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
from femubench.reports.cells import NOTHING, plain
from femubench.reports.diagnosis_words import (
    CAUSES,
    GAINS,
    INDICATORS,
    MARKS,
    MEANINGS,
    adequacy,
    change,
    look_changes,
    odds,
    pair_at,
    parameter_rows,
    percent,
    place_at,
    sentence,
    times,
)
from femubench.reports.figures import chance, figure, signed
from femubench.reports.templating import templates

Data = Mapping[str, Any]

_MOST_DATA, _MOST_ADVICE, _MOST_TOP, _MOST_TOLD = 2000, 8, 5, 12
_MAP, _SMALL = (4.8, 3.7), (3.4, 2.4)  # inch


def diagnosis_html(data: Data) -> str:
    """Return a diagnosis as a document that needs nothing but itself; it reads without scripts."""

    room = templates("page/assets", finalize=_shown)
    page = room.get_template("diagnosis.html")
    return page.render(
        style=_asset("diagnosis.css"),
        script=_asset("diagnosis.js"),
        **_head(data),
        **_fit(data),
        **_where(data),
        **_explanations(data),
        **_rest(data),
    )


def _shown(value: object) -> object:
    """Return text on one line, a number and its percent sign together."""
    if isinstance(value, Markup):
        return value
    text = plain(value).replace(" %", "\N{NO-BREAK SPACE}%")
    return text.replace("> ", ">\N{NO-BREAK SPACE}").replace("< ", "<\N{NO-BREAK SPACE}")


def _asset(name: str) -> Markup:
    """Return one of our own files as it is."""
    return Markup(files("femubench.reports").joinpath("page/assets", name).read_text("utf-8"))


def _head(data: Data) -> dict[str, Any]:
    nothing = data["nothing"]
    missing = None if nothing is None else 1.0 - nothing
    found, sure = (
        ("Nothing is missing", nothing)
        if data["verdict"] == "none"
        else ("Something is missing", missing)
    )
    tiles = [(found, chance(sure), "probability, before any name is given")]
    for key in ("held_out_percent", "modified_percent", "cross_validated_percent", "used_percent"):
        pair = data["gain"][key]
        if pair is not None and data["verdict"] != "none":
            text = f"{percent(pair[0])} → {percent(pair[1])}"
            tiles.append((f"Error on {GAINS[key]}", text, "median frequency error, before → after"))
            break
    left, said = adequacy(data)
    return {
        "case": data["case"],
        "verdict": data["verdict"],
        "mark": MARKS[data["verdict"]],
        "meaning": MEANINGS[data["verdict"]],
        "sentence": data["sentence"] or f"The verdict is {data['verdict']}.",
        "tiles": [*tiles, ("What is left", left, said)],
        "base": ", ".join(data["base"]),
    }


def _fit(data: Data) -> dict[str, Any]:
    """Return gains and residuals."""
    pairs = [(GAINS[key], data["gain"][key]) for key in GAINS if data["gain"][key] is not None]
    most = max([v for _, pair in pairs for v in pair if v is not None], default=0.0) or 1.0
    gains = [
        {
            "title": title,
            "bars": [
                {"kind": kind, "text": percent(value), "width": _width(value, most)}
                for kind, value in zip(("before", "after"), pair, strict=True)
            ],
            "times": times(*pair),
        }
        for title, pair in pairs
    ]
    panels = [
        _panel(data, "frequency", "Frequencies"),
        _panel(data, "shape", "Mode shapes, rms over the sensors"),
    ]
    rows = data["residuals"]
    return {
        "gains": gains,
        "panels": [panel for panel in panels if panel],
        "residuals": [_residual(row) for row in rows[:_MOST_DATA]],
        "hidden_residuals": max(0, len(rows) - _MOST_DATA),
        "chi2": [figure(value) for value in data["chi2"]],
        "data_count": data["data_count"],
    }


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


def _width(value: float | None, most: float) -> str:
    return "0" if value is None else f"{min(100.0, 100.0 * abs(value) / most):.1f}"


def _residual(row: Data) -> list[tuple[str, float | None]]:
    """Return the cells of a datum: text and what to sort by."""
    mode = NOTHING if row["mode"] is None else str(row["mode"])
    return [
        (mode, row["mode"]),
        (row["kind"], None),
        (row["sensor"], None),
        (figure(row["measured"], 6), row["measured"]),
        (signed(row["before"]), row["before"]),
        (signed(row["after"]), row["after"]),
    ]


def _where(data: Data) -> dict[str, Any]:
    """Return the map of the evidence and the other indicators."""
    spots = strongest_places(data)
    listed = ", ".join(f"{spot.place} {spot.value:.2f}" for spot in spots[:_MOST_TOP])
    says = f"Evidence by place: {listed}." if listed else "No place stands out."
    indicators = dict.fromkeys(row["indicator"] for row in data["locations"])
    return {
        "map": _map(data, "evidence", "map", "Evidence on the structure", says),
        "spots": [
            {"place": s.place, "value": f"{s.value:.2f}", "width": _width(s.value, 1.0)}
            | {"causes": s.causes, "level": s.level}
            for s in spots
        ],
        "indicators": [
            _indicator(data, name, number)
            for number, name in enumerate(indicators)
            if name != "evidence"
        ],
    }


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
    return {"name": name, "means": INDICATORS.get(name, ""), "top": top, "svg": drawn}


def _explanations(data: Data) -> dict[str, Any]:
    """Return causes, the group, what would split it, and the rivals."""
    causes = [
        {
            "effect": cause["effect"].replace("-", " "),
            "slug": cause["effect"],
            "place": place_at(cause["place"]),
            "summary": sentence(cause["summary"]),
            "chance": chance(cause["probability"]),
            "width": _width(cause["probability"], 1.0),
            "parameters": parameter_rows(cause),
        }
        for cause in data["causes"]
    ]
    advice = [
        {"text": item["measurement"], "size": figure(item["separation"], 3)}
        | {"odds": odds(item["separation"])}
        for item in data["advice"][:_MOST_ADVICE]
    ]
    rivals = [
        [
            (pair_at(rival), None),
            (chance(rival["probability"]), rival["probability"]),
            (figure(rival["delta_chi2"]), rival["delta_chi2"]),
            (NOTHING if rival["angle"] is None else f"{rival['angle']:.1f}", rival["angle"]),
        ]
        for rival in data["rivals"]
    ]
    return {
        "causes_title": CAUSES.get(data["verdict"], "Causes"),
        "causes": causes,
        "reason": sentence(data["reason"]),
        "advice": advice,
        "hidden_advice": max(0, len(data["advice"]) - _MOST_ADVICE),
        "rivals": rivals,
    }


def _rest(data: Data) -> dict[str, Any]:
    visible = [
        [
            (item["effect"].replace("-", " "), None),
            (place_at(item["place"]), None),
            (f"{figure(item['size'], 3)} {item['unit']}".strip() + change(item), item["size"]),
        ]
        for item in data["smallest_visible"]
    ]
    looks = [
        {"what": look["what"], "where": place_at(look["where"]), "effect": look["effect"]}
        | {"changes": look_changes(look)}
        for look in data["looks"]
    ]
    return {
        "visible": visible,
        "looks": looks,
        "notes": data["notes"],
        "written": data.get("written") or "",
        "version": data.get("version") or "",
        "seconds": figure(data["seconds"], 2),
    }
