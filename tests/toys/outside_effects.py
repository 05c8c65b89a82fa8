"""Effects of somebody else: one with everything that is optional, one with nothing of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from femubench import Model, hookimpl
from femubench.effect import FrameEffect, LookWarning, Parameter, Reading, Seen, Size
from femubench.fem import Factor, Frame

CAUTION = "A skin that peels off looks like a thinner one."
SUMMARY = "a skin stiffens the members in bending"


class Skin(FrameEffect):
    """Raise the bending stiffness of all members; twist and mass stay."""

    name = "stiff-skin"
    summary = SUMMARY
    caution = CAUTION
    softens = True
    reading = Reading("change of EI", "measure the skin with a gauge", std=0.01)
    sizes = (Size(0.2, 0.3),)

    def places(self, model: Model) -> Sequence[str]:
        return () if model.structure is None else ("all",)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("change of EI", "", 0.1, lower=-0.9, wording="change"),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        if not values[0]:
            return frame
        return replace(frame, factors=(*frame.factors, Factor("EI", ("all",), 1.0 + values[0])))

    def look(self, seen: Seen) -> Iterable[LookWarning]:
        structure = seen.model.structure
        if structure is None or structure.frame.factors:
            return ()
        changes = seen.changes(self.frame(structure.frame, "all", [0.1]))
        return seen.notable(self.name, "A skin of a tenth of the stiffness would show", changes)


class Bare(FrameEffect):
    """Let every member weigh more, and say no more of it than must be said."""

    name = "wet-wood"

    def places(self, model: Model) -> Sequence[str]:
        return ("all",) if model.structure is not None else ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("water", "", 0.1, lower=0.0, upper=0.5, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        return replace(frame, factors=(*frame.factors, Factor("rhoA", ("all",), 1.0 + values[0])))


class Plain:
    """Be an effect by its methods alone, without any base class."""

    name = "plain-skin"

    def places(self, model: Model) -> Sequence[str]:
        return Skin().places(model)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("more", "", 0.1, lower=-0.9),)

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        return Skin().extend(model, place, values)


@hookimpl
def femubench_effects() -> Iterable[object]:
    return [Skin, Bare, Plain]
