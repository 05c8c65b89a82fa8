"""Write what gives twins their truth: ``python -m truths [NAME ...] --only stretches``.

Each file is checked against a solid that was solved in full at a stretch it was not made from.
"""

from __future__ import annotations

import io
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from femubench.core.twin.reduced_solid import ReducedSolid
from femubench.core.twin.stretched_case import FILE
from truths.affine import Power, StretchedSolid
from truths.eigenmodes import RIGID
from truths.measurement import mac
from truths.modes_of import Observed, mesh_of, modes_of
from truths.reduction import KnownSolid, basis_of, drawn_factors, seat_of, snapshots, stretched
from truths.remade import RemadeSolid
from truths.seats import DIRECTIONS
from truths.stretch import sizes, stretch_of
from truths.structure import Change, Place, Structure
from truths.suite import SUITE

Array = npt.NDArray[np.float64]
States = tuple[Change | None, ...]  # as built, and after changes
Solved = tuple[Array, list[Observed]]  # factors, and the states of the structure at them

MOST_CORNERS = 2000  # of the finer mesh; of larger solids the coarser one is taken
SAMPLES, MOST_SAMPLES = 4, 16  # stretches that snapshots are taken of, more until near enough
SIZES = (45, 60, 75, 90, 110)  # of the basis, rigid motions aside: the first that is near enough
LARGEST_ERROR, LEAST_MAC = 1e-3, 0.999  # a third of the scatter of a test
MORE = 6  # modes of solids in full next to those listed
WANTED_ERROR = 4e-4  # at the stretches by which the size is chosen
_CHOICE_SEED, HELD_OUT_SEED = 7, 99
PAGE = Path(__file__).parents[1] / "docs" / "scoring.md"
MARK, END = "<!-- stretched -->", "<!-- /stretched -->"


def solid_of(structure: Structure) -> KnownSolid:
    """Return the solid of a structure: able to be stretched, or where it is not, to be remade.

    Raises:
        ValueError: where it has what the files do not hold.
    """
    if structure.struts or structure.oscillators:
        raise ValueError(f"{structure.name}: struts and oscillators are not stretched")
    coarse, fine = (mesh_of(structure, size) for size in structure.size)
    solid = fine if fine.points.shape[1] <= MOST_CORNERS else coarse
    try:
        return StretchedSolid(solid, stretch_of(structure))
    except ValueError:
        return RemadeSolid(structure, solid)


def file_of(structure: Structure, solid: KnownSolid, shapes: Array) -> dict[str, Any]:
    """Return the arrays of a file by their names.

    `names`, `ranges`: of the factors. `knots_x`, `kinds_x` and so on: planes across an axis in m,
    and the factor between them. `stiffness`, `mass`: upper triangles of matrices, one a row, and
    `_powers` of the factors. `masses`: kg. `sections`, `sizes`: width, height and wall in m of
    each, a sum over the factors. `members`, `materials`: factors of modulus and density of each
    that may be of another material. `sensors`: seat and direction. `lumps`, `springs`: state, seat,
    then mass in kg and offset in m, or direction and stiffness. `seat_...`: as `Seat` has them,
    filled up with 0. `error`, `alike`: what `distance` says, added when it is known.
    """
    stretch, upper = solid.stretch, np.triu_indices(shapes.shape[1])
    found: dict[str, Any] = {"names": np.array(stretch.names), "ranges": stretch.ranges}
    for axis, name in enumerate("xyz"):
        found[f"knots_{name}"] = stretch.knots[axis]
        found[f"kinds_{name}"] = stretch.classes[axis]
    for name, terms in zip(("stiffness", "mass"), solid.projected(shapes), strict=True):
        found[f"{name}_powers"] = np.array(list(terms), dtype=np.int8)
        # Shapes of unit energy keep all entries below 1, so that single precision is enough.
        found[name] = np.array([matrix[upper] for matrix in terms.values()], dtype=np.float32)
    masses: dict[Power, float] = solid.masses()
    found["masses"] = np.array([masses[tuple(p)] for p in found["mass_powers"].tolist()])
    found |= _drawn(structure, solid) | _attached(structure, solid, shapes)
    found["rigid_below"] = RIGID * structure.guess
    for name in ("scatter", "together", "shape_scatter"):
        found[name] = getattr(structure, name)
    return found


