"""A place where data, or what was typed in, may be wrong, and what is right if they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from femubench.core.fem.model import Model
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import EffectParameter

Corrected = tuple[Model, Measurement]


@dataclass(frozen=True)
class Suspect:
    """A fault at a place.

    Arguments:
        place: ``mode:3``, ``sensor:S5``, ``sensor:S5+S7``, ``material:steel``, ``section:tube``,
            ``support:A:z``, ``data``, ...
        words: what is wrong, as a clause: ``"sensor S5 reads with the wrong sign"``.
        corrected: from model, measurement and the value of the parameter to both as they are
            right; the one that is not wrong is handed back as it is. What is measured may be
            exchanged and multiplied. The measurement may hold more modes than the suspect was
            found in.
        parameter: what has to be estimated, such as a gain; the value is 0 without one.
        known: what is known without, such as a factor of 1000, by name.
        blatant: whether what was typed in cannot be, so that it is tried before everything else.
    """

    place: str
    words: str
    corrected: Callable[[Model, Measurement, float], Corrected]
    parameter: EffectParameter | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    blatant: bool = False
