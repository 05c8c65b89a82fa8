"""Count the lines of Python of every room against its budget; 1 where one exceeds it.

    python benchmarks/line_budget.py

A room is a folder of `core/`, or another folder at the root. `make test` runs this.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ("core", "plugins", "reports", "papers", "scenarios", "femubench")
ALL = "package"  # the rooms of PACKAGE together
# What the rooms have now: they may shrink, and the package is to come to 73 000 lines.
BUDGETS = {
    ALL: 91_536,
    "core": 1_025,
    "core/advise": 833,
    "core/case": 7_649,
    "core/challenge": 2_131,
    "core/change": 1_274,
    "core/child": 2_272,
    "core/cli": 2_592,
    "core/conformance": 2_249,
    "core/diagnosis": 3_080,
    "core/drawing": 1_467,
    "core/effect": 1_093,
    "core/fem": 5_706,
    "core/fit": 1_934,
    "core/identify": 1_717,
    "core/inference": 3_968,
    "core/library": 2_875,
    "core/look": 1_172,
    "core/modal": 4_792,
    "core/plot": 2_852,
    "core/plugin": 1_912,
    "core/publish": 1_467,
    "core/reproduction": 617,
    "core/run": 4_572,
    "core/schema": 1_474,
    "core/score": 2_523,
    "core/study": 610,
    "core/twin": 823,
    "core/update": 4_963,
    "plugins": 13_500,
    "reports": 4_075,
    "papers": 3_249,
    "scenarios": 750,
    "femubench": 320,
    "tests": 51_078,
    "truths": 14_392,
    "benchmarks": 8_032,
}
ADVICE = (
    "shorten the room: take out what nothing calls, make one of what is there twice; where a "
    "feature needs the lines, raise its budget in benchmarks/line_budget.py and say why in the "
    "message of the commit"
)


def lines_by_room(root: Path) -> dict[str, int]:
    """Return the lines of Python of every room and of the whole package; links are not followed."""
    found = dict.fromkeys(BUDGETS, 0)
    tops = dict.fromkeys(room.partition("/")[0] for room in BUDGETS if room != ALL)
    for top in tops:
        for folder, _, names in os.walk(root / top):  # follows no links to folders
            parts = Path(folder).relative_to(root).parts
            room = "/".join(parts[:2]) if top == "core" else top
            files = [Path(folder, name) for name in names if name.endswith(".py")]
            lines = sum(len(f.read_bytes().splitlines()) for f in files if not f.is_symlink())
            if lines:
                found[room] = found.get(room, 0) + lines
                found[ALL] += lines if top in PACKAGE else 0
    return found


def excesses(lines: Mapping[str, int], budgets: Mapping[str, int]) -> list[str]:
    """Return a sentence for every room that has more lines than its budget, or no budget."""
    over = {room: count - budgets.get(room, 0) for room, count in lines.items()}
    return [
        f"{room} has {lines[room]} lines, {more} more than its budget of {budgets.get(room, 0)}: "
        + ADVICE
        for room, more in over.items()
        if more > 0
    ]


def main(root: Path = ROOT, budgets: Mapping[str, int] = BUDGETS) -> int:
    """Print the table, and what to do where a room exceeds its budget; return the exit code."""
    lines = lines_by_room(root)
    print(f"{'room':20} {'lines':>7} {'budget':>7} {'left':>6}")
    for room, count in lines.items():
        budget = budgets.get(room, 0)
        print(f"{room:20} {count:7} {budget:7} {budget - count:6}")
    wrong = excesses(lines, budgets)
    print(*wrong, sep="\n", end="\n" * bool(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
