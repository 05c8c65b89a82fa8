"""The pages of a public leaderboard: ranking, a page a strategy, a page a case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from femubench.reports.cells import NOTHING, fixed, plain, shortened
from femubench.reports.site import environment
from femubench.results import ranked

_BLOCKS = ("used", "higher", "modified")
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 640.0, 220.0, 56.0, 34.0
_MOST_DOTS = 60


def pages_of(index: Mapping[str, Any]) -> dict[str, str]:
    """Return the pages by their names, relative to the folder.

    Arguments:
        index: the content of ``index.json``.
    """
    room = environment()

    def page(name: str, **parts: Any) -> str:  # noqa: ANN401 - whatever a template shows
        root = "../" if parts.pop("inner", True) else ""
        return room.get_template("site.html").render(page=name, root=root, **parts)

    board = [_board_row(item) for item in index["strategies"]]
    pages = {
        "index.html": page(
            "index",
            inner=False,
            title="Leaderboard of updating strategies",
            board=board,
            cases=[_case_row(item) for item in index["cases"]],
            ranked=sum(item["ranked"] for item in index["cases"]),
            runs=[_run_row(item) for item in reversed(index["runs"])],
            conflicts=[_conflict_row(item) for item in index["conflicts"]],
        )
    }
    for item in index["strategies"]:
        pages[item["page"]] = page(
            "strategy",
            title=plain(item["name"]) or "a strategy without name",
            citation=plain(item["citation"]),
            rank=item["rank"],
            history=[_version_row(row, item["cases"]) for row in item["versions"]],
            results=[_result_row(row) for row in item["versions"][0]["cases"]],
            chart=chart(item["versions"]),
        )
    for item in index["cases"]:
        rows = list(_on_case(index["strategies"], item["name"], item["digest"]))
        pages[item["page"]] = page(
            "case",
            title=plain(item["title"]) or plain(item["name"]),
            case=_case_row(item),
            nominal=[(name, _percent(item["nominal_percent"].get(name))) for name in _BLOCKS],
            older=[plain(digest)[:12] for digest in item["older"]],
            rows=rows,
        )
    return pages


def _cell(value: float | None, digits: int, width: int = 7) -> tuple[str, str]:
    """Return a number as it is shown and as it sorts."""
    return fixed(value, digits, width), "" if value is None else repr(value)


def _percent(value: float | None) -> tuple[str, str]:
    return _cell(value, 2)


def _errors(row: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [_percent(row[f"{name}_percent"]) for name in _BLOCKS]


def _day(moment: str) -> str:
    return moment[:10]


def _machine(machine: Mapping[str, Any]) -> str:
    """Return processor and linear algebra of a machine."""
    parts = [plain(machine.get(name) or "") for name in ("cpu", "blas")]
    return ", ".join(part for part in parts if part) or "unknown machine"


def _machines(machines: Iterable[Mapping[str, Any]], *, most: int = 3) -> str:
    """Return the first machines with processor and linear algebra, and how many there are."""
    names = list(dict.fromkeys(map(_machine, machines)))
    more = f"; and {len(names) - most} more" if len(names) > most else ""
    return "; ".join(names[:most]) + more


def _processors(machines: Sequence[Mapping[str, Any]]) -> str:
    """Return the first processor, and how many other machines there are."""
    first = shortened(plain(machines[0].get("cpu") or "unknown"), 24)
    return first + (f" +{len(machines) - 1}" if len(machines) > 1 else "")


def _flags(row: Mapping[str, Any]) -> list[str]:
    flags = []
    if row["unphysical"]:
        flags.append("unphysical")
    if row["conflicts"]:
        flags.append(f"{row['conflicts']} contradicted")
    if row["failures"]:
        flags.append(f"{row['failures']} failed")
    return flags


def _board_row(item: Mapping[str, Any]) -> dict[str, Any]:
    row = item["versions"][0]
    return {
        "name": plain(item["name"]) or "(no name)",
        "page": item["page"],
        "rank": (NOTHING, "") if item["rank"] is None else (str(item["rank"]), str(item["rank"])),
        "part": item["rank"] is None,
        "skill": _cell(row["skill"], 3),
        "errors": _errors(row),
        "seconds": _cell(row["seconds"], 2),
        "covered": (f"{row['covered']} of {item['cases']}", str(row["covered"])),
        "version": shortened(plain(row["version"]), 24),
        "femubench": plain(row["femubench"]),
        "day": _day(row["last"]),
        "versions": (str(len(item["versions"])), str(len(item["versions"]))),
        "flags": _flags(row),
        "machines": _processors(row["machines"]),
    }


def _version_row(row: Mapping[str, Any], cases: int) -> dict[str, Any]:
    return {
        "version": plain(row["version"]),
        "femubench": plain(row["femubench"]),
        "day": _day(row["last"]),
        "old": not row["comparable"],
        "skill": _cell(row["skill"], 3),
        "errors": _errors(row),
        "covered": f"{row['covered']} of {cases}",
        "flags": _flags(row),
        "machines": _machines(row["machines"]),
    }


def _result_row(row: Mapping[str, Any]) -> dict[str, Any]:
    flags = [word for word in ("unphysical", "conflict") if row[word]]
    basis = "as recorded" if row["recorded"] else f"median of {len(row['seeds'])} noise draws"
    return {
        "case": plain(row["case"]),
        "old": not row["current"],
        "status": row["status"],
        "score": _cell(row["score"], 3),
        "errors": _errors(row),
        "seconds": _cell(row["seconds"], 2),
        "basis": basis,
        "machines": row["machines"],
        "flags": ["contradicted" if word == "conflict" else word for word in flags],
    }


def _on_case(
    strategies: Iterable[Mapping[str, Any]], name: str, digest: str
) -> Iterable[dict[str, Any]]:
    found = [
        (row["score"], item["name"], {**_result_row(row), "name": plain(item["name"])}, item)
        for item in strategies
        for row in item["versions"][0]["cases"]
        if (row["case"], row["digest"]) == (name, digest)
    ]
    for _, (_, _, row, item) in ranked(
        found, lambda entry: ((entry[2]["flags"] != [],), entry[0], entry[1])
    ):
        yield {**row, "page": item["page"], "version": plain(item["versions"][0]["version"])}


def _case_row(item: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": plain(item["name"]) or "(no name)",
        "title": plain(item["title"]),
        "page": item["page"],
        "digest": plain(item["digest"])[:12],
        "older": len(item["older"]),
        "ranked": item["ranked"],
    }


def _run_row(item: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "run": plain(item["run"]),
        "file": item["file"],
        "day": _day(item["started"]),
        "machine": _machine(item["machine"]),
        "femubench": plain(item["versions"].get("femubench", "unknown")),
        "results": str(item["results"]),
    }


def _conflict_row(item: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "job": f"{plain(item['strategy'])}, {plain(item['case'])}, seed {item['seed']}",
        "results": [
            {
                "status": row["status"],
                "counted": row["counted"],
                "errors": _errors(row),
                "machines": _machines(row["machines"], most=1),
            }
            for row in item["results"]
        ],
    }


def chart(versions: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Return the skill over the versions, oldest left; None where there is nothing to compare.

    A version that lacks a case of the ranking is hollow and not joined by the line.
    """
    rows = [row for row in reversed(versions) if row["skill"] is not None][-_MOST_DOTS:]
    if len(rows) < 2:
        return None
    logs = [math.log(row["skill"]) for row in rows]
    low, high = min([*logs, 0.0]) - 0.1, max([*logs, 0.0]) + 0.1
    step = (_WIDTH - _LEFT - 30.0) / (len(rows) - 1)

    def height(log: float) -> float:
        return round(12.0 + (_HEIGHT - _BOTTOM - 12.0) * (high - log) / (high - low), 1)

    dots = [
        {
            "x": round(_LEFT + 10.0 + number * step, 1),
            "y": height(log),
            "hollow": not row["complete"],
            "label": f"{plain(row['version'])}: {row['skill']:.3f}",
            "day": _day(row["last"]),
        }
        for number, (row, log) in enumerate(zip(rows, logs, strict=True))
    ]
    solid = " ".join(f"{dot['x']},{dot['y']}" for dot in dots if not dot["hollow"])
    every = " ".join(f"{dot['x']},{dot['y']}" for dot in dots)
    nice = (digit * 10.0**power for power in range(-8, 9) for digit in (1.0, 2.0, 5.0))
    inside = [value for value in nice if low < math.log(value) < high and value != 1.0]
    shown = inside if len(inside) < 6 else [v for v in inside if f"{v:e}".startswith("1.")]
    ticks = [(height(math.log(value)), f"{value:g}") for value in [1.0, *shown]]
    ends = {"first": dots[0], "last": dots[-1]}
    return {"dots": dots, "line": solid, "every": every, "ticks": ticks, **ends}
