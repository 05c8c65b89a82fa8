"""How the cost of things grows with their size, next to what one would else use.

    make bench-report                             # everything, into docs/development/performance.md
    python benchmarks/performance.py --only lattice --within 60

Every figure is that of a process of its own (`benchmarks/scaling.py`), on one thread, in seconds of
processor; exponents are fitted to the larger half of the sizes. What takes longer than --within is
shown as such, and so is what fails. An anchor is one solution of the same model for its modes.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGE = DOCS / "development" / "performance.md"
KEPT = DOCS / "figures" / "performance.json"
_BEGIN, _END = "<!-- performance -->\n", "<!-- /performance -->"
_GRIDS, _LATTICES = (12, 36, 115, 259), (4, 6, 9, 13, 19)
_RESULTS = (1000, 10000, 100000)
_LIBRARIES = ("numpy", "scipy", "scikit-sparse", "openseespy", "distributed")


@dataclass(frozen=True)
class Series:
    """One thing at several sizes.

    Arguments:
        name: of the measurement in `benchmarks/scaling.py`.
        sizes: what it is called with.
    """

    name: str
    sizes: tuple[int, ...]


@dataclass(frozen=True)
class Section:
    """Series that belong to one question.

    Arguments:
        word: for `--only`.
        title: of the table.
        unit: what a size is: a key of the measured rows.
        series: the first is ours.
    """

    word: str
    title: str
    unit: str
    series: tuple[Series, ...]


SECTIONS = (
    Section(
        "grid",
        "Twelve modes of a planar grid that hangs free",
        "dofs",
        (
            Series("modes of a planar grid", _GRIDS),
            Series("one factorisation, planar grid", _GRIDS),
            Series("eigsh as called, planar grid", _GRIDS[:3]),
        ),
    ),
    Section(
        "lattice",
        "Twelve modes of a lattice that hangs free",
        "dofs",
        (
            Series("modes of a lattice", _LATTICES),
            Series("one factorisation, lattice", _LATTICES),
            Series("eigsh as called, lattice", _LATTICES[:3]),
        ),
    ),
    Section(
        "opensees",
        "Twelve modes of a lattice on four supports",
        "dofs",
        (
            Series("modes of a standing lattice", _LATTICES[:3]),
            Series("OpenSees, standing lattice", _LATTICES[:3]),
        ),
    ),
    Section(
        "gradients",
        "Derivatives of twelve eigenvalues, 27 702 dofs",
        "parameters",
        (
            Series("gradients", (10, 100, 1000, 10000)),
            Series("forward differences", (10, 100, 1000, 10000)),
        ),
    ),
    Section(
        "fit",
        "Member stiffnesses of a lattice from ten frequencies",
        "parameters",
        (
            Series("least squares with derivatives", (3, 4)),
            Series("least squares with differences", (3, 4)),
        ),
    ),
    Section(
        "changes",
        "Twelve modes after each of many attached masses, 27 702 dofs",
        "changes",
        (
            Series("masses at joints", (10, 100)),
            Series("masses inside elements", (10, 100)),
            Series("each change solved by itself", (10, 100)),
        ),
    ),
    Section(
        "mesh",
        "Mesh and matrices of a planar grid",
        "dofs",
        (Series("mesh and matrices of a planar grid", _GRIDS),),
    ),
    Section(
        "jobs",
        "Jobs that do nothing, each isolated and judged; an anchor is a millisecond a job",
        "jobs",
        (Series("jobs that do nothing", (100, 1000)),),
    ),
    Section(
        "store",
        "A stored run",
        "results",
        (Series("load and leaderboard", _RESULTS), Series("resume", _RESULTS)),
    ),
    Section(
        "diagnosis",
        "Diagnosis of a lattice with 3 and 4 joints a side",
        "hypotheses",
        (Series("diagnosis of a lattice", (3, 4)),),
    ),
    Section(
        "bricks",
        "A ladder of bricks in 40 groups, read and reduced to its basis",
        "dofs",
        (Series("bricks in groups, read and reduced", (6, 10)),),
    ),
)


@dataclass(frozen=True)
class Bar:
    """What is asked for.

    Arguments:
        words: what it is about.
        asked: the figure that may not be passed.
        section, series, size: of the row.
        figure: the key of it.
        over: series or key that it is divided by; empty for none.
        least: whether it may not be fallen short of instead.
    """

    words: str
    asked: float
    section: str
    series: str
    size: int
    figure: str = "seconds"
    over: str = ""
    least: bool = False

    def found(self, kept: Mapping[str, Any]) -> float | None:
        """Return the measured figure; None where it was not measured."""
        rows = {(r["series"], r["size"]): r for r in kept.get(self.section, {}).get("rows", ())}
        row = rows.get((self.series, self.size), {})
        other = rows.get((self.over, self.size), {}).get("seconds", row.get(self.over))
        value, under = row.get(self.figure), other if self.over else 1.0
        return None if value is None or under is None else float(value / under)

    def line(self, kept: Mapping[str, Any]) -> dict[str, str]:
        """Return a line of the table."""
        found = self.found(kept)
        short = found is not None and ((found < self.asked) if self.least else (found > self.asked))
        return {
            "what": self.words,
            "asked": f"{'at least' if self.least else 'at most'} {self.asked:g}",
            "found": "not measured" if found is None else f"{found:.3g}",
            "met": "" if found is None else ("no" if short else "yes"),
        }


_GRID, _LATTICE = "modes of a planar grid", "modes of a lattice"
_BRICKS = "bricks in groups, read and reduced"
_FACTORISED, _NULL = "one factorisation, lattice", "jobs that do nothing"
BARS = (
    Bar("`eigsh` as called, times as long, 27 702 dofs", 40, "lattice",
        "eigsh as called, lattice", 9, over=_LATTICE, least=True),
    Bar("OpenSees, times as long, 27 702 dofs", 10, "opensees", "OpenSees, standing lattice", 9,
        over="modes of a standing lattice", least=True),
    Bar("lattice of 27 702 dofs, over one factorisation and its iteration", 1.6, "lattice",
        _LATTICE, 9, over=_FACTORISED),
    Bar("lattice of 275 082 dofs, the same", 1.6, "lattice", _LATTICE, 19, over=_FACTORISED),
    Bar("lattice of 275 082 dofs, MB", 1500, "lattice", _LATTICE, 19, "peak_mb"),
    Bar("planar grid of a million dofs, MB", 1500, "grid", _GRID, 259, "peak_mb"),
    Bar("gradients by 10 000 parameters, solutions", 0.05, "gradients", "gradients", 10000,
        over="anchor"),
    Bar("100 masses at joints, solutions", 15, "changes", "masses at joints", 100, over="anchor"),
    Bar("100 masses inside elements, solutions", 15, "changes", "masses inside elements", 100,
        over="anchor"),
    Bar("a job that does nothing, ms", 30, "jobs", _NULL, 1000, over="anchor"),
    Bar("load and rank 100 000 results, s", 5, "store", "load and leaderboard", 100000),
    Bar("resume 100 000 results, s", 3, "store", "resume", 100000),
    Bar("diagnosis beyond 60 solutions, ms a hypothesis", 2, "diagnosis",
        "diagnosis of a lattice", 4, "ms"),
    Bar("reading and reducing 101 040 dofs in 40 groups, s", 120, "bricks", _BRICKS, 10),
    Bar("the same, MB", 2000, "bricks", _BRICKS, 10, "peak_mb"),
    Bar("diagnosis in its basis, s", 60, "bricks", _BRICKS, 10, "diagnosis"),
)  # fmt: skip


def page_of(kept: Mapping[str, Any]) -> str:
    """Return what stands between the marks of the page."""
    lines = pd.DataFrame([bar.line(kept) for bar in BARS])
    parts = ["## Bars", lines.to_markdown(index=False, disable_numparse=True)]
    for section in SECTIONS:
        if section.word in kept:
            found = kept[section.word]
            parts += [f"## {section.title}", table(section, found["rows"]), found["machine"]]
    return "\n\n".join(parts)


def measured(name: str, size: int, within: float) -> dict[str, Any]:
    """Return one measurement of a process of its own, or why there is none."""
    command = [sys.executable, str(Path(__file__).with_name("scaling.py")), name, str(size)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=within, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": f"over {within:g} s by the clock"}
    lines = [line for line in ended.stdout.splitlines() if line.startswith("{")]
    if ended.returncode or not lines:
        words = (ended.stderr.strip() or f"exit code {ended.returncode}").splitlines()[-1]
        return {"failed": words[:80]}
    return dict(json.loads(lines[-1]))


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Return the slope of the larger half of the sizes on logarithmic axes."""
    half = max(len(sizes) // 2, 2)
    return float(np.polyfit(np.log(sizes[-half:]), np.log(seconds[-half:]), 1)[0])


def rows_of(section: Section, within: float, sizes: int | None) -> list[dict[str, Any]]:
    """Return the measurements of a section, those of one size after each other."""
    rows = []
    for place in range(max(len(series.sizes) for series in section.series))[:sizes]:
        for series in section.series:
            if place < len(series.sizes):
                row = measured(series.name, series.sizes[place], within)
                rows.append({"series": series.name, "size": series.sizes[place], **row})
                print(json.dumps(rows[-1]), flush=True)
    return rows


def table(section: Section, rows: Sequence[dict[str, Any]]) -> str:
    """Return a section as a table: seconds, ratios to ours, memory, exponents in the last line."""
    known = {row["size"]: row[section.unit] for row in rows if section.unit in row}
    sizes = list(dict.fromkeys(row["size"] for row in rows))
    of = {(row["series"], row["size"]): row for row in rows}
    ours = section.series[0].name
    lines = []
    for size in sizes:
        own = of[ours, size]
        line = {
            section.unit: (
                f"{known[size]:,}".replace(",", " ") if size in known else f"size {size}"
            )
        }
        for series in section.series:
            line[series.name] = _cell(of.get((series.name, size)), own, series.name == ours)
        lines.append(line)
    last = {section.unit: "grows with"}
    for series in section.series:
        good = [row for row in rows if row["series"] == series.name and "seconds" in row]
        x = [row.get(section.unit, row["size"]) for row in good]
        power = exponent(x, [row["seconds"] for row in good]) if len(good) > 1 else np.nan
        last[series.name] = "" if np.isnan(power) else f"size^{power:.2f}"
    return str(pd.DataFrame([*lines, last]).to_markdown(index=False, disable_numparse=True))


def _cell(row: dict[str, Any] | None, own: dict[str, Any], first: bool) -> str:
    if row is None:
        return ""
    if "seconds" not in row:
        return str(row["failed"])
    text = f"{row['seconds']:.3g} s"
    if row.get("added_mb", 0.0) >= 1.0:
        text += f", +{row['added_mb']:.0f} MB"
    if row.get("anchor"):
        text += f", {row['seconds'] / row['anchor']:.3g} anchors"
    if first or "seconds" not in own:
        return text
    return f"{text} ({row['seconds'] / own['seconds']:.3g} x)"


def machine() -> str:
    """Return what was measured on, in one sentence."""
    words = Path("/proc/cpuinfo")
    lines = words.read_text(encoding="utf-8").splitlines() if words.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = named[0] if named else platform.processor() or platform.machine()
    known = []
    for library in _LIBRARIES:
        try:
            known.append(f"{library} {version(library)}")
        except ImportError:
            known.append(f"no {library}")
    when = datetime.now(UTC).strftime("%Y-%m-%d")
    return (
        f"Measured {when} on one thread of {len(named) or 1} ({processor}), {platform.system()}, "
        f"Python {platform.python_version()}, {', '.join(known)}."
    )


def write(kept: Mapping[str, Any]) -> None:
    """Keep figures, and put the tables of them into the page."""
    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(_BEGIN)
    text = f"{head}{_BEGIN}{page_of(kept)}\n{_END}{rest.partition(_END)[2]}"
    PAGE.write_text(text, encoding="utf-8")


def main() -> None:
    """Measure, and with --write keep the figures of every section as it is done."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=[one.word for one in SECTIONS])
    parser.add_argument("--within", type=float, default=100.0, help="seconds a measurement")
    parser.add_argument("--sizes", type=int, help="at most so many, the smallest first")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    words = parser.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for section in SECTIONS:
        if not words.only or section.word in words.only:
            rows = rows_of(section, words.within, words.sizes)
            kept[section.word] = {"machine": machine(), "rows": rows}
            if words.write:
                write(kept)
    print(page_of(kept))


if __name__ == "__main__":
    main()
