"""Another Young's modulus than the material's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from femubench import Model
from femubench.effect import Size
from femubench.plugins.effects.material import MaterialEffect


class YoungsModulus(MaterialEffect):
    """Scale Young's modulus of the whole structure; shear follows, Poisson's ratio stays."""

    name: ClassVar[str] = "youngs-modulus"
    summary: ClassVar[str] = "Young's modulus is another"
    caution: ClassVar[str] = (
        "A stiffness that falls with the amplitude looks like youngs-modulus until a second "
        "excitation level is measured."
    )
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.03, 0.15, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "E"

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole structure."""
        return ("all",)
