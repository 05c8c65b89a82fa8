"""What effects on Young's modulus or density have in common: one constant of some members."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

from femubench import Model
from femubench.effect import (
    Change,
    EffectParameter,
    ElementOperator,
    FrameEffect,
    MatrixOperator,
    Term,
    elements_of,
    once_for,
    proportional,
)
from femubench.fem import Frame, Member, ModelError, SparseArray, mass_matrices, stiffness_matrices


class MaterialEffect(FrameEffect):
    """Base class of relative changes of E or rho, of all members or of one.

    Attributes:
        constant: ``E`` scales EA, EI, GJ and GA together, ``rho`` all that is proportional to it.
    """

    constant: ClassVar[Literal["E", "rho"]]

    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return the relative change."""
        return (
            EffectParameter(f"change of {self.constant}", "", 0.1, lower=-0.9, wording="change"),
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with another material in the members."""
        members = tuple(
            self._scaled(member, 1.0 + values[0]) if place in ("all", member.name) else member
            for member in frame.members
        )
        return replace(frame, members=members)

    def _scaled(self, member: Member, factor: float) -> Member:
        value = getattr(member.material, self.constant) * factor
        return replace(member, material=replace(member.material, **{self.constant: value}))

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the change; matrices without a frame are scaled as they are."""
        if model.structure is not None:
            return super().extend(model, place, values)
        part, share = values[0] * self._matrix(model, place), 1.0 + values[0]
        if self.constant == "rho":
            low_rank = model.mass_change
            if low_rank is not None:
                low_rank = replace(low_rank, core=share * low_rank.core)
            return replace(model, mass=model.mass + part, mass_change=low_rank)
        low_rank = model.stiffness_change
        if low_rank is not None and place == "all":
            low_rank = replace(low_rank, core=share * low_rank.core)
        return replace(model, stiffness=model.stiffness + part, stiffness_change=low_rank)

    def _matrix(self, model: Model, place: str) -> SparseArray:
        """Return the part of a model's matrices that grows with the constant."""
        if place == "all":
            return model.stiffness if self.constant == "E" else model.mass
        if self.constant == "rho" or place not in model.groups:
            raise ModelError(f"there is no place {place!r}")
        return model.groups[place]

    def change(self, model: Model, place: str) -> Change:
        """Return the matrices of the elements, exactly proportional to the change."""
        kind: Literal["mass", "stiffness"] = "stiffness" if self.constant == "E" else "mass"
        structure = model.structure
        if structure is not None:
            rows = elements_of(structure, place, arms=True)
            matrices = stiffness_matrices if self.constant == "E" else mass_matrices
            whole = once_for(model, f"element {kind}", partial(matrices, structure.properties))
            return proportional(Term(kind, ElementOperator(structure, rows, whole[rows])))
        parts = [self._matrix(model, place)]
        low_rank = model.stiffness_change if self.constant == "E" else model.mass_change
        if low_rank is not None and place == "all":
            parts.append(low_rank)
        return proportional(*(Term(kind, MatrixOperator(part)) for part in parts))
