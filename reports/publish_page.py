"""The pages of a public leaderboard: a board a class, a page a strategy, a page a case."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from femubench.plot import Axis, Chart, Mark, Series
from femubench.reports.cells import fixed, interval, plain, shortened
from femubench.reports.feed import feed_of, headline_of
from femubench.reports.svg import drawing
from femubench.reports.templating import asset, templates
from femubench.results import ranked

_ALL = ("everything as JSON", "index.json")
_MOST_DRAWN = 20
_MOST_NEWS = 8
_LEAST = -1.0  # skill that is drawn; an arrow tells of less
_OTHERS = ("others", "not shown to be worse", "shown to be worse")
_BLOCKS = ("used", "higher", "modified")
_ERRORS = "rms frequency errors in percent: used modes, higher modes, after a design change"
_SKILL = (
    "Skill is the part of the textbook model's error on unseen data, higher modes and modified "
    "structures, that a strategy takes away: 1 is all of it, 0 none, less than 0 is worse; a "
    "failure leaves ten times the error. Unphysical models rank below all others; a strategy that "
    "lacks a case has no rank."
)

Data = Mapping[str, Any]
Kind = Literal["name", "text", "number"]


class Cell(NamedTuple):
    """What stands in a table; a number has the value to sort by."""

    kind: Kind
    text: str
    value: float | str = ""
    link: str = ""
    flags: Sequence[str] = ()


class Row(NamedTuple):
    """A row of a table and how it looks: ``old``, ``part`` or plain."""

    cells: Sequence[Cell]
    look: str = ""


class Table(NamedTuple):
    """A table, its heads with the kinds of their cells."""

    title: str
    heads: Sequence[tuple[str, Kind]]
    rows: Sequence[Row]
    caption: str = ""
    filtered: bool = False


def pages_of(index: Data) -> dict[str, str]:
    """Return all files but the data by their names, relative to the folder.

    Arguments:
        index: the content of ``index.json``.
    """
    boards, strategies = index["boards"], index["strategies"]
    links = [(plain(board["class"]) or "all", board["page"]) for board in boards]
    pages = {board["page"]: _board_page(index, board, links) for board in boards}
    table = [_of_board(board, item, row) for board, item, row in _places(index)]
    pages["leaderboard.csv"] = _csv(table)
    for item in strategies:
        stem = item["page"].removesuffix(".html")
        pages[item["page"]] = _strategy_page(item, index)
        pages[f"{stem}.json"] = json.dumps(item, indent=1, sort_keys=True, allow_nan=False) + "\n"
        pages[f"{stem}.csv"] = _csv(list(_of_strategy(item)))
    pages |= {item["page"]: _case_page(item, strategies) for item in index["cases"]}
    style = asset("page.css") + asset("site.css")
    return pages | {"feed.xml": feed_of(index), "site.css": style, "site.js": asset("site.js")}


def _page(here: str, title: str, **parts: Any) -> str:  # noqa: ANN401 - as the template has it
    root = "../" * here.count("/")
    empty = dict.fromkeys(("answer", "chart", "facts", "links", "news"), ())
    everything = {**empty, "downloads": [_ALL], **parts}
    return templates().get_template("site.html").render(
        here=here, root=root, title=title, **everything
    )  # fmt: skip


def _board_page(index: Data, board: Data, links: Sequence[tuple[str, str]]) -> str:
    whole = board is index["boards"][0]
    tables = [_board_table(index, board), _case_table(index, board)]
    if whole:
        tables += [_conflict_table(index)] if index["conflicts"] else []
        tables.append(_run_table(index))
    news = [{**item, "title": headline_of(item)} for item in index["news"][:_MOST_NEWS]]
    return _page(
        board["page"],
        "Leaderboard of updating strategies" + ("" if whole else f": {plain(board['class'])}"),
        answer=list(_answer(board)),
        links=links,
        chart=_drawn(skills_of(board), "The line is the 95 % interval over the structures."),
        news=news if whole else (),
        downloads=[("all boards as CSV", "leaderboard.csv"), _ALL],
        tables=tables,
    )


def _answer(board: Data) -> Iterator[str]:
    """Yield who is best, how sure that is, and on what."""
    first = [row for row in board["rows"] if row["rank"] == 1]
    others = [row for row in board["rows"] if _stand(row) in _OTHERS]
    if first:
        who = " and ".join(plain(row["strategy"]) for row in first)
        skill = f"skill {fixed(first[0]['skill'], 3, 7)}"
        yield f"{who} {'lead' if first[1:] else 'leads'} with {skill}{_sure(first[0])}."
    else:
        yield "Nobody leads: no strategy has all cases of the ranking."
    near = [plain(row["strategy"]) for row in others if not row["below_best"]]
    if others and not board["tested"]:
        yield "Too few structures to say whether the others are worse by more than chance."
    elif others:
        below = len(others) - len(near)
        more = f" and {len(near) - 3} more" if len(near) > 3 else ""
        rest = f"; not shown of {', '.join(near[:3])}{more}" if near else ""
        yield f"Shown to be worse by more than chance: {below} of {len(others)} others{rest}."
    unphysical = sum(_stand(row) == "unphysical" for row in board["rows"])
    if unphysical:
        yield f"Below them for unphysical models: {unphysical}."
    cases, structures = len(board["cases"]), board["structures"]
    told = f"{cases} case{'s' * (cases != 1)} of {structures} structure{'s' * (structures != 1)}"
    yield f"On {told} that more than half of the strategies were run on."


def _sure(row: Data) -> str:
    return "" if row["low"] is None else f" (95 % interval {interval(row['low'], row['high'])})"


def _board_table(index: Data, board: Data) -> Table:
    strategies = {item["name"]: item for item in index["strategies"]}
    rows = []
    for row in board["rows"]:
        item = strategies[row["strategy"]]
        latest = item["versions"][0]
        flags = _flags({**row, "conflicts": latest["conflicts"], "marks": latest["marks"]})
        covered = f"{row['covered']} of {len(board['cases'])}"
        cells = [
            Cell("number", str(row["rank"] or "–"), row["rank"] or ""),
            Cell("name", item["name"], link=item["page"], flags=flags),
            *_skill(row),
            *_errors(row),
            _number(row["seconds"]),
            Cell("number", covered, row["covered"]),
            Cell("text", shortened(plain(latest["version"]), 14)),
            Cell("text", latest["femubench"]),
            Cell("text", latest["last"][:10]),
            _count(len(item["versions"])),
            Cell("text", _machines(latest["machines"], most=1)),
        ]
        rows.append(Row(cells, "" if row["rank"] else "part"))
    heads = [
        *_heads("# rank | name strategy | # skill | 95 % | # used | # higher | # modified | # s"),
        *_heads("# cases | version | femubench | date | # versions | machine"),
    ]
    caption = f"{_SKILL} Then {_ERRORS}; median over the cases. Time in s."
    return Table("The latest version of every strategy", heads, rows, caption, filtered=True)


def _case_table(index: Data, board: Data) -> Table:
    """Return the cases of a board; on that of all also those that are not ranked."""
    every = not board["class"]
    rows = [
        Row([
            Cell("name", item["name"], link=item["page"]),
            Cell("text", item["title"]),
            Cell("text", ", ".join(map(plain, item["classes"]))),
            Cell("text", _digests(item)),
            Cell("text", "yes" if item["ranked"] else "no"),
        ])
        for item in index["cases"]
        if every or item["name"] in board["cases"]
    ]  # fmt: skip
    heads = _heads("name case | title | classes | digest of its files | in the ranking")
    return Table("Cases", heads, rows)


def _conflict_table(index: Data) -> Table:
    rows = [
        Row([
            Cell("name", f"{plain(i['strategy'])}, {plain(i['case'])}, seed {i['seed']}"),
            Cell("text", row["status"]),
            *_errors(row),
            Cell("text", "yes" if row["counted"] else "no"),
            Cell("text", _machines(row["machines"], most=1)),
        ])
        for i in index["conflicts"]
        for row in i["results"]
    ]  # fmt: skip
    caption = (
        "Runs of one and the same job, same case files, strategy, version and seed, that do not "
        "agree within 0.1 %. What most machines say counts; of equals, the worst."
    )
    heads = _heads("name job | status | # used | # higher | # modified | counts | machine")
    return Table("Contradicted results", heads, rows, caption)


def _run_table(index: Data) -> Table:
    rows = [
        Row([
            Cell("name", row["run"], "", row["file"], () if row["verified"] else ("unverified",)),
            Cell("text", row["started"][:10]),
            _count(row["results"]),
            Cell("text", row["versions"].get("femubench", "unknown")),
            Cell("text", _machines([row["machine"]])),
        ])
        for row in reversed(index["runs"])
    ]  # fmt: skip
    return Table("Runs", _heads("name run | date | # results | femubench | machine"), rows)


def _strategy_page(item: Data, index: Data) -> str:
    latest, stem = item["versions"][0], item["page"].removesuffix(".html")
    ranks = sum(row["rank"] is not None for row in index["boards"][0]["rows"])
    answer = "No rank: the latest version lacks a case of the ranking."
    if item["rank"]:
        skill = f"skill {fixed(latest['skill'], 3, 7)}{_sure(latest)}"
        answer = f"Rank {item['rank']} of {ranks} with {skill}."
    return _page(
        item["page"],
        plain(item["name"]) or "a strategy without name",
        answer=[answer],
        chart=_drawn(history_of(item["versions"]), "The line is the 95 % interval."),
        facts=list(_facts(item)),
        downloads=[(suffix.upper(), f"{stem}.{suffix}") for suffix in ("json", "csv")],
        tables=[_version_table(item), _class_table(item, index), _result_table(item, index)],
    )


def _facts(item: Data) -> Iterator[tuple[str, str, str]]:
    """Yield what is known of a strategy: what it is, text, link."""
    about = item["about"]
    told = [
        ("summary", about.get("summary"), ""),
        ("home page", about.get("homepage"), about.get("homepage")),
        ("author", about.get("author"), ""),
        ("citation", item["citation"], ""),
        ("DOI", about.get("doi"), f"https://doi.org/{about.get('doi')}"),
    ]
    yield from ((name, text, link) for name, text, link in told if plain(text or ""))


def _version_table(item: Data) -> Table:
    rows = []
    for number, row in zip(range(len(item["versions"]), 0, -1), item["versions"], strict=True):
        old = () if row["comparable"] else ("older case files",)
        cells = [
            _count(number),
            Cell("name", row["version"], flags=[*old, *_flags(row)]),
            Cell("text", row["femubench"]),
            Cell("text", row["last"][:10]),
            *_skill(row),
            *_errors(row),
            Cell("number", f"{row['covered']} of {item['cases']}", row["covered"]),
            Cell("text", _machines(row["machines"])),
        ]
        rows.append(Row(cells, "old" if old else ""))
    heads = [
        *_heads("# no. | name version | femubench | date | # skill | 95 % | # used | # higher"),
        *_heads("# modified | # cases | machine"),
    ]
    caption = f"Latest first; {_ERRORS}. Grey, without skill: on files of cases that have changed."
    return Table("Versions", heads, rows, caption)


def _class_table(item: Data, index: Data) -> Table:
    rows = [
        Row([
            Cell("name", plain(board["class"]) or "all", link=board["page"]),
            Cell("number", str(row["rank"] or "–"), row["rank"] or ""),
            *_skill(row),
            *_errors(row),
            Cell("number", f"{row['covered']} of {len(board['cases'])}", row["covered"]),
        ])
        for board, owner, row in _places(index)
        if owner is item
    ]  # fmt: skip
    heads = "name class | # rank | # skill | 95 % | # used | # higher | # modified | # cases"
    return Table("By class of structure", _heads(heads), rows)


def _result_table(item: Data, index: Data) -> Table:
    pages = {case["name"]: case["page"] for case in index["cases"]}
    rows = []
    for row in item["versions"][0]["cases"]:
        flags = [*(() if row["current"] else ("older case files",)), *_flags(row)]
        cells = [Cell("name", row["case"], link=pages[row["case"]], flags=flags), *_result(row)]
        rows.append(Row(cells, "" if row["current"] else "old"))
    return Table("The latest version, case by case", _heads(f"name case | {_RESULT}"), rows)


def _case_page(item: Data, strategies: Iterable[Data]) -> str:
    rows = [
        Row([
            Cell("name", owner["name"], link=owner["page"], flags=_flags(row)),
            *_result(row),
            Cell("text", shortened(plain(owner["versions"][0]["version"]), 24)),
        ])
        for owner, row in _on_case(strategies, item["name"], item["digest"])
    ]  # fmt: skip
    nominal = (f"{name} {fixed(item['nominal_percent'].get(name), 2, 7)}" for name in _BLOCKS)
    older = f" (older: {', '.join(plain(digest)[:12] for digest in item['older'])})"
    facts = [
        ("case", plain(item["name"]) or "(no name)", ""),
        ("classes", ", ".join(map(plain, item["classes"])) or "not told", ""),
        ("digest of its files", plain(item["digest"])[:12] + older * bool(item["older"]), ""),
        ("in the ranking", "yes" if item["ranked"] else "no", ""),
        ("textbook model, rms error in %", ", ".join(nominal), ""),
    ]
    caption = f"The latest version of every strategy on these files; {_ERRORS}; time in s."
    table = Table("Results", _heads(f"name strategy | {_RESULT} | version"), rows, caption)
    title = plain(item["title"]) or plain(item["name"])
    return _page(item["page"], title, facts=facts, tables=[table])


def _on_case(strategies: Iterable[Data], name: str, digest: str) -> Iterator[tuple[Data, Data]]:
    """Yield strategies with the results of their latest versions on a case, the best first."""
    found = [
        (item, row)
        for item in strategies
        for row in item["versions"][0]["cases"]
        if (row["case"], row["digest"]) == (name, digest)
    ]

    def order(entry: tuple[Data, Data]) -> tuple[tuple[bool], float, str]:
        item, row = entry
        return (bool(row["unphysical"] or row["conflict"]),), row["score"], item["name"]

    yield from (entry for _, entry in ranked(found, order))


def _places(index: Data) -> Iterator[tuple[Data, Data, Data]]:
    """Yield every board with every strategy and its row there."""
    strategies = {item["name"]: item for item in index["strategies"]}
    for board in index["boards"]:
        for row in board["rows"]:
            yield board, strategies[row["strategy"]], row


_RESULT = "status | # score | # used | # higher | # modified | # s | data | # machines"


def _result(row: Data) -> list[Cell]:
    seeds = len(row["seeds"])
    data = "as recorded" if row["recorded"] else f"median of {seeds} noise draw{'s' * (seeds > 1)}"
    figures = [_number(row["score"], 3), *_errors(row), _number(row["seconds"])]
    return [Cell("text", row["status"]), *figures, Cell("text", data), _count(row["machines"])]


def _heads(line: str) -> list[tuple[str, Kind]]:
    """Return heads of a table; ``#`` stands before those of numbers."""
    kinds: dict[str, Kind] = {"#": "number", "name": "name"}
    words = (part.strip().partition(" ") for part in line.split("|"))
    return [
        (rest, kinds[word]) if word in kinds else (f"{word} {rest}".strip(), "text")
        for word, _, rest in words
    ]


