"""Pose a truth as a case: its files over those of its structure, as a user would hand them in."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from femubench.core.challenge.truth_file import TRUTH_FILE, KnownCase, read_truth
from femubench.core.errors import InputError
from femubench.core.files import MIB, check_new, read_text

CASE_FILE, HEALTHY = "case.toml", "healthy.csv"
_ABOUT = (".md", ".svg")  # what tells of a structure and is no data


def pose(truth_folder: Path, structure: Path, target: Path, reference: bool = False) -> KnownCase:
    """Write the case of a truth into a new folder, and return the truth, which stays outside.

    Arguments:
        truth_folder: with a `truth.toml` and whatever differs from the structure's folder.
        structure: its folder.
        target: a new or an empty folder.
        reference: whether the case brings the healthy structure's measurement.

    Raises:
        InputError: for a faulty truth, an unknown structure, a reference that is not there.
    """
    truth = read_truth(truth_folder)
    if not (structure / CASE_FILE).is_file():
        file = truth_folder / TRUTH_FILE
        what, expected = f"no structure {truth.structure!r}", f"a folder in {structure.parent}"
        raise InputError(what, file=file, key="structure", expected=expected)
    overlay(structure, truth_folder, target, reference, truth.mass)
    return truth


def overlay(
    structure: Path,
    truth_folder: Path,
    target: Path,
    reference: bool = False,
    mass: tuple[float, float] | None = None,
) -> None:
    """Write the case of a structure with the files of a truth over its own.

    Modifications and responses are dropped: those of the structure are of the healthy one. `mass`
    is what a balance reads of the structure as it is, and its deviation, in kg.

    Raises:
        InputError: when the target is not empty, or the reference is not there.
    """
    if reference and not (truth_folder / HEALTHY).is_file():
        raise InputError("there is no reference", file=truth_folder, expected=f"a file {HEALTHY}")
    check_new(target)
    changed = truth_folder / CASE_FILE
    file = changed if changed.is_file() else structure / CASE_FILE
    document = parse_case(file)
    if "measurement" not in document:
        raise InputError("no measurement", file=file, key="measurement", expected="a table")
    changes = document.pop("modification", [])
    left_out = {CASE_FILE, TRUTH_FILE, *(str(change.get("modes")) for change in changes)}
    left_out |= set() if reference else {HEALTHY}
    target.mkdir(parents=True, exist_ok=True)
    for folder in (structure, truth_folder):
        for path in sorted(folder.iterdir()):
            if path.is_file() and path.name not in left_out and path.suffix not in _ABOUT:
                shutil.copyfile(path, target / path.name)
    for key in () if file == changed else ("frfs", "responses"):
        document["measurement"].pop(key, None)
    healthy = document["measurement"].get("mass")
    if mass is not None:
        document["measurement"]["mass"] = {"value": mass[0], "std": mass[1]}
    if reference:
        document["reference"] = {"modes": HEALTHY}
        if healthy is not None:
            document["reference"]["mass"] = healthy
    (target / CASE_FILE).write_text(case_text(document), encoding="utf-8")


def parse_case(file: Path) -> Any:  # noqa: ANN401 - tables of any keys
    """Return a `case.toml` as tables that can be changed; raises InputError for what is no TOML."""
    try:
        return tomlkit.parse(read_text(file, MIB))
    except TOMLKitError as error:
        raise InputError(str(error), file=file, expected="valid TOML") from None


def case_text(document: Any) -> str:  # noqa: ANN401 - of `parse_case`
    """Return the text of changed tables."""
    return tomlkit.dumps(document).rstrip("\n") + "\n"
