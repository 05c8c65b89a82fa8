"""Checks of a model that came back from a strategy, before anything is computed with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import StrategyFailure
from femubench.core.fem.model import LowRank, Model

_SYMMETRY = 1e-8  # of the largest entry
_MATRICES = ("mass", "stiffness")


def check_model(model: Model, nominal: Model) -> None:
    """Check that an updated model has finite symmetric matrices of the right size.

    The size is that of the nominal model; a strategy that returns a frame meshed anew (with
    joints that it made flexible, say) answers for that frame's own dofs.

    Raises:
        StrategyFailure: with what was seen and what was expected.
    """
    check_sizes(model, nominal)
    check_numbers(model)
    for name in _MATRICES:
        entries = sp.csr_array(getattr(model, name))
        _check_symmetry(name, entries - entries.T, entries.data)
        change = getattr(model, f"{name}_change")
        if change is not None:
            core = np.asarray(change.core)
            _check_symmetry(f"{name}_change: core", core - core.T, core)


def check_sizes(model: Model, nominal: Model) -> None:
    """Check that matrices and changes are of the right kind and size; as `check_model`."""
    size = len(model.dofs)
    own = model.structure is not None and model.structure.kinematics.transform.shape[1] == size
    if size != nominal.size and not own:
        raise StrategyFailure(
            f"the updated model has {size} degrees of freedom, expected {nominal.size}"
        )
    for name in _MATRICES:
        matrix, change = getattr(model, name), getattr(model, f"{name}_change")
        _check_sparse(name, matrix)
        _check_shape(name, matrix.shape, (size, size))
        if change is None:
            continue
        check_change(f"{name}_change", change)
        basis, core = np.asarray(change.basis), np.asarray(change.core)
        if basis.ndim != 2:
            what = f"{name}_change: basis has {basis.ndim} dimensions, expected 2"
            raise StrategyFailure(what)
        _check_shape(f"{name}_change: basis", basis.shape, (size, basis.shape[1]))
        _check_shape(f"{name}_change: core", core.shape, (basis.shape[1], basis.shape[1]))


def check_numbers(model: Model) -> None:
    """Check that matrices and changes of the right kind hold finite real numbers; likewise."""
    for name in _MATRICES:
        matrix, change = getattr(model, name), getattr(model, f"{name}_change")
        check_indices(name, matrix)
        _check_numbers(name, sp.coo_array(matrix).data)
        for part in () if change is None else ("basis", "core"):
            _check_numbers(f"{name}_change: {part}", np.asarray(getattr(change, part)))


def check_entries(name: str, matrix: Any) -> None:  # noqa: ANN401 - whatever came back
    """Check that a matrix is a sparse array of real numbers; raises StrategyFailure."""
    _check_sparse(name, matrix)
    _check_real(name, matrix)
    if matrix.format not in ("csr", "csc"):
        check_indices(name, matrix)


def check_change(name: str, change: Any) -> None:  # noqa: ANN401
    """Check that a change is one of low rank, in real numbers; raises StrategyFailure."""
    if not isinstance(change, LowRank):
        raise StrategyFailure(f"{name} is {type(change).__name__}, expected LowRank")
    for part in ("basis", "core"):
        _check_real(f"{name}: {part}", np.asarray(getattr(change, part)))


def check_indices(name: str, matrix: Any) -> None:  # noqa: ANN401
    """Make sure that no index points outside, which compiled code would follow.

    Raises:
        StrategyFailure: where one does.
    """
    try:
        if matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)
        elif matrix.format == "coo":
            matrix._check()
        elif matrix.format != "dia":
            raise ValueError(f"format {matrix.format}, expected csc, csr, coo, bsr or dia")
    except (ValueError, TypeError, AttributeError, IndexError) as error:
        raise StrategyFailure(f"{name} is not a valid sparse array: {error}") from error


def _check_sparse(name: str, matrix: Any) -> None:  # noqa: ANN401
    if not sp.issparse(matrix):
        raise StrategyFailure(f"{name} is {type(matrix).__name__}, expected a sparse array")


def _check_shape(name: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
    if tuple(shape) != expected:
        raise StrategyFailure(f"{name} has shape {tuple(shape)}, expected {expected}")


def _check_real(name: str, data: Any) -> None:  # noqa: ANN401
    if not np.issubdtype(data.dtype, np.floating) and not np.issubdtype(data.dtype, np.integer):
        raise StrategyFailure(f"{name} has entries of type {data.dtype}, expected real numbers")


def _check_numbers(name: str, data: Any) -> None:  # noqa: ANN401
    _check_real(name, data)
    bad = int(np.count_nonzero(~np.isfinite(data)))
    if bad:
        raise StrategyFailure(f"{name} has {bad} entries that are not finite, expected none")


def _check_symmetry(name: str, difference: Any, data: Any) -> None:  # noqa: ANN401
    largest = float(np.abs(data).max(initial=0.0))
    gap = float(abs(difference).max()) if 0 not in difference.shape else 0.0
    if gap > _SYMMETRY * largest:
        raise StrategyFailure(
            f"{name} is not symmetric: relative difference {gap / largest:.3g}, "
            f"allowed {_SYMMETRY:.0e}"
        )
