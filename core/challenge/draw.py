"""Draw a blind case: a nominal model, data of a truth that differs from it, and that truth."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from zlib import crc32

import numpy as np

from femubench.core.case.case import TOLERANCE, Case, Modification
from femubench.core.challenge.measuring import QUALITY, Ideal, add_mass, chi2, record, see
from femubench.core.challenge.outside import OUTSIDE, SENSOR_FAULTS
from femubench.core.challenge.structures import Specimen, structure_named
from femubench.core.challenge.truth import (
    HIDDEN,
    KINDS,
    DataKind,
    Hidden,
    HiddenCause,
    Truth,
    element_of,
    finer,
    scatter_elements,
    with_causes,
)
from femubench.core.challenge.visibility import find_unexplained
from femubench.core.change.parameter import Parameter
from femubench.core.effect.frame_effect import FrameEffect
from femubench.core.effect.sizes import Site, Size
from femubench.core.errors import FemubenchError, InputError, ModelError
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_modes
from femubench.core.typing import FloatArray

VISIBLE = 30.0  # of chi-square on ideal data: for either of a pair, and for what is outside
_LARGEST_MOVE = 0.4  # of a frequency
_HALF = 0.3  # share of effects in one element that fill but one half of it
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
    causes: tuple[HiddenCause, ...] = ()
    outside: str = ""
    excess: float = 0.0
    sensors: FloatArray | None = None

    @cached_property
    def model(self) -> Model:
        """Return the model of the frame."""
        return Model.of(self.frame)

    def observe(self, model: Model, specimen: Specimen) -> Ideal:
        """Return what the sensors show of a model."""
        seen = see(model, specimen)
        if self.sensors is None:
            return seen
        return replace(seen, readings=self.sensors @ seen.readings)


@lru_cache(maxsize=16)
def _clean(structure: str) -> Ideal:
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
    def clean(self) -> Ideal:
        """Return what an ideal test sees of the structure without any fault."""
        return _clean(self.specimen.name)

    @cached_property
    def places(self) -> dict[str, tuple[str, ...]]:
        """Return the places of every effect that applies to the structure."""
        name = self.specimen.name
        found = {key: _places(name, effect) for key, effect in self.effects.items()}
        return {name: places for name, places in found.items() if places}

    @property
    def drawn(self) -> list[str]:
        """Return the effects to choose from: what refines one is often like it."""
        return [n for n in self.places if getattr(self.effects[n], "refines", None) is None]

    @property
    def outsiders(self) -> tuple[str, ...]:
        """Return the causes outside the catalogue that the kind of data can show."""
        return tuple(key for key in OUTSIDE if self.kind != "C" or key not in SENSOR_FAULTS)

    def cause(self, name: str) -> HiddenCause:
        """Return an effect at a random place, of random size."""
        place = str(self.rng.choice(self.places[name]))
        effect = self.effects[name]
        parameters = tuple(effect.parameters(self.specimen.model, place))
        site = Site(self.specimen.frame, place, self.clean.mass, self.clean.frequencies)
        values = draw_values(effect.sizes, parameters, site, self.rng)
        narrow = element_of(place) is not None and effect.in_half(values) is not None
        half = narrow and self.rng.random() < _HALF
        return HiddenCause(
            effect=name,
            place=place,
            names=tuple(parameter.name for parameter in parameters),
            values=values,
            units=tuple(parameter.unit for parameter in parameters),
            half=(1 if self.rng.random() < 0.5 else 2) if half else 0,
        )

    def causes(self, *causes: HiddenCause) -> Candidate:
        """Return the truth that has these causes and the scatter of the draw."""
        frame = finer(self.specimen.frame)
        if self.scatter > 0.0:
            frame = scatter_elements(frame, self.scatter, np.random.default_rng(self.scatter_words))
        return Candidate(with_causes(frame, causes, self.effects), causes)

    def nothing(self) -> Candidate:
        """Return the truth of a clean case."""
        return self.causes()

    def one(self, effect: str | None) -> Candidate:
        """Return a truth with one effect."""
        return self.causes(self.cause(effect or str(self.rng.choice(self.drawn))))

    def pair(self, effect: str | None) -> Candidate:
        """Return a truth with two effects, either of which shows when the other is known.

        Raises:
            ModelError: when it does not, or both sit at one place.
        """
        first, second = (str(name) for name in self.rng.choice(self.drawn, 2, replace=False))
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
        name = name or str(self.rng.choice(self.outsiders))
        count = len(self.specimen.points)
        found = OUTSIDE[name](self.nothing().frame, count, self.rng)
        drawn = Candidate(found.frame, outside=found.text, sensors=found.sensors)
        ideal = self.ideal(drawn)
        if chi2(ideal, self.clean) < VISIBLE:
            raise ModelError("the cause is too small")
        excess = find_unexplained(self.specimen.model, ideal, self.effects.values(), TOLERANCE)
        if excess < VISIBLE:
            raise ModelError("an effect of the catalogue imitates the cause")
        return replace(drawn, excess=excess)

    def ideal(self, drawn: Candidate) -> Measurement:
        """Return the used data without noise."""
        quality = QUALITY[self.kind]
        seen = drawn.observe(drawn.model, self.specimen)
        return record(
            seen, self.specimen, self.kind, quality.used, None, shapes_up_to=quality.shapes
        )

    def check(self, seen: Ideal) -> None:
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


def draw_values(
    sizes: Sequence[Size],
    parameters: Sequence[Parameter],
    site: Site,
    rng: np.random.Generator,
) -> tuple[float, ...]:
    """Return random values of an effect's parameters within their bounds.

    Arguments:
        sizes: ranges of the parameters, the last one for all that follow; where there are none
            the values come from half a deviation to two of the prior.
        parameters: of the effect.
        site: where it sits.
        rng: where the numbers come from.
    """
    ranges = [sizes[min(i, len(sizes) - 1)] if sizes else None for i in range(len(parameters))]
    values = []
    for parameter, size in zip(parameters, ranges, strict=True):
        if size is not None:
            value = size.draw(site, rng)
        else:
            x = float(rng.uniform(0.5, 2.0))
            if not parameter.one_sided and rng.random() < 0.5:
                x = -x
            value = float(parameter.value(float(np.clip(x, *parameter.range))))
        values.append(float(np.clip(value, parameter.lower, parameter.upper)))
    return tuple(values)


_ATTEMPTS = 200
_LARGEST_SCATTER = 0.05
_WEIGHED = 0.5  # share of cases with a known mass, where there are shapes


@dataclass(frozen=True)
class BlindCase:
    """A case and what it hides."""

    case: Case
    truth: Truth


@lru_cache(maxsize=8)
def registered_effects(*named: str) -> Effects:
    """Return the effects on frames that come with femubench, and those named, by name.

    Blind cases have no reference, with which alone some are sought.

    Arguments:
        named: effects of any plugin, which is imported here; unknown names are left out.
    """
    from femubench.core.plugin import loader

    found = {effect.name: effect for effect in loader.list_effects()}
    if not set(named) <= set(found):
        offered = loader.load_plugins().effects
        found |= {name: offered[name] for name in named if name in offered}
    frames = {name: e for name, e in sorted(found.items()) if isinstance(e, FrameEffect)}
    return {name: effect for name, effect in frames.items() if not effect.acquired}


def draw_case(
    seed: int,
    kind: DataKind,
    *,
    structure: str = "ladder",
    hidden: Hidden = "one",
    effect: str | None = None,
    scatter: float = 0.0,
    effects: Effects | None = None,
) -> BlindCase:
    """Draw a blind case; the same arguments give the same case.

    Arguments:
        seed: of everything that is random.
        kind: how good the data are, see `QUALITY`.
        structure: one of `STRUCTURES`.
        hidden: one effect, none, a pair, or a cause outside the catalogue.
        effect: the effect to hide, or the one outside; None for a random one.
        scatter: standard deviation of every element's stiffness and mass, relative.
        effects: the catalogue by name; None for those that come with femubench and `effect`.

    Raises:
        InputError: for an unknown structure, kind or effect, or one that does not fit there.
        FemubenchError: when no sensible truth was met in many draws.
    """
    specimen = structure_named(structure)
    if not 0.0 <= scatter <= _LARGEST_SCATTER:
        expected = f"a number >= 0 and <= {_LARGEST_SCATTER}"
        raise InputError(f"scatter {scatter}", key="scatter", expected=expected)
    words = [seed, KINDS.index(kind), crc32(structure.encode()), HIDDEN.index(hidden)]
    choice, elements, noise = np.random.SeedSequence(words).spawn(3)
    named = () if effect is None or hidden == "outside" else (effect,)
    catalogue = registered_effects(*named) if effects is None else effects
    candidates = Candidates(
        specimen, kind, catalogue, scatter, np.random.default_rng(choice), elements
    )
    if hidden != "none":
        known = tuple(candidates.outsiders if hidden == "outside" else candidates.places)
        if effect is not None and effect not in known:
            what = f"{effect!r} cannot be hidden in {structure}"
            raise InputError(what, key="effect", expected=f"one of {', '.join(known)}")
        if not known:
            raise InputError("no effect can be hidden", expected="a plugin with effects")
    drawn, seen = _accepted(candidates, hidden, effect)
    case = _case(candidates, drawn, seen, np.random.default_rng(noise))
    truth = Truth(seed, kind, structure, hidden, drawn.causes, drawn.outside, drawn.excess, scatter)
    return BlindCase(case, truth)


def _accepted(
    candidates: Candidates, hidden: Hidden, effect: str | None
) -> tuple[Candidate, Ideal]:
    """Return the first sensible truth and what an ideal test sees of it."""
    draws: dict[Hidden, Callable[[], Candidate]] = {
        "none": candidates.nothing,
        "one": partial(candidates.one, effect),
        "pair": partial(candidates.pair, effect),
        "outside": partial(candidates.outside, effect),
    }
    for _ in range(_ATTEMPTS):
        try:
            drawn = draws[hidden]()
            seen = drawn.observe(drawn.model, candidates.specimen)
            candidates.check(seen)
        except (ModelError, IndexError):
            continue
        return drawn, seen
    what = effect or f"{hidden} of random effects"
    raise FemubenchError(f"no sensible truth in {_ATTEMPTS} draws of {what}")


def _case(candidates: Candidates, drawn: Candidate, seen: Ideal, rng: np.random.Generator) -> Case:
    """Return the case that the owner of the nominal model would have after the test."""
    specimen, kind, quality = candidates.specimen, candidates.kind, QUALITY[candidates.kind]
    count = quality.used + quality.held_out
    measurement = record(seen, specimen, kind, count, rng, shapes_up_to=quality.shapes)
    if kind != "C" and rng.random() < _WEIGHED:
        measurement = add_mass(measurement, seen.mass, rng)
    changed = drawn.observe(drawn.model.attach(*specimen.change), specimen)
    modified = record(changed, specimen, kind, quality.modified, rng)
    name = f"blind-{hashlib.sha256(measurement.frequencies.tobytes()).hexdigest()[:8]}"
    return Case(
        name=name,
        title=specimen.title,
        source="Computed from a hidden truth, with random noise; not measured",
        folder=Path(name),
        model=specimen.model,
        measurement=measurement,
        used=tuple(range(1, quality.used + 1)),
        held_out=tuple(range(quality.used + 1, count + 1)),
        modifications=(Modification(specimen.change_name, *specimen.change, modified),),
    )
