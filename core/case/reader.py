"""Read a case folder: whatever is wrong in it comes out as one line with file, line and key."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.case.case import SCATTER, Case, Match, Modification
from femubench.core.case.checks import FREE_YET_HELD, NOT_HELD, check_unique
from femubench.core.case.deviations import say_what_phases_lose, with_floor
from femubench.core.case.drawn import DRAWN, drawing_of
from femubench.core.case.faults import BadKey, KeyPath, at_key
from femubench.core.case.files import LARGEST_CASE, CaseFiles
from femubench.core.case.frame_tables import FrameTables
from femubench.core.case.frames import (
    Site,
    alteration_of,
    attachments,
    damping_of,
    frame_of,
    site_of,
)
from femubench.core.case.matching import Alignment, Placed, match_sensors
from femubench.core.case.matrices import model_of_matrices, reader_of, reading_with
from femubench.core.case.model_files import model_of_file, remarks_of
from femubench.core.case.modes import (
    FIT_STD,
    FREQUENCY_STD,
    NO_SENSORS,
    match_modes,
    observe_at,
    read_modes,
    select_measured,
    with_scatter,
)
from femubench.core.case.nodes import MatrixGeometry, with_mesh
from femubench.core.case.reducing import reduce_case
from femubench.core.case.repeats import with_covariance, with_repeats
from femubench.core.case.response_files import read_responses
from femubench.core.case.response_split import split_responses
from femubench.core.case.schema import (
    CaseSpec,
    DrawingSpec,
    FileSpec,
    FrameSpec,
    GroupedSpec,
    ModificationSpec,
    ScatterSpec,
)
from femubench.core.case.sensors import read_sensors
from femubench.core.case.tables import SUFFIXES, read_table
from femubench.core.case.toml_text import locate_fault, spec_of
from femubench.core.errors import InputError, ModelError, NotApplicable
from femubench.core.fem.frame import Frame, Member
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.files import read_text
from femubench.core.modal.frf import FrequencyResponses, ResponseSplit
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Reader
from femubench.core.typing import FloatArray

_MESHED = "a frame that can be meshed"
_EXPECTED = {
    "joint_springs": "a shorter one",
    "rigid_ends": "a shorter one",
    "links": "joints that follow one other joint each",
    "supports": "a support of the joint that leads",
    "gravity": "a frame in plane or in space that stands or hangs",
    "preloads": "a member of a ring with all constants of its section",
}
_MOST_CHANGED = 50_000_000  # every change is built once while the case is read


def read_case(
    folder: str | PathLike[str],
    name: str | None = None,
    readers: Collection[Reader] = (),
    *,
    installed: bool = False,
    reduced: bool = True,
) -> Case:
    """Read a case folder.

    Arguments:
        folder: a folder with a `case.toml`, or a file in one that holds another drawing: a
            `[model]` in place of that of the case.
        name: the name to give to the case; None takes its own, with that of the drawing.
        readers: reader plugins for files other than CSV and Matrix Market.
        installed: whether the folder came with an installed package; some installers make such
            a folder of links that lead out of it.
        reduced: whether a large model with groups is solved in a basis of these.

    Raises:
        InputError: for anything wrong in the folder.

    Examples:
        >>> femubench.read_case(case.folder).used
        (1, 2, 3)
    """
    drawing = drawing_of(folder)
    files = CaseFiles(Path(folder) if drawing is None else drawing.parent, links=installed)
    drawn, text, tables = "", read_text(files.case_file, LARGEST_CASE), FrameTables(files)
    try:
        spec = spec_of(text, files.case_file, CaseSpec, tables.spec)
        if drawing is not None:
            drawn = read_text(files.path(drawing.name), LARGEST_CASE)
            spec = _drawn_otherwise(spec, drawing, drawn, name)
        case = _Building(files, spec, readers).case(name)
        case = case if drawing is None else replace(case, drawing=drawing.stem)
        return reduce_case(case) if reduced else case
    except BadKey as fault:
        if drawing is not None and fault.path[:1] == ("model",):
            raise locate_fault(fault, drawn, drawing) from None
        place = tables.place(fault.path)
        if place is None:
            raise locate_fault(fault, text, files.case_file) from None
        file, line, key = place
        raise InputError(
            fault.what, file=file, line=line, key=key, expected=fault.expected
        ) from None


def _drawn_otherwise(spec: CaseSpec, drawing: Path, text: str, name: str | None) -> CaseSpec:
    """Return a case with the model of another drawing, as a case of the same structure."""
    try:
        model = spec_of(text, drawing, DrawingSpec).model
    except BadKey as fault:
        raise locate_fault(fault, text, drawing) from None
    mark, info = f"{DRAWN}{drawing.stem}", spec.case
    structure = info.structure or (info.name if name is None else name.removesuffix(mark))
    about = info.model_copy(update={"name": info.name + mark, "structure": structure})
    return spec.model_copy(update={"model": model, "case": about})


@dataclass
class _Building:
    """A case while it is put together."""

    files: CaseFiles
    spec: CaseSpec
    readers: Collection[Reader]
    readings: dict[Path, Measurement] = field(default_factory=dict)
    notes: dict[str, None] = field(default_factory=dict)
    matches: tuple[Match, ...] = ()
    lines: FloatArray | None = None

    def case(self, name: str | None) -> Case:
        """Return the case; raises BadKey or InputError."""
        model = self.model()
        if isinstance(model.geometry, MatrixGeometry):
            model = with_mesh(model)
        site = site_of(model)
        measurement = self.measurement(site)
        info = self.spec.case
        modifications = self.modifications(model, site, measurement.sensors)
        reference = self.reference(site, measurement.sensors)
        frfs, split = self.frfs(measurement)
        return Case(
            name=info.name if name is None else name,
            title=info.title or info.name,
            source=info.source,
            folder=self.files.folder,
            model=model,
            measurement=measurement,
            used=self.spec.measurement.used,
            held_out=self.spec.measurement.held_out,
            modifications=modifications,
            band=self.spec.measurement.band,
            tolerance=self.spec.diagnosis.tolerance,
            reference=reference,
            reference_used=self.reference_used,
            model_error=self.spec.diagnosis.model_error,
            beam_share=self.spec.diagnosis.beam_share,
            structure=info.structure,
            frfs=frfs,
            split=split,
            digest=self.files.digest(),  # of all that was read
            notes=tuple(self.notes),
            matches=self.matches,
            lines=self.lines,
        )

    def model(self) -> Model:
        spec = self.spec.model
        with at_key("model"), np.errstate(all="ignore"):
            if isinstance(spec, FileSpec):
                model = as_stated(model_of_file(spec, self.files, self.readers), spec)
                self.notes |= dict.fromkeys(remarks_of(spec, self.files, self.readers))
                return model
            if not isinstance(spec, FrameSpec):
                return as_stated(model_of_matrices(spec, self.files, self.readers), spec)
            frame = frame_of(spec)
            try:
                model = Model.of(frame)
                finite = all(np.isfinite(m.data).all() for m in (model.mass, model.stiffness))
            except ModelError as error:
                key, expected = _key_of(error.item, frame)
                raise BadKey(key, str(error), expected) from None
            except ArithmeticError:
                finite = False
            if not finite:
                expected = "sizes and constants of a real structure"
                raise BadKey((), "the matrices are not finite", expected)
            if model.size == 0:
                raise BadKey(("supports",), "nothing can move", "a direction that is free")
            return model

    def reading(self, key: KeyPath, name: str) -> tuple[Path, Measurement | None]:
        """Return the path of a file, and what a reader plugin reads in it, None for a table."""
        with at_key(*key):
            path = self.files.path(name)
        if path.suffix.lower() in SUFFIXES:
            return path, None
        reader = reader_of(path, self.readers)
        if reader is None:
            known = [".csv", *(suffix for r in self.readers for suffix in r.suffixes)]
            raise BadKey(key, f"unknown kind of file {name!r}", ", ".join(known))
        if path not in self.readings:
            names = self.spec.measurement.variables
            named = getattr(reader, "read_named_modes", None)
            if names and named is None:
                path_of = ("measurement", "variables")
                raise BadKey(path_of, f"{reader.name} has no variables", "no such key")
            with reading_with(reader, path):
                found = reader.read_modes(path) if named is None else named(path, names)
            if not isinstance(found, Measurement):
                what = f"{reader.name} gave {type(found).__name__}"
                raise BadKey(key, what, "femubench.Measurement")
            self.readings[path] = found
        return path, self.readings[path]

    def measurement(self, site: Site) -> Measurement:
        spec = self.spec.measurement
        if spec.band is not None and spec.band[0] >= spec.band[1]:
            raise BadKey(("measurement", "band"), "the band is empty", "[low, high], low < high")
        sensors, from_plugin = self.sensors(site)
        measurement = self.modes(("measurement", "modes"), spec.modes, sensors)
        if from_plugin:
            measured = select_measured(sensors, measurement.shapes)
            measurement = self.modes(("measurement", "modes"), spec.modes, measured)
        measurement = self.with_scatter(measurement)
        listed = [
            (("measurement", key, i), number)
            for key, numbers in (("used", spec.used), ("held_out", spec.held_out))
            for i, number in enumerate(numbers)
        ]
        check_labels(listed, measurement, spec.modes)
        if spec.mass is None:
            return measurement
        return replace(measurement, total_mass=(spec.mass.value, spec.mass.std))

    def with_scatter(self, measurement: Measurement) -> Measurement:
        """Return the measurement with what repeats, or a covariance, say of its frequencies."""
        spec = self.spec.measurement
        if spec.repeats is not None and spec.covariance is not None:
            what = "both repeats and covariance"
            raise BadKey(("measurement", "covariance"), what, "one of the two")
        if spec.covariance is not None:
            with at_key("measurement", "covariance"):
                path = self.files.path(spec.covariance)
            return with_covariance(measurement, path)
        if spec.repeats is None:
            return measurement
        with at_key("measurement", "repeats"):
            path = self.files.path(spec.repeats)
        found, stated = with_repeats(measurement, path)
        found, more = with_floor(found, spec.repeats, FREQUENCY_STD, spec.shape_std)
        self.notes |= dict.fromkeys((*stated, *more))
        return found

    def frfs(self, measured: Measurement) -> tuple[FrequencyResponses | None, ResponseSplit | None]:
        """Return the measured frequency responses, and which of them a strategy is given."""
        name, spec = self.spec.measurement.frfs, self.spec.measurement.responses
        if name is None:
            if spec is not None:
                raise BadKey(("measurement", "responses"), "no responses", "a file in frfs")
            return None, None
        found = self.responses(("measurement", "frfs"), name, measured.sensors)
        held_out = set(self.spec.measurement.held_out)
        return (found, None) if spec is None else split_responses(found, spec, measured, held_out)

    def responses(self, key: KeyPath, name: str, sensors: Sensors) -> FrequencyResponses:
        """Return the responses of a file, of which one at least is at a sensor of the case."""
        with at_key(*key):
            path = self.files.path(name)
        found = read_responses(path, self.readers, sensors)
        if not isinstance(found, FrequencyResponses):
            raise BadKey(key, f"{name!r} holds motions over time", "frequency responses")
        if not set(found.responses.labels) & set(sensors.labels):
            expected = f"labels as in the file, e.g. {found.responses.labels[0]!r}"
            raise BadKey(key, "no response belongs to a sensor of the case", expected)
        return found

    @property
    def reference_used(self) -> tuple[int, ...]:
        """Return the labels of the modes of the structure as it was that a diagnosis is given."""
        spec = self.spec.reference
        if spec is None:
            return ()
        return self.spec.measurement.used if spec.used is None else spec.used

    def reference(self, site: Site, sensors: Sensors) -> Measurement | None:
        """Return the modes of the structure as it was, on the sensors of the measurement."""
        spec = self.spec.reference
        if spec is None:
            return None
        own = sensors
        if spec.sensors is not None:
            path, read = self.reading(("reference", "sensors"), spec.sensors)
            own = self.place_sensors(path, read, site, spec.modes).sensors
        found = observe_at(self.modes(("reference", "modes"), spec.modes, own), sensors)
        key = "modes" if spec.used is None else "used"
        listed = [(("reference", key), number) for number in self.reference_used]
        check_labels(listed, found, spec.modes)
        mass = None if spec.mass is None else (spec.mass.value, spec.mass.std)
        found = replace(found, total_mass=mass)
        if spec.frfs is None:
            return found
        if (bands := self.spec.measurement.responses) is None:
            expected = "{used, held_out, std}, which hold for both states"
            raise BadKey(("measurement", "responses"), "no bands of the responses", expected)
        lines = self.responses(("reference", "frfs"), spec.frfs, sensors)
        lines, split = split_responses(lines, bands, found, set())
        return replace(found, responses=split.whole.given(lines))

    def sensors(self, site: Site) -> tuple[Sensors, bool]:
        """Return the sensors, and whether a reader plugin gave them."""
        spec = self.spec.measurement
        key, name = ("modes", spec.modes) if spec.sensors is None else ("sensors", spec.sensors)
        path, read = self.reading(("measurement", key), name)
        if spec.sensors is None and (read is None or not len(read.sensors)):
            return NO_SENSORS, False
        found = self.place_sensors(path, read, site, spec.modes)
        self.matches = found.matches
        reader: Any = None if read is None else reader_of(path, self.readers)
        if hasattr(reader, "read_outline"):
            with reading_with(reader, path):
                self.lines = found.alignment.moved(reader.read_outline(path).lines)
        return found.sensors, read is not None

    def place_sensors(self, path: Path, read: Measurement | None, site: Site, modes: str) -> Placed:
        """Return the sensors of a file and where each was taken to sit."""
        spec = self.spec.measurement
        with at_key("measurement", "frame"):  # of axes
            model = self.spec.model
            unit = model.unit if isinstance(model, FileSpec) else None
            alignment = Alignment.of(spec, unit)
        if read is None:
            found = read_sensors(path, site, alignment)
        else:
            labels = self.labels(modes)
            found = match_sensors(read.sensors, path, site, alignment, labels)
        self.notes |= dict.fromkeys(found.stated)
        return found

    def labels(self, modes: str) -> frozenset[str]:
        """Return the labels of what a file of modes may have a shape at."""
        path, read = self.reading(("measurement", "modes"), modes)
        return frozenset(read_table(path).columns if read is None else read.sensors.labels)

    def modes(self, key: KeyPath, name: str, sensors: Sensors) -> Measurement:
        share = self.spec.measurement.shape_std
        path, read = self.reading(key, name)
        if read is None:
            found = read_modes(path, sensors, share, self.spec.measurement.without)
        else:
            found = match_modes(read, path, sensors, share)
        self.notes |= dict.fromkeys(say_what_phases_lose(found, name))
        spec, fitted = self.spec.measurement.scatter, False
        if read is None and FIT_STD in read_table(path).columns:
            fitted, spec = True, spec or ScatterSpec(frequencies=SCATTER[0], shapes=SCATTER[1])
        if spec is not None:
            found = with_scatter(found, (spec.frequencies, spec.shapes))
            found = replace(found, assumed=fitted)
            why = "deviations are those of one fit, no repeats" if fitted else "as stated"
            self.notes[
                f"{name}: {why}: a scatter from test to test of {100.0 * spec.frequencies:g} % of "
                f"the frequencies and {100.0 * spec.shapes:g} % of the shapes was added to them "
                "(scatter in [measurement])."
            ] = None
        found, stated = with_floor(found, name, FREQUENCY_STD, share)
        self.notes |= dict.fromkeys(stated)
        return found

    def modifications(self, model: Model, site: Site, sensors: Sensors) -> tuple[Modification, ...]:
        specs = self.spec.modification
        check_unique((("modification", i, "name"), spec.name) for i, spec in enumerate(specs))
        if len(specs) * model.size > _MOST_CHANGED:
            what = f"{len(specs)} changes of {model.size} degrees of freedom"
            raise BadKey(("modification",), what, f"a product of at most {_MOST_CHANGED}")
        return tuple(
            self.modification(i, spec, model, site, sensors) for i, spec in enumerate(specs)
        )

    def modification(
        self, i: int, spec: ModificationSpec, model: Model, site: Site, sensors: Sensors
    ) -> Modification:
        with at_key("modification", i):
            masses = attachments("masses", spec.masses, site)
            springs = attachments("springs", spec.springs, site)
            altered = alteration_of(spec, site, self.spec.model)
            if not (masses or springs or altered):
                expected = "masses, springs, supports, remove or set"
                raise BadKey((), "nothing is changed", expected)
        measurement = self.modes(("modification", i, "modes"), spec.modes, sensors)
        change = Modification(spec.name, masses, springs, measurement, altered)
        with at_key("modification", i):
            try:
                changed = change.modify(model)
            except (ModelError, NotApplicable) as error:
                raise BadKey((), str(error), "a change that the model can take") from None
            if any(isinstance(part, Member) for part in altered.removed):
                seen = np.diff(sp.csr_array(changed.observe(sensors)).indptr) > 0
                lost = np.isfinite(measurement.shapes).any(axis=1) & ~seen
                if lost.any():
                    what = f"sensor {sensors.labels[int(lost.argmax())]!r} sat on what was removed"
                    raise BadKey(("modes",), what, "no readings there")
        return change


def as_stated(model: Model, spec: GroupedSpec) -> Model:
    """Return a model with what a case states of its damping, and whether it hangs free.

    Raises:
        BadKey: when its supports say otherwise.
    """
    model = replace(model, free=spec.free, damping=damping_of(spec.damping))
    if model.structure is None or not (spec.free or spec.damping):
        return model
    frame = replace(model.structure.frame, free=spec.free, damping=model.damping)
    if frame.free and frame.supports:
        raise BadKey(("free",), FREE_YET_HELD, NOT_HELD)
    structure = model.structure.rebuilt(frame)
    return replace(model, structure=structure, geometry=structure)


def check_labels(
    listed: Iterable[tuple[KeyPath, int]], measurement: Measurement, file: str
) -> None:
    """Check that modes are listed once, and that a measurement has them.

    Arguments:
        listed: the key of every label, and the label.
        file: where, as `case.toml` names it.

    Raises:
        BadKey: at the key of the first label that is wrong.
    """
    seen: set[int] = set()
    for path, number in listed:
        if number in seen:
            raise BadKey(path, f"mode {number} is listed twice", "every mode once")
        if number not in measurement.numbers:
            there = ", ".join(map(str, measurement.numbers[:20]))
            raise BadKey(path, f"mode {number} has no data in {file}", f"one of {there}")
        seen.add(number)


def _key_of(item: object, frame: Frame) -> tuple[KeyPath, str]:
    """Return the key, below `model`, of a part of the frame, and what would have been right."""
    for key, parts in vars(frame).items():
        if key == item:
            return (key,), _EXPECTED[key]
        for i, part in enumerate(parts if isinstance(parts, tuple) else ()):
            if part is item:
                return (key, i), _EXPECTED.get(key, _MESHED)
    return (), _MESHED