def _number(value: float | None, digits: int = 2) -> Cell:
    return Cell("number", fixed(value, digits, 7), "" if value is None else value)


def _count(value: int) -> Cell:
    return Cell("number", str(value), value)


def _skill(row: Data) -> list[Cell]:
    sure = "–" if row["low"] is None else interval(row["low"], row["high"])
    return [_number(row["skill"], 3), Cell("text", sure)]


def _errors(row: Data) -> list[Cell]:
    return [_number(row[f"{name}_percent"]) for name in _BLOCKS]


def _flags(row: Data) -> list[str]:
    """Return what a reader has to know of a version or of a result."""
    counts = {"contradicted": row.get("conflicts"), "failed": row.get("failures")}
    told = [f"{count} {word}" for word, count in counts.items() if count]
    plainly = {"unphysical": row["unphysical"], "contradicted": row.get("conflict")}
    return [*(word for word, is_so in plainly.items() if is_so), *told, *row.get("marks", ())]


def _digests(item: Data) -> str:
    older = f", {len(item['older'])} older" if item["older"] else ""
    return plain(item["digest"])[:12] + older


def _machines(machines: Sequence[Data], *, most: int = 3) -> str:
    """Return the first machines with processor and linear algebra, and how many there are."""
    keys = ("cpu",) if most == 1 else ("cpu", "blas")
    listed = (", ".join(plain(m[key]) for key in keys if m.get(key)) for m in machines)
    names = list(dict.fromkeys(shortened(name, 80) or "unknown" for name in listed))
    return "; ".join(names[:most]) + (f" +{len(names) - most}" if len(names) > most else "")


