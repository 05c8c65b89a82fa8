"""Another density than the material's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from femubench import Model
from femubench.effect import LookWarning, Seen, Size
from femubench.fem import FloatArray
from femubench.plugins.effects.material import MaterialEffect

_SURE = 3.0  # standard deviations of the weighed mass


class Density(MaterialEffect):
    """Scale the density of the whole structure; of matrices without a frame the whole mass."""

    name: ClassVar[str] = "density"
    summary: ClassVar[str] = "the density is another"
    sizes: ClassVar[Sequence[Size]] = (Size(0.03, 0.15, signed=True),)
    constant: ClassVar[Literal["E", "rho"]] = "rho"

    def look(self, seen: Seen) -> list[LookWarning]:
        """Return whether the model weighs other than the structure does on the scales."""
        if seen.measurement.total_mass is None:
            return []
        weighed, std = seen.measurement.total_mass
        mass = seen.model.total_mass
        if not abs(mass - weighed) > _SURE * std:
            return []
        apart = abs(mass - weighed) / std if std > 0.0 else np.inf
        what = (
            f"The model has {mass:.4g} kg, the structure {weighed:.4g} kg on the scales, "
            f"{apart:.3g} standard deviations apart."
        )
        return [seen.warning(self.name, what, self._changes(seen, mass, weighed))]

    def _changes(self, seen: Seen, mass: float, weighed: float) -> FloatArray | None:
        """Return the changes with the density that gives the weighed mass, (count,)."""
        if seen.model.structure is None:
            return np.full(seen.count, np.sqrt(mass / weighed) - 1.0)
        frame = seen.model.structure.frame
        lumps = sum(m.mass for m in frame.masses) + sum(o.mass for o in frame.oscillators)
        change = (weighed - mass) / (mass - lumps) if mass > lumps else -1.0
        return seen.changes(self.frame(frame, "all", (change,))) if change > -1.0 else None

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole structure."""
        return ("all",)
