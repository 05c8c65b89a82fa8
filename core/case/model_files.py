"""Models that come in the files of other programs: read by plugins, labelled, converted to SI."""

from __future__ import annotations

import bz2
import gzip
import os
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.case.drawn import CASE_FILE
from femubench.core.case.faults import BadKey, at_key
from femubench.core.case.files import LARGEST_CASE, CaseFiles
from femubench.core.case.frame_tables import FrameTables
from femubench.core.case.matrices import (
    check_symmetric,
    is_matrix_market,
    matrix_of,
    reader_of,
    reading_with,
    with_families,
    with_groups,
)
from femubench.core.case.matrix_files import matrices_of, matrix_market
from femubench.core.case.nodes import MatrixGeometry, matrix_model, read_dofs, read_nodes
from femubench.core.case.schema import DrawingSpec, FileSpec, FrameSpec, LengthUnit
from femubench.core.case.tables import SUFFIXES, read_table
from femubench.core.case.units import from_si, in_si
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.files import read_text, write_atomically
from femubench.core.roles import Reader

_PACKERS: dict[str, Callable[[bytes], bytes]] = {".gz": gzip.compress, ".bz2": bz2.compress}
_LABELS = "dofs: a table row,node,direction,x,y,z"
_PLACES = "dofs: a table node,x,y,z, or a file with nodes"


@dataclass(frozen=True)
class ModelFiles:
    """The files that give a model.

    Arguments:
        model: a whole model, or its stiffness alone.
        mass: the mass where `model` has the stiffness alone.
        dofs: labels or coordinates that the other files lack: a table
            row,node,direction,x,y,z or node,x,y,z, or a file from which a reader reads nodes.
    """

    model: Path
    mass: Path | None = None
    dofs: Path | None = None


def read_model(paths: ModelFiles, readers: Collection[Reader], unit: LengthUnit = "m") -> Model:
    """Return the model that files hold, in SI, with a label and a place for every row.

    Arguments:
        paths: the files.
        readers: reader plugins, of which the suffix of a file chooses one.
        unit: of the lengths in all of the files; see `units.in_si` for masses and forces.

    Raises:
        InputError: for a kind of file that no reader reads a model from, and all that is wrong
            in the files.
    """
    return in_si(read_as_it_is(paths, readers), unit)


def read_as_it_is(paths: ModelFiles, readers: Collection[Reader]) -> Model:
    """Return the model that files hold, in their units; raises InputError as in `read_model`."""
    model = _read(paths, readers)
    if not isinstance(model.geometry, MatrixGeometry):
        return model
    mass = check_symmetric(model.mass, paths.mass or paths.model, model.size)
    stiffness = check_symmetric(model.stiffness, paths.model, model.size)
    groups, mass_groups = (
        {name: check_symmetric(part, paths.model, model.size) for name, part in parts.items()}
        for parts in (model.groups, model.mass_groups)
    )
    found = replace(model, mass=mass, stiffness=stiffness, groups=groups, mass_groups=mass_groups)
    return _labelled(found, paths, readers)


def further_files(path: Path, readers: Collection[Reader]) -> tuple[Path, ...]:
    """Return the files that are opened in addition to a model's own, e.g. those that it includes.

    Raises:
        InputError: for a file that no reader reads.
    """
    reader = _reader(path, readers)
    if not hasattr(reader, "model_files"):
        return ()
    with reading_with(reader, path):
        return tuple(Path(further) for further in reader.model_files(path))


def remarks_of(spec: FileSpec, files: CaseFiles, readers: Collection[Reader]) -> tuple[str, ...]:
    """Return what the reader of a model took otherwise than it stands in the file.

    Raises:
        InputError: for what is wrong in the file.
    """
    path = files.path(spec.file)
    reader = _reader(path, readers)
    if spec.mass is not None or not hasattr(reader, "read_remarks"):
        return ()
    with reading_with(reader, path):
        return tuple(f"{spec.file}: {remark}" for remark in reader.read_remarks(path))


