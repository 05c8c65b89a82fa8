"""Diagnose some 680 blind cases and write figures of docs/diagnosis-accuracy.md.

    python benchmarks/diagnosis_sweep.py run --jobs 2          # appends, goes on where it stopped
    python benchmarks/diagnosis_sweep.py tables                # tables, confusion, calibration
    python benchmarks/diagnosis_sweep.py kernels --cases 13    # does rounding change an answer?

The figures need `pip install femubench[figures]`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from blind_sweep import (
    GROUPS,
    Record,
    SweepCase,
    bars_table,
    run_task,
    stated,
    tasks,
)
from stated_probabilities import (
    MATTERS,
    Statement,
    binned,
    calibration_rows,
    coverage_rows,
    fault_rows,
    percent,
    wilson,
)
from sweep_data import DATA, PAGE, as_markdown, each, filled, write_rows
from threadpoolctl import threadpool_limits
from true_fit import fits_worse, is_search_fault

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "femubench-results" / "diagnosis-sweep.jsonl"
MARK = "blind-cases"
NO_NAME = ("none", "unknown", "not-confirmed", "error")


def diagnosed(task: SweepCase) -> Record:
    """Return the record of one case, on one thread."""
    from femubench.core.diagnosis.diagnose import diagnose

    with threadpool_limits(1):
        return run_task(task, diagnose)


def read_records(path: Path) -> list[Record]:
    """Return the records of a results file; a line that was cut off is left out."""
    if not path.exists():
        return []
    records = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        records[record["group"], record["number"]] = record
    return list(records.values())


def run(path: Path, wanted: Sequence[SweepCase], jobs: int) -> None:
    """Diagnose what is not in the results file yet; append a line a case."""
    known = {(record["group"], record["number"]) for record in read_records(path)}
    rest = [task for task in wanted if task.key not in known]
    path.parent.mkdir(parents=True, exist_ok=True)
    print(f"{len(wanted) - len(rest)} of {len(wanted)} cases are in {path}", file=sys.stderr)
    with path.open("a") as stream:
        for i, record in enumerate(each(diagnosed, [(task,) for task in rest], jobs), 1):
            stream.write(json.dumps(record) + "\n")
            stream.flush()
            mark = "right" if record["right"] else "WRONG"
            line = f"{i}/{len(rest)} {mark} {record['group']} {record['seed']}"
            print(f"{line}: {record['truth']} -> {record['verdict']}", file=sys.stderr)


def run_kernels(path: Path, kernels: Sequence[str], arguments: Sequence[str]) -> list[Path]:
    """Run the sweep under several kernels of OpenBLAS; return the results file of each."""
    files = [path.with_stem(f"{path.stem}-{kernel}") for kernel in kernels]
    for kernel, file in zip(kernels, files, strict=True):
        command = [sys.executable, __file__, "run", *arguments, "--results", str(file)]
        subprocess.run(command, check=True, env={**os.environ, "OPENBLAS_CORETYPE": kernel})
    return files


def differing(first: Sequence[Record], second: Sequence[Record]) -> tuple[int, list[str]]:
    """Return how many cases two results share, and a line for each that they answer differently."""
    others = {(record["group"], record["number"]): record for record in second}
    both = [(a, others[key]) for a in first if (key := (a["group"], a["number"])) in others]
    lines = []
    for one, two in both:
        for what in ("truth", "verdict", "named", "named_places"):
            if one.get(what) != two.get(what):
                where = f"{one['group']} {one['seed']}: {what}"
                lines.append(f"{where} {one.get(what)} / {two.get(what)}")
                break
    return len(both), lines


def group_rows(records: Sequence[Record]) -> list[dict[str, str]]:
    """Return one row a group of cases."""
    rows = []
    for group in GROUPS:
        own = [record for record in records if record["group"] == group.name]
        if not own:
            continue
        right = sum(record["right"] for record in own)
        placed = [r["place_right"] for r in own if r.get("place_right") is not None]
        in_group = [r["group_size"] for r in own if r.get("group_size", 0) > 1]
        rows.append(
            {
                "cases": group.name,
                "number": str(len(own)),
                **percent(right, len(own)),
                "strict": _strict(own),
                "place right": f"{100.0 * np.mean(placed):.1f} %" if placed else "-",
                "too small": str(sum(bool(r.get("too_small")) for r in own)),
                "groups": f"{len(in_group)}, {np.mean(in_group):.1f} names" if in_group else "-",
                "seconds, median": f"{np.median([r['seconds'] for r in own]):.2f}",
            }
        )
    return rows


def _strict(records: Sequence[Record]) -> str:
    """Return the share of answers that are right alone: one name at one place for every cause."""
    if records[0]["hidden"] not in ("one", "pair"):
        return "-"
    hits = [r["verdict"] == "named" and bool(r["right"] and r.get("place_right")) for r in records]
    return f"{100.0 * np.mean(hits):.1f} %"


def effect_rows(records: Sequence[Record]) -> list[dict[str, str]]:
    """Return one row an effect, over all cases that hide one effect."""
    rows = []
    singles = [record for record in records if record["hidden"] == "one"]
    for effect in sorted({record["effects"][0] for record in singles}):
        own = [record for record in singles if record["effects"][0] == effect]
        right = sum(record["right"] for record in own)
        low, high = wilson(right, len(own))
        wrong = Counter(_column(record) for record in own if not record["right"])
        rows.append(
            {
                "hidden": effect,
                "cases": str(len(own)),
                "right": f"{100.0 * right / len(own):.0f} %",
                "95 % interval": f"{100.0 * low:.0f} to {100.0 * high:.0f} %",
                "too small": str(sum(bool(r.get("too_small")) for r in own)),
                "else it says": ", ".join(f"{k} {n}" for k, n in wrong.most_common(4)) or "-",
            }
        )
    return rows


def _column(record: Record) -> str:
    """Return what a record says, in one word."""
    if record["verdict"] in NO_NAME:
        return str(record["verdict"])
    if record["right"]:
        return " + ".join(record["effects"])
    named = record["named"]
    return str(named[0]) if record["verdict"] == "ambiguous" else " + ".join(named)


def _figure(width: float, height: float) -> tuple[Any, Any]:
    """Return figure and axes of matplotlib, which is only needed here."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "femubench", "font.size": 9})
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()


