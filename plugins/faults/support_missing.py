"""A support that was forgotten, or that is not there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

from femubench import Measurement, Model
from femubench.effect import Suspect
from femubench.fem import Frame, Place, Support


class SupportMissing:
    """A support lacks in the model, in one direction or in all, or is one too many there."""

    name: ClassVar[str] = "support-missing"
    side: ClassVar[Literal["input"]] = "input"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every support, and unless it hangs free every joint, held as others or one way."""
        if model.structure is None:
            return []
        frame = model.structure.frame
        return [*_too_many(frame), *(() if frame.free else _forgotten(frame))]


def _forgotten(frame: Frame) -> Iterator[Suspect]:
    """Yield supports at joints: as those that there are, in all directions, in single ones."""
    every = frame.active
    patterns = dict.fromkeys(tuple(sorted(s.fixed, key=every.index)) for s in frame.supports)
    patterns = dict.fromkeys((*patterns, every, *((direction,) for direction in every)))
    held = {(str(s.at), direction) for s in frame.supports for direction in s.fixed}
    for joint in frame.joints:
        for fixed in patterns:
            free = tuple(d for d in fixed if (joint.name, d) not in held)
            if free != fixed:
                continue
            support = Support(Place(joint=joint.name), fixed)
            where = _place(joint.name, fixed if len(fixed) == 1 else ())
            words = f"a support at {joint.name} is forgotten ({', '.join(fixed)})"
            yield Suspect(where, words, partial(_held, (*frame.supports, support)))


def _too_many(frame: Frame) -> Iterator[Suspect]:
    """Yield the supports there are, whole and direction by direction."""
    for i, support in enumerate(frame.supports):
        rest = (*frame.supports[:i], *frame.supports[i + 1 :])
        words = f"the support at {support.at} does not hold"
        yield Suspect(_place(str(support.at), ()), words, partial(_held, rest))
        for direction in support.fixed if len(support.fixed) > 1 else ():
            left = tuple(d for d in support.fixed if d != direction)
            yield Suspect(
                _place(str(support.at), (direction,)),
                f"{words} in direction {direction}",
                partial(_held, (*rest, replace(support, fixed=left))),
            )


def _place(at: str, direction: Sequence[str]) -> str:
    return ":".join(["support", at, *direction])


def _held(
    supports: tuple[Support, ...], model: Model, measurement: Measurement, value: float
) -> tuple[Model, Measurement]:
    structure = model.frame_structure
    frame = replace(structure.frame, supports=supports)
    return Model.of(structure.rebuilt(frame)), measurement
