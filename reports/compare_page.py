"""A comparison of two runs: sections for the screen, for Markdown and for one HTML document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from femubench.plot import Axis, Chart, Mark, Series
from femubench.reports.blocks import (
    Block,
    Column,
    Drawing,
    Items,
    Section,
    Table,
)
from femubench.reports.cells import NOTHING, fixed, plain, shortened
from femubench.reports.html import to_html
from femubench.reports.markdown import to_markdown
from femubench.reports.svg import drawing
from femubench.reports.terminal import to_terminal
from femubench.results import METHOD

_RATIOS = ("unseen", "used", "higher", "modified", "seconds")
_BLANK = "\u2800"  # stands for an indent until the table is made, which strips all white space
_MOST_LINES = 20  # of a list on the screen
_LONGEST = 300
_LEGEND = (
    "Ratios B / A, less than 1 is better in B: unseen (errors that make the skill); used, higher, "
    "modified (rms frequency error + 0.05 %); seconds (sums). Means are geometric, over cases and "
    "seeds. lost: results that A has and B has not."
)
_TELLING = "Scenarios where nothing differs are left out."
_EVIDENCE = f"{METHOD} The interval of the mean ratio is by bootstrap over structures."
_FOREST = (
    "Mean ratio of the errors, B / A, logarithmic, with its 95 % interval. The line is at no "
    "change; the table has the figures."
)
_SAYS = {"lost": "lost", "gained": "gained", "other": "changed"}
_BOARD = (
    Column("strategy", 22, left=True),
    Column("jobs", 4),
    *(Column(name, max(len(name), 6)) for name in _RATIOS),
    Column("lost", 4),
)
_PROOF = (
    Column("strategy", 20, left=True),
    Column("differing", 9),
    Column("ratio", 6),
    Column("95 % interval", 15, left=True),
    Column("p (Holm)", 8),
    Column("B is", 10, left=True, wrap=True),
)


def comparison_text(data: Mapping[str, Any]) -> str:
    """Return a comparison in 80 columns.

    Arguments:
        data: what `bench compare --format json` writes.
    """
    before, after = _sides(data)
    top = Section("", [f"A {before}, B {after}: {headline(data)}"])
    return to_terminal([top, *_sections(data, screen=True)]).replace(_BLANK, " ")


def comparison_markdown(data: Mapping[str, Any]) -> str:
    """Return a comparison in GitHub's Markdown."""
    top = Section(headline(data), [Items(tuple(zip("AB", _sides(data), strict=True)))], level=1)
    return to_markdown([top, *_sections(data)])


def comparison_html(data: Mapping[str, Any]) -> str:
    """Return a comparison as one document that needs no script and no network."""
    sides = _sides(data)
    top = Section("", [Items(tuple(zip("AB", sides, strict=True)))])
    return to_html([top, *_sections(data)], title=" against ".join(sides), heading=headline(data))


def headline(data: Mapping[str, Any]) -> str:
    """Return the answer in one sentence."""
    asked = ", ".join(f"{item['metric']} > {item['most']:g}" for item in data["thresholds"])
    jobs = f"{data['jobs']} job{'s' if data['jobs'] != 1 else ''} in both"
    if not data["worse"]:
        return f"B is not worse than A ({asked}; {jobs})"
    names = list(dict.fromkeys(plain(item["strategy"]) for item in data["excesses"]))
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"B is worse than A: {', '.join(names[:3])}{more} ({asked}; {jobs})"


def forest(evidence: Sequence[Mapping[str, Any]]) -> Chart:
    """Return ratio and interval of every strategy, by what is shown of it."""
    listed = [item for item in evidence if item["ratio"] is not None]
    series = []
    for verdict in dict.fromkeys(item["verdict"] for item in listed):
        own = [item for item in listed if item["verdict"] == verdict]
        ratio, low, high = ([item[key] for item in own] for key in ("ratio", "low", "high"))
        series.append(Series(verdict, ratio, [plain(o["strategy"]) for o in own], low, high))
    axes = Axis("mean ratio of the errors, B / A", log=True), Axis("strategy")
    return Chart("interval", "B over A", *axes, tuple(series), (Mark("x", 1.0, "no change"),))