def model_of_file(spec: FileSpec, files: CaseFiles, readers: Collection[Reader]) -> Model:
    """Return the model of a case of kind ``file``.

    Raises:
        BadKey: with a path below `model`.
        InputError: for what is wrong in one of the files.
    """
    found: dict[str, Path] = {}
    for key in ("file", "mass", "dofs"):
        if (name := getattr(spec, key)) is None:
            continue
        with at_key(key):
            found[key] = files.path(name)
            for further in further_files(found[key], readers):
                files.path(os.path.relpath(further, files.folder))
    paths = ModelFiles(found["file"], found.get("mass"), found.get("dofs"))
    model = read_as_it_is(paths, readers)
    if isinstance(model.geometry, MatrixGeometry):
        model = with_families(with_groups(model, spec.groups, files, readers), spec)
    elif spec.groups or spec.sets:
        key = "groups" if spec.groups else "sets"
        raise BadKey((key,), f"{spec.file} gives members, which are no groups", f"no {key}")
    return in_si(model, spec.unit)


def _read(paths: ModelFiles, readers: Collection[Reader]) -> Model:
    """Return what the readers read, in the units of the files, maybe without labels or places."""
    reader = _reader(paths.model, readers)
    if paths.mass is not None:
        own = _reader(paths.mass, readers)
        if own is reader and hasattr(reader, "read_pair"):
            with reading_with(reader, paths.model):
                return _a_model(reader.read_pair(paths.model, paths.mass), paths.model)
        stiffness = matrix_of(paths.model, readers)
        mass = matrix_of(paths.mass, readers)
        if stiffness.shape != mass.shape:
            what = f"the matrix has {mass.shape[0]} rows"
            expected = f"{stiffness.shape[0]} as in {paths.model.name}"
            raise InputError(what, file=paths.mass, expected=expected)
        return matrix_model(mass, stiffness)
    if not hasattr(reader, "read_model"):
        known = [s for r in readers if hasattr(r, "read_model") for s in r.suffixes]
        expected = f"{', '.join(known)}; or one with the stiffness and one with the mass"
        raise InputError(
            "no model is read from this kind of file", file=paths.model, expected=expected
        )
    with reading_with(reader, paths.model):
        return _a_model(reader.read_model(paths.model), paths.model)


def _reader(file: Path, readers: Collection[Reader]) -> Any:  # noqa: ANN401 - of optional members
    """Return the reader of a file, None for one of Matrix Market and for an unknown kind."""
    return None if is_matrix_market(file) else reader_of(file, readers)


def _a_model(found: object, file: Path) -> Model:
    if not isinstance(found, Model):
        raise InputError(f"the reader gave {type(found).__name__}", file=file, expected="a Model")
    for matrix in (found.mass, found.stiffness, *found.groups.values()):
        sp.csc_array(matrix).check_format(full_check=True)
    return found


def _labelled(model: Model, paths: ModelFiles, readers: Collection[Reader]) -> Model:
    """Return the model with the labels and places that another file gives."""
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    if paths.dofs is not None:
        if paths.dofs.suffix.lower() not in SUFFIXES:
            geometry = _placed(geometry, _nodes_of(paths.dofs, readers), paths.dofs)
        elif "row" not in read_table(paths.dofs).columns:
            geometry = _placed(geometry, read_nodes(paths.dofs), paths.dofs)
        else:
            geometry = read_dofs(paths.dofs)
            if len(geometry.dofs) != model.size:
                what, expected = f"{len(geometry.dofs)} rows", f"{model.size} as in the matrices"
                raise InputError(what, file=paths.dofs, expected=expected)
    if "" in geometry.dofs.direction:
        raise InputError("the rows have no labels", file=paths.model, expected=_LABELS)
    lost = np.flatnonzero(~np.isfinite(geometry.dofs.xyz).all(axis=1))
    if len(lost):
        what = f"node {geometry.names[geometry.dofs.node[lost[0]]]!r} has no coordinates"
        raise InputError(what, file=paths.dofs or paths.model, expected=_PLACES)
    return replace(model, dofs=geometry.dofs, geometry=geometry)


