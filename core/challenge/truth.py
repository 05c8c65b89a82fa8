"""What a blind case hides, and the frame that has it: of a finer class than the nominal model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from femubench.core.effect.frame_effect import FrameEffect
from femubench.core.fem.frame import Factor, Frame

DataKind = Literal["A", "B", "C"]
Hidden = Literal["one", "none", "pair", "outside"]
KINDS: tuple[DataKind, ...] = ("A", "B", "C")
HIDDEN: tuple[Hidden, ...] = ("one", "none", "pair", "outside")
_REFINEMENT = 2


@dataclass(frozen=True)
class HiddenCause:
    """One thing that the nominal model lacks.

    Arguments:
        effect: its slug.
        place: where it sits, in the words of the nominal model.
        names: of its parameters.
        values: of its parameters, on the nominal mesh.
        units: of its parameters.
        half: 0, or which half (1, 2) of the one nominal element has all of the effect.
    """

    effect: str
    place: str
    names: tuple[str, ...]
    values: tuple[float, ...]
    units: tuple[str, ...]
    half: Literal[0, 1, 2] = 0

    def __str__(self) -> str:
        items = zip(self.names, self.values, self.units, strict=True)
        sizes = ", ".join(f"{name} {value:.4g} {unit}".strip() for name, value, unit in items)
        return f"{self.effect} at {self.place} ({sizes})"


@dataclass(frozen=True)
class Truth:
    """What was drawn; together with the code it gives the case again.

    Arguments:
        seed: of the draw.
        kind: of the data.
        structure: name of the nominal structure.
        hidden: how much is hidden.
        causes: the effects of the catalogue that the model lacks.
        outside: what it lacks that no effect of the catalogue describes; empty for none.
        excess: chi-square that the best single effect of the catalogue leaves of ideal data.
        scatter: standard deviation of every element's stiffness and mass, relative.
        digest: of the case as it was written; empty for a case in memory.
    """

    seed: int
    kind: DataKind
    structure: str
    hidden: Hidden
    causes: tuple[HiddenCause, ...] = ()
    outside: str = ""
    excess: float = 0.0
    scatter: float = 0.0
    digest: str = ""

    def __str__(self) -> str:
        return self.outside or " + ".join(map(str, self.causes)) or "nothing"


def finer(frame: Frame) -> Frame:
    """Return a frame on a mesh twice as fine, with the mass matrix that converges to its theory."""
    members = (replace(m, elements=_REFINEMENT * m.elements) for m in frame.members)
    return replace(frame, members=tuple(members), bending_mass="shear-consistent")


def element_of(place: str) -> tuple[str, int] | None:
    """Return member and number of a place ``member/k``; None for any other place."""
    member, slash, number = place.rpartition("/")
    return (member, int(number)) if slash and number.isdigit() else None


def fine_places(place: str) -> tuple[str, ...]:
    """Return what a place of the nominal mesh is on the finer one."""
    element = element_of(place)
    if element is None:
        return (place,)
    member, k = element
    return tuple(f"{member}/{_REFINEMENT * (k - 1) + i}" for i in range(1, _REFINEMENT + 1))


def with_causes(
    frame: Frame, causes: Sequence[HiddenCause], effects: Mapping[str, FrameEffect]
) -> Frame:
    """Return the finer frame with the causes in it, by the effects' own words.

    Arguments:
        frame: on the finer mesh.
        causes: in the words of the nominal model.
        effects: by name.

    Raises:
        ModelError: when an effect cannot sit where another one sits.
    """
    for cause in causes:
        effect, places = effects[cause.effect], fine_places(cause.place)
        values = (effect.in_half(cause.values) if cause.half else None) or cause.values
        for place in places[cause.half - 1 : cause.half] if cause.half else places:
            frame = effect.frame(frame, place, values)
    return frame


def scatter_elements(frame: Frame, scatter: float, rng: np.random.Generator) -> Frame:
    """Return the finer frame with the stiffness and mass of every nominal element scattered.

    Arguments:
        frame: on the finer mesh.
        scatter: standard deviation, relative.
        rng: where the numbers come from.
    """
    labels = [
        f"{member.name}/{k}"
        for member in frame.members
        for k in range(1, member.elements // _REFINEMENT + 1)
    ]
    draws = 1.0 + scatter * rng.standard_normal((len(labels), 2))
    factors = tuple(
        Factor(quantity, fine_places(label), float(value))
        for label, row in zip(labels, draws, strict=True)
        for quantity, value in zip(("E", "density"), row, strict=True)
    )
    return replace(frame, factors=frame.factors + factors)
