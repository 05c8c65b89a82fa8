"""Explanations, and their probabilities by prior and evidence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from math import log

import numpy as np
from scipy.special import logsumexp

from femubench.core.fit.modal_fit import Fit, State, state_at
from femubench.core.fit.projection import Projection
from femubench.core.inference.prior import Base, log_prior, outside_odds
from femubench.core.inference.settings import settings
from femubench.core.ties import by_probability, in_order

Key = tuple[str, ...]


def _unpaired(state: State) -> int:
    """Return how many elastic modes lie below the last partner of a measured one, and are none."""
    below = state.eigenvalues[: int(state.partner.max()) + 1]
    return int((~state.problem.space.still(below)).sum()) - len(set(state.partner.tolist()))


@dataclass(frozen=True)
class Explanation:
    """A base with causes on top.

    Arguments:
        base: textbook effects.
        fit: of the causes; its parts are the causes, none for a model that lacks nothing more.
        names: number of effects that were candidates.
        further: ln of the density of data that the fit does not know, given those that it does.
    """

    base: Base
    fit: Fit
    names: int
    further: float = 0.0

    @property
    def parts(self) -> tuple[Projection, ...]:
        """Return the causes."""
        return self.fit.parts

    @property
    def chi2(self) -> float:
        """Return chi-square at the best fit."""
        return self.fit.state.chi2

    @property
    def log_likelihood(self) -> float:
        """Return ln of the probability of the data at the best fit, up to a constant of them."""
        return self.fit.state.problem.noise.log_density - 0.5 * self.chi2 + self.further

    @property
    def unknowns(self) -> int:
        """Return the number of values that were fitted."""
        return len(self.fit.state.x)

    @property
    def missed(self) -> int:
        """Return how many modes its causes add among the measured ones that were not measured."""
        added = sum(part.hypothesis.change.extra for part in self.parts)
        if not added:
            return 0
        state = self.fit.state
        drawn = state_at(replace(state.problem, offset=0.0), (), np.zeros(0))
        return max(min(added, _unpaired(state) - _unpaired(drawn)), 0)

    @property
    def log_evidence(self) -> float:
        """Return ln of the probability of all data, up to a constant of them."""
        return self.fit.log_evidence + self.further

    @cached_property
    def log_prior(self) -> float:
        """Return ln of the prior, and of what is improbable whatever the readings are."""
        missed = self.missed * log(settings.prior_missed_mode)
        prior = log_prior(self.parts, self.names, self._counts) + missed
        return self.base.log_prior + prior

    @property
    def _counts(self) -> tuple[float, ...]:
        further = settings.prior_of_further_causes
        return further if self.base.parts else settings.prior_of_causes

    @property
    def outside(self) -> float:
        """Return the odds that its causes only imitate one that no effect describes."""
        return outside_odds(len(self.parts), self._counts)

    @property
    def log_joint(self) -> float:
        """Return ln of prior times evidence."""
        return self.log_prior + self.log_evidence

    @cached_property
    def log_weight(self) -> float:
        """Return ln of prior times evidence, the latter as far as its noise is to be trusted."""
        trust = self.fit.state.problem.noise.trust
        return self.log_prior + trust * self.log_evidence

    @cached_property
    def searched(self) -> Key:
        """Return the slugs of the causes, sorted."""
        return tuple(sorted(part.hypothesis.name for part in self.parts))

    @cached_property
    def effects(self) -> frozenset[str]:
        """Return the slugs of all that is in the model, textbook or fitted."""
        return frozenset({*self.base.names, *self.searched})

    @property
    def tells_more(self) -> bool:
        """Tell whether an effect that tells more of another one is among the causes."""
        return any(part.hypothesis.stated is not None for part in self.parts)

    @property
    def place(self) -> str:
        """Return the places of the causes in the order of `searched`."""
        pairs = sorted((part.hypothesis.name, part.hypothesis.place) for part in self.parts)
        return " + ".join(place for _, place in pairs)


def fits_better(one: Explanation, other: Explanation) -> float:
    """Return ln of the likelihood ratio of two explanations: what the data say, no prior in it."""
    return one.log_likelihood - other.log_likelihood


def by_weight(explanations: Iterable[Explanation]) -> list[Explanation]:
    """Return explanations, most probable first; those that tie as they came."""
    return in_order(explanations, lambda e: -e.log_weight)


@dataclass(frozen=True)
class Posterior:
    """All explanations with their probabilities.

    Arguments:
        explanations: most probable first.
        probabilities: of each, (k,).
    """

    explanations: tuple[Explanation, ...]
    probabilities: tuple[float, ...]

    @classmethod
    def of(cls, explanations: Iterable[Explanation]) -> Posterior:
        """Weigh explanations against each other by prior and evidence."""
        ranked = by_weight(explanations)
        weights = np.array([e.log_weight for e in ranked])
        shares = np.exp(weights - logsumexp(weights))
        return cls(tuple(ranked), tuple(float(p) for p in shares))

    @cached_property
    def earned(self) -> frozenset[str]:
        """Return the textbook effects that the data made part of the name.

        Each by itself; and where none of several can be missed by itself, all that cannot be
        missed together.
        """
        likely = {name for e in self.explanations for name in e.base.names if self._likely(name)}
        alone = frozenset(name for name in likely if self._missed(frozenset({name})))
        rest = frozenset(likely - alone)
        return alone | rest if len(rest) > 1 and self._missed(rest) else alone

    def _likely(self, name: str) -> bool:
        pairs = zip(self.explanations, self.probabilities, strict=True)
        return sum(p for e, p in pairs if name in e.effects) >= settings.earned_probability

    def _missed(self, names: frozenset[str]) -> bool:
        """Tell whether the best explanation with textbook effects is much better than without.

        Better by the evidence and by the data alone. Textbook physics is weighed against the model
        without it, not against another effect that is fitted to stand for it; where nobody tried
        the same causes without it, the two textbook models alone are compared.
        """
        best = next((e for e in self.explanations if names <= set(e.base.names)), None)
        if best is None:
            return False
        rest, fitted = best.effects - names, tuple(n for n in best.searched if n not in names)
        without = self._first(rest, fitted)
        if without is None:
            physics = frozenset(best.base.names)
            bare, without = self._first(physics, ()), self._first(physics - names, ())
            best = bare or best
        if without is None:
            return True
        gains = best.log_evidence - without.log_evidence, fits_better(best, without)
        return min(gains) > log(settings.earned_factor)

    def _first(self, effects: frozenset[str], searched: Key) -> Explanation | None:
        """Return the best explanation with these effects in all and these of them fitted."""
        found = (e for e in self.explanations if (e.effects, e.searched) == (effects, searched))
        return next(found, None)

    def key(self, explanation: Explanation) -> Key:
        """Return the name of an explanation: its causes and the textbook effects that count."""
        physics = [name for name in explanation.base.names if name in self.earned]
        return tuple(sorted({*explanation.searched, *physics}))

    @cached_property
    def keys(self) -> tuple[Key, ...]:
        """Return the name of every explanation."""
        return tuple(map(self.key, self.explanations))

    @cached_property
    def names(self) -> dict[Key, float]:
        """Return the probability of every name, most probable first."""
        totals: dict[Key, float] = {}
        for key, p in zip(self.keys, self.probabilities, strict=True):
            totals[key] = totals.get(key, 0.0) + p
        return {key: totals[key] for key in by_probability(totals)}

    @cached_property
    def known(self) -> float:
        """Return the probability that what is missing is in the catalogue.

        A cause that no effect describes is weighed with every explanation that would imitate it.
        """
        pairs = zip(self.explanations, self.probabilities, strict=True)
        return 1.0 / (1.0 + sum(p * e.outside for e, p in pairs))

    def inclusion(self, name: str) -> float:
        """Return the probability that an effect is part of the name."""
        return sum(p for key, p in self.names.items() if name in key)

    def best(self, key: Key) -> Explanation:
        """Return the most probable explanation of that name.

        One that tells more, by another slug, stands first where hardly anything else is left.
        """
        members = self.members(key)
        first, _ = members[0]
        if not first.tells_more:
            return first
        more = sum(p for e, p in members if e.tells_more)
        if more >= settings.nearly_all * sum(p for _, p in members):
            return first
        return next((e for e, _ in members if not e.tells_more), first)

    @property
    def nothing(self) -> Explanation:
        """Return the most probable explanation without a cause or textbook physics."""
        return next(e for e in self.explanations if not e.parts and not e.base.parts)

    def members(self, key: Key) -> list[tuple[Explanation, float]]:
        """Return the explanations of that name with their probabilities."""
        rows = zip(self.explanations, self.probabilities, self.keys, strict=True)
        return [(e, p) for e, p, own in rows if own == key]