def _nodes_of(file: Path, readers: Collection[Reader]) -> dict[str, Sequence[float]]:
    reader = _reader(file, readers)
    if not hasattr(reader, "read_nodes"):
        known = [s for r in readers if hasattr(r, "read_nodes") for s in r.suffixes]
        expected = ", ".join([*SUFFIXES, *known])
        raise InputError("no nodes are read from this kind of file", file=file, expected=expected)
    with reading_with(reader, file):
        return dict(reader.read_nodes(file))


def _placed(
    geometry: MatrixGeometry, places: Mapping[str, Sequence[float]], file: Path
) -> MatrixGeometry:
    """Return a geometry with coordinates by the names of nodes; nan where there are none."""
    xyz = geometry.dofs.xyz.copy()
    for i, node in enumerate(geometry.dofs.node):
        if geometry.names[node] in places:
            xyz[i] = places[geometry.names[node]]
    if not np.isfinite(xyz).any():
        what = f"no node is called as in the matrices, e.g. {geometry.names[0]!r}"
        raise InputError(what, file=file, expected="coordinates of the same nodes")
    return replace(geometry, dofs=replace(geometry.dofs, xyz=xyz))


def write_model(
    model: Model,
    folder: Path,
    like: ModelFiles,
    readers: Collection[Reader],
    unit: LengthUnit = "m",
) -> None:
    """Write a model in the format of the files that it came from, under the same names.

    Arguments:
        model: in SI.
        folder: another one than that of the files.
        like: the files that the model came from.
        readers: reader plugins.
        unit: of the lengths in the files.

    Raises:
        InputError: for a format that is not written, or a model that is none of these files.
    """
    made = folder / like.model.name
    if folder.resolve() == like.model.parent.resolve():
        raise InputError("holds the files of the model", file=folder, expected="another folder")
    try:
        if model.mass_change is not None or model.stiffness_change is not None:
            mass, whole = matrices_of(model)
            model = replace(
                model, mass=mass, stiffness=whole, mass_change=None, stiffness_change=None
            )
        model = from_si(model, unit)
    except BadKey as fault:
        what = f"cannot be written: {fault.what}"
        raise InputError(what, file=made, expected=fault.expected) from None
    reader = _reader(like.model, readers)
    if like.mass is None and hasattr(reader, "write_model"):
        with reading_with(reader, like.model):
            reader.write_model(model, made, like.model)
        return
    if like.mass is not None and _reader(like.mass, readers) is reader:
        if reader is None and is_matrix_market(like.model):
            for file, matrix in ((like.model, model.stiffness), (like.mass, model.mass)):
                pack = _PACKERS.get(file.suffix.lower(), bytes)
                write_atomically(folder / file.name, pack(matrix_market(matrix)))
            return
        if hasattr(reader, "write_pair"):
            with reading_with(reader, like.model):
                originals = (like.model, like.mass)
                reader.write_pair(model, made, folder / like.mass.name, originals)
            return
    expected = "a format that goes both ways: see docs/readers.md"
    raise InputError("no such file is written", file=made, expected=expected)


def files_of(folder: Path, drawing: str = "") -> tuple[ModelFiles, LengthUnit] | None:
    """Return the files of the model of a case, and their unit; None where it has no such files."""
    file = folder / (f"{drawing}.toml" if drawing else CASE_FILE)
    data = tomllib.loads(read_text(file, LARGEST_CASE))
    known = DrawingSpec.model_validate if drawing else FrameTables(CaseFiles(folder)).spec
    spec = known(data).model
    if isinstance(spec, FrameSpec):
        return None
    parts = (spec.file, spec.mass) if isinstance(spec, FileSpec) else (spec.stiffness, spec.mass)
    model, mass, dofs = (None if name is None else folder / name for name in (*parts, spec.dofs))
    assert model is not None
    return ModelFiles(model, mass, dofs), spec.unit if isinstance(spec, FileSpec) else "m"
