"""Draw a blind case: a nominal model, data of a truth that differs from it, and that truth."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from zlib import crc32

import numpy as np

from femubench.core.case.case import Case, Modification
from femubench.core.challenge.candidates import Candidate, Candidates, Effects
from femubench.core.challenge.measuring import QUALITY, Seen, record, weighed
from femubench.core.challenge.structures import structure_named
from femubench.core.challenge.truth import HIDDEN, KINDS, DataKind, Hidden, Truth
from femubench.core.diagnosis.effect import FrameEffect
from femubench.core.errors import FemubenchError, InputError, ModelError

_ATTEMPTS = 200
_LARGEST_SCATTER = 0.05
_WEIGHED = 0.5  # share of cases with a known mass, where there are shapes


@dataclass(frozen=True)
class BlindCase:
    """A case and what it hides.

    Arguments:
        case: what may be shown.
        truth: what may not.
    """

    case: Case
    truth: Truth


@lru_cache(maxsize=1)
def registered_effects() -> Effects:
    """Return the effects on frames of all plugins, by name."""
    from femubench.core.plugin.loader import load_plugins

    offered = load_plugins().effects
    return {name: e for name, e in sorted(offered.items()) if isinstance(e, FrameEffect)}


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
        effects: the catalogue by name; None for those of all plugins.

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
    catalogue = registered_effects() if effects is None else effects
    candidates = Candidates(
        specimen, kind, catalogue, scatter, np.random.default_rng(choice), elements
    )
    _check_effect(candidates, hidden, effect)
    drawn, seen = _accepted(candidates, hidden, effect)
    case = _case(candidates, drawn, seen, np.random.default_rng(noise))
    truth = Truth(seed, kind, structure, hidden, drawn.causes, drawn.outside, drawn.excess, scatter)
    return BlindCase(case, truth)


def _check_effect(candidates: Candidates, hidden: Hidden, effect: str | None) -> None:
    """Refuse an effect that cannot be hidden.

    Raises:
        InputError: when it is unknown, or has no place on the structure.
    """
    if hidden == "none":
        return
    known = tuple(candidates.strangers if hidden == "outside" else candidates.places)
    if effect is not None and effect not in known:
        what = f"{effect!r} cannot be hidden in {candidates.specimen.name}"
        raise InputError(what, key="effect", expected=f"one of {', '.join(known)}")
    if not known:
        raise InputError("no effect can be hidden", expected="a plugin with effects")


def _accepted(candidates: Candidates, hidden: Hidden, effect: str | None) -> tuple[Candidate, Seen]:
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
            seen = drawn.seen(drawn.model, candidates.specimen)
            candidates.check(seen)
        except (ModelError, IndexError):
            continue
        return drawn, seen
    what = effect or f"{hidden} of random effects"
    raise FemubenchError(f"no sensible truth in {_ATTEMPTS} draws of {what}")


def _case(candidates: Candidates, drawn: Candidate, seen: Seen, rng: np.random.Generator) -> Case:
    """Return the case that the owner of the nominal model would have after the test."""
    specimen, kind, quality = candidates.specimen, candidates.kind, QUALITY[candidates.kind]
    count = quality.used + quality.held_out
    measurement = record(seen, specimen, kind, count, rng, shapes_up_to=quality.shapes)
    if kind != "C" and rng.random() < _WEIGHED:
        measurement = weighed(measurement, seen.mass, rng)
    changed = drawn.seen(drawn.model.attach(*specimen.change), specimen)
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
