"""A diagnosis as a report of any form, from the data of ``bench diagnose --json``.

The argument `data` of all functions is what `diagnosis_to_json` gives, fresh or read from a file
through `diagnosis_from_json`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from femubench import InputError
from femubench.plot import (
    MOST_ROWS,
    error_budget,
    evidence,
    residual_dots,
    residuals,
    state_changes,
    strongest_places,
    svg,
)
from femubench.reports import diagnosis_words as words
from femubench.reports.blocks import (
    Block,
    Cards,
    Cell,
    Column,
    Drawing,
    FindingCard,
    Items,
    Passage,
    Row,
    Table,
)
from femubench.reports.cells import chance, figure, format_signed, plain, sentence
from femubench.reports.diagnosis_words import Data
from femubench.reports.markdown import to_markdown
from femubench.reports.terminal import to_terminal

_MOST_RESIDUALS = 2000
_LEAST = 0.005  # what two decimals show
_SUMS = {
    "unexplained": "left_percent",
    "drawing's error": "error_percent",
    "predicted to ±": "std_percent",
}
_NOTABLE = 0.1  # % of a frequency, rms, that a line of a budget is worth
_WHEN = ("before", "after")
_KINDS = {"frequency": "Frequencies", "shape": "Mode shapes, rms over the sensors"}
_MAP, _SMALL = (4.8, 3.7), (3.4, 2.4)  # inch
_ARROWS = "Arrows: from the reference to the present. Bands: ±2 standard deviations of both states."
_LACKS = "Blue: drawn too soft or too heavy. Purple: too stiff or too light. Dark: much of it."
_EVIDENCE = "Thick lines and large dots: strong evidence. Numbers: the causes. "


def diagnosis_text(data: Data) -> str:
    """Return a diagnosis as plain text of 80 columns at most."""
    return to_terminal([Passage("", [*_lead(data), _heading(data)]), *_sections(data)])


def diagnosis_markdown(data: Data) -> str:
    """Return a diagnosis in GitHub's Markdown."""
    sections = [Passage("", [*_lead(data), _heading(data)]), *_sections(data)]
    return to_markdown(sections, f"Diagnosis of {data['case']}")


def diagnosis_html(data: Data) -> str:
    """Return a diagnosis as a document that needs nothing but itself; it reads without scripts."""
    from femubench.reports.html import to_html

    seconds = f"{figure(data['seconds'], 2)} s"
    return to_html(
        _sections(data, page=True),
        title=f"Diagnosis of {data['case']}: {data['verdict']}",
        lead="".join(_lead(data)),
        heading=_heading(data),
        brand=f"Diagnosis of {data['case']}",
        foot=f"femubench {data['version']}, {seconds}. The numbers are those of bench "
        "diagnose --json.",
        scripts=("sortable.js", "diagnosis.js", "figures.js"),
    )


def summary_lines(data: Data) -> list[str]:
    """Return the verdict and its causes, a line each, for a comment or a list."""
    cards = [_card(number, cause) for number, cause in enumerate(data["causes"], 1)]
    stated = (": ".join(entry) for entry in Cards(cards).entries)
    return [line for line in map(plain, (data["sentence"], *stated)) if line]


def _heading(data: Data) -> str:
    return data["sentence"] or f"The verdict on {data['case']} is {data['verdict']}."


def _lead(data: Data) -> list[str]:
    """Return what comes before any name: of two measurements, or of the drawing by itself."""
    if data["states"]:
        return [words.states(data["states"])]
    return [words.budget(data)] if data["budget_modes"] else []