def _drawn(structure: Structure, solid: KnownSolid) -> dict[str, Any]:
    """Return what the factors do to sections and members of the drawing."""
    rows, names = {}, list(solid.stretch.names)
    made = solid.factors_of if isinstance(solid, RemadeSolid) else {}
    for member in () if made else structure.solid_members:
        edges = sizes(structure, solid.stretch, member)  # (rectangles, y0 y1 z0 z1, factors)
        outer = edges[0]
        row = np.array([outer[1] - outer[0], outer[3] - outer[2], 0 * outer[0]])
        if len(edges) > 1:
            row[2] = outer[1] - edges[1][1]
        if "shape" not in structure.sections[member.section].drawn:
            row[:] = 0.0
        rows[member.section] = row
    return {
        "sections": np.array(list(rows), dtype=np.str_),
        "sizes": np.array(list(rows.values())).reshape(-1, 3, len(names)),
        "members": np.array(list(made), dtype=np.str_),
        "materials": np.array(list(made.values()), dtype=np.int64).reshape(-1, 2),
    }


def _attached(structure: Structure, solid: KnownSolid, shapes: Array) -> dict[str, Any]:
    """Return sensors, masses and springs, and the seats that they sit on."""
    states = (Change("", structure.lumps, structure.springs), *structure.changes)
    lumps = [(i, lump) for i, state in enumerate(states) for lump in state.lumps]
    springs = [(i, spring) for i, state in enumerate(states) for spring in state.springs]
    places: list[Place] = [at for at, _ in structure.sensors]
    places += [*(lump.at for _, lump in lumps), *(spring.at for _, spring in springs)]
    number = {place: i for i, place in enumerate(dict.fromkeys(places))}
    matrices = solid.matrices(np.ones(len(solid.stretch.names)))
    seats = [astuple(seat_of(structure, solid, matrices, at, shapes)) for at in number]
    names = ("axes", "factors", "counts", "first", "second", "sums", "moments")
    kept = {
        f"seat_{name}": _filled(parts)
        for name, parts in zip(names, zip(*seats, strict=True), strict=True)
    }
    for name in ("sums", "moments"):
        kept[f"seat_{name}"] = kept[f"seat_{name}"].astype(np.float32)
    return {
        "sensors": np.array(
            [(number[at], DIRECTIONS.index(d)) for at, own in structure.sensors for d in own]
        ),
        "lumps": np.array(
            [(i, number[part.at], part.mass, *part.offset) for i, part in lumps]
        ).reshape(-1, 6),
        "springs": np.array(
            [
                (i, number[part.at], DIRECTIONS.index(part.direction), part.stiffness)
                for i, part in springs
            ]
        ).reshape(-1, 4),
        **kept,
    }


def _filled(parts: tuple[Any, ...]) -> npt.NDArray[Any]:
    """Return arrays of several sizes in one, with zeros at their ends."""
    arrays = [np.asarray(part) for part in parts]
    shape = np.max([array.shape for array in arrays], axis=0, initial=0).astype(int)
    if not len(shape):
        return np.array(arrays)
    found = np.zeros((len(arrays), *shape), dtype=arrays[0].dtype)
    for row, array in zip(found, arrays, strict=True):
        row[tuple(slice(size) for size in array.shape)] = array
    return found


