"""A case folder from the files of a model and of a test: what they say and what they leave open."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.case.case import SCATTER, Case
from femubench.core.case.drawn import CASE_FILE
from femubench.core.case.faults import Remedy
from femubench.core.case.files import LARGEST_FILE
from femubench.core.case.matching import Alignment
from femubench.core.case.matrices import reader_of, reading_with
from femubench.core.case.model_files import ModelFiles, further_files, read_model
from femubench.core.case.modes import FIT_STD
from femubench.core.case.reader import read_case
from femubench.core.case.records import COVARIANCE, MODES, REFERENCES, SENSORS
from femubench.core.case.response_files import holds_responses, read_responses
from femubench.core.case.schema import CaseSpec, LengthUnit
from femubench.core.case.table_text import csv_bytes
from femubench.core.case.tables import SUFFIXES, read_table
from femubench.core.case.toml_text import spec_of
from femubench.core.case.turns import propose_axes
from femubench.core.case.units import METRES, NEWTONS
from femubench.core.case.writing import new_folder
from femubench.core.errors import InputError, ModelError
from femubench.core.fem.model import Model
from femubench.core.files import check_regular
from femubench.core.modal.rigid import rigid_body_vectors, rigid_modes_of
from femubench.core.roles import Reader

# Mass over the cube of the diagonal, kg/m3: a mast of 1 km to a block of steel.
_DENSITIES = (1e-4, 2e4)
MATCHES, PICTURE = "matches.csv", "matches.png"
REFERENCE, REFERENCE_SENSORS = "reference.csv", "reference_sensors.csv"


@dataclass(frozen=True)
class Beginning:
    """What is at hand of a structure.

    Arguments:
        model: a file with the model, or with its stiffness alone.
        modes: the file with the measured modes, the folder of an identification or a file of
            responses; several such records are repeats.
        mass, dofs: files with the mass, and with labels or places of the rows of matrices.
        sensors: a file with the places of sensors, where `modes` has none.
        model_unit: of the lengths of the model; None where it was not stated.
        unit, frame, directions, tolerance, origin, without: of the test, as the keys of
            ``[measurement]``.
        reference: the modes or responses of the structure as it was, like `modes`.
        tables: what was identified, by name: the file that it comes from, and the table.
    """

    model: Path
    modes: tuple[Path, ...]
    mass: Path | None = None
    dofs: Path | None = None
    sensors: Path | None = None
    model_unit: LengthUnit | None = None
    unit: LengthUnit | None = None
    frame: str | None = None
    directions: str | None = None
    tolerance: float | None = None
    origin: str | None = None
    without: str | None = None
    reference: Path | None = None
    tables: Mapping[str, tuple[Path, bytes]] = field(default_factory=dict)
    stated: tuple[str, ...] = ()

    @classmethod
    def of(cls, model: Any, modes: Sequence[Any], **stated: Any) -> Beginning:  # noqa: ANN401
        """Return it with paths; raises InputError where model or modes are missing."""
        if model is None or not modes:
            missing = "--model" if model is None else "--modes"
            expected = "a file with the model and one with the modes"
            raise InputError("is missing", key=missing, expected=expected)
        return cls(Path(model), tuple(Path(path) for path in modes), **stated)

    def files(self) -> tuple[Path, ...]:
        """Return the files that are at hand."""
        modes = () if MODES in self.tables else self.modes
        sensors = None if SENSORS in self.tables else self.sensors
        reference = None if REFERENCE in self.tables else self.reference
        every = (self.model, self.mass, self.dofs, *modes, sensors, reference)
        return tuple(path for path in every if path is not None)

    def command(self, folder: Path, remedy: Remedy) -> str:
        """Return the command that begins the case with other keys."""
        words = ["bench", "init", str(folder)]
        files = ("model", "mass", "dofs", "modes", "reference", "sensors")
        axes = ("model-unit", "unit", "frame", "directions", "origin", "tolerance", "without")
        for key in (*files, *axes):
            value = remedy.keys.get(key, getattr(self, key.replace("-", "_")))
            for one in value if isinstance(value, tuple) else (value,):
                words += [] if one is None else [f"--{key}", str(one)]
        return shlex.join(words)


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
        draw: draws the matches of a case into a file; None for no picture.

    Raises:
        InputError: when the folder holds anything, or for what is wrong in the files.
    """
    guessed = given.model_unit is None
    if guessed:
        given = replace(given, model_unit=_likely_unit(given, readers))
    with new_folder(folder) as fresh:
        copies = _copied(given, fresh, readers)
        for name, (_, content) in given.tables.items():
            (fresh / name).write_bytes(content)
        modes = fresh / MODES if MODES in given.tables else given.modes[0]
        used, held_out = _shared_out(mode_numbers(modes, readers), given.modes[0])
        before: list[int] = []
        if (path := given.reference) is not None:
            modes = fresh / REFERENCE if REFERENCE in given.tables else path
            before = _shared_out(mode_numbers(modes, readers), path)[0]
        keys = _Keys(folder.resolve().name, given, copies, used, held_out, guessed, before)
        text = keys.text(readers)
        (fresh / CASE_FILE).write_text(text, encoding="utf-8")
        try:
            case = read_case(fresh, readers=readers)
        except InputError as error:
            # The file that the user has, and not its copy.
            origins = {fresh / name: path for path, name in copies.items()}
            origins |= {fresh / name: path for name, (path, _) in given.tables.items()}
            file = None if error.file is None else origins.get(Path(error.file))
            line = error.line if file is not None and file.suffix in SUFFIXES else None
            expected = error.expected
            if isinstance(error.remedy, Remedy) and expected is not None:
                command = given.command(folder, error.remedy)
                expected = expected.replace(f"with {error.remedy}", f"with `{command}`")
            raise InputError(
                error.what, file=file, line=line, key=error.key, expected=expected
            ) from None
        with suppress(ModelError):
            spec = spec_of(text, fresh / CASE_FILE, CaseSpec).measurement
            if found := propose_axes(case, Alignment.of(spec)):
                given = replace(given, stated=(*given.stated, found))
        keys = replace(keys, given=given)
        (fresh / CASE_FILE).write_text(keys.text(readers, case), encoding="utf-8")
        if case.matches:
            (fresh / MATCHES).write_bytes(_matches_csv(case))
        case = read_case(fresh, readers=readers)
        if draw is not None and case.matches:
            draw(case, fresh / PICTURE)
    return replace(case, folder=folder, notes=(*given.stated, *case.notes))


