"""A comparison of two runs on the screen, in Markdown and as one HTML document."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from femubench.plot import Axis, Chart, Mark, Series
from femubench.reports.cells import NOTHING, fixed, plain, shortened
from femubench.reports.markdown import escape, table
from femubench.reports.svg import drawing
from femubench.reports.templating import styled_page
from femubench.reports.terminal import WIDTH, aligned_table
from femubench.results import METHOD

_RATIOS = ("unseen", "used", "higher", "modified", "seconds")
_NAME = 26
_BLANK = "\u2800"  # stands for an indent until the table is made, which strips all white space
_MOST_LINES = 20
_LEGEND = (
    "Ratios B / A, less than 1 is better in B: unseen (errors that make the skill); used, higher, "
    "modified (rms frequency error + 0.05 %); seconds (sums). Means are geometric, over cases and "
    "seeds."
)
_EVIDENCE = f"{METHOD} The interval of the mean ratio is by bootstrap over structures."
_SAYS = {"lost": "lost", "gained": "gained", "other": "changed"}
_HEADS = ("strategy", "scenario", "jobs", *_RATIOS, "lost")


def comparison_text(data: Mapping[str, Any]) -> str:
    """Return a comparison in 80 columns.

    Arguments:
        data: what `bench compare --format json` writes.
    """
    before, after = _sides(data)
    parts = [_wrapped(f"A {before}, B {after}: {headline(data)}")]
    parts += _listed("Ended otherwise", [_change(item) for item in data["changes"]])
    parts += _listed("Beyond a threshold", [_excess(item) for item in data["excesses"]])
    rows = [
        [shortened(cells[0] if cells[1] == "all" else 2 * _BLANK + cells[1], _NAME), *cells[2:]]
        for cells in map(_cells, _telling(data["rows"]))
    ]
    heads = ("strategy", "jobs", "unseen", "used", "high.", "mod.", "s", "lost")
    board = aligned_table(rows, heads, ("left", *("right",) * 7))
    parts.append(board.replace(_BLANK, " "))
    parts.append(_wrapped(_LEGEND + " Scenarios where nothing differs are left out."))
    titles = ("strategy", "struc-\ntures", "differ", "ratio", "95 % interval", "p", "B is")
    lines = [[shortened(row[0], 18), *row[1:]] for row in map(_proof, data["evidence"])]
    align = ("left", "right", "right", "right", "left", "right", "left")
    parts.append(aligned_table(lines, titles, align))
    parts.append(_wrapped(_EVIDENCE))
    for title, lines_of in _lists(data):
        parts += _listed(title, lines_of)
    return "\n\n".join(parts)


def comparison_markdown(data: Mapping[str, Any]) -> str:
    """Return a comparison in GitHub's Markdown."""
    before, after = map(escape, _sides(data))
    parts = [
        f"# {escape(headline(data))}",
        table(["", ""], (["A", before], ["B", after]), "ll"),
    ]
    parts += _bullets("Ended otherwise", [_change(item) for item in data["changes"]])
    parts += _bullets("Beyond a threshold", [_excess(item) for item in data["excesses"]])
    rows = [[escape(cell) for cell in _cells(row)] for row in data["rows"]]
    parts += ["## Ratios", table(_HEADS, rows, "llrrrrrrr"), _LEGEND]
    rows = [[escape(cell) for cell in _proof(item)] for item in data["evidence"]]
    heads = ("strategy", "structures", "differing", "ratio", "95 % interval", "p (Holm)", "B is")
    parts += ["## Is it more than chance?", table(heads, rows, "lrrrlrl"), _EVIDENCE]
    for title, lines in _lists(data):
        parts += _bullets(title, lines)
    return "\n\n".join(parts)


def comparison_html(data: Mapping[str, Any]) -> str:
    """Return a comparison as one document that needs no script and no network."""
    before, after = _sides(data)
    return styled_page("compare.html").render(
        headline=headline(data),
        before=before,
        after=after,
        worse=data["worse"],
        excesses=[_excess(item) for item in data["excesses"]],
        changes=[(_SAYS[item["kind"]], _job(item), item) for item in data["changes"]],
        heads=_HEADS,
        rows=[(row["scenario"] is None, _cells(row), _tones(row)) for row in data["rows"]],
        proofs=map(_proof, data["evidence"]),
        forest=drawing(
            forest(data["evidence"]), "Their 95 % intervals; the table has the figures."
        ),
        lists=[(title, lines) for title, lines in _lists(data) if lines],
        legend=_LEGEND,
        evidence=_EVIDENCE,
    )


