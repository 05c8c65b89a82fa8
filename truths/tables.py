"""The table of the suite in docs/scenarios.md: ``python -m truths.tables``."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np

from femubench import rank
from truths.posing import ROOT, SUITE
from truths.suite import listed_modes

PAGE = ROOT / "docs" / "scenarios.md"
MARK, END = "<!-- suite -->", "<!-- /suite -->"
NODES = re.compile(r"scikit-fem, (\d+) and\s+(\d+) nodes")


def suite_rows() -> list[str]:
    """Return one row of Markdown a structure: classes, meshes, how far the drawing is off."""
    table = tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))
    results = rank(["suite"], ["unchanged"]).results
    errors = {result.case: result for result in results}
    rows = []
    for name, item in table.items():
        text = (SUITE / name / "README.md").read_text(encoding="utf-8")
        nodes = NODES.search(text)
        modes = listed_modes(text)
        if nodes is None or not modes:
            raise ValueError(f"{name}: its README holds no meshes or no modes")
        used = sum(use == "used" for use, _ in modes)
        worst = max(difference for _, difference in modes)
        error = errors[f"suite/{name}"].blocks["used"].rms_percent
        rows.append(
            f"| [`{name}`](../scenarios/suite/{name}/README.md) | {', '.join(item['classes'])} "
            f"| {used} + {len(modes) - used} | {nodes[1]}, {nodes[2]} | {worst:.2f} | {error:.1f} |"
        )
    return rows


def write_table(page: Path = PAGE) -> None:
    """Replace what stands between the marks of the page."""
    rows = suite_rows()
    errors = np.array([float(row.split("|")[-2]) for row in rows])
    head = (
        "| structure | classes | modes used + held out | nodes of the two meshes "
        "| largest difference of the meshes, % | error of the drawing in the used modes, rms % |\n"
        "| :--- | :--- | ---: | ---: | ---: | ---: |\n"
    )
    foot = (
        f"\n{len(rows)} structures; the drawing misses the used modes by {errors.min():.1f} to "
        f"{errors.max():.1f} %, {np.median(errors):.1f} % in the median.\n"
    )
    before, _, rest = page.read_text(encoding="utf-8").partition(MARK)
    table = MARK + "\n\n" + head + "\n".join(rows) + "\n" + foot + "\n" + END
    page.write_text(before + table + rest.partition(END)[2], encoding="utf-8")


if __name__ == "__main__":
    write_table()
