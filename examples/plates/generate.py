"""Write the files of this folder: three bolted plates as a CalculiX job, and a test of them.

Usage: python generate.py. The decks are written at once; test.unv needs `ccx`: it is measured on
another model than the job, with four times as many elements and a softer left joint, at points that
lie up to 2 mm next to the nodes of the job, with noise.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyuff

from femubench import Model, solve_modes
from femubench.plugins.readers.calculix import CalculixReader

HERE = Path(__file__).parent
LENGTH, WIDTH, THICKNESS, GAP, LAP = 160.0, 60.0, 6.0, 1.0, 40.0  # mm
STEEL, BOLTS, DENSITY = 210e3, 200.0, 7.85e-9  # MPa, MPa, t/mm3
PLATES = ((0.0, 0.0), (LENGTH - LAP, THICKNESS + GAP), (2.0 * (LENGTH - LAP), 0.0))  # x, z
JOINTS = {"left": 1, "right": 2}  # the plate on the right of each
SOFTER = 0.4  # of the left joint in the test
MODES, SHAPE_NOISE, FREQUENCY_NOISE = 12, 0.01, 0.001


def mesh(nx: int, ny: int) -> str:
    """Return nodes and elements of the plates and of the blocks that bolt them together.

    Arguments:
        nx, ny: elements of a plate along x (a multiple of 8) and along y (of 4); one over the
            thickness. They have 20 nodes, which are counted on a grid of half elements.
    """
    nodes, elements = ["*NODE, NSET=NALL"], []
    step_x, step_y, step_z = 0.5 * LENGTH / nx, 0.5 * WIDTH / ny, 0.5 * THICKNESS

    def number(plate: int, i: int, j: int, k: int) -> int:
        return 1 + plate * 100_000 + (i * (2 * ny + 1) + j) * 3 + k

    def ring(plate: int, i: int, j: int, k: int) -> tuple[list[int], list[int]]:
        corners = [(0, 0), (2, 0), (2, 2), (0, 2)]
        edges = [(1, 0), (2, 1), (1, 2), (0, 1)]
        one, other = (
            [number(plate, 2 * i + a, 2 * j + b, k) for a, b in s] for s in (corners, edges)
        )
        return one, other

    def brick(
        label: int, low: tuple[list[int], ...], high: tuple[list[int], ...], up: list[int]
    ) -> None:
        every = [*low[0], *high[0], *low[1], *high[1], *up]
        elements.append(f"{label}, " + ", ".join(map(str, every[:10])) + ",")
        elements.append(", ".join(map(str, every[10:])))

    for plate, (x, z) in enumerate(PLATES):
        for i, j, k in np.ndindex(2 * nx + 1, 2 * ny + 1, 3):
            if i % 2 + j % 2 + k % 2 <= 1:
                place = x + i * step_x, j * step_y, z + k * step_z
                nodes.append(f"{number(plate, i, j, k)}, " + ", ".join(f"{v:g}" for v in place))
        elements.append("*ELEMENT, TYPE=C3D20R, ELSET=PLATES")
        for i, j in np.ndindex(nx, ny):
            up = [
                number(plate, 2 * i + a, 2 * j + b, 1) for a, b in ((0, 0), (2, 0), (2, 2), (0, 2))
            ]
            brick(1 + plate * 100_000 + i * ny + j, ring(plate, i, j, 0), ring(plate, i, j, 2), up)
    for name, right in JOINTS.items():
        elements.append(f"*ELEMENT, TYPE=C3D20R, ELSET={name.upper()}")
        lower, upper = sorted((right - 1, right), key=lambda plate: PLATES[plate][1])
        middle: dict[tuple[int, int], int] = {}
        for i, j in np.ndindex(nx // 4, ny):
            if j // (ny // 4) in (1, 2):  # two rows of bolts, along either edge
                continue
            shift = {right - 1: i + nx - nx // 4, right: i}
            for a, b in ((0, 0), (2, 0), (2, 2), (0, 2)):
                at = 2 * i + a, 2 * j + b
                if at not in middle:
                    middle[at] = 800_000 + 10_000 * right + len(middle)
                    place = PLATES[right][0] + at[0] * step_x, at[1] * step_y, THICKNESS + 0.5 * GAP
                    nodes.append(f"{middle[at]}, " + ", ".join(f"{v:g}" for v in place))
            up = [middle[2 * i + a, 2 * j + b] for a, b in ((0, 0), (2, 0), (2, 2), (0, 2))]
            low, high = ring(lower, shift[lower], j, 2), ring(upper, shift[upper], j, 0)
            brick(900_000 + 10_000 * right + i * ny + j, low, high, up)
    return "\n".join([*nodes, *elements]) + "\n"


def deck(step: str, **moduli: float) -> str:
    """Return a deck on the mesh of mesh.inp.

    Arguments:
        step: the line of the analysis.
        moduli: Young's modulus in MPa by set of elements.
    """
    lines = ["*INCLUDE, INPUT=mesh.inp"]
    for name, modulus in moduli.items():
        lines += [
            f"*MATERIAL, NAME={name}", "*ELASTIC", f"{modulus:g}, 0.3",
            "*DENSITY", f"{DENSITY:g}", f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
        ]  # fmt: skip
    return "\n".join([*lines, "*STEP", step, "20", "*END STEP"]) + "\n"


def job(folder: Path, name: str, **moduli: float) -> None:
    """Write a deck that stores the matrices."""
    step = "*FREQUENCY, SOLVER=MATRIXSTORAGE"
    (folder / f"{name}.inp").write_text(deck(step, **moduli))


def nominal(folder: Path) -> None:
    """Write the job, and for each joint one in which nothing else is stiff: a group."""
    (folder / "mesh.inp").write_text(mesh(8, 4))
    whole = {"PLATES": STEEL, "LEFT": BOLTS, "RIGHT": BOLTS}
    job(folder, "plates", **whole)
    for group in ("LEFT", "RIGHT"):
        part = {name: E * (1.0 if name == group else 1e-9) for name, E in whole.items()}
        job(folder, f"plates_{group.lower()}", **part)


def truth() -> Model:
    """Return the model that was tested, in the units of the job."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mesh.inp").write_text(mesh(16, 8))
        job(folder, "truth", PLATES=1.01 * STEEL, LEFT=SOFTER * BOLTS, RIGHT=BOLTS)
        subprocess.run(["ccx", "truth"], cwd=folder, check=True, capture_output=True)
        return CalculixReader().read_model(folder / "truth.inp")