def _sections(data: Data, *, page: bool = False) -> list[Passage]:
    """Return what a diagnosis says; of a page the first passages and faults stand at the top."""
    verdict, base, reason = data["verdict"], data["base"], sentence(data["reason"])
    name = verdict if page else f"{data['case']}: {verdict}"
    said = Items([(name, f"{words.MEANINGS[verdict]}.")], look=f"verdict {verdict}")
    warned = [("", row["warning"]) for row in data["scatter"] if row["warning"]]
    looks = [(words.place(look["where"]), words.look(look)) for look in data["looks"]]
    notes = [("", note) for note in data["notes"]]
    if data["written"]:
        notes.append(("", f"The extended case is in {data['written']}"))
    next_title = "What cannot be distinguished" if reason else ""
    if data["advice"]:
        next_title = f"{next_title}, and what to measure next" if reason else "What to measure next"
    gain_title = "How far off the model is" if verdict == "none" else "What it gains"
    textbook = [f"Taken at the textbook value: {', '.join(base)}."] if base else []
    found = (
        Passage("", [said], area="first"),
        Passage("The two measurements", _states(data, page=page), area="first"),
        Passage("What the drawing lacks", _budget(data, page=page), area="first"),
        Passage(words.CAUSES.get(verdict, ""), [*_cards(data), *textbook], area="first"),
        Passage("", [Items(_tiles(data), look="tiles"), *_error(data)], area="first"),
        Passage("", [_map(data)] if page else [], area="aside"),
        Passage(words.FAULTS, _cards(data, faults=True), area="aside"),
        Passage("The stated scatter does not fit what is left", [Items(warned)] * bool(warned),
                area="aside", look="notes"),
        Passage(next_title, [*([reason] if reason else []), *_advice(data)]),
        Passage(gain_title, _gain(data)),
        Passage("How well it fits", list(_fit(data, page=page))),
        Passage("Where it is", list(_where(data))),
        Passage("Rivals", [*_rivals(data), *map(words.weight, data["evidence"])]),
        Passage("The smallest that these data would have shown", _visible(data)),
        Passage("Classical indicators of where the error sits", _indicators(data, page=page)),
        Passage("Plausibility checks of the model, before any fit", [Items(looks)] * bool(looks)),
        Passage("Notes", [Items(notes)] * bool(notes)),
    )  # fmt: skip
    return [section for section in found if section.blocks]


def _tiles(data: Data) -> list[tuple[str, ...]]:
    """Return the figures that matter most, each with a title and what it is."""
    nothing, none = data["nothing"], data["verdict"] == "none"
    sure = nothing if none or nothing is None else 1.0 - nothing
    found = "Nothing is missing" if none else "Something is missing"
    tiles: list[tuple[str, ...]] = [(found, chance(sure), "probability, before any name is given")]
    stated = [(key, name) for key, name in words.GAINS.items() if data["gain"].get(key)]
    for key, name in stated[:1] if not none else ():
        kind, pairs = next(iter(_errors(data).items()))
        before, after = map(words.percent, pairs[key])
        said = f"{kind} frequency error, before → after"
        tiles.append((f"Error on {name}", f"{before} → {after}", said))
    tiles.append(("What is left", *words.adequacy(data)))
    return tiles


def _error(data: Data) -> list[Block]:
    """Return the classes of model error, folded: they are many."""
    scales = ((f"{figure(r['scale'], 2)} {r['unit']}", r["class"]) for r in data["model_error"])
    tiles = [("Model error", *scale) for scale in scales]
    return [Items(tiles, look="tiles", folded="Model error by classes")] if tiles else []


