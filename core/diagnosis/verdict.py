"""From probabilities to a verdict: nothing, a name, a group, unknown, not confirmed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.special import expit

from femubench.core.effect.places import bare_place
from femubench.core.inference.posterior import (
    Explanation,
    Key,
    Posterior,
    fits_better,
)
from femubench.core.inference.search import adequacy
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Verdict
from femubench.core.ties import alike, by_probability


@dataclass(frozen=True)
class Decision:
    """A verdict with the explanations that it rests on.

    Arguments:
        verdict: see `Verdict`.
        group: the names that stay, most probable first; the first one is the best guess.
        nothing: probability that nothing is missing.
        angles: of every name of the group to the first one, degrees.
        held: probability that any known explanation holds, at most; below 1 where what is left, or
            unseen data, speak against all of them.
        unconfirmed: whether there are no unseen data that could have spoken against it.
        shared: of a group that is named for what its names have in common, these causes.
    """

    verdict: Verdict
    group: tuple[Key, ...]
    nothing: float
    angles: tuple[float, ...] = ()
    held: float = 1.0
    unconfirmed: bool = False
    shared: Key = ()


@dataclass(frozen=True)
class Sufficiency:
    """Whether a statement is enough: of a cause, of nothing, or of a fault of the data.

    Arguments:
        left: probability of what it leaves of the used data, were it noise under model error.
        own: share of what differs that it leaves to its own error, or to one not in the reference.
        log_bayes: ln of its Bayes factor against nothing added, on data that it has not seen.
        holds: whether these data get no worse by it.
        tells: whether they could.
    """

    left: float
    own: float = 0.0
    log_bayes: float = 0.0
    holds: bool = True
    tells: bool = True

    @property
    def explains(self) -> bool:
        """Tell whether what is left is noise, and its own error as small as of right causes."""
        return self.left > settings.noise_p and self.own <= settings.largest_own_error


def angle_between(first: Explanation, second: Explanation) -> float:
    """Return the largest principal angle of two sensitivity subspaces in degrees.

    Each is spanned by the derivatives of the prediction at the best fit, in units of the noise;
    nan where one of them is empty.
    """
    one, two = (e.fit.state.jacobian for e in (first, second))
    one, two = (j[:, np.linalg.norm(j, axis=0) > 0.0] for j in (one, two))
    if one.shape[1] == 0 or two.shape[1] == 0:
        return float("nan")
    return float(np.degrees(la.subspace_angles(one, two)[0]))


def decide(
    posterior: Posterior, leader: Explanation, test: Sufficiency, differs: bool | None = None
) -> Decision:
    """Return the verdict: what the evidence prefers, where it is sufficient.

    Arguments:
        posterior: all explanations.
        leader: the most probable explanation, or what unseen data bear out in its place.
        test: of the leader.
        differs: whether the measurement differs from that of the reference, whatever any model
            says; None without a reference. What does not differ has no cause, what does has one.
    """
    nothing = posterior.names.get((), 0.0)
    if differs is False:
        return Decision("none", (), nothing)
    if nothing >= settings.nothing_missing:
        enough = test.explains and not differs
        held = 1.0 if test.explains else most_believed(test.left)
        return Decision("none" if enough else "unknown", (), nothing * held, (), held)
    group, angles = inseparable(posterior, leader)
    if not test.explains:
        held = most_believed(test.left) if test.left < settings.noise_p else 1.0
        return Decision("unknown", group, nothing * held, angles, held)
    if not test.holds:
        held = float(expit(min(test.log_bayes, 0.0)))
        return Decision("not-confirmed", group, nothing, angles, held)
    shared = find_shared(posterior, group[0]) if len(group) > 1 else ()
    verdict: Verdict = "ambiguous" if len(group) > 1 and not shared else "named"
    return Decision(verdict, group, nothing, angles, 1.0, not test.tells, shared)


def find_shared(posterior: Posterior, first: Key) -> Key:
    """Return the causes of a name that nearly all have, where these alone leave noise."""
    shared = tuple(name for name in first if posterior.inclusion(name) >= settings.nearly_all)
    # Each once: the same effect at two places is one more cause.
    once = (e for e, _ in posterior.members(shared) if len(set(e.searched)) == len(e.searched))
    left = (adequacy(e.fit.state, e.unknowns) for e in once)
    return shared if max(left, default=0.0) > settings.noise_p else ()


def most_believed(p: float) -> float:
    """Return the most that can be believed of a hypothesis that data contradict, at even odds.

    Arguments:
        p: probability of data as far off, were it true; below 1 / e.

    Source: Sellke, Bayarri & Berger (2001), Am. Stat. 55, 62-71: the least Bayes factor
    -e p ln p.
    """
    factor = -np.e * p * np.log(p) if p > 0.0 else 0.0
    return float(factor / (1.0 + factor))


def inseparable(
    posterior: Posterior, leader: Explanation | None = None
) -> tuple[tuple[Key, ...], tuple[float, ...]]:
    """Return the best name with all that these data cannot exclude, and their angles to it.

    These are the most probable names that cover nearly all of what is not nothing, and those that
    fit about as well with no more values, whatever their prior says. A name with further causes
    contradicts none that it holds.

    Arguments:
        posterior: all explanations.
        leader: what stands first, and the angles are to; the most probable one by default.
    """
    names = {key: p for key, p in posterior.names.items() if key}
    something = sum(names.values())
    best = posterior.best(next(iter(names))) if leader is None else leader
    first = posterior.key(best)
    group = [first]
    covered = sum(p for key, p in names.items() if set(first) <= set(key)) / something
    for key, p in names.items():
        if len(group) == settings.largest_group:
            break
        if set(first) <= set(key):
            continue
        if covered < settings.nearly_all or fits_as_well(posterior, best, key):
            group.append(key)
            covered += p / something
    angles = (angle_between(best, posterior.best(key)) for key in group[1:])
    return tuple(group), (0.0, *angles)


def fits_as_well(posterior: Posterior, best: Explanation, key: Key) -> bool:
    """Tell whether a name explains the data about as well as the best one, with no more values."""
    return any(
        fits_better(best, other) <= settings.as_well and other.unknowns <= best.unknowns
        for other, _ in posterior.members(key)
    )


def places_of(posterior: Posterior, explanation: Explanation, part: int) -> dict[str, float]:
    """Return where one cause of an explanation sits, most probable place first.

    All explanations of the same name count, whatever comes with the cause; where the effect is in
    them several times, what sits where the others of it sit here is left to those. A place is one
    however many values the effect has there.

    Arguments:
        posterior: what the explanation was weighed in.
        explanation: one of its explanations.
        part: position of the cause among its parts.
    """
    own = explanation.parts[part].hypothesis
    words = {bare_place(own.place): own.place}

    def places_in(e: Explanation) -> list[str]:
        found = (q.hypothesis.place for q in e.parts if q.hypothesis.name == own.name)
        return [words.setdefault(bare_place(place), place) for place in found]

    taken = places_in(explanation)
    taken.remove(own.place)
    shares: dict[str, float] = {}
    for other, p in posterior.members(posterior.key(explanation)):
        places = places_in(other)
        free = [place for place in places if place not in taken] or places
        for place in free:
            shares[place] = shares.get(place, 0.0) + p / len(free)
    total = sum(shares.values())
    return {place: shares[place] / total for place in by_probability(shares)}


def credible(shares: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return the fewest places with 95 % of the probability, and all that tie with the last.

    Arguments:
        shares: probability of every place, most probable first.
    """
    found: list[tuple[str, float]] = []
    covered = 0.0
    for place, share in shares.items():
        if covered >= settings.nearly_all and not alike(share, found[-1][1]):
            break
        found.append((place, share))
        covered += share
    return tuple(found)


def fitted_otherwise(posterior: Posterior, explanation: Explanation) -> list[Explanation]:
    """Return the same name where what is fitted is taken from a handbook, or the reverse."""
    found: dict[Key, Explanation] = {}
    for other, _ in posterior.members(posterior.key(explanation)):
        if set(other.searched) != set(explanation.searched):
            found.setdefault(other.searched, other)
    return list(found.values())


def elsewhere(posterior: Posterior, explanation: Explanation) -> list[Explanation]:
    """Return the same name at other places that the data do not exclude, most probable first."""
    sets = [
        {place for place, _ in credible(places_of(posterior, explanation, k))}
        for k in range(len(explanation.parts))
    ]
    found: dict[str, Explanation] = {}
    for other, _ in posterior.members(posterior.key(explanation)):
        if len(other.parts) == len(explanation.parts) and other.place != explanation.place:
            within = all(p.hypothesis.place in set().union(*sets) for p in other.parts)
            if within:
                found.setdefault(other.place, other)
    return list(found.values())
