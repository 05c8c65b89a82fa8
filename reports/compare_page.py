"""A comparison of two runs: sections for the screen, for Markdown and for one HTML document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from femubench.plot import Axis, Chart, Mark, Series
from femubench.reports.blocks import Block, Cell, Column, Drawing, Items, Passage, Table
from femubench.reports.cells import NOTHING, format_fixed, plain, shorten_text
from femubench.reports.html import to_html
from femubench.reports.markdown import to_markdown
from femubench.reports.svg import drawing
from femubench.reports.terminal import to_terminal
from femubench.results import Standings

_VALUES = ("loss", "used", "higher", "modified", "seconds")
_BLANK = "\u2800"  # stands for an indent until the table is made, which strips all white space
_MOST_LINES = 20  # of a list on the screen
_LONGEST = 300
_LEGEND = (
    "loss: gain in A less that in B, mean over structures. Ratios B / A, less than 1 is better in "
    "B: used, higher, modified (rms frequency error + 0.05 %, geometric means over cases and "
    "seeds); seconds (sums). lost: results that A has and B has not."
)
_TELLING = "Scenarios where nothing differs are left out."
_EVIDENCE = (
    f"{Standings.METHOD} The interval of the mean difference is by bootstrap over structures."
)
_FOREST = (
    "Mean difference of the gains, B - A, with its 95 % interval. The line is at no change; the "
    "table has the figures."
)
_SAYS = {"lost": "lost", "gained": "gained", "other": "changed"}
_PROOF = (
    Column("strategy", 20, left=True),
    Column("differing", 9),
    Column("gain B - A", 10, digits=3),
    Column("95 % interval", 15, left=True),
    Column("p", 8, say=lambda p: NOTHING if p is None else f"{p:.2g}"),
    Column("B is", 10, left=True, wrap=True),
)


def comparison_text(data: Mapping[str, Any]) -> str:
    """Return a comparison in 80 columns.

    Arguments:
        data: what `bench compare --format json` writes.
    """
    before, after = _sides(data)
    top = Passage("", [f"A {before}, B {after}: {headline(data)}"])
    return to_terminal([top, *_sections(data, screen=True)]).replace(_BLANK, " ")


def comparison_markdown(data: Mapping[str, Any]) -> str:
    """Return a comparison in GitHub's Markdown."""
    return to_markdown([_top(data), *_sections(data)], headline(data))


def comparison_html(data: Mapping[str, Any]) -> str:
    """Return a comparison as one document that needs no script and no network."""
    sections, title = [_top(data), *_sections(data)], " against ".join(_sides(data))
    return to_html(sections, title=title, heading=headline(data))


def headline(data: Mapping[str, Any]) -> str:
    """Return the answer in one sentence."""
    asked = ", ".join(f"{item['metric']} > {item['most']:g}" for item in data["thresholds"])
    jobs = f"{data['jobs']} job{'s' if data['jobs'] != 1 else ''} in both"
    if not data["worse"]:
        return f"B is not worse than A ({asked}; {jobs})"
    names = list(dict.fromkeys(plain(item["strategy"]) for item in data["excesses"]))
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"B is worse than A: {', '.join(names[:3])}{more} ({asked}; {jobs})"


