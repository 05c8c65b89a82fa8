"""Physical parameters: one factor on every rigidity of every element."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.fem import Structure
from femubench.update import ElementFamily, ElementStrategy


@dataclass(frozen=True)
class Physical(ElementStrategy):
    """Scale EI and GJ (out of plane), EI and EA (in plane) or all four of every element.

    Of matrices every group has a factor.

    The factors stay above one hundredth, so the stiffness stays positive semidefinite.
    """

    name: ClassVar[str] = "physical"
    citation: ClassVar[str] = (
        "Ahmadian, Gladwell & Ismail (1997), Parameter selection strategies in finite element "
        "model updating, section 4.2, table 3"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})
    cost_reference: ClassVar[bool] = True
    takes_groups: ClassVar[bool] = True
    promises: ClassVar[frozenset[str]] = frozenset({"no-negative-eigenvalue"})

    def family(self, structure: Structure) -> ElementFamily:
        """Return factors on the rigidities of every element."""
        return ElementFamily.physical(structure)
