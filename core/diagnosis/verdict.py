"""From probabilities to a verdict: nothing, a name, a group, unknown, not confirmed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.special import expit

from femubench.core.diagnosis.scatter import overstatement
from femubench.core.effect.places import bare_place
from femubench.core.inference.posterior import (
    Explanation,
    Key,
    Posterior,
    fits_better,
)
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
    """

    verdict: Verdict
    group: tuple[Key, ...]
    nothing: float
    angles: tuple[float, ...]
    held: float = 1.0


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
    posterior: Posterior, adequate: float, leader: Explanation, log_bayes: float, confirmed: bool
) -> Decision:
    """Return the verdict.

    Arguments:
        posterior: all explanations.
        adequate: probability of what the leading explanation leaves, were it noise.
        leader: the most probable explanation, or what unseen data bear out in its place.
        log_bayes: ln of its Bayes factor on unseen data against nothing added.
        confirmed: whether unseen data bear it out.
    """
    nothing = posterior.names.get((), 0.0)
    if nothing >= settings.nothing_missing:
        held = 1.0 if adequate > settings.noise_p else most_believed(adequate)
        verdict: Verdict = "none" if adequate > settings.noise_p else "unknown"
        return Decision(verdict, (), nothing * held, (), held)
    group, angles = inseparable(posterior, leader)
    held = 1.0
    if adequate <= settings.noise_p:
        verdict, held = "unknown", most_believed(adequate)
        nothing *= held
    elif not confirmed:
        verdict, held = "not-confirmed", float(expit(min(log_bayes, 0.0)))
    else:
        verdict = "ambiguous" if len(group) > 1 and not mostly_common(posterior, group) else "named"
    return Decision(verdict, group, nothing, angles, held)


def most_believed(p: float) -> float:
    """Return the most that can be believed of a hypothesis that data contradict, at even odds.

    Arguments:
        p: probability of data as far off, were it true; below 1 / e.

    Source: Sellke, Bayarri & Berger (2001), Am. Stat. 55, 62-71: the least Bayes factor
    -e p ln p.
    """
    factor = -np.e * p * np.log(p) if p > 0.0 else 0.0
    return float(factor / (1.0 + factor))


def mostly_common(posterior: Posterior, group: Sequence[Key]) -> bool:
    """Tell whether the first name of a group stands, but for what hardly matters.

    What all names of the group share must be the first name as a whole, or rest on textbook
    physics, and carry most of what is explained, and all but few of them must be the first name
    with more in addition, or with one cause for another that acts alike: what is left of a real
    structure then goes by any name.
    """
    common = set(group[0]).intersection(*group[1:])
    best = posterior.best(group[0])
    if common != set(group[0]) and not common.intersection(best.base.names):
        return False
    share = sum(
        p for key, p in posterior.names.items() if _says_as_much(posterior, best, group[0], key)
    )
    if share < settings.common_share:
        return False
    nothing = next(e for e in posterior.explanations if not e.parts and not e.base.parts)
    core = [e.chi2 for e in posterior.explanations if set(posterior.key(e)) == common]
    explained = nothing.chi2 - min(core, default=np.inf)
    return bool(explained >= settings.explained_share * (nothing.chi2 - best.chi2))


def _says_as_much(posterior: Posterior, best: Explanation, first: Key, key: Key) -> bool:
    """Tell whether a name holds another one, or swaps one cause of it for its like."""
    if set(first) <= set(key):
        return True
    swapped = len(key) == len(first) and len(set(first) - set(key)) == 1
    if not swapped or posterior.names[key] < settings.parallel_rival_share:
        return False
    return angle_between(best, posterior.best(key)) < settings.parallel_angle


def inseparable(
    posterior: Posterior, leader: Explanation | None = None
) -> tuple[tuple[Key, ...], tuple[float, ...]]:
    """Return the best name with all that these data cannot exclude, and their angles to it.

    Not excluded is what is probable enough, and what fits about as well, whatever its prior says.

    Arguments:
        posterior: all explanations.
        leader: what stands first, and the angles are to; the most probable one by default.
    """
    names = {key: p for key, p in posterior.names.items() if key}
    something = sum(names.values())
    ranked = list(names)
    best = posterior.best(ranked[0])
    group, angles, covered = [ranked[0]], [0.0], names[ranked[0]] / something
    for key in ranked[1:]:
        if len(group) == settings.largest_group:
            break
        share = names[key] / something
        angle = angle_between(best, posterior.best(key))
        near = angle < settings.parallel_angle or covered < settings.covered_share
        least = settings.parallel_rival_share if near else settings.rival_share
        likely = share >= least
        if likely or fits_as_well(posterior, best, key):
            group.append(key)
            angles.append(angle)
            covered += share
    if leader is None or posterior.key(leader) == group[0]:
        return tuple(group), tuple(angles)
    first = posterior.key(leader)
    keys = (first, *(key for key in group if key != first))
    return keys, (0.0, *(angle_between(leader, posterior.best(key)) for key in keys[1:]))


def fits_as_well(posterior: Posterior, best: Explanation, key: Key) -> bool:
    """Tell whether a name explains the data about as well as the best explanation does.

    A name that only adds to the best one always does, and is left to its evidence. Where the
    stated deviations are too large, so are those of the likelihoods.
    """
    if set(posterior.key(best)) <= set(key):
        return False
    limit = settings.as_well / overstatement(best.fit.state) ** 2
    few = settings.few_values
    return any(
        fits_better(best, other) <= limit and abs(best.unknowns - other.unknowns) <= few
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