def _states(data: Data, *, page: bool) -> list[Block]:
    """Return the two measurements mode by mode, in a page as arrows too."""
    states = data["states"]
    if not states or not states["modes"]:
        return []
    say = partial(figure, digits=6)
    columns = {
        "reference_mode": Column("reference\nmode", 9),
        "reference_hz": Column("reference,\nHz", 9, say=say),
        "mode": Column("present\nmode", 9),
        "present_hz": Column("present,\nHz", 9, say=say),
        "change_percent": Column("change, %", 9, say=partial(format_signed, decimals=2)),
        "deviations": Column("deviations", 10, say=format_signed),
        "mac": Column("MAC", 5, digits=2),
    }
    found = [*states["modes"]]
    found += [{"reference_mode": m["mode"], "reference_hz": m["hz"]} for m in states["lost"]]
    found += [{"mode": m["mode"], "present_hz": m["hz"]} for m in states["new"]]
    rows = [[row.get(key) for key in columns] for row in found]
    size = 4.4, 0.9 + 0.27 * min(len(rows), MOST_ROWS)
    title = "Change of the frequencies from the reference to the present state"
    drawn = _drawn(partial(state_changes, states), "states", title, _lead(data)[0], size)
    table = Table([*columns.values()], rows, folded=f"The {len(rows)} modes in figures")
    return [*([Row([Drawing("", _ARROWS, drawn)])] * page), table]


def _budget(data: Data, *, page: bool) -> list[Block]:
    """Return what the drawing lacks, by class and mode."""
    modes = data["budget_modes"]
    if not modes:
        return []
    say = partial(format_signed, decimals=1)
    columns = [
        *(Column("class", 19, left=True), Column("at", 12, left=True)),
        *(Column("rms, %", 7, say=say), Column("±", 5, digits=1)),
        Column("source", 8, left=True),
        *(Column(f"{m['mode']}" if m["used"] else f"({m['mode']})", 6, say=say) for m in modes),
        Column("not seen", 30, left=True, wrap=True),
    ]
    worth = [row for row in data["budget"] if abs(row["rms_percent"]) >= _NOTABLE]
    rows: list[list[Cell]] = [
        [row["class"], words.place(row["place"]), row["rms_percent"], row["rms_std"], row["source"],
         *row["percent"], ", ".join(row["unseen"])]
        for row in worth
    ]  # fmt: skip
    for name, key in _SUMS.items():
        own = [m[key] for m in modes]
        rows.append([name, "", figure(words.root_mean_square(own), 2), None, "", *own, ""])
    said = (
        "In % of the frequencies (ln measured / predicted), mode by mode; + where the drawing is "
        "too soft or too heavy. Modes in brackets had no part in it: their lines are predictions."
    )
    size = 3.4 + 0.34 * min(len(modes), MOST_ROWS), 3.6
    title = "What the drawing lacks, mode by mode"
    draw = partial(error_budget, data)
    drawn = _drawn(draw, "budget", title, _lead(data)[0], size) if page else ""
    table = Table(columns, rows, folded=f"The {len(modes)} modes in figures" * page)
    draw = partial(error_budget, {**data, "budget": worth}, by="place")
    placed = _drawn(draw, "lacks", "What the drawing lacks, by place", said, _MAP) if page else ""
    drawings = [Drawing("", said, drawn), *[Drawing("", _LACKS, placed)] * bool(placed)]
    first: Block = Row(drawings) if page else said
    return [first, table, *words.as_drawn(data["budget"], _NOTABLE)]


def _cards(data: Data, *, faults: bool = False) -> list[Block]:
    """Return the causes, or the faults of the data and of what was typed in, with their numbers."""
    cards = [
        _card(number, cause)
        for number, cause in enumerate(data["causes"], 1)
        if (cause["side"] != "model") is faults
    ]
    return [Cards(cards)] if cards else []


def _card(number: int, cause: Data) -> FindingCard:
    sure = [("probability", cause["probability"])]
    if cause["place"] != "all" and cause["place_probability"] is not None:
        sure.append(("at this place", cause["place_probability"]))
    said = "textbook value, not fitted"
    return FindingCard(
        cause["effect"],
        words.at(cause["place"]),
        number,
        sure,
        [line for line in (words.elsewhere(cause), cause["summary"]) if plain(line)],
        [
            (item["name"], words.parameter(item), *([said] if item["textbook"] else []))
            for item in cause["parameters"]
        ],
    )


