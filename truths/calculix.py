"""Solve a structure's mesh of bricks by CalculiX too: ``python -m truths.calculix NAME [SIZE]``.

The second solver shares nothing with the first but corners of cells: its input has nodes, elements
of type C3D20 and materials. Attachments are left out on both sides; clamps stay.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from truths.modes_of import assembled, mesh_of, modes_of
from truths.solid import Solid
from truths.structure import Structure
from truths.suite import structures

Array = npt.NDArray[np.float64]
# scikit-fem's corners in the order of an Abaqus brick, and its edges in that order.
ORDER = (0, 2, 4, 1, 3, 6, 7, 5)
EDGES = (
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 0),
    (4, 5),
    (5, 6),
    (6, 7),
    (7, 4),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
)


def input_deck(structure: Structure, solid: Solid, modes: int) -> str:
    """Return CalculiX's input for the lowest modes of a solid."""
    corners = solid.cells[list(ORDER)]
    pairs = np.sort(np.array([[corners[a], corners[b]] for a, b in EDGES]), axis=1)
    flat = pairs.transpose(0, 2, 1).reshape(-1, 2)
    edges, index = np.unique(flat, axis=0, return_inverse=True)
    middle = index.reshape(len(EDGES), -1) + solid.points.shape[1]
    points = np.hstack([solid.points, solid.points[:, edges].mean(axis=2)])
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.9e},{y:.9e},{z:.9e}" for i, (x, y, z) in enumerate(points.T, 1)]
    kinds, which = np.unique(
        np.array([solid.modulus, solid.poisson, solid.density]), axis=1, return_inverse=True
    )
    cells = np.vstack([corners, middle]).T + 1
    for k in range(kinds.shape[1]):
        lines.append(f"*ELEMENT, TYPE=C3D20, ELSET=E{k}")
        for number in np.flatnonzero(which == k):
            words = [str(n) for n in (number + 1, *cells[number])]
            lines += [",".join(words[:11]) + ",", ",".join(words[11:])]
    for k, (modulus, poisson, density) in enumerate(kinds.T):
        lines += [f"*MATERIAL, NAME=M{k}", "*ELASTIC", f"{modulus:.9e},{poisson:.9e}"]
        lines += ["*DENSITY", f"{density:.9e}", f"*SOLID SECTION, ELSET=E{k}, MATERIAL=M{k}"]
    for clamp in structure.clamps:
        fixed = np.flatnonzero(clamp.holds(points)) + 1
        lines += ["*BOUNDARY", *(f"{node},1,3" for node in fixed)]
    lines += ["*STEP", "*FREQUENCY", str(modes), "*END STEP", ""]
    return "\n".join(lines)


def frequencies(structure: Structure, solid: Solid, modes: int) -> Array:
    """Return the lowest natural frequencies by CalculiX, rigid ones among them, Hz.

    Raises:
        FileNotFoundError: where CalculiX is not installed.
        RuntimeError: where it fails.
    """
    program = shutil.which("ccx")
    if program is None:
        raise FileNotFoundError("CalculiX is needed: apt install calculix-ccx")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "solid.inp"
        file.write_text(input_deck(structure, solid, modes))
        done = subprocess.run([program, "solid"], cwd=folder, capture_output=True, text=True)
        result = Path(folder) / "solid.dat"
        if done.returncode or not result.exists():
            raise RuntimeError(f"CalculiX failed: {done.stdout[-300:]}")
        found = []
        for line in result.read_text().splitlines():
            words = line.split()
            if len(words) == 5 and words[0].isdigit():
                found.append(float(words[3]))
            if "P A R T I C I P A T I O N" in line:
                break
    return np.array(found)


def main() -> int:
    """Compare both solvers; return the exit status."""
    name = sys.argv[1]
    structure = replace(structures()[name], lumps=(), springs=(), struts=(), oscillators=())
    if structure.mesher != "bricks" or structure.warp is not None:
        print(f"{name}: only straight structures of bricks are compared", file=sys.stderr)
        return 2
    size = float(sys.argv[2]) if len(sys.argv) > 2 else structure.size[0]
    solid, count = mesh_of(structure, size), structure.used + structure.held_out
    first = modes_of(replace(structure, plane="3d"), assembled(structure, solid), count)
    second = frequencies(structure, solid, count + 6)
    second = second[second > 0.02 * structure.guess][:count]
    print("scikit-fem, Hz  CalculiX, Hz  difference, %")
    for one, two in zip(first.frequencies, second, strict=False):
        print(f"{one:14.4f}  {two:12.4f}  {100 * (two / one - 1):+.4f}")
    worst = float(np.abs(second / first.frequencies[: len(second)] - 1).max())
    return 0 if worst < 0.005 else 1


if __name__ == "__main__":
    raise SystemExit(main())
