"""Nobari with the rigid-body modes of the structure as hard constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.fem import Structure
from femubench.update import ElementFamily, ElementStrategy, nobari_family


@dataclass(frozen=True)
class NobariRigid(ElementStrategy):
    """Change the terms of every element matrix as `nobari` does, rigid-body modes kept exactly.

    What is left are the physical factors, (21), here without bounds: wherever those of `physical`
    stay above theirs, both give the same model.
    """

    name: ClassVar[str] = "nobari-rigid"
    citation: ClassVar[str] = (
        "Nobari, Robb & Ewins (1993), with the rigid-body modes as data: Ahmadian, Gladwell & "
        "Ismail (1997), section 4.2"
    )
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes"})
    keep_rigid: ClassVar[bool] = True

    def family(self, structure: Structure) -> ElementFamily:
        """Return factors on the kinds of entries of every element matrix."""
        return nobari_family(structure)
