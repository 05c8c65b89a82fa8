"""Where truths and their structures are; pose one as a case."""

from __future__ import annotations

import tomllib
from pathlib import Path

from femubench.core.challenge import posing
from femubench.core.challenge.truth_file import KnownCase, read_truth
from truths.structure import AFTER

ROOT = Path(__file__).parents[1]
SUITE = ROOT / "scenarios" / "suite"
DEFECTS = ROOT / "truths" / "data" / "defects"
FAULTS = ROOT / "truths" / "data" / "faults"
# Of a second generator, with structures of their own.
OPENSEES = ROOT / "truths" / "data" / "opensees"
STRUCTURES = OPENSEES / "structures"
# Of a third, shear frames, by SciPy alone.
SHEAR = ROOT / "truths" / "data" / "shear"
SHEAR_STRUCTURES = SHEAR / "structures"


def first_folders(suite: Path = SUITE) -> list[Path]:
    """Return the structures that defects and faults are drawn on: none after the rule."""
    index = suite / "suite.toml"
    listed = tomllib.loads(index.read_text(encoding="utf-8")) if index.exists() else {}
    later = {name for name, item in listed.items() if AFTER in item["classes"]}
    return [p.parent for p in sorted(suite.glob("*/case.toml")) if p.parent.name not in later]


def pose(
    truth_folder: Path, target: Path, reference: bool = False, *, suite: Path = SUITE
) -> KnownCase:
    """Write the case of a truth on a structure of the suite; see `femubench.core.challenge.posing`.

    Arguments:
        truth_folder, target, reference: of the truth, of the case, and whether with the healthy.
        suite: where the structures are.
    """
    structure = suite / read_truth(truth_folder).structure
    return posing.pose(truth_folder, structure, target, reference)
