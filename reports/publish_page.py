"""The pages of a public leaderboard: a board a class, a page a strategy, a page a case."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from markupsafe import Markup

from femubench import FemubenchError, cases
from femubench.plot import Axis, Chart, Mark, Series, mode_shape, svg
from femubench.reports.blocks import Column, Passage, Table
from femubench.reports.cells import format_fixed, interval, plain, shorten_text
from femubench.reports.feed import feeds_of, headline_of
from femubench.reports.markdown import to_markdown
from femubench.reports.summary import headline
from femubench.reports.svg import drawing
from femubench.reports.templating import asset, templates
from femubench.results import Standings

_MOST_DRAWN = 20
_LEAST = -1.0  # the least gain that there is
_LINE = "The line is the 95 % interval. "

Data = Mapping[str, Any]


def pages_of(index: Data) -> dict[str, str]:
    """Return all files but the data by their names, relative to the folder.

    Arguments:
        index: the content of ``index.json``.
    """
    pages = {board["page"]: _board_page(index, board) for board in index["boards"]}
    marks = {item["name"]: item["versions"][0]["marks"] for item in index["strategies"]}
    releases = {item["name"]: _release(item["versions"][0]) for item in index["strategies"]}
    pages["leaderboard.csv"] = _csv(
        {
            "class": kind,
            **{k: " ".join(v) if isinstance(v, list) else v for k, v in row.items()},
            **releases[row["strategy"]],
            "marks": "; ".join(_flags({**row, "marks": marks[row["strategy"]]})),
        }
        for kind, rows in ((board["class"], board["rows"]) for board in index["boards"])
        for row in rows
    )
    pages["leaderboard.md"] = _markdown(index["boards"], marks)
    for item in index["strategies"]:
        stem = item["page"].removesuffix(".html")
        pages[item["page"]] = _strategy_page(item, index)
        pages[f"{stem}.json"] = json.dumps(item, indent=1, sort_keys=True, allow_nan=False) + "\n"
        pages[f"{stem}.csv"] = _csv(_lines(item))
    for item in index["cases"]:
        rows = _on_case(index["strategies"], item["name"], item["digest"])
        title = plain(item["title"]) or plain(item["name"])
        pages[item["page"]] = _page("case", index, item, title, rows=rows, picture=_picture(item))
    style = asset("page.css") + asset("site.css")
    script = asset("sortable.js") + asset("site.js")
    return pages | feeds_of(index) | {"site.css": style, "site.js": script}


def _page(kind: str, index: Data, item: Data, title: str, **parts: Any) -> str:  # noqa: ANN401
    """Return a page of a board, a strategy or a case: `item`."""
    page = templates().get_template(f"site_{kind}.html", globals=_WORDS)
    root = "../" * item["page"].count("/")
    return page.render(index=index, item=item, title=title, root=root, **parts)


def _board_page(index: Data, board: Data) -> str:
    name = plain(board["class"])
    return _page(
        "board", index, board,
        "Leaderboard of updating strategies" + (f": {name}" if name else ""),
        answer=list(_answer(board)),
        chart=gains_of(board),
        strategies={item["name"]: item for item in index["strategies"]},
    )  # fmt: skip


def _picture(item: Data) -> Markup | None:
    """Return the first mode of a case on its structure, where the same files are installed."""
    name, said = plain(item["name"]), "The structure and its first mode, predicted and measured."
    try:
        if name not in cases or cases[name].digest != item["digest"]:
            return None
        draw = partial(mode_shape, cases[name], 1)
        drawn = svg(draw, name="structure", title=name, caption=said, size=(6.0, 4.2), themed=True)
    except FemubenchError:  # as of a model of more nodes than a picture has
        return None
    return Markup(drawn)


def _strategy_page(item: Data, index: Data) -> str:
    latest = item["versions"][0]
    ranks = sum(row["rank"] is not None for row in index["boards"][0]["rows"])
    answer = "No rank: the latest version lacks a case of the ranking."
    if latest["yardstick"]:
        answer = f"A yardstick, without rank: {plain(latest['yardstick'])}."
    elif item["rank"]:
        answer = f"Rank {item['rank']} of {ranks} with {_gain_words(latest)}."
    return _page(
        "strategy", index, item,
        plain(item["name"]) or "a strategy without name",
        answer=[answer],
        chart=history_of(item["versions"]),
        pages={case["name"]: case["page"] for case in index["cases"]},
    )  # fmt: skip


def _answer(board: Data) -> Iterator[str]:
    """Yield who is best, how sure that is, and on what."""
    rows = [
        {**row, "gain_low": _number(row["low"]), "gain_high": _number(row["high"])}
        for row in board["rows"]
        if row["complete"]
    ]
    over = f"{board['structures']} structures" * any(row["low"] is not None for row in rows)
    said = headline(rows, "Above the given band", "handbooks", board["structures"], over)
    if any(row["rank"] == 1 for row in rows):
        yield from said
    else:
        yield "Nobody leads: no strategy has all cases of the ranking."
    cases, structures = len(board["cases"]), board["structures"]
    stated = f"{cases} case{'s' * (cases != 1)} of {structures} structure{'s' * (structures != 1)}"
    yield f"On {stated} that more than half of the strategies were run on."


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _gain_words(row: Data) -> str:
    sure = "" if row["low"] is None else f" (95 % interval {interval(row['low'], row['high'])})"
    return f"gain {format_fixed(row['gain'], 3, 7)}{sure}"


def _on_case(strategies: Iterable[Data], name: str, digest: str) -> list[tuple[Data, Data]]:
    """Return strategies with the results of their latest versions on a case, the best first."""
    found = [
        (item, row)
        for item in strategies
        for row in item["versions"][0]["cases"]
        if (row["case"], row["digest"]) == (name, digest)
    ]

    def order(entry: tuple[Data, Data]) -> tuple[tuple[bool], float, str]:
        item, row = entry
        return (bool(row["conflict"]),), -row["gain"], item["name"]

    return Standings.ordered(found, order)


def _flags(row: Data) -> list[str]:
    """Return what a reader has to know of a version or of a result."""
    plainly = {
        "older case files": not row.get("current", row.get("comparable", True)),
        "unphysical": row["unphysical"],
        "contradicted": row.get("conflict"),
    }
    counts = {"contradicted": row.get("conflicts"), "failed": row.get("failures")}
    stated = [f"{count} {word}" for word, count in counts.items() if count]
    return [*(word for word, is_so in plainly.items() if is_so), *stated, *row.get("marks", ())]


def _machines(machines: Sequence[Data], *, most: int = 3) -> str:
    """Return the first machines with processor and linear algebra, and how many there are."""
    keys = ("cpu",) if most == 1 else ("cpu", "blas")
    listed = (", ".join(plain(m[key]) for key in keys if m.get(key)) for m in machines)
    names = list(dict.fromkeys(shorten_text(name, 80) or "unknown" for name in listed))
    return "; ".join(names[:most]) + (f" +{len(names) - most}" if len(names) > most else "")


def gains_of(board: Data) -> Chart:
    """Return the gains of a board with their intervals."""
    known = [row for row in board["rows"] if row["gain"] is not None]
    whose = "every strategy" if len(known) <= _MOST_DRAWN else f"the first {_MOST_DRAWN}"
    labels = (
        f"{row['rank'] or ('=' if row['yardstick'] else '–')}  {plain(row['strategy'])}"
        for row in known
    )
    return _chart(f"Gain of {whose}", list(zip(map(_stand, known), labels, known, strict=True)))


def _stand(row: Data) -> str:
    if not row["complete"]:
        return "lacks a case"
    if row["yardstick"]:
        return "yardsticks"
    return "best" if row["rank"] == 1 else "others"


def history_of(versions: Sequence[Data]) -> Chart | None:
    """Return the gain of every version, latest first; None where there is nothing to compare."""
    rows = [
        (
            "on all cases" if row["complete"] else "lacks a case",
            f"{len(versions) - age}  {shorten_text(plain(row['version']), 14)}, {row['last'][:10]}",
            row,
        )
        for age, row in enumerate(versions)
        if row["gain"] is not None
    ]
    return _chart("Gain of every version", rows) if len(rows) > 1 else None


def _chart(title: str, rows: Sequence[tuple[str, str, Data]]) -> Chart:
    """Return the first gains with their intervals, given by group and label."""
    drawn = rows[:_MOST_DRAWN]
    ends = [row[key] for _, _, row in drawn for key in ("gain", "low") if row[key] is not None]
    series = []
    for group in dict.fromkeys(group for group, _, _ in drawn):
        own = [(label, row) for other, label, row in drawn if other == group]
        low, high = (
            [None if row[key] is None else max(row[key], _LEAST) for _, row in own]
            for key in ("low", "high")
        )
        gains = [row["gain"] for _, row in own]
        series.append(Series(group, gains, [label for label, _ in own], low, high))
    least = max(min([*ends, 0.0]) - 0.05, _LEAST)
    x = Axis("gain over the textbook models", low=least, high=1.0)
    y = Axis("", names=tuple(label for _, label, _ in drawn))
    sure = any(row["low"] is not None for _, _, row in drawn)
    note = f"{_LINE * sure}1: no error left; 0: as the textbook models, without data."
    marks = (Mark("x", 0.0, "textbook model"),)
    return Chart("interval", title, x, y, tuple(series), marks, note=note)


def _release(version: Data) -> dict[str, Any]:
    return {key: version[key] for key in ("version", "femubench", "last")}


def _lines(item: Data) -> Iterator[dict[str, Any]]:
    """Yield a line a version and case."""
    for version in item["versions"]:
        for row in version["cases"]:
            yield {**_release(version), **row, "seeds": " ".join(map(str, row["seeds"]))}


def _markdown(boards: Iterable[Data], marks: Mapping[str, Sequence[str]]) -> str:
    """Return all boards as tables, which say of every row what was computed again."""
    heads = [Column(title, 0, left=True) for title in ("#", "strategy", "gain", "marks")]
    sections = []
    for board in boards:
        rows = [
            [str(row["rank"] or "=" * bool(row["yardstick"])), row["strategy"],
             "" if row["gain"] is None else _gain_words(row).removeprefix("gain "),
             "; ".join(_flags({**row, "marks": marks[row["strategy"]]}))]
            for row in board["rows"]
        ]  # fmt: skip
        sections.append(Passage(board["class"] or "all cases", [Table(heads, rows)]))
    return to_markdown(sections, "Leaderboard of updating strategies") + "\n"


def _csv(rows: Iterable[Data]) -> str:
    import pandas as pd

    from femubench.reports.csvs import harmless_csv

    return harmless_csv(pd.DataFrame(list(rows))) + "\n"


_WORDS = {
    "drawing": drawing, "flags": _flags, "headline": headline_of, "interval": interval,
    "machines": _machines,
}  # fmt: skip
