"""Which numbers of a diagnosis change an answer: each moved by a factor of two, on blind cases.

    python benchmarks/number_sweep.py run --numbers sure_fault      # one number, down and up
    python benchmarks/number_sweep.py run --together near seeds     # some at once
    python benchmarks/number_sweep.py tables                        # what changed; docs/settings.md

Appends to a results file and goes on where it stopped. Counts move to the next whole number,
probabilities by a factor of two in their odds, all others by a factor of two; distributions over
counts are sharpened or flattened to the power of two or a half. The same moves "up" and "down" for
all numbers of a group.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from blind_sweep import GROUPS, Record, SweepCase, run_task, tasks
from threadpoolctl import threadpool_limits

from femubench.core.inference.settings import (
    Setting,
    Value,
    format_value,
    overridden,
    settings_table,
)

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
RESULTS = DOCS / "data" / "settings-sweep.jsonl"
ODDS = ("probability", "cosine", "MAC")
SLOW = ("pairs", "outside")
COLUMNS = ("name", "value", "unit", "kind", "why", "changes")


def moved(setting: Setting, up: bool) -> Value:
    """Return a number moved by two, up or down."""
    value = setting.value
    factor = 2.0 if up else 0.5
    if isinstance(value, tuple) and setting.unit == "probability":
        powers = [p**factor for p in value]
        return tuple(p / sum(powers) for p in powers)
    if isinstance(value, tuple) and isinstance(value[0], int):
        return tuple(int(factor * x) for x in value)
    if isinstance(value, tuple):
        # A range becomes wider or narrower, other lists of numbers larger or smaller.
        first = value[0] / factor if len(value) == 2 else value[0] * factor
        return first, *(factor * x for x in value[1:])
    if isinstance(value, int):
        return max(value + (1 if up else -1), 1)
    if setting.unit in ODDS:
        odds = value / (1.0 - value) * factor
        return odds / (1.0 + odds)
    return value * factor


def answer(task: SweepCase, values: Mapping[str, Value]) -> Record:
    """Return what is said of a case while some numbers have other values."""
    from femubench.core.diagnosis.diagnose import diagnose

    with threadpool_limits(1), overridden(values):
        found = run_task(task, diagnose)
    said = ("verdict", "named", "named_places", "right", "place_right", "probability")
    return {name: found.get(name) for name in said}


def read(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a results file; one that was cut off is left out."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return found


def chosen(count: int) -> list[SweepCase]:
    """Return so many cases, spread over the groups that do not take long."""
    groups = [group for group in GROUPS if group.name not in SLOW]
    each = -(-count // len(groups))
    return tasks(groups, each)[:count]


def run(path: Path, sets: Iterable[Sequence[str]], count: int) -> None:
    """Diagnose cases with each set of numbers moved down and up; append a line a case."""
    table = settings_table()
    known = {(tuple(r["numbers"]), r["up"], r["group"], r["number"]) for r in read(path)}
    moves: list[tuple[tuple[str, ...], bool]] = [((), True)]
    moves += [(tuple(names), up) for names in sets for up in (False, True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as stream:
        for names, up in moves:
            values = {name: moved(table[name], up) for name in names}
            for task in chosen(count):
                if (names, up, *task.key) in known:
                    continue
                head = {"numbers": names, "up": up, "group": task.group, "number": task.number}
                stream.write(json.dumps({**head, **answer(task, values)}) + "\n")
                stream.flush()
            print(" ".join(names) or "the table as it is", "up" if up else "down", file=sys.stderr)


def changes(lines: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return of every set of numbers how many cases it has answered otherwise, and which."""
    lines = list(lines)
    plain = {(r["group"], r["number"]): r for r in lines if not r["numbers"]}
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    for line in lines:
        key = line["group"], line["number"]
        if not line["numbers"] or key not in plain:
            continue
        row = found.setdefault(tuple(line["numbers"]), {"down": set(), "up": set(), "changed": {}})
        way = "up" if line["up"] else "down"
        row[way].add(key)
        said = ("verdict", "named", "named_places")
        if any(line[name] != plain[key][name] for name in said):
            words = f"{way}: {_verdict(plain[key])} -> {_verdict(line)}"
            row["changed"].setdefault(key, []).append(words)
    return [
        {"numbers": names, "cases": row["down"] & row["up"], "changed": row["changed"]}
        for names, row in found.items()
    ]


def _verdict(line: Mapping[str, Any]) -> str:
    pairs = zip(line["named"] or (), line["named_places"] or (), strict=False)
    return f"{line['verdict']} {' + '.join(' at '.join(pair) for pair in pairs)}".strip()


def measured(lines: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return "n of m" of every number, by itself or in a group that changes nothing."""
    found: dict[str, str] = {}
    for row in changes(lines):
        for name in row["numbers"]:
            if len(row["numbers"]) == 1 or not row["changed"]:
                found[name] = f"{len(row['changed'])} of {len(row['cases'])}"
    return found


def table_text(known: Mapping[str, str]) -> str:
    """Return the table of docs/settings.md.

    Arguments:
        known: what is measured of a number, by its name.
    """
    rows = [
        (f"`{name}`", format_value(s.value), s.unit, s.kind, s.why, known.get(name, ""))
        for name, s in settings_table().items()
    ]
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("what", choices=("run", "tables"))
    parser.add_argument("--numbers", nargs="*", default=(), help="each by itself")
    parser.add_argument("--together", nargs="+", action="append", default=[], help="all at once")
    parser.add_argument("--cases", type=int, default=120)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    if options.what == "run":
        sets = [*((name,) for name in options.numbers), *options.together]
        run(options.results, sets, options.cases)
        return
    lines = read(options.results)
    for row in changes(lines):
        print(" ".join(row["numbers"]), f"{len(row['changed'])} of {len(row['cases'])} change")
        for (group, number), words in sorted(row["changed"].items()):
            print(f"    {group} {number}: {'; '.join(words)}")
    page = DOCS / "settings.md"
    head = page.read_text(encoding="utf-8").partition("| name |")[0]
    page.write_text(head + table_text(measured(lines)), encoding="utf-8")


if __name__ == "__main__":
    main()
