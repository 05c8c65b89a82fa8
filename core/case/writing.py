"""Write a case folder that reads back to the same case, with another model where one is given."""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np

from femubench.core.case.case import BEAM_SHARE, TOLERANCE, Case, Modification
from femubench.core.case.deviations import with_floor
from femubench.core.case.drawn import CASE_FILE
from femubench.core.case.faults import BadKey, join_key_path
from femubench.core.case.frame_keys import (
    Keys,
    Known,
    describe_frame,
    frame_keys,
    keys_of,
    read_known,
)
from femubench.core.case.frame_tables import MANY
from femubench.core.case.matrix_files import (
    Files,
    frame_files,
    frame_geometry,
    frame_places,
    has_skew_dofs,
    matrices_of,
    matrix_keys,
)
from femubench.core.case.modes import FREQUENCY_STD
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.reader import read_case
from femubench.core.case.reducing import expand_model
from femubench.core.case.response_files import responses_npz
from femubench.core.case.table_text import (
    SHAPE_STD,
    common_share,
    covariance_csv,
    modes_csv,
    part_csv,
    sensors_csv,
    toml_bytes,
)
from femubench.core.errors import InputError, ModelError
from femubench.core.fem.alteration import Alteration, Removable, find_removed
from femubench.core.fem.frame import Frame, GroundSpring, Member, PointMass, Support
from femubench.core.fem.mesh import locate
from femubench.core.fem.model import Model
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.modal.measurement import Measurement


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder next to the wanted one that takes its place when all went well.

    Raises:
        InputError: when the wanted folder holds anything, or nothing can be written there.
    """
    made: list[Path] = []
    fresh = folder.parent / f".{folder.name}.{os.getpid()}-{secrets.token_hex(4)}"
    try:
        if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
            what = "is not empty" if folder.is_dir() else "is no folder"
            raise InputError(what, file=folder, expected="a new or an empty folder")
        above = [path for path in (folder.parent, *folder.parent.parents) if not path.exists()]
        for path in reversed(above):
            path.mkdir()
            made.append(path)
        fresh.mkdir()
        yield fresh
        if os.name == "nt" and folder.exists():  # an empty one, of which nothing takes the place
            folder.rmdir()
        fresh.rename(folder)
        made.clear()
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError(what, file=folder, expected="a folder that can be written") from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir()


_SAME_MATRIX = 1e-9  # of the diagonal: far above rounding, far below any change that matters


_SETTINGS = (
    *("name", "title", "source", "structure", "used", "held_out", "band", "reference_used"),
    *("split", "tolerance", "model_error", "beam_share"),
)


def check_written(fresh: Path, folder: Path, wanted: Case) -> None:
    """Check that the folder reads back to the case.

    Raises:
        InputError: when it cannot be read, or says something else.
    """
    try:
        back = read_case(fresh, reduced=False)
    except InputError as error:
        what = error.what.replace(str(fresh), str(folder))
        raise refuse_case(folder, what, error.key, error.expected) from None
    if not back.model.has_matrices(*matrices_of(wanted.model), _SAME_MATRIX):
        what = "no keys of a frame give the matrices of this model"
        raise refuse_case(folder, what, "model", "parameters that keys can say")
    for part in _SETTINGS:
        if getattr(back, part) != getattr(wanted, part):
            what = f"{getattr(wanted, part)!r} does not read back"
            raise refuse_case(folder, what, part, f"not {getattr(back, part)!r}")
    share = read_known(fresh / CASE_FILE).shape_std or SHAPE_STD
    if not _same_responses(wanted.frfs, back.frfs):
        raise refuse_case(
            folder, "the frequency responses do not read back", "frfs", "finite numbers"
        )
    first, second = (_measurements(case) for case in (wanted, back))
    for one, other in zip(first, second, strict=True):
        # Deviations of next to nothing are raised when they are read.
        column = _differing(with_floor(one, "", FREQUENCY_STD, share)[0], other)
        if column is not None:
            what = f"the {column.replace('_', ' ')} of a measurement does not read back"
            raise refuse_case(folder, what, "measurement", "finite numbers within their bounds")


def _same_responses(one: FrequencyResponses | None, other: FrequencyResponses | None) -> bool:
    if one is None or other is None:
        return one is other
    sides = ("responses", "references")
    stds = [np.asarray(item.deviations, dtype=float) for item in (one, other)]  # None is nan
    return (
        all(getattr(one, side).labels == getattr(other, side).labels for side in sides)
        and one.quantity == other.quantity
        and np.array_equal(one.frequencies, other.frequencies)
        and np.array_equal(one.values, other.values, equal_nan=True)
        and np.array_equal(stds[0], stds[1], equal_nan=True)
    )


def _measurements(case: Case) -> list[Measurement]:
    """Return all that was measured: the structure, its modifications, the reference."""
    changed = [change.measurement for change in case.modifications]
    return [case.measurement, *changed, *([] if case.reference is None else [case.reference])]


def _differing(one: Measurement, other: Measurement) -> str | None:
    """Return a field in which two measurements differ."""
    for f in fields(Measurement):
        first, second = getattr(one, f.name), getattr(other, f.name)
        if f.name in ("assumed", "out_of_phase"):  # what is written is stated, and real
            continue
        if f.name == "responses" and _same_responses(one.responses, other.responses):
            continue
        if f.name == "shape_std":  # of what was not measured it means nothing
            first = np.where(np.isnan(first) & np.isnan(one.shapes), second, first)
        if f.name == "sensors":
            same = first.labels == second.labels
            same = same and np.array_equal(first.xyz, second.xyz)
            same = same and np.array_equal(first.axes, second.axes)
        elif f.name == "frequency_correlation" and first is not None and second is not None:
            same = np.allclose(first, second, rtol=0.0, atol=1e-9)
        elif isinstance(first, np.ndarray):
            same = np.array_equal(first, second, equal_nan=True)
        else:
            same = first == second
        if not same:
            return f.name
    return None


def refuse_case(folder: Path, what: str, key: str | None, expected: str | None) -> InputError:
    """Return the error of a case that no folder can hold."""
    return InputError(f"cannot be written: {what}", file=folder, key=key, expected=expected)


def write_case(
    folder: Path,
    case: Case,
    model: Model | None = None,
    *,
    comment: Sequence[str] = (),
    name: str | None = None,
    title: str | None = None,
) -> None:
    """Write a new case folder that `read_case` reads back to an equal case.

    Of a frame, `case.toml` says everything, and `matrices/` holds mass, stiffness and dofs for
    other programs. A model whose matrices an update has changed is written as matrices.

    Arguments:
        folder: new or empty; it appears complete or not at all.
        case: whose measurement, modifications and settings are written.
        model: the nominal model to write; None for that of the case.
        comment: lines to put on top of `case.toml`.
        name, title: None for those of the case.

    Raises:
        InputError: when the folder holds anything or cannot be written, or for what no case
            folder can say.
    """
    folder = Path(folder)
    name = case.name if name is None else name
    title = (case.title if title is None else title) or name
    model = case.model if model is None else model
    try:
        model = expand_model(case, model)
    except ModelError as error:
        raise refuse_case(folder, str(error), "model", "factors of its groups") from None
    wanted = replace(case, name=name, title=title, model=model, whole=None)
    lines = comment.splitlines() if isinstance(comment, str) else comment
    flat = [line for entry in lines for line in entry.splitlines() or [""]]
    try:
        files = case_files(wanted, read_known(case.folder / CASE_FILE), flat)
    except BadKey as fault:
        raise refuse_case(folder, fault.what, join_key_path(fault.path), fault.expected) from None
    except UnicodeEncodeError as error:
        what = f"{error.object[:40]!r} is not a text"
        raise refuse_case(folder, what, None, "characters of Unicode") from None
    with new_folder(folder) as fresh:
        for file, content in files.items():
            (fresh / file).parent.mkdir(exist_ok=True)
            (fresh / file).write_bytes(content)
        check_written(fresh, folder, wanted)


def case_files(case: Case, known: Known, comment: Sequence[str]) -> Files:
    """Return the files of a case folder.

    Arguments:
        known: what the file of the case that it comes from says as well.
        comment: lines for the top of `case.toml`.

    Raises:
        BadKey: for what no case folder can say.
    """
    keys, files, modifications, exchanged = _model_part(case, known)
    # Long lists of joints and members go to files of their own.
    for part in ("joints", "members"):
        if len(keys.get(part, ())) > MANY:
            files[f"{part}.csv"] = part_csv(part, keys[part])
            keys[part] = f"{part}.csv"
    if case.model.free:
        keys = {"kind": keys["kind"], "free": True, **keys}
    if case.model.damping is not None:
        keys["damping"] = asdict(case.model.damping)
    share = common_share(_measurements(case), known.shape_std)
    measurement: Keys = {"modes": "modes.csv", "shape_std": share}
    if len(case.measurement.sensors):
        measurement = {"sensors": "sensors.csv", **measurement}
        files["sensors.csv"] = sensors_csv(case.measurement.sensors)
    files["modes.csv"] = modes_csv(case.measurement, share)
    if case.measurement.frequency_correlation is not None:
        measurement["covariance"] = "covariance.csv"
        files["covariance.csv"] = covariance_csv(case.measurement)
    measurement["used"] = [int(number) for number in case.used]
    if case.held_out:
        measurement["held_out"] = [int(number) for number in case.held_out]
    if case.band is not None:
        measurement["band"] = [float(frequency) for frequency in case.band]
    measurement |= _weight(case.measurement)
    if case.frfs is not None:
        measurement["frfs"] = "frfs.npz"
        files["frfs.npz"] = responses_npz(case.frfs)
        if case.split is not None:
            measurement["responses"] = {k: own for k, own in vars(case.split).items() if own}
    stated = {key: getattr(case, key) for key in ("name", "title", "source", "structure")}
    info = {key: value for key, value in stated.items() if value}
    content: Keys = {"case": info, "model": keys, "measurement": measurement}
    tables = []
    for item in modifications:
        slug = re.sub(r"[^a-z0-9]+", "-", item.name.lower()).strip("-")[:60] or "structure"
        file, count = f"modified-{slug}.csv", 1
        while file in files:
            count += 1
            file = f"modified-{slug}-{count}.csv"
        files[file] = modes_csv(item.measurement, share)
        more = item.alteration
        attached = {"masses": item.masses, "springs": item.springs, "supports": more.supports}
        plain = {key: [keys_of(one) for one in many] for key, many in attached.items() if many}
        plain["remove"] = _removal_keys(case.model, more.removed)
        plain["set"] = [
            {"member": change.member, **{k: own[k] for k in _EXCHANGED if getattr(change, k)}}
            for change, own in zip(more.exchanged, exchanged, strict=False)
        ]
        exchanged = exchanged[len(more.exchanged) :]
        given = {key: entries for key, entries in plain.items() if entries}
        tables.append({"name": item.name, **given, "modes": file})
    if case.reference is not None:
        file = "reference.csv"
        files[file] = modes_csv(case.reference, share)
        content["reference"] = {"modes": file, "used": [int(n) for n in case.reference_used]}
        content["reference"] |= _weight(case.reference)
        if case.reference.responses is not None:
            content["reference"]["frfs"] = "reference-frfs.npz"
            files["reference-frfs.npz"] = responses_npz(case.reference.responses)
    if tables:
        content["modification"] = tables
    settings: dict[str, tuple[float | None, float | None]] = {
        "tolerance": (case.tolerance, TOLERANCE),
        "model_error": (case.model_error, None),
        "beam_share": (case.beam_share, BEAM_SHARE),
    }
    own = {
        key: float(value)
        for key, (value, usual) in settings.items()
        if value is not None and value != usual
    }
    if own:
        content["diagnosis"] = own
    return {CASE_FILE: toml_bytes(content, comment), **files}


_EXCHANGED = ("section", "material")
_REMOVED: dict[type, str] = {Support: "support", PointMass: "mass", GroundSpring: "spring"}


def _removal_keys(model: Model, removed: Sequence[Removable]) -> list[Keys]:
    """Return entries of `remove` for parts, where an update has put them."""
    if model.structure is None:
        return []
    found = [own for part in removed for own in find_removed(model.structure.frame, part)]
    entries: list[Keys] = [
        {"member": own.name}
        if isinstance(own, Member)
        else {_REMOVED[type(own)]: keys_of(own)["at"]}
        for own in found
    ]
    return [entry for i, entry in enumerate(entries) if entry not in entries[:i]]


def _weight(measurement: Measurement) -> Keys:
    if measurement.total_mass is None:
        return {}
    value, std = measurement.total_mass
    return {"mass": {"value": float(value), "std": float(std)}}


def _model_part(
    case: Case, known: Known
) -> tuple[Keys, Files, tuple[Modification, ...], list[Keys]]:
    """Return the table `[model]`, its files, and the modifications at the places of that model.

    The tables of members as modifications exchange them come last, in the order of these.
    """
    model = case.model
    if model.structure is not None and model.has_matrices(*model.structure.matrices()):
        frame = describe_frame(model.structure)
        keys, exchanged = frame_keys(frame, known, _exchanged_members(frame, case))
        return keys, frame_files(_model_of(frame)), case.modifications, exchanged
    matrices = matrices_of(model)
    if isinstance(model.geometry, MatrixGeometry):
        return *matrix_keys(*matrices, model.geometry, model), case.modifications, []
    if model.structure is None:
        what = "a model without elements and without nodes by name cannot be written"
        raise BadKey(("model",), what, "a frame, or matrices from files")
    if has_skew_dofs(model):
        what = "the model has changed matrices and flexible connections of skew members"
        raise BadKey(("model",), what, "degrees of freedom along x, y or z")
    frame = model.frame_structure.frame
    frame_places(model, [locate(frame, xyz) for xyz in case.measurement.sensors.xyz])
    moved = tuple(_at_nodes(item, model) for item in case.modifications)
    return *matrix_keys(*matrices, frame_geometry(model), model), moved, []


def _exchanged_members(frame: Frame, case: Case) -> list[Member]:
    """Return members as modifications exchange them, each by a name of its own."""
    found, taken = list[Member](), set(frame.member_index)
    for change in (own for item in case.modifications for own in item.alteration.exchanged):
        member = frame.members[frame.member_index[change.member]]
        name = f"{change.member}-changed"
        while name in taken:
            name += "-too"
        taken.add(name)
        parts = {key: getattr(change, key) or getattr(member, key) for key in _EXCHANGED}
        found.append(replace(member, name=name, **parts))
    return found


def _model_of(frame: Frame) -> Model:
    """Return the model that the keys give, whose last digits may differ from those of an update."""
    try:
        return Model.of(frame)
    except ModelError as error:
        raise BadKey(("model",), str(error), "parameters that keys can say") from None


def _at_nodes(item: Modification, model: Model) -> Modification:
    own = item.alteration
    if own.removed or own.exchanged:
        what = f"modification {item.name!r} takes or exchanges parts, and the matrices were updated"
        raise BadKey(("modification",), what, "a strategy that scales parameters")
    places = frame_places(model, item.places)
    masses = tuple(replace(mass, at=places[mass.at]) for mass in item.masses)
    springs = tuple(replace(spring, at=places[spring.at]) for spring in item.springs)
    supports = tuple(replace(support, at=places[support.at]) for support in own.supports)
    return replace(item, masses=masses, springs=springs, alteration=Alteration(supports))
