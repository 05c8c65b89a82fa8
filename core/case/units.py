"""Models in other units than SI: a unit of length, and what hangs together with it."""

from __future__ import annotations

from dataclasses import replace

from femubench.core.case.frame_keys import describe_frame
from femubench.core.case.matrix_files import matrices_of
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.schema import LengthUnit
from femubench.core.case.similarity import (
    Similarity,
    matrix_factors,
    scale_matrix,
    similar_frame,
    similar_matrices,
)
from femubench.core.fem.model import Model

METRES: dict[LengthUnit, float] = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
_POUND = 4.4482216152605  # N; models in inches and feet have it as their force
NEWTONS: dict[LengthUnit, float] = {
    unit: _POUND if unit in ("in", "ft") else 1.0 for unit in METRES
}


def in_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in SI that was read in other units.

    The force is N (or lbf with in and ft) and the time s, so that the mass is N s2 / unit: with
    mm this is the system of tonnes and MPa. With T, 1 / unit for translations and 1 for
    rotations, and the energy e = force times unit in J, K is e T K T and M e T M T.
    """
    return _converted(model, METRES[unit], NEWTONS[unit])


def from_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in the units of a file; the inverse of `in_si`.

    Raises:
        Fault: for parameters of a frame that it cannot say by itself.
    """
    return _converted(model, 1.0 / METRES[unit], 1.0 / NEWTONS[unit])


class _Unit(Similarity):
    """A unit of length and one of force as factors; that of time is a second."""

    @classmethod
    def of(cls, length: float, force: float) -> _Unit:
        return cls(length, force / length**2, force / length**4)

    @property
    def frequency(self) -> float:
        return 1.0

    @property
    def mass(self) -> float:
        return self.stiffness("x")


def _converted(model: Model, length: float, force: float) -> Model:
    if length == force == 1.0:
        return model
    by = _Unit.of(length, force)
    if model.structure is None:
        assert isinstance(model.geometry, MatrixGeometry)
        return similar_matrices(model, model.geometry, by)
    frame = describe_frame(model.structure)
    new = Model.of(replace(similar_frame(frame, by), gravity=frame.gravity))
    # An update may have changed the matrices themselves.
    parts = zip(matrices_of(model), model.structure.matrices(), strict=True)
    factors = matrix_factors(new.dofs, by)
    mass, stiffness = (
        scale_matrix(whole - own, factor)
        for (whole, own), factor in zip(parts, factors, strict=True)
    )
    return replace(new, mass=new.mass + mass, stiffness=new.stiffness + stiffness)