def _sides(data: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of A and B, with the strategies of two names that are compared."""
    before, after = (
        plain(data[side])
        + (f" ({', '.join(plain(item[side]) for item in data['against'])})" * bool(data["against"]))
        for side in ("before", "after")
    )
    return before, after


def _top(data: Mapping[str, Any]) -> Passage:
    return Passage("", [Items(tuple(zip("AB", _sides(data), strict=True)))])


def _sections(data: Mapping[str, Any], *, screen: bool = False) -> Iterator[Passage]:
    """Yield the parts; lists are cut on the screen, and tables show what differs."""
    differing = [shorten_text(plain(line), _LONGEST) for line in data["environment"]]
    notes = [shorten_text(plain(note), _LONGEST) for note in data["notes"]]
    yield from _listed("Ended otherwise", map(_change, data["changes"]), screen)
    yield from _listed("Beyond a threshold", map(_excess, data["excesses"]), screen)
    evidence = data["evidence"]
    stated = [] if screen else _drawn(evidence)
    proof = Table(_PROOF, [*map(_proof, evidence)])
    yield Passage("Is it more than chance?", [*stated, proof, _EVIDENCE])
    legend = f"{_LEGEND} {_TELLING}" if screen else _LEGEND
    cells = []
    for row in data["rows"]:
        name, scenario, values = plain(row["strategy"]), row["scenario"], row["values"]
        same = not any(_arrow(key, values[key]) for key in _VALUES[:-1])
        if screen and scenario is not None and same and not values["failures"]:
            continue
        if scenario is not None:
            name = 2 * _BLANK + plain(scenario) if screen else f"{name}, {plain(scenario)}"
        cells.append([name, row["jobs"], *map(values.get, _VALUES), values["failures"]])
    says = (None if screen else partial(_value_text, key) for key in _VALUES)
    figures = [
        Column(key, max(len(key), 6), digits=2 if key == "seconds" else 3, say=say)
        for key, say in zip(_VALUES, says, strict=True)
    ]
    columns = [Column("strategy", 22, left=True), Column("jobs", 4), *figures, Column("lost", 4)]
    yield Passage("Loss and ratios", [Table(columns, cells), legend])
    yield from _listed("Only in A", _jobs(data["only_before"]), screen)
    yield from _listed("Only in B", _jobs(data["only_after"]), screen)
    yield from _listed("Not compared: other case files", _jobs(data["other_cases"]), screen)
    yield from _listed("Environment", differing or ["nothing differs"], screen)
    yield from _listed("Notes", notes, screen)
    yield from _listed("Thresholds that nothing was held against", data["untested"], screen)


def _listed(title: str, lines: Iterable[str], screen: bool) -> Iterator[Passage]:
    found = list(lines)
    shown = found[:_MOST_LINES] if screen else found
    more = [f"... and {len(found) - len(shown)} more"] if len(shown) < len(found) else []
    if found:
        yield Passage(title, [Items([("", line) for line in [*shown, *more]])])


def _drawn(evidence: Sequence[Mapping[str, Any]]) -> list[Block]:
    listed = [item for item in evidence if item["difference"] is not None]
    series = []
    for verdict in dict.fromkeys(item["verdict"] for item in listed):
        own = [item for item in listed if item["verdict"] == verdict]
        change, low, high = ([o[key] for o in own] for key in ("difference", "low", "high"))
        series.append(Series(verdict, change, [plain(o["strategy"]) for o in own], low, high))
    axes = Axis("mean difference of the gains, B - A"), Axis("strategy")
    shown = drawing(
        Chart("interval", "B over A", *axes, tuple(series), (Mark("x", 0.0, "no change"),)), _FOREST
    )
    return [Drawing("B over A", _FOREST, shown)] if shown else []


def _value_text(name: str, value: float | None) -> str:
    return format_fixed(value, 2 if name == "seconds" else 3, 6) + _arrow(name, value)


def _arrow(name: str, value: float | None) -> str:
    """Return where a value went, nothing where it stayed; times scatter."""
    still = 0.0 if name == "loss" else 1.0
    off, room = (still if value is None else value) - still, 0.25 if name == "seconds" else 5e-4
    return " \u25b2" if off > room else " \u25bc" if off < -room else ""


def _proof(item: Mapping[str, Any]) -> list[Cell]:
    low, high = item["low"], item["high"]
    ends = (
        None
        if low is None or high is None
        else f"{format_fixed(low, 3, 6)} to {format_fixed(high, 3, 6)}"
    )
    differing = f"{item['differing']} of {item['structures']}"
    return [
        item["strategy"],
        differing,
        item["difference"],
        ends or NOTHING,
        item["p"],
        item["verdict"],
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
