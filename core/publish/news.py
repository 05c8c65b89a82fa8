"""What happened on a public leaderboard, run by run: new versions, new leaders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from femubench.core.score.ranking import rank_items

_MOST = 100  # entries that are kept, the latest
_STATED = ("gain", "error_percent", "textbook_percent", "marks", "failures")


def news_of(
    strategies: Sequence[Mapping[str, Any]], runs: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return every new version and every change of the leader, latest first.

    Gains are those on the cases of today, on which alone versions of different times compare; so
    a leader of old is whom one would have seen with these cases.

    Arguments:
        strategies: those of ``index.json``, with their versions.
        runs: those of ``index.json``, oldest first.
    """
    owners: dict[str, list[tuple[Mapping[str, Any], Mapping[str, Any]]]] = {}
    for strategy in strategies:
        for version in strategy["versions"]:
            for name in version["runs"]:
                owners.setdefault(name, []).append((strategy, version))
    present: dict[str, Mapping[str, Any]] = {}
    stated: list[dict[str, Any]] = []
    leader = ""
    for run in runs:
        found = owners.get(run["file"].rpartition("/")[2], [])
        for strategy, version in sorted(found, key=lambda item: str(item[0]["name"])):
            if version["runs"][0] == run["file"].rpartition("/")[2]:
                kind = "version" if strategy["name"] in present else "strategy"
                stated.append(_entry(kind, strategy["name"], version, run))
        present |= {strategy["name"]: version for strategy, version in found}
        first = _leaders(present)
        if first and leader not in first:
            leader = first[0]
            stated.append(_entry("leader", leader, present[leader], run))
    pages = {strategy["name"]: strategy["page"] for strategy in strategies}
    return [{**item, "page": pages[item["strategy"]]} for item in stated[::-1][:_MOST]]


def _leaders(present: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return who shares the first rank; nobody where nobody has all cases."""
    sound = {
        name: version
        for name, version in present.items()
        if version["complete"] and version["answered"] and not version["yardstick"]
    }
    listed = rank_items(sound, lambda name: ((), -sound[name]["gain"], name))
    return [name for rank, name in listed if rank == 1]


def _entry(
    kind: str, strategy: str, version: Mapping[str, Any], run: Mapping[str, Any]
) -> dict[str, Any]:
    stated = {name: version[name] for name in (*_STATED, "version", "femubench", "low", "high")}
    return {"kind": kind, "when": run["started"], "strategy": strategy, **stated}
