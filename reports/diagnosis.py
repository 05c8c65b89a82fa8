"""A diagnosis for the screen and in Markdown, from the data of ``bench diagnose --json``.

The argument `data` of all functions is what `diagnosis_to_json` gives, fresh or read from a file
through `diagnosis_from_json`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from femubench.reports.blocks import Block, Column, Items, Section, Table, to_markdown, to_terminal
from femubench.reports.cells import NOTHING, fixed, plain
from femubench.reports.diagnosis_words import (
    CAUSES,
    FAULTS,
    GAINS,
    numbered,
    pairs_of,
    sentence,
    sits,
    weight,
)
from femubench.reports.figures import chance, estimate, figure, rms, signed
from femubench.reports.markdown import escape

Data = Mapping[str, Any]

_MOST_RIVALS, _MOST_PLACES, _MOST_CHANGES, _MOST_ADVICE = 8, 5, 8, 5
_LEAST = 0.005  # what two decimals show
_WHEN = ("before", "after")
_GAINS = {**GAINS, "cross_validated_percent": "each used mode left out in turn"}


def diagnosis_text(data: Data) -> str:
    """Return a diagnosis as plain text of 80 columns at most."""
    return to_terminal(diagnosis_sections(data))


def diagnosis_markdown(data: Data) -> str:
    """Return a diagnosis in GitHub's Markdown."""
    title = f"# Diagnosis of {escape(data['case'])}"
    return f"{title}\n\n{to_markdown(diagnosis_sections(data))}"


def summary_lines(data: Data) -> list[str]:
    """Return the verdict and its causes, a line each, for a comment or a list."""
    causes = (plain(f"{_at(cause)}: {_cause(cause)}") for cause in data["causes"])
    return [line for line in (plain(data["sentence"]), *causes) if line]


def diagnosis_sections(data: Data) -> list[Section]:
    """Return what a diagnosis says, the verdict first, for a report of any form."""
    found: dict[str, list[Data]] = {}
    for row in data["locations"]:
        found.setdefault(row["indicator"], []).append(row)
    written = data.get("written")
    parts: list[tuple[str, list[Block]]] = [
        ("", [data["sentence"]] if data["sentence"] else []),
        ("", [_verdict(data)]),
        (
            "Plausibility checks of the model, before any fit",
            _items((look["where"], _look(look)) for look in data["looks"]),
        ),
        (
            "The stated scatter does not fit what is left",
            _items(("", row["warning"]) for row in (data.get("scatter") or ()) if row["warning"]),
        ),
        ("Residuals in standard deviations, measured minus predicted", _residuals(data)),
        (
            FAULTS,
            _items((_at(c), _cause(c)) for _, c in numbered(data["causes"], faults=True)),
        ),
        (
            CAUSES.get(data["verdict"], "Causes"),
            [
                *_items((_at(c), _cause(c)) for _, c in numbered(data["causes"])),
                *_items(("", sentence(weight(row))) for row in data["evidence"]),
                *([data["reason"]] if data["reason"] else []),
            ],
        ),
        ("Rivals", _items(((_pair_at(r), _rival(r)) for r in data["rivals"]), _MOST_RIVALS)),
        (
            "What to measure next",
            _items((("", _advice(item)) for item in data["advice"]), _MOST_ADVICE),
        ),
        ("The smallest that these data would have shown", _visible(data)),
        ("Gain: frequency error before and after", _gain(data)),
        ("Where the error sits, 1 at the largest", _items((k, _top(v)) for k, v in found.items())),
        ("Notes", _items(("", note) for note in data["notes"])),
        ("", [f"The extended case is in {written}"] if written else []),
    ]
    return [Section(title, blocks) for title, blocks in parts if blocks]


def _items(entries: Iterable[tuple[str, str]], most: int | None = None) -> list[Block]:
    """Return a list of remarks and how many more there are; nothing where there is none."""
    listed = list(entries)
    hidden = len(listed[most:]) if most else 0
    more = [f"... and {hidden} more in the JSON"] if hidden else []
    return [Items(listed[:most]), *more] if listed else []


def _verdict(data: Data) -> str:
    said = [f"{data['case']}: {data['verdict']}"]
    if data["nothing"] is not None:
        said.append(f"that nothing is missing has probability {chance(data['nothing'])}")
    if data["base"]:
        said.append(f"taken at the textbook value: {', '.join(data['base'])}")
    return "; ".join(said) + "."


def _look(look: Data) -> str:
    known = [change for change in look["changes"] if change["percent"] is not None]
    changes = [
        f"mode {change['mode']} {signed(change['percent'], 2)} %"
        for change in known[:_MOST_CHANGES]
    ]
    more = len(known) - len(changes)
    by = f" ({look['effect']})" if look["effect"] else ""
    tail = f" and {more} more" if more else ""
    corrected = f" If corrected{by}: {', '.join(changes)}{tail}." if changes else by
    return f"{look['what']}{corrected}"


