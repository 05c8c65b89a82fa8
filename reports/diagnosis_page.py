"""A diagnosis as one HTML page, from the data of ``bench diagnose --json``.

The argument `data` of all functions is what `diagnosis_from_json` gives, or `diagnosis_to_json`.
Files of an earlier version, which hold no structure, give a page without the map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from femubench.reports.cells import NOTHING, plain
from femubench.reports.diagnosis_charts import MOST_ROWS, dots, frequency_rows, shape_rows
from femubench.reports.diagnosis_map import Spot, level, structure_map
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

_MOST_SPOTS, _MOST_DATA, _MOST_ADVICE, _MOST_TOP = 14, 2000, 8, 5
_LEAST = 0.005  # what two decimals show


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
    panels = []
    for title, rows, one_sided in (
        ("Frequencies", frequency_rows(data), False),
        ("Mode shapes, rms over the sensors", shape_rows(data), True),
    ):
        if rows:
            name = "Residuals of shapes" if one_sided else "Residuals of frequencies"
            anchor = f"dots-{int(one_sided)}"
            svg = dots(rows, one_sided=one_sided, name=name, anchor=anchor)
            panels.append({"title": title, "svg": svg, "hidden": max(0, len(rows) - MOST_ROWS)})
    residuals = data["residuals"]
    return {
        "gains": gains,
        "panels": panels,
        "residuals": [_residual(row) for row in residuals[:_MOST_DATA]],
        "hidden_residuals": max(0, len(residuals) - _MOST_DATA),
        "chi2": [figure(value) for value in data["chi2"]],
        "data_count": data["data_count"],
    }


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
    structure = data.get("structure")
    spots = [] if data["verdict"] == "none" else _spots(data)
    listed = ", ".join(f"{spot.place} {spot.value:.2f}" for spot in spots[:5])
    says = f"Evidence by place: {listed}." if listed else "No place stands out."
    drawn = _drawn(structure, spots, "Evidence on the structure", says, "map")
    return {
        "map": drawn,
        "spots": [
            {"place": s.place, "value": f"{s.value:.2f}", "width": _width(s.value, 1.0)}
            | {"causes": s.causes, "level": level(s.value)}
            for s in spots
        ],
        "indicators": [
            _indicator(name, rows, structure, number)
            for number, (name, rows) in enumerate(_by_indicator(data).items())
            if name != "evidence"
        ],
    }


def _drawn(
    structure: Data | None, spots: Sequence[Spot], name: str, says: str, anchor: str
) -> Markup | None:
    if structure is None:
        return None
    names = anchor == "map"
    return structure_map(structure, spots, name=name, says=says, anchor=anchor, names=names)


def _by_indicator(data: Data) -> dict[str, list[Spot]]:
    """Return the places of every indicator, strongest first."""
    found: dict[str, list[Spot]] = {}
    for row in data["locations"]:
        value = min(1.0, max(0.0, row["value"] or 0.0))
        found.setdefault(row["indicator"], []).append(Spot(row["place"], value))
    return {name: sorted(rows, key=lambda spot: -spot.value) for name, rows in found.items()}


def _spots(data: Data) -> list[Spot]:
    """Return the places with evidence, strongest first, with the numbers of the causes there."""
    causes: dict[str, list[str]] = {}
    for number, cause in enumerate(data["causes"], 1):
        causes.setdefault(cause["place"], []).append(str(number))
    evidence = {spot.place: spot.value for spot in _by_indicator(data).get("evidence", ())}
    for place in causes:
        evidence.setdefault(place, 0.0)
    ranked = sorted(evidence, key=lambda place: -evidence[place])
    kept = [p for p in ranked[:_MOST_SPOTS] if evidence[p] >= _LEAST]
    kept += [place for place in causes if place not in kept]
    return [Spot(place, evidence[place], ", ".join(causes.get(place, ()))) for place in kept]


def _indicator(
    name: str, rows: Sequence[Spot], structure: Data | None, number: int
) -> dict[str, Any]:
    known = [spot for spot in rows if spot.value >= _LEAST]
    top = ", ".join(f"{spot.place} {spot.value:.2f}" for spot in known[:_MOST_TOP]) or NOTHING
    # Single elements and joints say more than the member that holds them.
    fine = [spot for spot in known if "/" in spot.place] or known
    points = known if fine is known else [*fine, *(s for s in known if _is_joint(s, structure))]
    drawn = _drawn(structure, points, f"Indicator {name}", f"Highest: {top}.", f"where-{number}")
    return {"name": name, "means": INDICATORS.get(name, ""), "top": top, "svg": drawn}


def _is_joint(spot: Spot, structure: Data | None) -> bool:
    return structure is not None and any(j["name"] == spot.place for j in structure["joints"])


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
