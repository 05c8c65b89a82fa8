"""Random truths for a blind case, before anybody asks whether they are sensible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from femubench.core.case.case import TOLERANCE
from femubench.core.challenge.measuring import QUALITY, Seen, chi2, record, see
from femubench.core.challenge.outside import OUTSIDE, SENSOR_FAULTS
from femubench.core.challenge.sizes import Site, draw_values
from femubench.core.challenge.structures import Specimen, structure_named
from femubench.core.challenge.truth import (
    LOSS,
    DataKind,
    TrueCause,
    finer,
    scattered,
    with_causes,
)
from femubench.core.challenge.visibility import unexplained
from femubench.core.diagnosis.effect import FrameEffect
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame
from femubench.core.measurement import Measurement
from femubench.core.modal.pairing import pair_modes
from femubench.core.model import Model
from femubench.core.typing import FloatArray

VISIBLE = 30.0  # of chi-square on ideal data: for either of a pair, and for what is outside
_LARGEST_MOVE = 0.4  # of a frequency
_HALF = 0.3  # share of local losses that fill one half of their element

Effects = Mapping[str, FrameEffect]


@dataclass(frozen=True)
class Candidate:
    """A possible truth.

    Arguments:
        frame: that has the causes.
        causes, outside, excess: as in `Truth`.
        sensors: what faulty sensors make of the readings, (n_sensors, n_sensors); None where
            all are right.
    """

    frame: Frame
    causes: tuple[TrueCause, ...] = ()
    outside: str = ""
    excess: float = 0.0
    sensors: FloatArray | None = None

    @cached_property
    def model(self) -> Model:
        """Return the model of the frame."""
        return Model.of(self.frame)

    def seen(self, model: Model, specimen: Specimen) -> Seen:
        """Return what the sensors show of a model."""
        seen = see(model, specimen)
        if self.sensors is None:
            return seen
        return replace(seen, readings=self.sensors @ seen.readings)


@lru_cache(maxsize=16)
def _clean(structure: str) -> Seen:
    """Return what an ideal test sees of the structure without any fault, on the finer mesh."""
    specimen = structure_named(structure)
    return see(Model.of(finer(specimen.frame)), specimen)


@lru_cache(maxsize=256)
def _places(structure: str, effect: FrameEffect) -> tuple[str, ...]:
    """Return where an effect may sit on a structure."""
    return tuple(effect.places(structure_named(structure).model))


@dataclass(frozen=True)
class Candidates:
    """A source of random truths for one structure.

    Arguments:
        specimen: the structure.
        kind: of the data.
        effects: the catalogue by name.
        scatter: standard deviation of every element's stiffness and mass, relative.
        rng: of effects, places and sizes.
        scatter_words: the seed of the scatter, which is the same for all candidates.
    """

    specimen: Specimen
    kind: DataKind
    effects: Effects
    scatter: float
    rng: np.random.Generator
    scatter_words: np.random.SeedSequence

    @property
    def clean(self) -> Seen:
        """Return what an ideal test sees of the structure without any fault."""
        return _clean(self.specimen.name)

    @cached_property
    def places(self) -> dict[str, tuple[str, ...]]:
        """Return the places of every effect that applies to the structure."""
        name = self.specimen.name
        found = {key: _places(name, effect) for key, effect in self.effects.items()}
        return {name: places for name, places in found.items() if places}

    @property
    def strangers(self) -> tuple[str, ...]:
        """Return the causes outside the catalogue that the kind of data can show."""
        return tuple(key for key in OUTSIDE if self.kind != "C" or key not in SENSOR_FAULTS)

    def cause(self, name: str) -> TrueCause:
        """Return an effect at a random place, of random size."""
        place = str(self.rng.choice(self.places[name]))
        parameters = tuple(self.effects[name].parameters(self.specimen.model, place))
        values = draw_values(name, parameters, Site(self.specimen, self.clean, place), self.rng)
        half = name == LOSS and self.rng.random() < _HALF
        return TrueCause(
            effect=name,
            place=place,
            names=tuple(parameter.name for parameter in parameters),
            values=values,
            units=tuple(parameter.unit for parameter in parameters),
            half=(1 if self.rng.random() < 0.5 else 2) if half else 0,
        )

    def causes(self, *causes: TrueCause) -> Candidate:
        """Return the truth that has these causes and the scatter of the draw."""
        frame = finer(self.specimen.frame)
        if self.scatter > 0.0:
            frame = scattered(frame, self.scatter, np.random.default_rng(self.scatter_words))
        return Candidate(with_causes(frame, causes, self.effects), causes)

    def nothing(self) -> Candidate:
        """Return the truth of a clean case."""
        return self.causes()

    def one(self, effect: str | None) -> Candidate:
        """Return a truth with one effect."""
        return self.causes(self.cause(effect or str(self.rng.choice(list(self.places)))))

    def pair(self, effect: str | None) -> Candidate:
        """Return a truth with two effects, either of which shows beside the other.

        Raises:
            ModelError: when it does not, or both sit at one place.
        """
        first, second = (str(name) for name in self.rng.choice(list(self.places), 2, replace=False))
        if effect is not None:
            first, second = effect, first if first != effect else second
        causes = self.cause(first), self.cause(second)
        if causes[0].place == causes[1].place:
            raise ModelError("two effects at one place")
        drawn = self.causes(*causes)
        ideal = self.ideal(drawn)
        for cause in causes:
            single = self.causes(cause)
            if chi2(ideal, see(single.model, self.specimen)) < VISIBLE:
                raise ModelError("one of the two is too small")
        return drawn

    def outside(self, name: str | None) -> Candidate:
        """Return a truth with a cause outside the catalogue that shows, and that none imitates.

        Raises:
            ModelError: when it does not show, or a single effect explains the data as well.
            IndexError: when the structure has no place for it.
        """
        name = name or str(self.rng.choice(self.strangers))
        count = len(self.specimen.points)
        found = OUTSIDE[name](self.nothing().frame, count, self.rng)
        drawn = Candidate(found.frame, outside=found.text, sensors=found.sensors)
        ideal = self.ideal(drawn)
        if chi2(ideal, self.clean) < VISIBLE:
            raise ModelError("the cause is too small")
        excess = unexplained(self.specimen.model, ideal, self.effects.values(), TOLERANCE)
        if excess < VISIBLE:
            raise ModelError("an effect of the catalogue imitates the cause")
        return replace(drawn, excess=excess)

    def ideal(self, drawn: Candidate) -> Measurement:
        """Return the used data without noise."""
        quality = QUALITY[self.kind]
        seen = drawn.seen(drawn.model, self.specimen)
        return record(
            seen, self.specimen, self.kind, quality.used, None, shapes_up_to=quality.shapes
        )

    def check(self, seen: Seen) -> None:
        """Refuse an absurd truth.

        Raises:
            ModelError: when a frequency has moved too far, or the modes cannot be recognised.
        """
        used = QUALITY[self.kind].used
        clean = self.clean
        pairs = pair_modes(
            clean.frequencies[:used], clean.readings[:, :used], seen.frequencies, seen.readings
        ).index
        found = pairs >= 0
        moved = seen.frequencies[pairs[found]] / clean.frequencies[:used][found] - 1.0
        if 2 * found.sum() < used or np.abs(moved).max() > _LARGEST_MOVE:
            raise ModelError("the effect is absurdly large")
