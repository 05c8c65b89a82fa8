"""Generic element matrices, every element on its own or alike for all elements of a kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.fem import Structure
from femubench.update import ElementFamily, ElementStrategy, Symmetry


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
    tied: ClassVar[bool] = False
    settings: ClassVar[tuple[str, ...]] = (
        *ElementStrategy.settings,
        "plain=full",
        "plain=full,joint=full",
        "plain=none",
    )

    plain: Symmetry = "half-turn"
    joint: Symmetry = "none"

    def family(self, structure: Structure) -> ElementFamily:
        """Return a core for every element, or one for all elements of a kind."""
        # Elements that share a core are turned end for end where their second end is at the joint.
        tied = self.tied or self.changes != self.OWN
        return ElementFamily.generic(structure, plain=self.plain, joint=self.joint, tied=tied)


@dataclass(frozen=True)
class GenericAdjusted(GenericLS):
    """Give the elements at joints of one type, and all plain elements, one generic core each.

    Cores are relative to the nominal element. Where the second end of an element is at the joint,
    the core is turned end for end. They stay positive definite as in `generic-ls`.

    Arguments:
        plain, joint: as for `generic-ls`.
    """

    name: ClassVar[str] = "generic-adjusted"
    citation: ClassVar[str] = (
        "Ahmadian, Gladwell & Ismail (1997), section 4.3, table 4, adjusted solution; Gladwell & "
        "Ahmadian (1995), Generic element matrices suitable for finite element model updating"
    )
    tied: ClassVar[bool] = True