def universal_file(model: Model, file: Path) -> None:
    """Write what a test of the structure saw: points in cm, all directions, free modes."""
    rng = np.random.default_rng(15)
    xyz, dofs = model.dofs.xyz, np.array(model.dofs.direction)
    steps = {plate: np.arange(0.0, LENGTH + 1.0, 40.0) for plate in range(3)}
    wanted = [
        (x0 + x, y, z0 + THICKNESS)
        for plate, (x0, z0) in enumerate(PLATES)
        for x in steps[plate]
        for y in (0.0, WIDTH)
    ]
    modes = solve_modes(model, 6 + MODES)
    elastic = np.flatnonzero(~modes.rigid)[:MODES]
    points = np.array(wanted)
    rows = np.array(
        [
            [int(np.argmin(np.linalg.norm(xyz - at, axis=1) + 1e9 * (dofs != d))) for d in "xyz"]
            for at in points
        ]
    )
    labels = np.arange(1, len(points) + 1)
    seen = points + rng.uniform(-2.0, 2.0, points.shape) * [1.0, 1.0, 0.0]
    zeros = np.zeros(len(points), dtype=int)
    x, y, z = seen.T  # the units of dataset 164: numbers are in cm
    sets = [
        {"type": 164, "units_code": 9, "units_description": "cm", "temp_mode": 1, "length": 100.0,
         "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 2411, "node_nums": labels, "def_cs": zeros, "disp_cs": zeros, "color": zeros,
         "x": x / 10.0, "y": y / 10.0, "z": z / 10.0},
    ]  # fmt: skip
    for number, mode in enumerate(elastic, start=1):
        shape = modes.shapes[rows, mode]
        shape = shape + SHAPE_NOISE * np.abs(shape).max() * rng.standard_normal(shape.shape)
        frequency = np.sqrt(modes.eigenvalues[mode]) / (2.0 * np.pi)
        frequency *= 1.0 + FREQUENCY_NOISE * rng.standard_normal()
        sets.append(
            {"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8,
             "load_case": 1, "mode_n": number, "freq": frequency, "modal_damp_vis": 0.002,
             "node_nums": labels, "r1": shape[:, 0], "r2": shape[:, 1], "r3": shape[:, 2]}
        )  # fmt: skip
    pyuff.UFF(str(file)).write_sets(sets, mode="overwrite")


if __name__ == "__main__":
    nominal(HERE)
    if "decks" not in sys.argv:
        universal_file(truth(), HERE / "test.unv")
