"""An updated model as plain data: how it differs from the nominal model, and nothing else of it.

Who reads it back has the nominal model. Degrees of freedom, geometry and groups are those of that
model, or of the frame with its changes meshed anew; nobody asks an answer for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Annotated, Any, Literal

import numpy as np
import scipy.sparse as sp
from msgspec import UNSET, Meta, Struct, UnsetType, structs

from femubench.core.errors import StrategyFailure
from femubench.core.fem.beam import BeamProperties
from femubench.core.fem.model import LowRank, Model, common_dofs, dofs_of
from femubench.core.fem.parameters import Property
from femubench.core.fem.structure import Structure
from femubench.core.run.model_checks import check_change, check_entries, check_indices
from femubench.core.run.plain_arrays import BytesError, Shelf
from femubench.core.run.plain_frame import frame_from_plain, frame_to_plain
from femubench.core.typing import AnyArray, IntArray, SparseArray
from femubench.core.update.uncertainty import MOST_SAMPLES

_MATRICES = ("mass", "stiffness")
_CHANGES = ("mass_change", "stiffness_change")
_FORMS = {"csc": sp.csc_array, "csr": sp.csr_array}
_SAME = 1e-9  # relative: what is computed in another order
Kept = tuple[Model, tuple[Model, ...]]


class SparseParts(Struct, frozen=True):
    """A sparse array; numbers of the arrays of its data, indices and starts."""

    form: Literal["csc", "csr"]
    shape: tuple[int, int]
    parts: tuple[int, int, int]


class Matrices(Struct, frozen=True):
    """The matrices of a model; None for one that the reader has, numbers of arrays for changes."""

    mass: SparseParts | None
    stiffness: SparseParts | None
    mass_change: tuple[int, int] | None = None
    stiffness_change: tuple[int, int] | None = None


class PlainStructure(Struct, frozen=True):
    """A structure by its parameters and values, in numbers of arrays.

    Arguments:
        changes: arrays of the parameters that were set in turn, and of their values.
        fields: what differs in its frame; None where that is the nominal one.
        node, direction: of its dofs, where the frame is another.
    """

    properties: tuple[int, ...]
    springs: int
    parameters: tuple[Property, ...]
    changes: tuple[int, int]
    fields: dict[str, Any] | None = None
    node: int = -1
    direction: str = ""


class PlainModel(Struct, frozen=True):
    """A model and samples of it; a structure that is unset is that of the nominal model."""

    model: Matrices
    samples: Annotated[tuple[Matrices, ...], Meta(max_length=MOST_SAMPLES)] = ()
    structure: PlainStructure | UnsetType | None = UNSET


def model_to_plain(
    model: Model, samples: Sequence[Model], nominal: Model, shelf: Shelf
) -> PlainModel:
    """Return a model and samples of it as plain data, their arrays on a shelf.

    Raises:
        StrategyFailure: when it is no model of the structure that the nominal model is of.
    """
    model, samples = _in_order(model, samples, nominal)
    structure = model.structure
    frame = None if nominal.structure is None else nominal.structure.frame
    if structure is None or structure.frame is frame:
        dofs, given = model.dofs, nominal.dofs
        if len(dofs) != len(given):
            raise StrategyFailure(
                f"the updated model has {len(dofs)} degrees of freedom, expected {len(given)}"
            )
        if dofs is not given and not (
            dofs.direction == given.direction and np.array_equal(dofs.node, given.node)
        ):
            raise StrategyFailure(
                "the updated model has other degrees of freedom than the nominal model, expected "
                "those of the nominal model in its order"
            )
    own = _matrices(model, nominal, shelf)
    others = tuple(_matrices(sample, model, shelf) for sample in samples)
    if structure is nominal.structure:
        return PlainModel(own, others)
    if structure is None:
        return PlainModel(own, others, None)
    return PlainModel(own, others, _structure_to_plain(structure, nominal, shelf))


def model_from_plain(data: PlainModel, arrays: Sequence[AnyArray], nominal: Model) -> Kept:
    """Return a model and samples of it.

    Raises:
        BytesError, ModelError: when it is no such data, or a frame that cannot be meshed.
        StrategyFailure: for matrices that are none.
    """
    base = nominal
    if data.structure is not UNSET:
        base = replace(nominal, structure=None)
        if data.structure is not None:
            structure = _structure_from_plain(data.structure, arrays, nominal)
            base = replace(nominal, geometry=structure, structure=structure)
            assert nominal.structure is not None
            if structure.mesh is not nominal.structure.mesh:
                base = replace(base, dofs=dofs_of(structure), groups={}, mass_groups={})
    model = replace(base, **_read(data.model, arrays, nominal))
    return model, tuple(replace(model, **_read(item, arrays, model)) for item in data.samples)


# --- matrices ---------------------------------------------------------------------------------


def _matrices(model: Model, known: Model, shelf: Shelf) -> Matrices:
    found: dict[str, Any] = {}
    for name in _MATRICES:
        matrix = getattr(model, name)
        found[name] = None if matrix is getattr(known, name) else _entries(name, matrix, shelf)
    for name in _CHANGES:
        change = getattr(model, name)
        if change is not None:
            check_change(name, change)
            pair = np.asarray(change.basis), np.asarray(change.core)
            found[name] = tuple(map(shelf.put, pair))
    return Matrices(**found)


def _entries(name: str, matrix: SparseArray, shelf: Shelf) -> SparseParts:
    check_entries(name, matrix)
    if matrix.format not in _FORMS:
        matrix = sp.csc_array(matrix)
    data, indices, starts = map(shelf.put, (matrix.data, matrix.indices, matrix.indptr))
    return SparseParts(matrix.format, matrix.shape, (data, indices, starts))


def _read(data: Matrices, arrays: Sequence[AnyArray], known: Model) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in _MATRICES:
        entry = getattr(data, name)
        found[name] = getattr(known, name) if entry is None else _sparse(name, entry, arrays)
    for name in _CHANGES:
        pair = getattr(data, name)
        found[name] = pair and LowRank(*(_taken(arrays, number) for number in pair))
    return found


def _sparse(name: str, entry: SparseParts, arrays: Sequence[AnyArray]) -> SparseArray:
    data, indices, starts = (_taken(arrays, part) for part in entry.parts)
    if not all(array.ndim == 1 and array.dtype.kind == "i" for array in (indices, starts)):
        raise BytesError(f"{name} is no sparse array: its indices are no whole numbers")
    if len(starts) != entry.shape[entry.form == "csc"] + 1:
        raise BytesError(f"{name} is not a valid sparse array: {len(starts)} starts")
    try:
        found = _FORMS[entry.form]((data, indices, starts), shape=entry.shape)
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise BytesError(f"{name} is not a valid sparse array: {error}") from error
    check_indices(name, found)
    if not found.has_canonical_format:
        tidy = found.copy()
        tidy.sum_duplicates()
        # Parts of an entry that cancel would hide a lack of symmetry, and their sum depends on
        # what is added to them.
        found = found if tidy.nnz == found.nnz else tidy
    return found


def _taken(arrays: Sequence[AnyArray], number: int) -> AnyArray:
    if not 0 <= number < len(arrays):
        raise BytesError(f"there is no array {str(number)[:30]}")
    return arrays[number]


# --- frames -----------------------------------------------------------------------------------


def _structure_to_plain(structure: Structure, nominal: Model, shelf: Shelf) -> PlainStructure:
    if nominal.structure is None:
        raise StrategyFailure("the updated model holds a frame, and the nominal model has none")
    numbers: dict[Property, int] = {}
    each = [numbers.setdefault(parameter, len(numbers)) for parameter, _ in structure.changes]
    values = np.array([value for _, value in structure.changes], dtype=float)
    found = PlainStructure(
        tuple(shelf.put(getattr(structure.properties, f.name)) for f in fields(BeamProperties)),
        shelf.put(structure.springs),
        tuple(numbers),
        (shelf.put(np.array(each, dtype=np.int64)), shelf.put(values)),
    )
    if structure.frame is nominal.structure.frame:
        return found
    kinematics = structure.kinematics
    return structs.replace(
        found,
        fields=frame_to_plain(structure.frame, nominal.structure.frame),
        node=shelf.put(kinematics.node),
        direction="".join(name.ljust(2) for name in kinematics.direction),
    )


def _structure_from_plain(
    data: PlainStructure, arrays: Sequence[AnyArray], nominal: Model
) -> Structure:
    """Return a structure whose present properties follow from its frame and its parameters.

    Were they others, a modified structure would not follow from the model that was scored: what
    is attached splits elements with these properties, or has the frame meshed anew.
    """
    if nominal.structure is None:
        raise BytesError("the updated model holds a frame, and the nominal model has none")
    names = [f.name for f in fields(BeamProperties)]
    columns = [_taken(arrays, number) for number in data.properties]
    count = columns[0].size if columns else 0
    if len(columns) != len(names) or any(array.shape != (count,) for array in columns):
        raise BytesError("the properties of its elements are not one a property and element")
    springs = _taken(arrays, data.springs)
    plain = nominal.structure
    if data.fields is not None:
        plain = Structure.build(frame_from_plain(data.fields, plain.frame, count))
        kinematics = plain.kinematics
        direction = "".join(name.ljust(2) for name in kinematics.direction)
        same = direction == data.direction
        if not same or not np.array_equal(kinematics.node, _taken(arrays, data.node)):
            raise BytesError("its degrees of freedom are not those of its frame, meshed anew")
    elif plain.changes:
        plain = Structure.build(plain.frame)
    changes, expected = _changes(data, arrays), replace(plain)
    # What is kept of a nominal structure is for its own parameters alone.
    expected.__dict__.update({name: own for name, own in vars(plain).items() if name != "kept"})
    for turn in _turns(changes):
        values = [value for *_, value in turn]
        expected = expected.with_values([each for _, each, _ in turn], values)
    if springs.shape != expected.springs.shape or count != len(expected.properties):
        raise BytesError("its element properties are those of another mesh")
    present = [getattr(expected.properties, name) for name in names]
    for name, own, given in zip(
        (*names, "springs"), (*present, expected.springs), (*columns, springs), strict=True
    ):
        if not np.all(np.abs(given - own) <= _SAME * np.abs(own)):
            raise BytesError(f"its {name} does not follow from its frame and parameters")
    properties = BeamProperties(**dict(zip(names, columns, strict=True)))
    return replace(expected, properties=properties, springs=springs)


def _changes(data: PlainStructure, arrays: Sequence[AnyArray]) -> list[tuple[int, Property, float]]:
    """Return every parameter that was set, with its number and value, in turn."""
    each, given = (_taken(arrays, number) for number in data.changes)
    known = each.dtype.kind == "i" and np.all((each >= 0) & (each < len(data.parameters)))
    if not (known and each.ndim == 1 and given.shape == each.shape):
        raise BytesError("the changes are not one value a parameter")
    pairs = zip(each.tolist(), given.tolist(), strict=True)
    return [(number, data.parameters[number], value) for number, value in pairs]


def _turns(
    changes: Sequence[tuple[int, Property, float]],
) -> Iterator[list[tuple[int, Property, float]]]:
    """Yield the changes in turn, no parameter twice at a time."""
    turn: list[tuple[int, Property, float]] = []
    seen: set[int] = set()
    for change in changes:
        if change[0] in seen:
            yield turn
            turn, seen = [], set()
        turn.append(change)
        seen.add(change[0])
    if turn:
        yield turn


def _in_order(model: Model, samples: Sequence[Model], nominal: Model) -> Kept:
    """Return a model with its dofs in the order in which its frame is meshed.

    The nodes at which `Model.attach` splits elements come behind all others.
    """
    structure, samples = model.structure, tuple(samples)
    if structure is None or nominal.structure is None:
        return model, samples
    frame, given = structure.frame, nominal.structure.frame
    if frame.masses is given.masses and frame.springs is given.springs:
        return model, samples
    meshed = Structure.build(frame)
    place = common_dofs(structure, meshed)
    if len(place) != len(meshed.kinematics.node):
        raise StrategyFailure("the updated model is not meshed as its frame is")
    if np.array_equal(place, np.arange(len(place))):
        return model, samples
    order = np.argsort(place)
    found = replace(meshed, properties=structure.properties, springs=structure.springs)
    found = replace(found, changes=structure.changes)
    base: dict[str, Any] = {"dofs": dofs_of(found), "geometry": found, "structure": found}
    moved = [replace(each, **base, **_turned(each, order)) for each in (model, *samples)]
    return moved[0], tuple(moved[1:])


def _turned(model: Model, order: IntArray) -> dict[str, Any]:
    found: dict[str, Any] = {
        name: sp.csc_array(getattr(model, name))[order][:, order] for name in _MATRICES
    }
    for name in _CHANGES:
        change = getattr(model, name)
        found[name] = None if change is None else LowRank(change.basis[order], change.core)
    return found
