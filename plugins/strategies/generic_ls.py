"""Generic element matrices, every element on its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.fem import Structure
from femubench.update import ElementFamily, ElementStrategy, Symmetry, generic_family


@dataclass(frozen=True)
class GenericLS(ElementStrategy):
    """Give every element a free symmetric core for its strain modes.

    The cores stay positive definite: no strain motion of an element loses more than 99 percent of
    its stiffness.

    Arguments:
        plain: symmetry of elements that touch no joint; with `half-turn` they have 4 parameters in
            a plane, with `mirror` 4 others, with `full` 3.
        joint: symmetry of elements at a joint; with `none` they have 6 parameters.
    """

    name: ClassVar[str] = "generic-ls"
    citation: ClassVar[str] = (
        "Ahmadian, Gladwell & Ismail (1997), section 4.3, table 4, LS solution; Gladwell & "
        "Ahmadian (1995), Generic element matrices suitable for finite element model updating"
    )
    promises: ClassVar[frozenset[str]] = frozenset({"no-negative-eigenvalue"})

    plain: Symmetry = "half-turn"
    joint: Symmetry = "none"

    def family(self, structure: Structure) -> ElementFamily:
        """Return a core for every element."""
        return generic_family(structure, plain=self.plain, joint=self.joint)