def _sides(data: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of A and B, with the strategies of two names that are compared."""
    before, after = (
        plain(data[side])
        + (f" ({', '.join(plain(item[side]) for item in data['against'])})" * bool(data["against"]))
        for side in ("before", "after")
    )
    return before, after


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


def _telling(rows: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Leave out the scenarios where only times differ."""
    for row in rows:
        values = [row["values"][name] for name in _RATIOS if name != "seconds"]
        differs = any(value is not None and abs(value - 1.0) > 5e-4 for value in values)
        if row["scenario"] is None or differs or row["values"]["failures"]:
            yield row


def _cells(row: Mapping[str, Any]) -> list[str]:
    values = row["values"]
    return [
        plain(row["strategy"]),
        "all" if row["scenario"] is None else plain(row["scenario"]),
        str(row["jobs"]),
        *(fixed(values[name], 2 if name == "seconds" else 3, 6) for name in _RATIOS),
        f"{values['failures']:.0f}",
    ]


def _tones(row: Mapping[str, Any]) -> list[str]:
    """Return how every cell is shown: up, down or nothing."""
    tones = ["", "", ""]
    for name in _RATIOS:
        value = row["values"][name]
        far = 0.25 if name == "seconds" else 5e-4
        off = 0.0 if value is None else value - 1.0
        tones.append("up" if off > far else "down" if off < -far else "")
    return [*tones, "up" if row["values"]["failures"] else ""]


def _proof(item: Mapping[str, Any]) -> list[str]:
    known = item["low"] is not None and item["high"] is not None
    return [
        plain(item["strategy"]),
        str(item["structures"]),
        str(item["differing"]),
        fixed(item["ratio"], 3, 6),
        f"{fixed(item['low'], 3, 6)} - {fixed(item['high'], 3, 6)}" if known else NOTHING,
        NOTHING if item["p"] is None else f"{item['p']:.2g}",
        item["verdict"],
    ]


def _job(item: Mapping[str, Any]) -> str:
    return f"{plain(item['strategy'])}, {plain(item['case'])}, seed {item['seed']}"


def _change(item: Mapping[str, Any]) -> str:
    said = f" ({plain(item['reason'])})" if item["reason"] else ""
    kind = _SAYS[item["kind"]]
    return f"{kind}: {_job(item)}: {item['before']} -> {item['after']}{said}"


def _excess(item: Mapping[str, Any]) -> str:
    where = "all scenarios" if item["scenario"] is None else plain(item["scenario"])
    value = f"{item['value']:.4g} > {item['most']:g}"
    return f"{plain(item['strategy'])}, {where}: {item['metric']} {value}"


def _lists(data: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    yield "Only in A", _jobs(data["only_before"])
    yield "Only in B", _jobs(data["only_after"])
    yield "Not compared: other case files", _jobs(data["other_cases"])
    differing = [shortened(plain(line), 300) for line in data["environment"]]
    yield "Environment", differing or ["nothing differs"]
    yield "Notes", [shortened(plain(note), 300) for note in data["notes"]]
    if data["untested"]:
        yield "Thresholds that nothing was held against", list(data["untested"])


def _jobs(jobs: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a line for every strategy and case."""
    found: dict[tuple[str, str], list[str]] = {}
    for job in jobs:
        found.setdefault((plain(job["strategy"]), plain(job["case"])), []).append(str(job["seed"]))
    return [
        f"{strategy}, {case}, seed{'s' if len(seeds) > 1 else ''} {', '.join(seeds)}"
        for (strategy, case), seeds in found.items()
    ]


def _listed(title: str, lines: Sequence[str]) -> list[str]:
    if not lines:
        return []
    more = [f"  ... and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    shown = [_wrapped(line, "  ") for line in lines[:_MOST_LINES]]
    return ["\n".join([f"{title} ({len(lines)})", *shown, *more])]


def _bullets(title: str, lines: Sequence[str]) -> list[str]:
    return [f"## {title}", "\n".join(f"- {escape(line)}" for line in lines)] if lines else []


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, WIDTH, initial_indent=indent, subsequent_indent=2 * indent)
