"""Write the scenario folder of a structure: drawn model, measured data, README, picture."""

from __future__ import annotations

import importlib
import pkgutil
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

import truths.structures
from truths.drawing import case_text, text
from truths.measurement import modes_csv, record, sensors_csv
from truths.modes_of import Observed, assembled, mesh_difference, mesh_of, modes_of
from truths.picture import picture
from truths.structure import AFTER, Structure

Array = npt.NDArray[np.float64]
SUITE = Path(__file__).parents[1] / "scenarios" / "suite"
BEFORE = "before the rule"  # class of the structures that the rule of the boards was made with
LARGEST_DIFFERENCE = 0.007  # of a listed mode's frequency, between the two meshes


def structures() -> dict[str, Structure]:
    """Return all structures by name: `STRUCTURE` of every file in `truths/structures`."""
    found = {}
    for module in pkgutil.iter_modules(truths.structures.__path__):
        item: Structure = importlib.import_module(f"truths.structures.{module.name}").STRUCTURE
        found[item.name] = item
    return dict(sorted(found.items()))


@dataclass(frozen=True)
class Solved:
    """Hold what the solids say of a structure.

    Arguments:
        states: the structure as built, then after each change of its design.
        differences: relative difference of the two meshes in each listed mode of the first state.
        alike: MAC of these modes between the two meshes.
        nodes: of the two meshes.
        mass: kg, without what hangs on it for a change.
    """

    states: tuple[Observed, ...]
    differences: Array
    alike: Array
    nodes: tuple[int, int]
    mass: float


def solve_structure(structure: Structure) -> Solved:
    """Solve a structure on two meshes, and its changes on the finer one.

    Raises:
        ValueError: where a listed mode differs by more than 0.7 % between the meshes, the guess is
            far off, or too few modes were found.
    """
    count = structure.used + structure.held_out
    coarse, fine = (assembled(structure, mesh_of(structure, size)) for size in structure.size)
    states = tuple(
        modes_of(structure, fine, count, change) for change in (None, *structure.changes)
    )
    first = float(states[0].frequencies[0])
    if not 0.2 < first / structure.guess < 5:
        raise ValueError(f"{structure.name}: first mode {first:.3g} Hz, guess {structure.guess:g}")
    difference, alike = mesh_difference(modes_of(structure, coarse, count), states[0], count)
    if difference.max() > LARGEST_DIFFERENCE:
        raise ValueError(
            f"{structure.name}: mode {difference.argmax() + 1} differs by "
            f"{100 * difference.max():.2f} % between the meshes, at most 0.7 % expected"
        )
    if min(len(state.frequencies) for state in states) < count:
        raise ValueError(f"{structure.name}: fewer than {count} modes were found")
    nodes = (coarse.nodes.shape[1], fine.nodes.shape[1])
    mass = fine.total_mass + structure.hung_mass
    return Solved(states, difference, alike, nodes, mass)


ROW = re.compile(r"^\| \d+ \| (used|held out) \| [\d.]+ \| ([\d.]+) \|", re.MULTILINE)


def listed_modes(readme: str) -> list[tuple[str, float]]:
    """Return use and difference of the two meshes (%) of each mode that a README lists."""
    return [(use, float(difference)) for use, difference in ROW.findall(readme)]


def mesh_differences(name: str) -> Array:
    """Return the relative differences of the meshes that a structure's README lists."""
    text = (SUITE / name / "README.md").read_text(encoding="utf-8")
    return np.array([difference / 100 for _, difference in listed_modes(text)])


def readme(structure: Structure, solved: Solved) -> str:
    """Return the README of a scenario."""
    count = structure.used + structure.held_out
    rows = [
        f"| {i + 1} | {'used' if i < structure.used else 'held out'} "
        f"| {solved.states[0].frequencies[i]:.3f} | {100 * solved.differences[i]:.3f} "
        f"| {solved.alike[i]:.4f} |"
        for i in range(count)
    ]
    elements = "20-node bricks" if structure.mesher == "bricks" else "10-node tetrahedra"
    changes = "\n".join(
        f"{number}. {change.name}" for number, change in enumerate(structure.changes, 1)
    )
    return (
        f"""# {structure.name}: {structure.title}

![the structure](picture.svg)

{structure.story.strip()}

**Origin.** The measured side is a solid model: {elements} by scikit-fem, {solved.nodes[0]} and
{solved.nodes[1]} nodes; what is published comes from the finer mesh. `truths/structures` holds the
description, `make truths ARGS={structure.name}` computes it again. The nominal model is drawn from
centre lines and catalogue values and knows nothing else of the solid.

**Scatter of the test** (seed {structure.seed}): frequencies {100 * structure.scatter:g} %, of whose
variance all modes share {100 * structure.together:g} %; shapes {100 * structure.shape_scatter:g} %
of the largest component, half of its variance a gain of each sensor. `frequency_std` holds the
scatter, which is drawn, and the difference of the two meshes, which is not.

**Changes of the design**, solved on the same solid:

{changes}

| mode | | frequency of the solid, Hz | difference of the meshes, % | MAC of the meshes |
|---|---|---|---|---|
"""
        + "\n".join(rows)
        + "\n"
    )


def files_of(structure: Structure, solved: Solved) -> dict[str, str]:
    """Return the text of every file of a scenario folder."""
    count = structure.used + structure.held_out
    mesh = solved.differences
    weighed = np.random.default_rng((structure.seed, 99)).standard_normal() * structure.weighed
    files = {
        "case.toml": case_text(structure, solved.mass * (1 + weighed)),
        "sensors.csv": sensors_csv(structure),
        "README.md": readme(structure, solved),
        "picture.svg": picture(structure),
    }
    names = ["modes.csv", *(f"change-{i + 1}.csv" for i in range(len(structure.changes)))]
    for number, (name, state) in enumerate(zip(names, solved.states, strict=True)):
        recording = record(
            structure,
            state.frequencies[:count],
            state.sensors[:count],
            mesh,
            structure.seed,
            number,
        )
        files[name] = modes_csv(structure, recording)
    return files


def index_text(all_structures: dict[str, Structure]) -> str:
    """Return `suite.toml`: title and classes of each structure."""
    tables = []
    for name, item in all_structures.items():
        classes = [*item.classes, *(() if AFTER in item.classes else (BEFORE,))]
        values = {"title": item.title, "classes": classes, "default": item.default}
        tables.append(f"[{name}]\n" + "".join(f"{k} = {text(v)}\n" for k, v in values.items()))
    return "# Written by `make truths`.\n\n" + "\n".join(tables)


def write_files(folder: Path, files: dict[str, str]) -> list[str]:
    """Write files into a folder; return what differs from what was there."""
    differences = []
    for name, content in files.items():
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.exists() else None
        if old != content:
            differences.append(f"{folder.name}/{name}: {'new' if old is None else 'changed'}")
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(content, encoding="utf-8")
    return differences


def write(structure: Structure, folder: Path) -> list[str]:
    """Compute a structure and write its folder; return what differs from what was there."""
    return write_files(folder / structure.name, files_of(structure, solve_structure(structure)))