def held_out(structure: Structure, solid: KnownSolid, seed: int, states: States) -> Solved:
    """Return factors and what the solid in full says at them in some states."""
    count, (factors,) = structure.used + structure.held_out, drawn_factors(solid, 1, seed)
    here, matrices = stretched(structure, solid, factors), solid.matrices(factors)
    # Of a planar structure as many modes as are wanted may lie among those across its plane.
    full = [modes_of(here, matrices, count + MORE, state) for state in states]
    if min(len(state.frequencies) for state in full) < count:
        raise ValueError(f"{structure.name}: fewer than {count} modes of a stretch were found")
    return factors, full


def distance(solved: Solved, reduced: ReducedSolid, count: int) -> tuple[float, float]:
    """Return the largest relative error of the first frequencies, and the lowest MAC at sensors."""
    errors, alike = [], []
    for number, full in enumerate(solved[1]):
        hertz, shapes = reduced.modes(solved[0], number, count)
        errors.append(np.abs(hertz / full.frequencies[:count] - 1).max())
        alike.append(mac(full.sensors[:count], shapes.T).diagonal().min())
    return float(max(errors)), float(min(alike))


def write(structure: Structure, folder: Path) -> list[str]:
    """Write the file of a structure into its folder in the suite, and return how far it is off.

    Raises:
        ValueError: where it is off by more than 0.1 % or a MAC is below 0.999; nothing is written.
    """
    solid, count = solid_of(structure), structure.used + structure.held_out
    chosen_by = held_out(structure, solid, _CHOICE_SEED, (None,))
    drawn, near = drawn_factors(solid, MOST_SAMPLES), False
    taken: list[Array] = []
    while not near and len(taken) < MOST_SAMPLES:
        taken += [snapshots(structure, solid, f) for f in drawn[len(taken) :][:SAMPLES]]
        for size in SIZES:
            arrays = file_of(structure, solid, basis_of(structure, solid, np.hstack(taken), size))
            near = distance(chosen_by, ReducedSolid(arrays), count)[0] <= WANTED_ERROR
            if near:
                break
    checked_by = held_out(structure, solid, HELD_OUT_SEED, (None, *structure.changes))
    error, alike = distance(checked_by, ReducedSolid(arrays), count)
    if error > LARGEST_ERROR or alike < LEAST_MAC:
        raise ValueError(
            f"{structure.name}: {100 * error:.3f} % and MAC {alike:.4f} from solids "
            f"in full, at most 0.1 % and at least 0.999 expected"
        )
    content = io.BytesIO()
    np.savez_compressed(content, **arrays, error=error, alike=alike)
    (folder / structure.name / FILE).write_bytes(content.getvalue())
    return [
        f"{structure.name}/{FILE}: {len(content.getvalue()) / 1024:.0f} KiB, frequencies within "
        f"{100 * error:.4f} %, MAC from {alike:.5f}"
    ]


def write_table(page: Path = PAGE) -> None:
    """Replace what stands between the marks of the page by a row for each file."""
    files = sorted(SUITE.glob(f"*/{FILE}"))
    rows = [
        "| case | factors | shapes | KiB | largest error of a frequency, % | lowest MAC |",
        "| :--- | :--- | ---: | ---: | ---: | ---: |",
    ]
    for file in files:
        solid = ReducedSolid.read(file)
        error, alike = (float(solid.arrays[name]) for name in ("error", "alike"))
        rows.append(
            f"| `suite/{file.parent.name}` | {', '.join(solid.names)} | {solid.size} "
            f"| {file.stat().st_size / 1024:.0f} | {100 * error:.3f} | {alike:.5f} |"
        )
    total = sum(file.stat().st_size for file in files) / 1024**2
    foot = f"\n{len(files)} cases, {total:.1f} MiB together.\n"
    before, _, rest = page.read_text(encoding="utf-8").partition(MARK)
    table = MARK + "\n\n" + "\n".join(rows) + "\n" + foot + "\n" + END
    page.write_text(before + table + rest.partition(END)[2], encoding="utf-8")
