"""Where the error of a model sits, by classical indicators that know of no cause."""

from __future__ import annotations

from collections.abc import Iterable

from femubench.core.diagnosis.locate_expansion import Comparison, expand
from femubench.core.diagnosis.locate_indicators import (
    Elements,
    Values,
    ecomac,
    energy_error,
    force_residual,
    group_energy,
    mdlac,
    node_residual,
)
from femubench.core.diagnosis.result import LocationRow
from femubench.core.errors import ModelError
from femubench.core.measurement import Measurement
from femubench.core.model import Model

# Below this an indicator is made of rounding errors, and says nothing; energies go by the square.
_NOTHING = {"force-residual": 1e-6, "energy-error": 1e-12, "ecomac": 1e-6, "mdlac": 0.0}


def locate(model: Model, measurement: Measurement) -> tuple[LocationRow, ...]:
    """Return `force-residual`, `energy-error`, `ecomac` and `mdlac` at every place, highest first.

    Frames have rows for members, ``member/k`` and joints, models from files for nodes and groups,
    `ecomac` for sensors. Without shapes only `mdlac` is left. Within an indicator the largest of
    every kind of place is 1.

    Arguments:
        model: the nominal one.
        measurement: the used modes.

    Raises:
        ModelError: when the model has no modes.
    """
    comparison = Comparison.of(model, measurement)
    found: dict[str, list[Values]] = {}
    try:
        expansion = expand(comparison)
    except ModelError:  # no sensor sees any motion, or every shift is singular
        expansion = None
    shaped = expansion is not None and expansion.shapes.shape[1] > 0
    if model.structure is not None:
        elements = Elements(model.structure)
        if expansion is not None and shaped:
            found["force-residual"] = force_residual(elements, comparison, expansion)
            found["energy-error"] = energy_error(elements, expansion)
        found["mdlac"] = mdlac(elements, comparison)
    elif expansion is not None and shaped:
        found["force-residual"] = node_residual(comparison, expansion)
        found["energy-error"] = group_energy(comparison, expansion)
    found["ecomac"] = [ecomac(comparison)]
    return tuple(row for name, kinds in found.items() for row in _rows(name, kinds))


def _rows(indicator: str, kinds: Iterable[Values]) -> list[LocationRow]:
    rows = []
    for values in kinds:
        largest = max(values.values(), default=0.0)
        if largest > _NOTHING[indicator]:
            rows += [LocationRow(indicator, place, v / largest) for place, v in values.items()]
    return sorted(rows, key=lambda row: -row.value)