def _likely_unit(given: Beginning, readers: Sequence[Reader]) -> LengthUnit:
    """Return the unit in which a model is as heavy for its size as a structure can be."""
    files = ModelFiles(given.model, given.mass, given.dofs)
    model = read_model(files, readers)
    size = float(np.linalg.norm(np.ptp(model.dofs.xyz, axis=0))) if len(model.dofs) else 0.0
    density = model.total_mass / size**3 if size > 0.0 else 0.0
    units: tuple[LengthUnit, ...] = ("m", "mm", "in")
    low, high = _DENSITIES
    likely = [u for u in units if low <= density * NEWTONS[u] / METRES[u] ** 4 <= high]
    return next(iter(likely), "m")


def _copied(given: Beginning, fresh: Path, readers: Sequence[Reader]) -> dict[Path, str]:
    """Copy the files into a folder; return from every file to its name there."""
    names = {path: path.name for path in given.files()}
    check_regular(given.model, LARGEST_FILE)
    for further in further_files(given.model, readers):
        names.setdefault(further, os.path.relpath(further, given.model.parent))
    taken: dict[str, Path] = dict.fromkeys((CASE_FILE, MATCHES, PICTURE, *given.tables), fresh)
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


def mode_numbers(file: Path, readers: Sequence[Reader]) -> list[int]:
    """Return the labels of the modes of a file by frequency; none for a file of responses.

    Raises:
        InputError: for a kind of file that nobody reads, or one that is broken.
    """
    if file.suffix.lower() in SUFFIXES:
        table = read_table(file)
        if holds_responses(table.columns):
            return []
        table.check_columns(("mode", "frequency"), table.columns)
        found = [(row.number("frequency") or 0.0, row.whole("mode")) for row in table.rows]
        return [number for _, number in sorted(found)]
    reader = reader_of(file, readers)
    if reader is None:
        known = ", ".join([*SUFFIXES, *(s for r in readers for s in r.suffixes)])
        expected = f"{known}, or a folder that `bench identify` writes"
        raise InputError("unknown kind of file", file=file, expected=expected)
    try:
        with reading_with(reader, file):
            read = reader.read_modes(file)
    except InputError:
        with suppress(InputError):
            read_responses(file, readers)
            return []
        raise
    return [read.numbers[k] for k in np.argsort(read.frequencies)]