def draw_confusion(records: Sequence[Record], path: Path) -> None:
    """Draw which effect is taken for which, over all cases with one hidden effect."""
    singles = [record for record in records if record["hidden"] == "one"]
    rows = sorted({record["effects"][0] for record in singles})
    said = [_column(record) for record in singles]
    others = sorted(set(said) - set(rows) - set(NO_NAME))
    columns = [*rows, *(word for word in others if " + " not in word)]
    columns += ["several"] if any(" + " in word for word in said) else []
    columns += [word for word in NO_NAME if word in said]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for record, word in zip(singles, said, strict=True):
        word = "several" if " + " in word else word
        counts[rows.index(record["effects"][0]), columns.index(word)] += 1
    figure, axes = _figure(9.5, 7.5)
    share = counts / counts.sum(axis=1, keepdims=True)
    image = axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    for (i, j), n in np.ndenumerate(counts):
        if n:
            axes.text(j, i, str(n), ha="center", va="center", fontsize=7,
                      color="white" if share[i, j] > 0.5 else "black")  # fmt: skip
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("what the diagnosis says (a group with the right name counts as the name)")
    axes.set_ylabel("hidden effect")
    axes.set_title(f"{len(singles)} blind cases with one hidden effect; numbers are cases")
    figure.colorbar(image, ax=axes, label="share of the row", shrink=0.7)
    _save(figure, path)


