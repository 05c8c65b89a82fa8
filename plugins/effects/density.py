"""Another density than the material's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from femubench import Model
from femubench.plugins.effects.material import MaterialEffect


class Density(MaterialEffect):
    """Scale the density of the whole structure; of matrices without a frame the whole mass."""

    name: ClassVar[str] = "density"
    summary: ClassVar[str] = "the density is another"
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole structure."""
        return ("all",)
