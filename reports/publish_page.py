"""The pages of a public leaderboard: ranking, a page a strategy, a page a case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from femubench.reports.cells import plain, shortened
from femubench.reports.templating import site_page
from femubench.results import ranked

_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 640.0, 220.0, 56.0, 34.0
_MOST_DOTS = 60
_LEAST_LEFT = 1e-6  # of the error, so that it has a logarithm

Data = Mapping[str, Any]


def pages_of(index: Data) -> dict[str, str]:
    """Return the pages by their names, relative to the folder.

    Arguments:
        index: the content of ``index.json``.
    """

    def page(kind: str, title: str, **parts: Any) -> str:  # noqa: ANN401 - as the template has it
        root = "" if kind == "index" else "../"
        words = {"machines": _machines, "processors": _processors}
        template = site_page("site.html")
        return template.render(page=kind, root=root, title=title, **words, **parts)

    pages = {"index.html": page("index", "Leaderboard of updating strategies", index=index)}
    for item in index["strategies"]:
        title = plain(item["name"]) or "a strategy without name"
        pages[item["page"]] = page("strategy", title, item=item, chart=chart(item["versions"]))
    for item in index["cases"]:
        title = plain(item["title"]) or plain(item["name"])
        rows = list(_on_case(index["strategies"], item["name"], item["digest"]))
        pages[item["page"]] = page("case", title, item=item, rows=rows)
    return pages


def _machine(machine: Data) -> str:
    """Return processor and linear algebra of a machine."""
    parts = [plain(machine.get(name) or "") for name in ("cpu", "blas")]
    return ", ".join(part for part in parts if part) or "unknown machine"


def _machines(machines: Iterable[Data], *, most: int = 3) -> str:
    """Return the first machines with processor and linear algebra, and how many there are."""
    names = list(dict.fromkeys(map(_machine, machines)))
    more = f"; and {len(names) - most} more" if len(names) > most else ""
    return "; ".join(names[:most]) + more


def _processors(machines: Sequence[Data]) -> str:
    """Return the first processor, and how many other machines there are."""
    first = shortened(plain(machines[0].get("cpu") or "unknown"), 24)
    return first + (f" +{len(machines) - 1}" if len(machines) > 1 else "")


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


def chart(versions: Sequence[Data]) -> dict[str, Any] | None:
    """Return the skill over the versions, oldest left; None where there is nothing to compare.

    A version that lacks a case of the ranking is hollow and not joined by the line.
    """
    rows = [row for row in reversed(versions) if row["skill"] is not None][-_MOST_DOTS:]
    if len(rows) < 2:
        return None
    logs = [math.log(max(1.0 - row["skill"], _LEAST_LEFT)) for row in rows]
    low, high = min([*logs, 0.0]) - 0.1, max([*logs, 0.0]) + 0.1
    step = (_WIDTH - _LEFT - 30.0) / (len(rows) - 1)

    def height(log: float) -> float:
        return round(12.0 + (_HEIGHT - _BOTTOM - 12.0) * (log - low) / (high - low), 1)

    dots = [
        {
            "x": round(_LEFT + 10.0 + number * step, 1),
            "y": height(log),
            "hollow": not row["complete"],
            "label": f"{plain(row['version'])}: {row['skill']:.3f}",
            "day": row["last"][:10],
        }
        for number, (row, log) in enumerate(zip(rows, logs, strict=True))
    ]
    solid = " ".join(f"{dot['x']},{dot['y']}" for dot in dots if not dot["hollow"])
    every = " ".join(f"{dot['x']},{dot['y']}" for dot in dots)
    nice = (digit * 10.0**power for power in range(-8, 9) for digit in (1.0, 2.0, 5.0))
    inside = [value for value in nice if low < math.log(value) < high and value != 1.0]
    shown = inside if len(inside) < 6 else [v for v in inside if f"{v:e}".startswith("1.")]
    ticks = [(height(math.log(value)), f"{1.0 - value:g}") for value in [1.0, *shown]]
    return {"dots": dots, "line": solid, "every": every, "ticks": ticks}