def _shared_out(numbers: Sequence[int], file: Path) -> tuple[list[int], list[int]]:
    """Return the labels of the modes to use, and of the upper third, which is held out."""
    if not numbers:
        raise InputError("no modes", file=file, expected="frequencies and mode shapes")
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
    guessed: bool
    before: Sequence[int]

    def text(self, readers: Sequence[Reader], case: Case | None = None) -> str:
        """Return it; with a case that was read from a first one, also what that found."""
        given = self.given
        every = dict.fromkeys((*given.files(), *given.modes, *filter(None, [given.reference])))
        source = " and ".join(path.name for path in every)
        lines = [
            f"# Written by `bench init` from {source}.",
            "# `bench help KEY` explains a key (docs/case-format.md); an unknown key is an error.",
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
            *self._reference(),
            "# A known change of the structure that was measured as well is the test that counts:",
            "# [[modification]]",
            '# name = "1 kg at a node"',
            '# masses = [{at = "NODE", mass = 1.0}]',
            '# modes = "modified.csv"',
        ]
        return "\n".join(lines) + "\n"

    def _title(self, readers: Sequence[Reader]) -> str:
        """Return the title that a test has in its file."""
        file = self.given.modes[0]
        reader: Any = None if file.is_dir() else reader_of(file, readers)
        if not hasattr(reader, "read_outline"):
            return ""
        with reading_with(reader, file):
            return str(reader.read_outline(file).title)[:200]

    def _model(self, case: Case | None) -> Iterator[str]:
        given = self.given
        yield "[model]"
        yield 'kind = "file"'
        for key, path in (("file", given.model), ("mass", given.mass), ("dofs", given.dofs)):
            if path is not None:
                yield f"{key} = {_quoted(self.copies[path])}"
        stated = "   # not stated: taken from its size and mass" if self.guessed else ""
        yield f'unit = "{given.model_unit}"{stated}'
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
        for said in given.stated:
            yield f"# {_clean(said)}"
        if SENSORS in given.tables:
            yield f'sensors = "{SENSORS}"'
        elif given.sensors is not None:
            yield f"sensors = {_quoted(self.copies[given.sensors])}"
        modes = MODES if MODES in given.tables else self.copies[given.modes[0]]
        yield f"modes = {_quoted(modes)}"
        if COVARIANCE in given.tables:
            yield f'covariance = "{COVARIANCE}"'
        if REFERENCES in given.tables:
            yield f"# {REFERENCES}: what every response was measured to."
        if FIT_STD.encode() in given.tables.get(MODES, (None, b""))[1][:80]:
            shares = "frequencies = {:g}, shapes = {:g}".format(*SCATTER)
            yield f"scatter = {{{shares}}}   # from test to test, added to what the fit says"
        if given.unit is not None:
            yield f'unit = "{given.unit}"   # of the coordinates of the sensors'
        if given.frame is not None:
            yield f"frame = {_quoted(given.frame)}   # the model's axes in those of the test"
        if given.directions is not None:
            yield f"directions = {_quoted(given.directions)}   # likewise of directions alone"
        if given.tolerance is not None:
            yield f"tolerance = {given.tolerance!r}   # of the size of the structure"
        if given.origin is not None:
            yield f"origin = [{given.origin}]   # of the test's origin, in m"
        if given.without is not None:
            listed = ", ".join(_quoted(label) for label in given.without.split(","))
            yield f"without = [{listed}]   # sensors that are left out"
        for note in () if case is None else case.notes:
            yield f"# {_clean(note)}"
        if case is not None and case.matches:
            yield f"# {MATCHES} lists where every sensor was taken to sit."
        yield "shape_std = 0.015   # of the largest reading, where the test states no scatter"
        yield f"used = {list(self.used)}   # what an updating strategy is given"
        share = "the upper third: only the score sees them" if self.held_out else "too few modes"
        yield f"held_out = {list(self.held_out)}   # {share}"
        yield "# band = [LOW, HIGH]   # in Hz, if every mode in between was found"
        yield "# mass = {value = KG, std = KG}   # if the structure was weighed"

    def _reference(self) -> Iterator[str]:
        given = self.given
        if given.reference is None:
            return
        yield "[reference]   # the structure as it was: what differs from it is sought"
        yield f"modes = {_quoted(self.copies.get(given.reference, REFERENCE))}"
        if REFERENCE_SENSORS in given.tables:
            yield f'sensors = "{REFERENCE_SENSORS}"'
        yield f"used = {list(self.before)}"
        yield ""


def sizes_of(model: Model) -> str:
    """Return how large and heavy a model is, as a clause: a wrong unit shows there first.

    Matrices that hold a model lack the rows of what is held, and their mass.
    """
    motions = rigid_body_vectors(model.dofs).shape[1] if model.structure is None else 0
    held = rigid_modes_of(model).shape[1] < motions
    extent = np.ptp(model.dofs.xyz, axis=0) if len(model.dofs) else np.zeros(3)
    sides = " x ".join(f"{side:.4g}" for side in extent)
    return (
        f"has {model.size} degrees of freedom, spans {sides} m along x, y, z and has a mass of "
        f"{model.total_mass:.4g} kg{', without held rows if it has any' if held else ''}"
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
