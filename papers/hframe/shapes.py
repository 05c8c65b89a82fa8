"""Table 3: MAC between expanded measured shapes and those of mesh C_a."""

from __future__ import annotations

import numpy as np

from femubench import Case, solve_modes
from femubench.fem import FloatArray
from femubench.modal import expand_by_serep, mac
from femubench.papers.hframe.meshes import MODES, RECOVERED, frequencies
from femubench.papers.printed import read_printed
from femubench.reproduction import Cell, Extra, Ground, Page

OUT_OF_PLANE = 7
POINTS = 1.0


def compute_expanded_mac(case: Case, directions: str = "all") -> dict[int, FloatArray]:
    """Return the MAC in percent of every measured in-plane mode with the modes of mesh C_a, (8,).

    The measured shapes are expanded to all dofs as combinations of the eight elastic modes.

    Arguments:
        case: the H-frame.
        directions: ``all`` dofs as the paper has it, or ``translations`` among them.
    """
    model = case.model
    measured = case.measurement.select((*case.used, *case.held_out))
    modes = solve_modes(model).elastic.shapes[:, :MODES]
    full = expand_by_serep(measured.shapes, model.observe(measured.sensors) @ modes, modes)
    rows = np.array([directions == "all" or name in "xyz" for name in model.dofs.direction])
    found = 100.0 * mac(full[rows], modes[rows])
    return dict(zip(measured.numbers, found, strict=True))


def shape_cells(case: Case) -> tuple[Cell, ...]:
    """Return table 3: analytical frequencies to 0.01 %, and MAC of the pairs.

    Other MAC values are small in any model: that ours are small too would say nothing.
    """
    table = read_printed("hframe")["table3"]
    page = Page("hframe", "3", (RECOVERED,), "Hz", tolerance=0.01, decimals=2)
    columns = [f"analytical {mode}" for mode in range(1, MODES + 1)]
    row = zip(columns, table["analytical"], frequencies(case.model), strict=True)
    cells = [page.cell("analytical frequency", name, theirs, float(f)) for name, theirs, f in row]
    for number, values in compute_expanded_mac(case).items():
        k = partner(number) - 1
        theirs, ours = float(table["mac"][number - 1][k]), float(values[k])
        unseen = Page("hframe", "3", (_unseen(theirs, ours),), "%", POINTS, 2)
        cells.append(unseen.cell(f"measured {number}", columns[k], theirs, ours))
    return tuple(cells)


def _unseen(theirs: float, ours: float) -> Ground:
    return Ground(
        "cannot-be-checked",
        "needs the test's shapes, which the paper does not print; those of a solid twin are nearer "
        f"to those of beams by {ours - theirs:.0f} points",
    )


def mac_extra(case: Case) -> Extra:
    """Return the whole of table 3 with the twin's shapes."""
    return Extra(
        "MAC of the solid twin's shapes with mesh C_a, after SEREP, in %",
        ("measured mode", *(f"FE {mode}" for mode in range(1, MODES + 1))),
        tuple(
            (str(number), *(f"{value:.2f}" for value in values))
            for number, values in compute_expanded_mac(case).items()
        ),
        "Not the paper's data. The test's mode 7 is out of plane: the twin has no in-plane shape.",
    )


def partner(number: int) -> int:
    """Return the analytical mode that a measured in-plane mode pairs with, counted from 1."""
    return number if number < OUT_OF_PLANE else number - 1