def _advice(data: Data) -> list[Block]:
    rows = [[item["measurement"], *[item["separation"]] * 2] for item in data["advice"]]
    columns = (
        Column("measurement", 0, left=True, wrap=True),
        Column("distance,\nσ²", 9, say=partial(figure, digits=3)),
        Column("odds", 20, say=words.odds),
    )
    said = (
        "What separates the explanations most comes first: with the distance in squared standard "
        "deviations that it would open between them, and the odds that this stands for."
    )
    return [Table(columns, rows, most=8), said] if rows else []


def _errors(data: Data) -> dict[str, Data]:
    """Return the frequency errors by kind, those of a run first."""
    kinds = {"rms": data["gain_rms"], "median": data["gain"]}
    return {kind: pairs for kind, pairs in kinds.items() if any(pairs.values())}


def _gain(data: Data) -> list[Block]:
    """Return the errors before and after."""
    kinds = _errors(data)
    columns = [Column("frequency error", 17, left=True, wrap=True)]
    for kind in kinds:
        columns += [Column(f"{kind}\n{t}", 8, say=words.percent, bar=t) for t in _WHEN]
    rows: list[list[Cell]] = []
    for key, name in reversed(words.GAINS.items()):
        pairs = [pairs.get(key) or (None, None) for pairs in kinds.values()]
        if any(map(any, pairs)):
            rows.append(
                [name, *(value for pair in pairs for value in pair), words.times(*pairs[0])]
            )
    most = max((cell for row in rows for cell in row if isinstance(cell, float)), default=0.0)
    said = (
        "Nothing was added to the model, so nothing changes."
        if data["verdict"] == "none"
        else "Held-out modes and modified structures had no part in the naming."
    )
    table = Table([*columns, Column("change", 18, left=True)], rows, full=most or 1.0)
    return [f"Over the modes, rms as in bench run. {said}", table] if rows else []


def _fit(data: Data, *, page: bool) -> Iterator[Block]:
    """Yield the residuals, as drawings in a page, and whether they are noise."""
    yield (
        "Measured minus predicted in standard deviations of the measurement: 19 of 20 data that "
        "are noise alone lie within ±2" + (", the shaded band. ○ before, ◆ after." * page or ".")
    )
    drawings = []
    before_after = [Column(when, 9, say=format_signed) for when in _WHEN]
    kind: Any
    for kind, title in _KINDS.items():
        dots = residual_dots(data, kind)
        if page and dots:
            size = 4.6, 1.0 + 0.27 * min(len(dots), MOST_ROWS)
            said = "; ".join(f"{dot.name} {dot.text}" for dot in dots[:12])
            drawn = _drawn(partial(residuals, data, kind=kind), f"dots-{kind}", title, said, size)
            more = f"{len(dots) - MOST_ROWS} more in the table below." * (len(dots) > MOST_ROWS)
            drawings.append(Drawing(title, more, drawn))
        elif dots:
            say = partial(figure, digits=3) if kind == "shape" else format_signed
            heads = [Column(title, 36, left=True), *(Column(when, 9, say=say) for when in _WHEN)]
            yield Table(heads, [[dot.name, dot.before, dot.after] for dot in dots])
    if drawings:
        yield Row(drawings)
    yield words.chi_square(data)
    found = data["residuals"]
    if page and found:
        columns = (
            *(Column("mode", 5), Column("kind", 9, left=True), Column("sensor", 16, left=True)),
            *(Column("measured", 9, say=partial(figure, digits=6)), *before_after),
        )
        keys = ("mode", "kind", "sensor", "measured", *_WHEN)
        cells = [[row[key] for key in keys] for row in found[:_MOST_RESIDUALS]]
        yield Table(columns, cells, sortable=True, folded=f"All {len(found)} residuals")
        if found[_MOST_RESIDUALS:]:
            yield f"{len(found) - _MOST_RESIDUALS} more in the JSON."


