"""The weight of the structure, which stiffens what hangs and softens what stands."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model, solve_modes
from femubench.effect import Change, FrameEffect, Parameter, Size, Term, once_for
from femubench.fem import Frame, GeometricStiffness, ModelError, SparseArray

# Beyond the own weight there may be loads that stand on it; what stands is safe from buckling
# by three times its weight and more.
_MOST = 3.0
_LEAST, _MODES = 5e-3, 6  # less of any of these frequencies is lost in what a model is off


class GravityStiffness(FrameEffect):
    """Let the weight of all members and masses act on the stiffness, down along global z.

    The model has the geometric stiffness of the stress that its weight leaves, times a multiple;
    1 is the weight on earth. Where z is not up, or loads stand on it that are not in the model,
    the multiple is another.
    """

    name: ClassVar[str] = "gravity-stiffness"
    summary: ClassVar[str] = "its weight acts on its stiffness"
    innate: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.5, 2.0),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame where it stands or hangs, and where a test can feel it."""
        if model.structure is None or model.structure.frame.plane == "out-of-plane":
            return ()
        with suppress(ModelError):
            unit = _unit(model)
            modes = once_for(model, "modes under weight", lambda: solve_modes(model).elastic)
            few = modes.take(np.arange(min(_MODES, len(modes))))
            work = np.einsum("ij,ij->j", few.shapes, unit @ few.shapes)
            scale = (
                np.einsum("ij,ij->j", few.shapes, model.mass_times(few.shapes)) * few.eigenvalues
            )
            felt = float(np.abs(0.5 * work / scale).max(initial=0.0))
            return ("all",) if _MOST * felt > _LEAST else ()
        return ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the multiple of the weight."""
        now = model.frame_structure.frame.gravity
        parameter = Parameter(
            "multiple of the weight", "", 1.0, now, 0.0, now + _MOST, one_sided=now == 0.0
        )
        return (parameter,)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame under that multiple of its weight."""
        return replace(frame, gravity=float(values[0]))

    def change(self, model: Model, place: str) -> Change:
        """Return the geometric stiffness of the weight."""
        now = model.frame_structure.frame.gravity
        return Change.proportional(Term.of("stiffness", _unit(model)), neutral=now)


def _unit(model: Model) -> SparseArray:
    """Return the geometric stiffness of the weight, worked out once."""
    return once_for(model, "weight", lambda: GeometricStiffness(model.frame_structure).of_weight())