def draw_calibration(said: Sequence[Statement], path: Path) -> None:
    """Draw how often names and places are right against the probability that is stated."""
    figure, axes = _figure(6.0, 5.0)
    axes.plot([0.0, 1.0], [0.0, 1.0], color="grey", linestyle="--", label="calibrated")
    for matter, colour in zip(MATTERS, ("tab:blue", "tab:orange"), strict=True):
        own = [one for one in binned(said, matter) if one.count]
        shares = [one.hits / one.count for one in own]
        intervals = [wilson(one.hits, one.count) for one in own]
        pairs = list(zip(shares, intervals, strict=True))
        error = [
            [max(share - low, 0.0) for share, (low, _) in pairs],
            [max(high - share, 0.0) for share, (_, high) in pairs],
        ]
        means = [one.mean for one in own]
        axes.errorbar(means, shares, error, fmt="o", color=colour, capsize=3, label=matter)
        for one, share in zip(own, shares, strict=True):
            axes.annotate(f" {one.count}", (one.mean, share), fontsize=7, va="top")
    axes.set_xlabel("stated probability (mean of the bin)")
    axes.set_ylabel("share that is right, 95 % interval")
    axes.set_title("Causes that are named, alone or in a group; numbers are causes")
    axes.set_xlim(-0.02, 1.04)
    axes.set_ylim(0.0, 1.04)
    axes.legend(loc="upper left")
    _save(figure, path)


def _save(figure: Any, path: Path) -> None:  # noqa: ANN401 - matplotlib is optional
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})


def by_group(
    records: Sequence[Record], values: Callable[[Record], Sequence[Any]]
) -> dict[str, list[Any]]:
    """Return some values of all records by group."""
    groups = {group.name: [r for r in records if r["group"] == group.name] for group in GROUPS}
    return {name: [v for r in own for v in values(r)] for name, own in groups.items()}


def _faults(record: Record) -> list[tuple[bool, bool]]:
    worse = fits_worse(record)
    return [] if worse is None else [(worse, bool(is_search_fault(record)))]


def tables(records: Sequence[Record]) -> dict[str, list[dict[str, str]]]:
    """Return the rows of all tables by name."""
    return {
        "effects": effect_rows(records),
        "calibration": calibration_rows(stated(records)),
        "sizes": coverage_rows(by_group(records, lambda r: r.get("size_deviations", ()))),
        "fits": fault_rows(by_group(records, _faults)),
    }


def main() -> None:
    """Run the sweep, or write its figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("run", "tables", "kernels"))
    parser.add_argument("--kernels", nargs=2, default=("Nehalem", "Haswell"), help="of OpenBLAS")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--cases", type=int, default=None, help="at most so many of each group")
    parser.add_argument("--groups", default="", help="groups by name, parted by semicolons")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the tables")
    options = parser.parse_args()
    names = [name for name in options.groups.split(";") if name]
    unknown = set(names) - {group.name for group in GROUPS}
    if unknown:
        parser.error(f"no group {sorted(unknown)}; there are {[g.name for g in GROUPS]}")
    if options.what == "run":
        chosen = [group for group in GROUPS if not names or group.name in names]
        run(options.results, tasks(chosen, options.cases), options.jobs)
        return
    if options.what == "kernels":
        given = ["--jobs", str(options.jobs), "--groups", options.groups]
        given += ["--cases", str(options.cases)] if options.cases is not None else []
        files = run_kernels(options.results, options.kernels, given)
        count, lines = differing(*map(read_records, files))
        print(*lines, f"{len(lines)} of {count} answers differ", sep="\n")
        sys.exit(bool(lines))
    records = read_records(options.results)
    if not records:
        parser.error(f"no results in {options.results}: run the sweep first")
    figures = options.page.parent / "figures"
    draw_confusion(records, figures / "diagnosis-confusion")
    draw_calibration(stated(records), figures / "diagnosis-calibration")
    for table, rows in tables(records).items():
        write_rows(options.data / f"sweep-{table}.csv", "blind", rows)
    page = options.page.read_text(encoding="utf-8")
    page = filled(page, as_markdown(bars_table(records)), MARK)
    page = filled(page, as_markdown(group_rows(records)), f"{MARK}-kinds")
    options.page.write_text(page, encoding="utf-8")
    for row in bars_table(records):
        print(*row.values(), sep=" | ")


if __name__ == "__main__":
    main()
