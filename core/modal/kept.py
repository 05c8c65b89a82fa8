"""What follows from a model alone, computed once for all who ask."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any, TypeVar

import numpy as np

from femubench.core.modal.eigen import DENSE_LIMIT, Modes, solve_modes
from femubench.core.model import Model

_Kept = TypeVar("_Kept")
# Models are compared by what they are, not by what they hold: equality of arrays is no key.
_kept: dict[int, tuple[weakref.ref[Model], dict[Hashable, Any]]] = {}


def once_for(model: Model, key: Hashable, make: Callable[[], _Kept]) -> _Kept:
    """Return what was made before for this very model, or make it and keep it as long.

    Arguments:
        key: what it is, among all that is kept of a model.
        make: called where it was not made before.
    """
    entry = _kept.get(id(model))
    if entry is None or entry[0]() is not model:
        number = id(model)
        # Bound early: at the end of the interpreter the name may be gone before the model.
        forget = partial(_forget, _kept, number)
        entry = (weakref.ref(model, forget), {})
        _kept[number] = entry
    if key not in entry[1]:
        entry[1][key] = make()
    value: _Kept = entry[1][key]
    return value


def _forget(kept: dict[int, Any], number: int, _: object) -> None:
    kept.pop(number, None)


def modes_of(model: Model, count: int | None = None) -> Modes:
    """Return the lowest modes of a model as `solve_modes` does, a small one solved only once.

    Arguments:
        model: any model.
        count: number of modes wanted, rigid ones included; None as for `solve_modes`.

    Raises:
        ModelError: when the model has no modes.
    """
    if model.size > DENSE_LIMIT:
        return solve_modes(model, count)
    modes = once_for(model, "modes", lambda: solve_modes(model))
    return modes if count is None else modes.take(np.arange(min(count, len(modes))))