def skills_of(board: Data) -> Chart:
    """Return the skills of a board with their intervals, by what is shown of them."""
    known = [row for row in board["rows"] if row["skill"] is not None]
    title = "Skill of every strategy" if len(known) <= _MOST_DRAWN else "Skill of the first"
    rows = [
        (_stand(row), f"{row['rank'] or '–'}  {plain(row['strategy'])}", row)
        for row in known[:_MOST_DRAWN]
    ]
    return _chart(title, rows)


def _stand(row: Data) -> str:
    if not row["complete"]:
        return "lacks a case"
    if row["unphysical"]:
        return "unphysical"
    if row["rank"] == 1:
        return "best"
    return _OTHERS[(None, False, True).index(row["below_best"])]


def history_of(versions: Sequence[Data]) -> Chart | None:
    """Return the skill of every version, latest first; None where there is nothing to compare."""
    numbers = range(len(versions), 0, -1)
    rows = [
        (
            "on all cases" if row["complete"] else "lacks a case",
            f"{number}  {shortened(plain(row['version']), 14)}, {row['last'][:10]}",
            row,
        )
        for number, row in zip(numbers, versions, strict=True)
        if row["skill"] is not None
    ]
    return _chart("Skill of every version", rows[:_MOST_DRAWN]) if len(rows) > 1 else None


