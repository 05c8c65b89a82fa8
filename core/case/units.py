"""Models in other units than SI: a unit of length, and what hangs together with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.schema import LengthUnit
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.typing import SparseArray

METRES: dict[LengthUnit, float] = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
_POUND = 4.4482216152605  # N; models in inches and feet have it as their force
NEWTONS: dict[LengthUnit, float] = {
    unit: _POUND if unit in ("in", "ft") else 1.0 for unit in METRES
}


def in_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in SI that was read in other units.

    The force is N (or lbf beside in and ft) and the time s, so that the mass is N s2 / unit: with
    mm this is the system of tonnes and MPa. With T, unit / m for translations and 1 for
    rotations, and the energy e of one force times one unit in J, K is e T K T and M e T M T.

    Arguments:
        model: matrices in the units of its file.
        unit: of its lengths.

    Raises:
        ModelError: for a model of elements.
    """
    return _converted(model, METRES[unit], NEWTONS[unit])


def from_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in the units of a file; the inverse of `in_si`."""
    return _converted(model, 1.0 / METRES[unit], 1.0 / NEWTONS[unit])


def _converted(model: Model, length: float, force: float) -> Model:
    if length == force == 1.0:
        return model
    if not isinstance(model.geometry, MatrixGeometry):
        raise ModelError("the elements of a model are not converted to other units")
    rotation = np.array([name.startswith("r") for name in model.dofs.direction])
    scale = sp.diags_array(np.sqrt(force * length) * np.where(rotation, 1.0, 1.0 / length))

    def turned(matrix: SparseArray) -> SparseArray:
        return sp.csc_array(scale @ matrix @ scale)

    dofs = replace(model.dofs, xyz=length * model.dofs.xyz)
    return replace(
        model,
        mass=turned(model.mass),
        stiffness=turned(model.stiffness),
        dofs=dofs,
        geometry=replace(model.geometry, dofs=dofs),
        groups={name: turned(part) for name, part in model.groups.items()},
    )
