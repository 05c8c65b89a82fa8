"""Another Young's modulus or density than the material's, of all members or of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    LookWarning,
    ModelPlaces,
    Parameter,
    Places,
    Seen,
    Size,
    Term,
    once_for,
)
from femubench.fem import FloatArray, Frame, Groups, Member, Property
from femubench.modal import GroupPriors

_SURE = 3.0  # standard deviations of the weighed mass
# ln(E/rho) of steel, aluminium, titanium, magnesium, brass and cast iron scatters by 0.32.
_OF_METALS = 0.3


class MaterialEffect(FrameEffect):
    """Base class of relative changes of E or rho, of all members or of one.

    Attributes:
        constant: ``E`` scales EA, EI, GJ and GA together, ``rho`` all that is proportional to it.
    """

    constant: ClassVar[Literal["E", "rho"]]

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole structure, and the members of every material where there are more."""
        structure = model.structure
        return ("all", *(() if structure is None else Places(structure.frame).sets(("material",))))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative change; of a group with a prior of its own, that of a factor."""
        name = f"change of {self.constant}"
        known, group = GroupPriors(model), place.removeprefix(Groups.PREFIX)
        matrix: Literal["mass", "stiffness"] = "stiffness" if self.constant == "E" else "mass"
        own = model.groups if self.constant == "E" else model.mass_groups
        parts = own.keys() & Groups(model).names(place)
        if any(part in model.group_priors or known.kind(part) != "part" for part in parts):
            # What a joint is stiffer by, as by a fillet, is no defect: the drawing lacks it.
            soft = self.constant == "E" and np.isfinite(known.largest_factor(group))
            most = 1.0 if soft else np.inf
            given = known.std(group, matrix), 0.0, -np.inf, most - 1.0
            return (Parameter(name, "", *given, scaling="factor", wording="change"),)
        return (Parameter(name, "", 0.1, lower=-0.9, wording="change"),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with another material in the members."""
        named = Places(frame).members(place)
        members = tuple(
            self._scaled(member, 1.0 + values[0]) if member.name in named else member
            for member in frame.members
        )
        return replace(frame, members=members)

    def _scaled(self, member: Member, factor: float) -> Member:
        value = getattr(member.material, self.constant) * factor
        return replace(member, material=replace(member.material, **{self.constant: value}))

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with its matrices scaled as they are."""
        quantity = "E" if self.constant == "E" else "density"
        return Groups(model).with_factors([Property(place, quantity, (place,))], [1.0 + values[0]])

    def change(self, model: Model, place: str) -> Change:
        """Return the matrices of the elements, exactly proportional to the change."""
        kind: Literal["mass", "stiffness"] = "stiffness" if self.constant == "E" else "mass"
        structure = model.structure
        if structure is not None:
            rows = ModelPlaces(model).elements(place, arms=True)
            p = structure.properties
            matrices = p.stiffness_matrices if self.constant == "E" else p.mass_matrices
            whole = once_for(model, f"element {kind}", matrices)
            return Change.proportional(
                Term(kind, ElementOperator(structure, rows, whole, kind=rows))
            )
        parts = [Groups(model).matrix(kind, place)]
        low_rank = model.stiffness_change if self.constant == "E" else model.mass_change
        if low_rank is not None and place == "all":
            parts.append(low_rank)
        return Change.proportional(*(Term.of(kind, part) for part in parts))


class YoungsModulus(MaterialEffect):
    """Scale Young's modulus of the whole structure; shear follows, Poisson's ratio stays."""

    name: ClassVar[str] = "youngs-modulus"
    summary: ClassVar[str] = "Young's modulus is another"
    caution: ClassVar[str] = (
        "A stiffness that falls with the amplitude looks like youngs-modulus until a second "
        "excitation level is measured."
    )
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.03, 0.15, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "E"


class Density(MaterialEffect):
    """Scale the density of the whole structure; of matrices without a frame the whole mass."""

    name: ClassVar[str] = "density"
    summary: ClassVar[str] = "the density is another"
    sizes: ClassVar[Sequence[Size]] = (Size(0.03, 0.15, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def look(self, seen: Seen) -> list[LookWarning]:
        """Return whether the model weighs other than the structure does on the scales."""
        if seen.measurement.total_mass is None:
            return []
        weighed, std = seen.measurement.total_mass
        mass = seen.model.total_mass
        if not abs(mass - weighed) > _SURE * std:
            return []
        apart = abs(mass - weighed) / std if std > 0.0 else np.inf
        what = (
            f"The model has {mass:.4g} kg, the structure {weighed:.4g} kg on the scales, "
            f"{apart:.3g} standard deviations apart."
        )
        return [seen.warning(self.name, what, self._changes(seen, mass, weighed))]

    def _changes(self, seen: Seen, mass: float, weighed: float) -> FloatArray | None:
        """Return the changes with the density that gives the weighed mass, (count,)."""
        if seen.model.structure is None:
            return np.full(seen.count, np.sqrt(mass / weighed) - 1.0)
        frame = seen.model.structure.frame
        lumps = sum(m.mass for m in frame.masses) + sum(o.mass for o in frame.oscillators)
        change = (weighed - mass) / (mass - lumps) if mass > lumps else -1.0
        return seen.changes(self.frame(frame, "all", (change,))) if change > -1.0 else None


class MemberStiffness(MaterialEffect):
    """Scale Young's modulus of one member, or of one group or family of matrices from files."""

    name: ClassVar[str] = "member-stiffness"
    summary: ClassVar[str] = "a member has another stiffness"
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "E"

    def places(self, model: Model) -> Sequence[str]:
        """Return members and families, or the groups; a single one is `youngs-modulus`."""
        if model.structure is None:
            return Groups(model).places("stiffness") + Groups(model).families("stiffness")
        return _parts(model.structure.frame)