def _residuals(data: Data) -> list[Block]:
    """Return the residuals, a mode a row, and how likely their sum is."""
    rows = data["residuals"]
    shapes = any(row["kind"] == "shape" for row in rows)
    columns = [
        Column("mode", 6),
        Column("measured\nHz", 10),
        Column("frequency\nbefore", 9),
        Column("frequency\nafter", 9),
    ]
    if shapes:
        columns += [
            Column("shape\nsensors", 7),
            Column("shape rms\nbefore", 9),
            Column("shape rms\nafter", 9),
        ]
    modes = dict.fromkeys(row["mode"] for row in rows if row["mode"] is not None)
    lines = [_mode_row(mode, rows, shapes)[: len(columns)] for mode in modes]
    text = [
        f"mass {figure(row['measured'])} kg: {signed(row['before'])} before, "
        f"{signed(row['after'])} after"
        for row in rows
        if row["kind"] == "mass"
    ]
    return [*([Table(columns, lines)] if lines else []), *text, _chi_square(data)]


def _mode_row(mode: int, rows: Iterable[Data], shapes: bool) -> list[str]:
    own = [row for row in rows if row["mode"] == mode]
    frequency = next((row for row in own if row["kind"] == "frequency"), {})
    shape = [row for row in own if row["kind"] == "shape"]
    return [
        str(mode),
        figure(frequency.get("measured"), 6),
        signed(frequency.get("before")),
        signed(frequency.get("after")),
        str(len(shape)),
        figure(rms(row["before"] for row in shape), 3),
        figure(rms(row["after"] for row in shape), 3),
    ]


def _chi_square(data: Data) -> str:
    before, after = data["chi2"]
    noise = "ordinary scatter of the elements" + (" and model error" if data["model_error"] else "")
    text = (
        f"Chi-square, {noise} counted as noise: "
        f"{figure(before)} before, {figure(after)} after, {data['data_count']} data"
    )
    if data["adequacy_p"] is None:
        return f"{text}."
    return f"{text}. Noise alone leaves as much with probability {data['adequacy_p']:.2g}."


def _cause(cause: Data) -> str:
    parts = [f"probability {chance(cause['probability'])}", sits(cause), cause["summary"]]
    parts = [part for part in parts if part]
    return "; ".join([*parts, *(_parameter(item) for item in cause["parameters"])])


def _parameter(item: Data) -> str:
    unit = f" {item['unit']}" if item["unit"] else ""
    source = " (textbook)" if item["textbook"] else ""
    return f"{item['name']} {estimate(item['value'], item['std'])}{unit}{source}"


def _at(item: Data) -> str:
    if item["place"] == "all":
        return f"{item['effect']}, everywhere"
    return f"{item['effect']} at {item['place']}" if item["place"] else str(item["effect"])


def _pair_at(rival: Data) -> str:
    """Return effects and places of a combination, each effect beside its place."""
    return " + ".join(_at({"effect": effect, "place": place}) for effect, place in pairs_of(rival))


def _rival(rival: Data) -> str:
    text = (
        f"probability {chance(rival['probability'])}, "
        f"lowers chi-square by {figure(rival['delta_chi2'])}"
    )
    return text if rival["angle"] is None else f"{text}, {rival['angle']:.1f} degrees away"


def _advice(item: Data) -> str:
    return f"{item['measurement']} (separates by {figure(item['separation'], 3)} sigma squared)"


def _visible(data: Data) -> list[Block]:
    columns = [
        *(Column("effect", 32, left=True), Column("at its best place", 22, left=True)),
        *(Column("size", 10), Column("unit", 8, left=True)),
    ]
    rows = [
        [item["effect"], item["place"], figure(item["size"], 3), item["unit"]]
        for item in data["smallest_visible"]
    ]
    return [Table(columns, rows)] if rows else []


def _gain(data: Data) -> list[Block]:
    """Return the errors as rms, as in a run, and as medians, which alone files of old have."""
    columns = [Column("", 32, left=True)]
    columns += [Column(f"{kind} %\n{when}", 9) for kind in ("rms", "median") for when in _WHEN]
    pairs = [
        (title, (data.get("gain_rms") or {}).get(key), data["gain"][key])
        for key, title in _GAINS.items()
    ]
    rows = [
        [title, *(fixed(v, 3, 7) for v in (*(rms or (None, None)), *median))]
        for title, rms, median in pairs
        if median
    ]
    return [Table(columns, rows)]


def _top(rows: Sequence[Data]) -> str:
    known = [row for row in rows if (row["value"] or 0.0) >= _LEAST]
    best = sorted(known, key=lambda row: -row["value"])[:_MOST_PLACES]
    return ", ".join(f"{row['place']} {row['value']:.2f}" for row in best) or NOTHING
