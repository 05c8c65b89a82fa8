"""Springs between members at joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from femubench import Measurement, Model, NotApplicable
from femubench.effect import Change
from femubench.fem import Structure
from femubench.update import (
    Changes,
    JointGroup,
    Joints,
    SensitivityStrategy,
)

_BENDING, _TORSION, _TRANSLATION = ("ry", "rz"), ("rx",), ("x", "y", "z")
_SOFTEST, _STIFFEST = 1e-4, 1e3  # of the initial stiffness: a hinge, and rigid


@dataclass(frozen=True)
class Spring(SensitivityStrategy):
    """Connect members at joints by springs and update them with one global factor.

    A spring of every direction ties a member's end to the joint, behind a stiff massless arm as
    long as half the depth of the member that it meets: where a member passes the joint at every
    branch, else at all ends but one. Stiffnesses are shared by all joints of a type. No more
    parameters than measured frequencies are free: first rotations in bending, then the global
    factor, then torsion, then translations; the others keep their initial value.

    Arguments:
        variant: ``joints`` for table 4(d); ``global`` for table 4(c), where EI and rho A of all
            members are updated and the springs stay as they are.
        free_stiffness: whether the global stiffness factor is free with the springs; table 4(d)
            prints 1.000 for it, which needs it fixed.
        arm: length of the arm in m; None for half the depth of the crossing member.
        arm_factor: rigidity of the arm in that of the member; None for a rigid arm.
        stiffness: initial values by local direction in N/m or N m/rad that replace those of
            `spring_estimates`.
        options: of the iteration. Springs that hardly matter drift as far as its damping lets
            them; it is that of the other sensitivity strategies.

    Source: Horton et al. (1999), sections 3.1 and 7, table 4(c) and (d).
    """

    name: ClassVar[str] = "spring"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, section 7, table 4(c) and (d)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"geometry", "joints"})
    settings: ClassVar[tuple[str, ...]] = (
        "residual=frequency",
        "damping=1e-4",
        "damping=3e-3",
        "free_stiffness=false",
    )

    variant: Literal["joints", "global"] = "joints"
    free_stiffness: bool = True
    arm: float | None = None
    arm_factor: float | None = 5.0
    stiffness: Mapping[str, float] = field(default_factory=dict)

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Structure, list[Change]]:
        """Return the frame with springs at its joints, on the mesh that has them, and these."""
        structure = model.frame_structure
        groups = self._groups(structure, len(measurement))
        values = {name: self._initial(structure, ends) for name, ends in groups.items()}
        placed = {end: values[name] for name, ends in groups.items() for end in ends}
        sprung = Joints(structure).with_springs(placed, arm=self.arm, arm_factor=self.arm_factor)
        if self.variant == "global":
            mass = Change.scale_property("rhoA all members", "rhoA", sprung.elements, fatal=True)
            return sprung, [Changes(sprung).stiffness(), mass]
        return sprung, self._springs(sprung, groups, values, len(measurement))

    def _groups(self, structure: Structure, count: int) -> dict[str, tuple[str, ...]]:
        """Return flexible ends by group; one group where bending alone outnumbers the data."""
        groups = _flexible(structure, Joints(structure).groups())
        directions = Joints(structure).spring_estimates(next(iter(groups.values())))
        if len(groups) * sum(name in _BENDING for name in directions) > count:
            return {"all joints": tuple(end for ends in groups.values() for end in ends)}
        return groups

    def _initial(self, structure: Structure, ends: tuple[str, ...]) -> dict[str, float]:
        estimates = Joints(structure).spring_estimates(ends)
        return {name: self.stiffness.get(name, value) for name, value in estimates.items()}

    def _springs(
        self,
        structure: Structure,
        groups: Mapping[str, tuple[str, ...]],
        values: Mapping[str, Mapping[str, float]],
        count: int,
    ) -> list[Change]:
        def level(directions: tuple[str, ...]) -> list[Change]:
            return [
                _spring(group, ends, name, values[group][name])
                for name in directions
                for group, ends in groups.items()
                if name in values[group]
            ]

        stiffness = [Changes(structure).stiffness()] if self.free_stiffness else []
        levels = [level(_BENDING), stiffness, level(_TORSION), level(_TRANSLATION)]
        return Changes.determined(levels, count)


def _flexible(structure: Structure, groups: tuple[JointGroup, ...]) -> dict[str, tuple[str, ...]]:
    found = {group.name: Joints(structure).flexible_ends(group) for group in groups}
    flexible = {name: ends for name, ends in found.items() if ends}
    if not flexible:
        raise NotApplicable("no member end at a joint bends and has no spring yet")
    return flexible


def _spring(group: str, ends: tuple[str, ...], direction: str, start: float) -> Change:
    places = tuple(f"{end}:{direction}" for end in ends)
    unit = "N m/rad" if direction.startswith("r") else "N/m"
    limits = _SOFTEST * start, _STIFFEST * start
    return Change.set_property(
        f"k_{direction} {group}", "spring", places, start, *limits, unit=unit
    )