class MemberMass(MaterialEffect):
    """Scale the density of one member; what is attached to it stays."""

    name: ClassVar[str] = "member-mass"
    summary: ClassVar[str] = "a member has another mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def places(self, model: Model) -> Sequence[str]:
        """Return members and families; a single one is `density`."""
        if model.structure is None:
            return ()
        return _parts(model.structure.frame)


class GroupMass(MaterialEffect):
    """Scale the mass of one group of a model from matrices, or of one family."""

    name: ClassVar[str] = "group-mass"
    summary: ClassVar[str] = "a group has another mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def places(self, model: Model) -> Sequence[str]:
        """Return the groups of the mass, and families of them."""
        return Groups(model).places("mass") + Groups(model).families("mass")


class GroupMaterial(GroupMass):
    """Scale mass and stiffness of a part of a model from matrices: another metal, another wall.

    The stiffness follows the mass, but for what E/rho of metals scatters by.
    """

    name: ClassVar[str] = "group-material"
    summary: ClassVar[str] = "a group is of another material or thickness"

    def places(self, model: Model) -> Sequence[str]:
        """Return the parts that have both matrices, and families of such."""
        parts = {name for name in model.groups if GroupPriors(model).kind(name) == "part"}
        parts &= model.mass_groups.keys()
        return [p for p in super().places(model) if parts.issuperset(Groups(model).names(p))]

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative changes of the mass and of the stiffness a mass."""
        ratio = Parameter("change of E/rho", "", _OF_METALS, scaling="factor", wording="change")
        return (*super().parameters(model, place), ratio)

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the matrices of the group scaled."""
        grown = 1.0 + self.change(model, place).coefficients(np.array([values]))[0]
        scaled = [Property(f"{place} {name}", name, (place,)) for name in ("density", "E")]
        return Groups(model).with_factors(scaled, grown)

    def change(self, model: Model, place: str) -> Change:
        """Return both matrices of the group."""
        kinds: tuple[Literal["mass", "stiffness"], ...] = ("mass", "stiffness")
        terms = tuple(Term.of(kind, Groups(model).matrix(kind, place)) for kind in kinds)
        return Change(
            terms, lambda v: np.column_stack([v[:, 0], (1.0 + v[:, 0]) * (1.0 + v[:, 1]) - 1.0])
        )


def _parts(frame: Frame) -> tuple[str, ...]:
    """Return the members, then sets and sections of more than one; nothing of a single member."""
    return (*frame.member_index, *Places(frame).sets()) if len(frame.members) > 1 else ()
