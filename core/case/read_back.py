"""Check that a case folder that was written says what it should."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.matrix_files import matrices_of
from femubench.core.case.reader import read_case
from femubench.core.errors import InputError
from femubench.core.measurement import Measurement
from femubench.core.typing import SparseArray

_SAME_MATRIX = 1e-9  # of the diagonal: far above rounding, far below any change that matters


def check_written(fresh: Path, folder: Path, wanted: Case) -> None:
    """Check that the folder reads back to the case.

    Raises:
        InputError: when it cannot be read, or says something else.
    """
    try:
        back = read_case(fresh)
    except InputError as error:
        what = error.what.replace(str(fresh), str(folder))
        raise refused(folder, what, error.key, error.expected) from None
    model = wanted.model
    mass, stiffness = matrices_of(model)
    same_matrices = alike(mass, back.model.mass, _SAME_MATRIX) and alike(
        stiffness, back.model.stiffness, _SAME_MATRIX
    )
    if not same_matrices:
        what = "no keys of a frame give the matrices of this model"
        raise refused(folder, what, "model", "parameters that keys can say")
    for part in ("name", "title", "source", "used", "held_out", "band", "tolerance"):
        if getattr(back, part) != getattr(wanted, part):
            what = f"{getattr(wanted, part)!r} does not read back"
            raise refused(folder, what, part, f"not {getattr(back, part)!r}")
    pairs = [(wanted.measurement, back.measurement)]
    pairs += [
        (one.measurement, other.measurement)
        for one, other in zip(wanted.modifications, back.modifications, strict=True)
    ]
    for one, other in pairs:
        column = _differing(one, other)
        if column is not None:
            what = f"the {column.replace('_', ' ')} of a measurement does not read back"
            raise refused(folder, what, "measurement", "finite numbers within their bounds")


def _differing(one: Measurement, other: Measurement) -> str | None:
    """Return a field in which two measurements differ."""
    for f in fields(Measurement):
        first, second = getattr(one, f.name), getattr(other, f.name)
        if f.name == "sensors":
            same = first.labels == second.labels
            same = same and np.array_equal(first.xyz, second.xyz)
            same = same and np.array_equal(first.axes, second.axes)
        elif f.name == "shape_std":  # of what was not measured it means nothing
            first = np.where(np.isnan(first) & np.isnan(one.shapes), second, first)
            same = np.array_equal(first, second, equal_nan=True)
        elif isinstance(first, np.ndarray):
            same = np.array_equal(first, second, equal_nan=True)
        else:
            same = first == second
        if not same:
            return f.name
    return None


def alike(one: SparseArray, other: SparseArray, tolerance: float = 1e-12) -> bool:
    """Tell whether two symmetric matrices agree, entry by entry, to a share of their diagonals."""
    if one.shape != other.shape:
        return False
    apart = (one - other).tocoo()
    size = np.sqrt(np.abs(one.diagonal()))
    return bool(np.all(np.abs(apart.data) <= tolerance * size[apart.row] * size[apart.col]))


def refused(folder: Path, what: str, key: str | None, expected: str | None) -> InputError:
    """Return the error of a case that no folder can hold."""
    return InputError(f"cannot be written: {what}", file=folder, key=key, expected=expected)