def _chart(title: str, rows: Sequence[tuple[str, str, Data]]) -> Chart:
    """Return skills with intervals, given by group and label."""
    ends = [row[key] for _, _, row in rows for key in ("skill", "low") if row[key] is not None]
    least = max(min([*ends, 0.0]) - 0.05, _LEAST)
    series = []
    for group in dict.fromkeys(group for group, _, _ in rows):
        own = [(label, row) for other, label, row in rows if other == group]
        low, high = (
            [None if row[key] is None else max(row[key], _LEAST) for _, row in own]
            for key in ("low", "high")
        )
        skills = [row["skill"] for _, row in own]
        series.append(Series(group, skills, [label for label, _ in own], low, high))
    x = Axis("skill, part of the error taken away", low=least, high=1.0)
    y = Axis("", names=tuple(label for _, label, _ in rows))
    return Chart("interval", title, x, y, tuple(series), (Mark("x", 0.0, "textbook model"),))


def _drawn(chart: Chart | None, note: str) -> dict[str, Any] | None:
    told = f"{note} 1: no error left; 0: as the textbook model, without data."
    found = chart and drawing(chart, f"{told} The table has the figures.")
    return {"title": chart.title, "drawing": found, "note": told} if chart and found else None


def _of_board(board: Data, item: Data, row: Data) -> dict[str, Any]:
    latest = {key: item["versions"][0][key] for key in ("version", "femubench", "last")}
    return {"class": board["class"], **row, **latest, "marks": "; ".join(_flags(row))}


def _of_strategy(item: Data) -> Iterator[dict[str, Any]]:
    """Yield a line a version and case."""
    for version in item["versions"]:
        told = {key: version[key] for key in ("version", "femubench", "last")}
        for row in version["cases"]:
            yield {**told, **row, "seeds": " ".join(map(str, row["seeds"]))}


def _csv(rows: Sequence[Data]) -> str:
    import pandas as pd

    from femubench.reports.csvs import harmless_csv

    return harmless_csv(pd.DataFrame(rows)) + "\n"
