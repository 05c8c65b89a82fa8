"""A member, or a named part of a stiffness matrix, that is stiffer or softer than it should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from femubench import Model
from femubench.effect import Size, member_labels
from femubench.plugins.effects.material import MaterialEffect


class MemberStiffness(MaterialEffect):
    """Scale Young's modulus of one member, or one stiffness group of matrices from files."""

    name: ClassVar[str] = "member-stiffness"
    summary: ClassVar[str] = "a member has another stiffness"
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "E"

    def places(self, model: Model) -> Sequence[str]:
        """Return the members, or the groups; a single one is `youngs-modulus`."""
        structure = model.structure
        parts = tuple(model.groups) if structure is None else member_labels(structure.frame)
        return parts if len(parts) > 1 or structure is None else ()
