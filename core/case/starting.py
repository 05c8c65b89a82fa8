"""A case folder from the files of a model and of a test: what they say and what they leave open."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.files import CASE_FILE, LARGEST_FILE
from femubench.core.case.matrices import reader_of, reading_with
from femubench.core.case.model_files import further_files
from femubench.core.case.reader import read_case
from femubench.core.case.schema import LengthUnit
from femubench.core.case.table_text import csv_bytes
from femubench.core.case.tables import SUFFIXES, read_table
from femubench.core.case.writing import new_folder
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.files import check_regular
from femubench.core.roles import Reader

MATCHES, PICTURE = "matches.csv", "matches.png"


@dataclass(frozen=True)
class Beginning:
    """What is at hand of a structure.

    Arguments:
        model: a file with the model, or with its stiffness alone.
        modes: a file with the measured modes.
        mass, dofs: files with the mass, and with labels or places of the rows of matrices.
        sensors: a file with the places of sensors, where `modes` has none.
        model_unit: of the lengths of the model; None where it was not stated.
        unit, frame, tolerance: of the test, as the keys of ``[measurement]``.
    """

    model: Path
    modes: Path
    mass: Path | None = None
    dofs: Path | None = None
    sensors: Path | None = None
    model_unit: LengthUnit | None = None
    unit: LengthUnit | None = None
    frame: str | None = None
    tolerance: float | None = None

    def files(self) -> dict[str, Path]:
        """Return the files that are at hand, by what they are."""
        named = {key: getattr(self, key) for key in ("model", "mass", "dofs", "modes", "sensors")}
        return {key: path for key, path in named.items() if path is not None}


def start_case(
    folder: Path,
    given: Beginning,
    readers: Sequence[Reader],
    draw: Callable[[Case, Path], None] | None = None,
) -> Case:
    """Write a case folder with copies of the files, and return the case.

    The upper third of the modes is held out. ``matches.csv`` lists where every sensor was taken
    to sit.

    Arguments:
        folder: new or empty; it appears complete or not at all.
        given: the files, and what was given of them.
        readers: reader plugins.
        draw: draws the matches of a case into a file; None for no picture.

    Raises:
        InputError: when the folder holds anything, or for what is wrong in the files.
    """
    with new_folder(folder) as fresh:
        copies = _copied(given, fresh, readers)
        used, held_out = _shared_out(given.modes, readers)
        keys = _Keys(folder.resolve().name, given, copies, used, held_out)
        (fresh / CASE_FILE).write_text(keys.text(readers), encoding="utf-8")
        try:
            case = read_case(fresh, readers=readers)
        except InputError as error:
            # The file that the user has, and not its copy.
            origins = {fresh / name: path for path, name in copies.items()}
            file = None if error.file is None else origins.get(Path(error.file))
            line = error.line if file is not None else None
            raise InputError(
                error.what, file=file, line=line, key=error.key, expected=error.expected
            ) from None
        (fresh / CASE_FILE).write_text(keys.text(readers, case), encoding="utf-8")
        if case.matches:
            (fresh / MATCHES).write_bytes(_matches_csv(case))
        case = read_case(fresh, readers=readers)
        if draw is not None and case.matches:
            draw(case, fresh / PICTURE)
    return replace(case, folder=folder)


def _copied(given: Beginning, fresh: Path, readers: Sequence[Reader]) -> dict[Path, str]:
    """Copy the files into a folder; return from every file to its name there."""
    names = {path: path.name for path in given.files().values()}
    check_regular(given.model, LARGEST_FILE)
    for further in further_files(given.model, readers):
        names.setdefault(further, os.path.relpath(further, given.model.parent))
    taken: dict[str, Path] = dict.fromkeys((CASE_FILE, MATCHES, PICTURE), fresh)
    for source, name in names.items():
        if name.startswith(".."):
            what = f"{given.model.name} includes it, which lies outside of its folder"
            raise InputError(what, file=source, expected="all files below one folder")
        if taken.setdefault(name, source).resolve() != source.resolve():
            raise InputError(f"the name {name} is taken", file=source, expected="another name")
        check_regular(source, LARGEST_FILE)
        (fresh / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, fresh / name)
    return names


def _shared_out(modes: Path, readers: Sequence[Reader]) -> tuple[list[int], list[int]]:
    """Return the labels of the modes to use, and of the upper third, which is held out."""
    if modes.suffix.lower() in SUFFIXES:
        table = read_table(modes)
        table.check_columns(("mode", "frequency"), table.columns)
        found = [(row.number("frequency") or 0.0, row.whole("mode")) for row in table.rows]
    else:
        reader = reader_of(modes, readers)
        if reader is None:
            known = ", ".join([*SUFFIXES, *(s for r in readers for s in r.suffixes)])
            raise InputError("unknown kind of file", file=modes, expected=known)
        with reading_with(reader, modes):
            read = reader.read_modes(modes)
        found = list(zip(read.frequencies.tolist(), read.numbers, strict=True))
    if not found:
        raise InputError("no modes", file=modes, expected="frequencies and mode shapes")
    numbers = [number for _, number in sorted(found)]
    count = min(round(len(numbers) / 3) or 1, len(numbers) - 1)
    first = len(numbers) - count
    return sorted(numbers[:first]), sorted(numbers[first:])


@dataclass(frozen=True)
class _Keys:
    """The text of a `case.toml`."""

    name: str
    given: Beginning
    copies: Mapping[Path, str]
    used: Sequence[int]
    held_out: Sequence[int]

    def text(self, readers: Sequence[Reader], case: Case | None = None) -> str:
        """Return it; with a case that was read from a first one, also what that found."""
        source = " and ".join(path.name for path in self.given.files().values())
        lines = [
            f"# Written by `bench init` from {source}.",
            "# Every key is explained in docs/case-format.md; an unknown key is an error.",
            "",
            "[case]",
            f"name = {_quoted(self.name)}",
            f"title = {_quoted(self._title(readers) or self.name)}",
            f"source = {_quoted(source)}",
            "",
            *self._model(case),
            "",
            *self._measurement(case),
            "",
            "# A known change of the structure that was measured as well is the test that counts:",
            "# [[modification]]",
            '# name = "1 kg at a node"',
            '# masses = [{at = "NODE", mass = 1.0}]',
            '# modes = "modified.csv"',
        ]
        return "\n".join(lines) + "\n"

    def _title(self, readers: Sequence[Reader]) -> str:
        """Return the title that a test has in its file."""
        reader: Any = reader_of(self.given.modes, readers)
        if not hasattr(reader, "read_outline"):
            return ""
        with reading_with(reader, self.given.modes):
            return str(reader.read_outline(self.given.modes).title)[:200]

    def _model(self, case: Case | None) -> Iterator[str]:
        given = self.given
        yield "[model]"
        yield 'kind = "file"'
        for key, path in (("file", given.model), ("mass", given.mass), ("dofs", given.dofs)):
            if path is not None:
                yield f"{key} = {_quoted(self.copies[path])}"
        stated = "" if given.model_unit else "   # not stated: m, N and kg were taken"
        yield f'unit = "{given.model_unit or "m"}"{stated}'
        if case is not None:
            yield f"# It {sizes_of(case.whole or case.model)}."
        yield "# free = true   # if it hung free: nothing that holds it to ground is then suspected"
        if case is not None and case.model.structure is not None:
            return
        if case is not None and case.model.groups:
            yield f"# Parts that may be wrong by a factor: {', '.join(case.model.groups)}"
            return
        yield "# Parts that may be wrong by a factor are the parameters of most strategies:"
        yield "# [[model.groups]]"
        yield '# name = "bearings"'
        yield '# dofs = ["NODE", "NODE:z"]   # or stiffness = a file with that part of the matrix'

    def _measurement(self, case: Case | None) -> Iterator[str]:
        given = self.given
        yield "[measurement]"
        if given.sensors is not None:
            yield f"sensors = {_quoted(self.copies[given.sensors])}"
        yield f"modes = {_quoted(self.copies[given.modes])}"
        if given.unit is not None:
            yield f'unit = "{given.unit}"   # of the coordinates of the sensors'
        if given.frame is not None:
            yield f"frame = {_quoted(given.frame)}   # the model's axes in those of the test"
        if given.tolerance is not None:
            yield f"tolerance = {given.tolerance!r}   # of the size of the structure"
        for note in () if case is None else case.notes:
            yield f"# {_clean(note)}"
        if case is not None and case.matches:
            yield f"# {MATCHES} lists where every sensor was taken to sit."
        yield "shape_std = 0.015   # of the largest component, where the test states no scatter"
        yield f"used = {list(self.used)}   # what an updating strategy is given"
        share = "the upper third: only the score sees them" if self.held_out else "too few modes"
        yield f"held_out = {list(self.held_out)}   # {share}"
        yield "# band = [LOW, HIGH]   # in Hz, if every mode in between was found"
        yield "# mass = {value = KG, std = KG}   # if the structure was weighed"


def sizes_of(model: Model) -> str:
    """Return how large and heavy a model is, as a clause: a wrong unit shows there first."""
    extent = np.ptp(model.dofs.xyz, axis=0) if len(model.dofs) else np.zeros(3)
    sides = " x ".join(f"{side:.4g}" for side in extent)
    return (
        f"has {model.size} degrees of freedom, spans {sides} m along x, y, z and has a mass of "
        f"{model.total_mass:.4g} kg"
    )


def _quoted(text: str) -> str:
    """Return a text as a basic string of TOML."""
    clean = _clean(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{clean}"'


def _clean(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text).strip()


def _matches_csv(case: Case) -> bytes:
    directions = dict(
        zip(case.measurement.sensors.labels, case.measurement.sensors.directions, strict=True)
    )
    header = ["sensor", "direction", "place", "distance", "x", "y", "z"]
    rows = [
        [m.sensor, directions[m.sensor], m.place, *(f"{v:.6g}" for v in (m.distance, *m.measured))]
        for m in case.matches
        if m.sensor in directions
    ]
    return csv_bytes(header, rows)
