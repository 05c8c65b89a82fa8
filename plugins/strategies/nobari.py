"""Nobari: one factor on every kind of entry of every element matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.fem import Structure
from femubench.update import ElementFamily, ElementStrategy


@dataclass(frozen=True)
class Nobari(ElementStrategy):
    """Scale deflection, coupling, slope and rod terms of every element matrix on their own.

    Nothing ties them to each other, so elements lose their rigid-body modes and the stiffness may
    become indefinite: that is the method, not an error.
    """

    name: ClassVar[str] = "nobari"
    citation: ClassVar[str] = (
        "Nobari, Robb & Ewins (1993), Model updating and joint identification methods: "
        "applications, restrictions and overlap; as in Ahmadian, Gladwell & Ismail (1997), "
        "equation (20), table 3"
    )

    def family(self, structure: Structure) -> ElementFamily:
        """Return factors on the kinds of entries of every element matrix."""
        return ElementFamily.nobari(structure)


@dataclass(frozen=True)
class NobariRigid(Nobari):
    """Change the terms of every element matrix as `nobari` does, rigid-body modes kept exactly.

    They are hard constraints. What is left are the physical factors, (21), here without bounds:
    wherever those of `physical` stay above theirs, both give the same model.
    """

    name: ClassVar[str] = "nobari-rigid"
    citation: ClassVar[str] = (
        "Nobari, Robb & Ewins (1993), with the rigid-body modes as data: Ahmadian, Gladwell & "
        "Ismail (1997), section 4.2"
    )
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes"})
    keep_rigid: ClassVar[bool] = True
