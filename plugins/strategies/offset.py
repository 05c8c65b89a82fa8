"""Partly rigid elements at joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Change
from femubench.fem import Structure
from femubench.update import Changes, JointGroup, Joints, SensitivityStrategy

_SHARE_WITHOUT_DEPTH = 0.1  # of the element
_ALMOST_NOTHING = 3.12e-6  # m, the initial offset of the passing member in table 4(e)
_LONGEST_EXTENSION = 3.0  # negative lengths, in those available


@dataclass(frozen=True)
class Offset(SensitivityStrategy):
    """Make the elements at joints partly rigid and update the rigid lengths with EI.

    Every joint type has one length for its branches, initially half the depth of the member that
    passes, and one for the member that passes, initially nothing; where none passes, one for all
    ends. The mass of branches inside the passing member is left out once and for all. Lengths may
    become negative, which stands for a joint softer than the beam; they move by multiples of their
    initial size, so that one which starts at nothing stays there, as in the paper. No more
    parameters than measured frequencies are free: branches first, then EI, then what passes.

    Arguments:
        length: initial rigid length of branches and ends in m; None for half the depth.
        options: of the iteration.

    Source: Horton et al. (1999), sections 3.2 and 8, table 4(e); Ahmadian, Mottershead & Friswell
    for the partly rigid element.
    """

    name: ClassVar[str] = "offset"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, equation (5), section 8, table 4(e)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"geometry", "joints"})
    settings: ClassVar[tuple[str, ...]] = (
        "residual=frequency",
        "residual=relative-eigenvalue",
        "damping=1e-3",
    )

    length: float | None = None

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Structure, list[Change]]:
        """Return the frame with partly rigid elements at its joints, and what moves them."""
        structure = model.frame_structure
        count = len(measurement)
        groups = Joints(structure).groups_within(count, passing=False)
        lengths: dict[str, tuple[float, float]] = {}
        own: dict[str, list[Change]] = {"branch": [], "end": [], "through": []}
        for group in groups:
            start, in_mass = self._initial(structure, group)
            lengths.update(dict.fromkeys(group.ends, (start, in_mass)))
            own[group.role].append(_length(structure, group, start))
        levels = [own["branch"] + own["end"], [Changes(structure).stiffness()], own["through"]]
        return Joints(structure).with_rigid_ends(lengths), Changes.determined(levels, count)

    def _initial(self, structure: Structure, group: JointGroup) -> tuple[float, float]:
        """Return the rigid lengths in the stiffness and in the mass matrix in m."""
        if group.role == "through":
            return _ALMOST_NOTHING, 0.0
        half = float(np.mean([Joints(structure).half_depth(end) for end in group.ends]))
        room = min(Joints(structure).available_length(end) for end in group.ends)
        # A length moves by multiples of its start, so it must have one.
        wanted = self.length or half or _SHARE_WITHOUT_DEPTH * room
        start = min(max(wanted, _ALMOST_NOTHING), room / 2.0)
        return start, start if group.role == "branch" else 0.0


def _length(structure: Structure, group: JointGroup, start: float) -> Change:
    room = min(Joints(structure).available_length(end) for end in group.ends)
    limits = -_LONGEST_EXTENSION * room, room
    name = f"a {group.name}"
    return Change.set_property(name, "rigid", group.ends, start, *limits, unit="m", signed=True)
