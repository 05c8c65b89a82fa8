"""The fit of what truly is there and of what a search found: faults of search, not of inference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice, product
from typing import Any

import numpy as np

from femubench.core.change.hypothesis import Hypothesis, hypotheses_of, hypothesis_at
from femubench.core.errors import FemubenchError, ModelError
from femubench.core.fit.extended_model import check_joint_fit, extend_model
from femubench.core.fit.modal_fit import Fit, Problem, State, bounds_of, fit, state_at
from femubench.core.fit.projection import Projection, Projector
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.examine import Examination, damage_of, is_innate
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.prior import Base, textbook_bases
from femubench.core.roles import Effect
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray

SLACK = 1.0  # of chi-square, by which the truth must fit better
_STARTS = 3
_WAYS = 8  # of saying the same truth


@dataclass(frozen=True)
class CataloguedCause:
    """A cause in the words of the catalogue.

    Arguments:
        effect: slug.
        place: where it sits.
        values: of all of its parameters; empty where they are not known.
    """

    effect: str
    place: str
    values: tuple[float, ...] = ()


def fits_of(
    examination: Examination,
    causes: Iterable[Iterable[CataloguedCause]],
    effects: Mapping[str, Effect],
    same: Callable[[str, str], bool],
) -> dict[str, Any]:
    """Return chi-square, unknowns and ln weight of what a search found best, and of the truth.

    The truth is fitted in the noise and on the textbook set of the most probable explanation.
    Nothing where the truth is no explanation of the catalogue, or cannot be fitted.

    Arguments:
        examination: of the search.
        causes: of the truth; each in one word, or in several that say the same.
        effects: the catalogue by name.
        same: whether two places are one.
    """
    leader = examination.posterior.explanations[0]
    try:
        truth = true_fit(examination, causes, effects, same)
    except (FemubenchError, np.linalg.LinAlgError):  # of a model that the truth cannot stand in
        truth = None
    return {} if truth is None else {"leader_fit": _of(leader), "true_fit": _of(truth)}


def _of(explanation: Explanation) -> dict[str, float]:
    return {
        "chi2": explanation.chi2,
        "unknowns": explanation.unknowns,
        "log_weight": explanation.log_weight,
    }


def fits_worse(record: Mapping[str, Any]) -> bool | None:
    """Tell whether a search's best has no fewer unknowns than the truth and fits worse.

    None where the truth was not fitted.
    """
    if "true_fit" not in record:
        return None
    leader, truth = record["leader_fit"], record["true_fit"]
    better = leader["chi2"] > truth["chi2"] + SLACK
    return bool(better and leader["unknowns"] >= truth["unknowns"])


def is_search_fault(record: Mapping[str, Any]) -> bool | None:
    """Tell whether a search's best fits worse, and the truth would lead by prior and evidence too.

    Otherwise prior and evidence chose what fits worse, and the search did what it is for.
    """
    worse = fits_worse(record)
    more = worse and record["true_fit"]["log_weight"] > record["leader_fit"]["log_weight"]
    return None if worse is None else bool(more)


def true_fit(
    examination: Examination,
    causes: Iterable[Iterable[CataloguedCause]],
    effects: Mapping[str, Effect],
    same: Callable[[str, str], bool],
) -> Explanation | None:
    """Return the most probable fit of the truth; see `fits_of`.

    A true cause that the textbook set has is also fitted, on the set without it.
    """
    leader = examination.posterior.explanations[0]
    wanted = [list(ways) for ways in causes]
    meant = {finding.effect for ways in wanted for finding in ways}
    bases = textbook_bases(examination.problem.space.projections)
    without = set(leader.base.names) - meant
    others = [base for base in bases if set(base.names) == without != set(leader.base.names)]
    found = []
    for base in (leader.base, *others):
        rest = [[f for f in ways if f.effect not in base.names] for ways in wanted]
        fits = _fits_on(examination, base, [ways for ways in rest if ways], effects, same)
        found += [Explanation(base, item, leader.names) for item in fits]
    return in_order(found, lambda e: -e.log_weight)[0] if found else None


def _fits_on(
    examination: Examination,
    base: Base,
    causes: Sequence[Sequence[CataloguedCause]],
    effects: Mapping[str, Effect],
    same: Callable[[str, str], bool],
) -> Iterator[Fit]:
    """Yield fits of causes on a textbook set, in the noise of the leading explanation."""
    model = extend_model(examination.model, base.parts, base.x)
    best = examination.posterior.explanations[0].fit.state.problem
    problem = place_data(model, best.data, best.noise, ())
    project = Projector(model, modes_for(model).shapes)

    def offered(finding: CataloguedCause) -> Hypothesis | None:
        effect = effects.get(finding.effect)
        places = [] if effect is None else list(dict.fromkeys(effect.places(model)))
        place = next((place for place in places if same(place, finding.place)), None)
        if effect is None or place is None:
            return None
        every = hypotheses_of(model, (effect,), damage_of(model, examination.reference))
        found = next((h for h in every if h.place == place), None)
        found = found or hypothesis_at(model, effect, place, len(places))
        return None if examination.reference is not None and is_innate(found) else found

    known = [[(h, f) for f in ways if (h := offered(f)) is not None] for ways in causes]
    for chosen in islice(product(*known), _WAYS) if known else ():
        parts = [project(hypothesis) for hypothesis, _ in chosen]
        yield from _fits(problem, parts, [_starts(*pair) for pair in chosen])


def _starts(hypothesis: Hypothesis, finding: CataloguedCause) -> FloatArray:
    """Return coordinates to start from, (s, k): the true ones if they are known, and the grid."""
    grid = hypothesis.grid
    if len(finding.values) != len(hypothesis.parameters):
        return grid
    pairs = zip(hypothesis.parameters, finding.values, strict=True)
    true = np.array([parameter.coordinate(value) for parameter, value in pairs])
    # What holds nothing at all has no coordinate.
    return np.vstack([true, grid]) if np.isfinite(true).all() else grid


def _fits(
    problem: Problem, parts: Sequence[Projection], starts: Sequence[FloatArray]
) -> Iterator[Fit]:
    """Yield fits of causes from the best combinations of their starts."""
    alone = [
        [state.x for state in _best(problem, [part], own)]
        for part, own in zip(parts, starts, strict=True)
    ]
    together = np.array([np.concatenate(xs) for xs in product(*alone)])
    for state in _best(problem, parts, together):
        found = fit(problem, parts, state.x)
        if found is not None:
            # Several causes add up in modal coordinates and not in a model.
            borne = check_joint_fit(found) if len(parts) > 1 else found
            if borne is not None:
                yield borne


def _best(problem: Problem, parts: Sequence[Projection], starts: FloatArray) -> list[State]:
    """Return the few states of least cost among some starts."""
    low, high = bounds_of(parts)
    states = []
    for start in starts:
        with suppress(ModelError):
            states.append(state_at(problem, parts, np.clip(start, low, high)))
    return in_order(states, lambda state: state.cost)[:_STARTS]
