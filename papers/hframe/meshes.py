"""Table 2: natural frequencies on four meshes, and with accelerometers on the third."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from femubench import Case, Model, solve_modes
from femubench.fem import FloatArray
from femubench.papers.printed import read_printed
from femubench.reproduction import Cell, Ground, Page

MODES = 8
RECOVERED = Ground(
    "fitted",
    "dimensions and accelerometers are recovered from these very frequencies: no independent check",
)
LEVERS = (
    "what was recovered decides: with the second accelerometer on a lever like the first one's, "
    "on either side of its leg (the text gives no length) there are values of ours"
)
_BASE = Ground("input", "by definition: the row that all others are divided by")
_RATIOS = Ground(
    "independent",
    "how far a mesh is from the coarsest one, with beams as the text has them; the dimensions are "
    "fitted to one mesh, not to what refining does",
)


def frequencies(model: Model, count: int = MODES) -> FloatArray:
    """Return the lowest elastic natural frequencies in Hz, (count,)."""
    return solve_modes(model).elastic.natural_frequencies[:count]


def bare(case: Case, mesh: Sequence[int]) -> Model:
    """Return the frame without accelerometers on another mesh.

    Arguments:
        mesh: elements of the horizontal, of each lower and of each upper leg.
    """
    frame = case.model.frame_structure.frame
    count = dict(zip(("horizontal", "lower", "upper"), mesh, strict=True))
    members = tuple(replace(m, elements=count[m.name.split("-")[0]]) for m in frame.members)
    return Model.of(replace(frame, members=members, masses=()))


def levered(case: Case) -> Iterator[Case]:
    """Yield the case with its second accelerometer on a lever like the first one's, either way."""
    frame = case.model.frame_structure.frame
    first, second = frame.masses
    for x in (first.offset[2], -first.offset[2]):
        moved = replace(second, offset=(x, 0.0, 0.0))
        yield replace(case, model=Model.of(replace(frame, masses=(first, moved))))


def mesh_cells(case: Case) -> tuple[Cell, ...]:
    """Return table 2, normalised with mesh A; what agrees rounds to the printed digit."""
    tables = read_printed("hframe")
    meshes = tables["test_article"]["mesh"]
    found = {name: frequencies(bare(case, mesh)) for name, mesh in meshes.items()}
    found["C_a"] = frequencies(case.model)
    cells = []
    for row, values in tables["table2"].items():
        for k, (theirs, hertz, base) in enumerate(zip(values, found[row], found["A"], strict=True)):
            ours = float(hertz / base)
            edge = theirs + (0.0005 if ours > theirs else -0.0005)
            off = 100.0 * abs(ours / edge - 1.0)
            reason = (
                f"at a rounding edge: {ours:.6f} rounds to {ours:.3f}, the printed digit begins at "
                f"{edge:.4f}, {off:.4f} % away"
            )
            if row == "C_a":
                own = tables["table3"]["analytical"][k]
                reason += f"; the printed {own} Hz of table 3 over our mesh A is {own / base:.6f}"
            ground = {"A": _BASE, "C_a": RECOVERED}.get(row, _RATIOS)
            fault = Ground("does-not-follow", reason)
            page = Page("hframe", "2", (ground,), "", 0.0, 3, fault, LEVERS)
            others = partial(_levered_ratios, case, k, base) if row == "C_a" else tuple
            cells.append(page.cell(row, f"mode {k + 1}", theirs, ours, others))
    return tuple(cells)


def _levered_ratios(case: Case, mode: int, base: float) -> Iterator[float]:
    return (float(frequencies(other.model)[mode] / base) for other in levered(case))
