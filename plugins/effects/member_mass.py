"""A member that is heavier or lighter than it should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from femubench import Model
from femubench.effect import Size, member_labels
from femubench.plugins.effects.material import MaterialEffect


class MemberMass(MaterialEffect):
    """Scale the density of one member; what is attached to it stays."""

    name: ClassVar[str] = "member-mass"
    summary: ClassVar[str] = "a member has another mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def places(self, model: Model) -> Sequence[str]:
        """Return the members; a single one is `density`."""
        if model.structure is None:
            return ()
        members = member_labels(model.structure.frame)
        return members if len(members) > 1 else ()