def _where(data: Data) -> Iterator[Block]:
    """Yield the evidence by place; HTML ties its rows to the drawing."""
    spots = strongest_places(data)
    if not spots:
        yield "No place stands out."
        return
    guess = data["verdict"] in ("unknown", "not-confirmed")
    among = ", among explanations that do not hold" if guess else ""
    said = f"The probability that a cause sits there, 1 at the most probable place{among}."
    named = [words.place(spot.place) for spot in spots]
    columns = (
        *(Column("place", 40, left=True), Column("cause", 9, left=True)),
        Column("evidence", 8, digits=2, bar="evidence"),
    )
    rows = [(name, spot.causes, spot.value) for name, spot in zip(named, spots, strict=True)]
    tones = [name if name == "everywhere" else str(k) for k, name in enumerate(named)]
    yield said
    yield Table(columns, rows, tones=tones)
    if data["causes"]:
        yield (
            "The probability of each cause is that of the effect wherever it sits, and that of its "
            "place if the effect is there. Values ± one standard deviation."
        )


def _rivals(data: Data) -> list[Block]:
    columns = (
        Column("explanation", 0, left=True, wrap=True),
        Column("probability", 11, say=chance),
        Column("lowers\nchi-square", 10, say=figure),
        Column("angle,\ndegrees", 7, digits=1),
    )
    rows = [
        [words.pair_at(rival), *(rival[key] for key in ("probability", "delta_chi2", "angle"))]
        for rival in data["rivals"]
    ]
    said = "A small angle: the data see it and the winner alike."
    return [said, Table(columns, rows, most=8, sortable=True)] if rows else []


def _visible(data: Data) -> list[Block]:
    columns = (
        *(Column("effect", 26, left=True), Column("at its best place", 22, left=True)),
        *(Column("size", 10, say=partial(figure, digits=3)), Column("unit", 12, left=True)),
    )
    rows = [
        [r["effect"], words.place(r["place"]), r["size"], words.unit_of(r)]
        for r in data["smallest_visible"]
    ]
    said = (
        "What is smaller stays hidden. For springs in place of something rigid: the stiffest that "
        "shows."
    )
    return [said, Table(columns, rows, sortable=True)] if rows else []


def _indicators(data: Data, *, page: bool) -> list[Block]:
    """Return what knows of no cause, with a small drawing each in a page."""
    found: dict[str, list[Data]] = {}
    for row in data["locations"]:
        found.setdefault(row["indicator"], []).append(row)
    found.pop("evidence", None)
    drawings = []
    for number, (name, rows) in enumerate(found.items()):
        top = words.strongest(rows, _LEAST)
        meaning = f"{words.INDICATORS[name]}. " if name in words.INDICATORS else ""
        draw = partial(evidence, data, indicator=name, names=False)
        title = f"Indicator {name}"
        drawn = _drawn(draw, f"where-{number}", title, f"Highest: {top}.", _SMALL) if page else ""
        drawings.append(Drawing(name, f"{meaning}{top}", drawn))
    said = "They know of no cause, point at places and name nothing. 1 at the largest."
    return [said, Row(drawings)] if drawings else []


def _map(data: Data) -> Block:
    """Return the structure with causes and evidence."""
    listed = ", ".join(f"{s.place} {s.value:.2f}" for s in strongest_places(data)[:5])
    says = f"Evidence by place: {listed}." if listed else "No place stands out."
    drawn = _drawn(partial(evidence, data), "map", "Evidence on the structure", says, _MAP)
    if not drawn:
        return "This file holds no geometry, so there is no drawing."
    return Row([Drawing("", f"{_EVIDENCE * bool(listed)}▲ sensor.", drawn)])


def _drawn(
    draw: Callable[..., object], name: str, title: str, says: str, size: tuple[float, float]
) -> str:
    """Return a drawing in the colours of the page; nothing where there is no geometry."""
    from markupsafe import Markup

    try:
        return Markup(svg(draw, name=name, title=title, caption=says, size=size, themed=True))
    except InputError:
        return ""
