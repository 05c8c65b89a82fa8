"""A base class for effects on frames."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import ClassVar

from femubench.core.change.change import Change
from femubench.core.change.parameter import Parameter
from femubench.core.change.tabulated import tabulate_change
from femubench.core.effect.reading import Reading
from femubench.core.effect.sizes import Size
from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.roles import Effect


class FrameEffect(Effect):
    """Base class of effects on frames: override `places`, `parameters` and `frame`.

    Attributes:
        name: a slug such as ``"loose-bolt"``.
        summary: what the model lacks, as a clause: ``"a bolt is loose"``.
        caution: a sentence for anyone who finds this effect named; a note of the diagnosis.
        softens: whether its stiffness may fall with the level of excitation, so that a second
            level is worth measuring.
        innate: whether it is there from the day that the structure was built, so that it cannot
            be what differs from a reference.
        acquired: whether it comes about later alone, so that it is sought with a reference only.
        handbook: whether handbooks give its values without any fit.
        refines: the slug of an effect of which it tells more at the same place: it is tried where
            that one is likely, and weighed with it.
        reading: the instrument that reads it directly; a proposal of the advice.
        sizes: how large it is in hidden cases, one range a parameter; of more parameters the last
            range goes on. Without one it is drawn from half a deviation of its prior to two.
    """

    name: ClassVar[str]
    summary: ClassVar[str] = ""
    caution: ClassVar[str] = ""
    softens: ClassVar[bool] = False
    innate: ClassVar[bool] = False
    acquired: ClassVar[bool] = False
    handbook: ClassVar[bool] = False
    refines: ClassVar[str | None] = None
    reading: ClassVar[Reading | None] = None
    sizes: ClassVar[Sequence[Size]] = ()

    @abstractmethod
    def places(self, model: Model) -> Sequence[str]:
        """Return where the effect may sit in this model; nothing where it does not apply."""

    @abstractmethod
    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return its parameters there."""

    @abstractmethod
    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the effect in it, written as ordinary keys of a case."""

    def tabulate(self, model: Model, place: str) -> Change:
        """Return what it does there, interpolated between values, as where there is no `change`.

        Raises:
            ModelError: for more than two parameters, or when the extended model has lost dofs.
        """
        return tabulate_change(self, model, place, self.parameters(model, place))

    def in_half(self, values: Sequence[float]) -> Sequence[float] | None:
        """Return what half an element needs for as much effect as `values` have in the whole.

        None, as here, where a hidden effect cannot fill one half of its element alone.
        """
        return None

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the effect in it."""
        structure = model.structure
        if structure is None:
            return self.extend_matrices(model, place, values)
        return Model.of(structure.rebuilt(self.frame(structure.frame, place, values)))

    @property
    def writes(self) -> Callable[[Frame, str, Sequence[float]], Frame] | None:
        """Return what writes the effect into a frame, where `extend` does no more; else None."""
        return self.frame if type(self).extend is FrameEffect.extend else None

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return a model that came as matrices with the effect in it: the terms of its `change`.

        Raises:
            NotApplicable: where it needs a frame.
        """
        change: Callable[[Model, str], Change] | None = getattr(self, "change", None)
        with suppress(NotApplicable):
            if change is not None:
                return change(model, place).add_to(model, values)
        raise NotApplicable(f"{self.name} needs a frame, not a pair of matrices")