def _sides(data: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of A and B, with the strategies of two names that are compared."""
    before, after = (
        plain(data[side])
        + (f" ({', '.join(plain(item[side]) for item in data['against'])})" * bool(data["against"]))
        for side in ("before", "after")
    )
    return before, after


def _sections(data: Mapping[str, Any], *, screen: bool = False) -> Iterator[Section]:
    """Yield the parts; lists are cut on the screen, and tables show what differs."""
    differing = [shortened(plain(line), _LONGEST) for line in data["environment"]]
    notes = [shortened(plain(note), _LONGEST) for note in data["notes"]]
    yield from _listed("Ended otherwise", map(_change, data["changes"]), screen)
    yield from _listed("Beyond a threshold", map(_excess, data["excesses"]), screen)
    rows, told = _proofs(data["evidence"]), [] if screen else _drawn(data["evidence"])
    yield Section("Is it more than chance?", [*told, Table(_PROOF, rows), _EVIDENCE])
    legend = f"{_LEGEND} {_TELLING}" if screen else _LEGEND
    yield Section("Ratios", [_ratios(data["rows"], screen), legend])
    yield from _listed("Only in A", _jobs(data["only_before"]), screen)
    yield from _listed("Only in B", _jobs(data["only_after"]), screen)
    yield from _listed("Not compared: other case files", _jobs(data["other_cases"]), screen)
    yield from _listed("Environment", differing or ["nothing differs"], screen)
    yield from _listed("Notes", notes, screen)
    yield from _listed("Thresholds that nothing was held against", data["untested"], screen)


def _listed(title: str, lines: Iterable[str], screen: bool) -> Iterator[Section]:
    found = list(lines)
    shown = found[:_MOST_LINES] if screen else found
    more = [f"... and {len(found) - len(shown)} more"] if len(shown) < len(found) else []
    if found:
        yield Section(title, [Items([("", line) for line in [*shown, *more]])])


def _drawn(evidence: Sequence[Mapping[str, Any]]) -> list[Block]:
    shown = drawing(forest(evidence), _FOREST)
    return [Drawing("B over A", _FOREST, shown)] if shown else []


def _ratios(rows: Iterable[Mapping[str, Any]], screen: bool) -> Table:
    """Return the ratios, those that got worse or better with an arrow where there is room for it.

    The screen leaves out the scenarios where only times differ.
    """
    cells = []
    for row in rows:
        name, scenario, values = plain(row["strategy"]), row["scenario"], row["values"]
        signs = [_arrow(key, values[key]) for key in _RATIOS]
        if screen and scenario is not None and not (any(signs[:-1]) or values["failures"]):
            continue
        if scenario is not None:
            name = 2 * _BLANK + plain(scenario) if screen else f"{name}, {plain(scenario)}"
        figures = [fixed(values[key], 2 if key == "seconds" else 3, 6) for key in _RATIOS]
        if not screen:
            figures = [text + sign for text, sign in zip(figures, signs, strict=True)]
        cells.append([name, str(row["jobs"]), *figures, f"{values['failures']:.0f}"])
    return Table(_BOARD, cells)


def _arrow(name: str, ratio: float | None) -> str:
    """Return where a ratio went, nothing where it stayed; times scatter."""
    off, room = (ratio or 1.0) - 1.0, 0.25 if name == "seconds" else 5e-4
    return " \u25b2" if off > room else " \u25bc" if off < -room else ""


def _proofs(evidence: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    return [
        [
            plain(item["strategy"]),
            f"{item['differing']} of {item['structures']}",
            fixed(item["ratio"], 3, 6),
            NOTHING
            if item["low"] is None or item["high"] is None
            else f"{fixed(item['low'], 3, 6)} - {fixed(item['high'], 3, 6)}",
            NOTHING if item["p"] is None else f"{item['p']:.2g}",
            item["verdict"],
        ]
        for item in evidence
    ]


def _change(item: Mapping[str, Any]) -> str:
    said = f" ({plain(item['reason'])})" if item["reason"] else ""
    job = f"{plain(item['strategy'])}, {plain(item['case'])}, seed {item['seed']}"
    return f"{_SAYS[item['kind']]}: {job}: {item['before']} -> {item['after']}{said}"


def _excess(item: Mapping[str, Any]) -> str:
    where = "all scenarios" if item["scenario"] is None else plain(item["scenario"])
    value = f"{item['value']:.4g} > {item['most']:g}"
    return f"{plain(item['strategy'])}, {where}: {item['metric']} {value}"


def _jobs(jobs: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for every strategy and case."""
    found: dict[str, list[str]] = {}
    for job in jobs:
        key = f"{plain(job['strategy'])}, {plain(job['case'])}"
        found.setdefault(key, []).append(str(job["seed"]))
    for key, seeds in found.items():
        yield f"{key}, seed{'s' if len(seeds) > 1 else ''} {', '.join(seeds)}"
