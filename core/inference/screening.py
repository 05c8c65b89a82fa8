"""The hypotheses of a large model that are worth coordinates of their own.

All of them are ranked by what they do to first order, which one basis gives exactly for all: with
the response to forces at the sensors in it, the modes alone bring every force to every reading.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.effect.change import ElementOperator, RowOperator, Term
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.inference.fit import Fit, Problem, State, fit, state_at
from femubench.core.inference.grid_search import Screened, screen
from femubench.core.inference.hypothesis import Hypothesis
from femubench.core.inference.noise import marginal
from femubench.core.inference.projection import Projection, Projector
from femubench.core.inference.static_response import LargeProblem, enriched, magnitudes
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray

_MOST, _OF_A_NAME, _PARTNERS = 240, 12, 60
_SIZES = (0.12, 0.5, 1.3, 2.6)  # at which each is tried
_STEPS = 3
_NOTHING = 1e-6
_CHUNK = 256  # hypotheses whose forces are held at once
_SLACK = 0.1  # share of the prior that counts: a ranking by first order must not mind sizes
_BLUNT = 0.05  # a resonance closer than this share of an eigenvalue is no matter of first order


@dataclass(frozen=True)
class Ranked:
    """A hypothesis by first order.

    Arguments:
        hypothesis: the hypothesis.
        gain: about, by how much it lowers chi-square.
        visible: change of the data in deviations a unit of its coordinate.
    """

    hypothesis: Hypothesis
    gain: float
    visible: float


def with_shortlist(problem: Problem) -> Problem:
    """Return a problem with the hypotheses in its coordinates that come nearest to the data.

    Small problems have all of theirs already.
    """
    if not isinstance(problem, LargeProblem):
        return problem
    vectors = problem.common.modes.shapes
    local = _Local(problem.model, vectors)
    ranked = list(_ranked(local, state_at(problem, (), np.zeros(0)), problem.hypotheses))
    chosen = _chosen(ranked, _MOST, _OF_A_NAME)
    space = replace(problem.space, projections=tuple(local.project(h) for h in chosen))
    return replace(problem, space=space)


def screened(problem: Problem, base: State, projections: Sequence[Projection]) -> list[Screened]:
    """Return the atlas; of a large model, each hypothesis in coordinates of its own."""
    if not isinstance(problem, LargeProblem):
        return screen(problem, base, projections)
    tried = (_tried(problem, projection) for projection in projections)
    return [item for item in tried if item is not None]


def _tried(problem: LargeProblem, projection: Projection) -> Screened | None:
    """Return a hypothesis at a few magnitudes, and where some steps from the best one lead.

    None where it makes the mass indefinite at all of them.
    """
    own, parts = enriched(problem, (projection,), rounds=1)
    points, states = [], []
    for x in magnitudes(projection.hypothesis, _SIZES):
        try:
            states.append(state_at(own, parts, x))
        except ModelError:
            continue
        points.append(x)
    if not states:
        return None
    best = in_order(states, lambda state: state.cost)[0]
    found = fit(own, parts, best.x, steps=_STEPS)
    assert found is not None
    residuals = np.array([state.residual for state in states])
    state = found.state
    evidence = found.log_evidence
    return Screened(projection, np.array(points), residuals, state.x, state.cost, evidence)


def beside(problem: Problem, seed: Fit) -> Problem:
    """Return the data in the modal coordinates of the model with some causes in it.

    Arguments:
        problem: without the causes.
        seed: their fit.
    """
    state = seed.state
    if not isinstance(problem, LargeProblem):
        space = problem.space.rebased(seed.parts, state.x)
        return replace(problem, space=space, offset=state.problem.offset)
    space, vectors = problem.common.enriched(problem.space, seed.parts)
    own = replace(problem, space=space, offset=state.problem.offset)
    there = state_at(own, space.projections, state.x)
    taken = {id(part.hypothesis) for part in seed.parts}
    free = [h for h in problem.hypotheses if id(h) not in taken]
    local = _Local(problem.model, vectors)
    ranked = list(_ranked(local, there, free))
    partners = tuple(local.project(h) for h in _chosen(ranked, _PARTNERS, 3))
    rebased = replace(space, projections=partners).rebased(space.projections, state.x)
    return replace(own, space=rebased)


def _chosen(ranked: Sequence[Ranked], most: int, of_a_name: int) -> list[Hypothesis]:
    """Return the best of all, of every name, the most visible of it, and the textbook effects."""
    names: dict[str, list[Ranked]] = {}
    rest = in_order(ranked, lambda item: -item.gain)
    for item in rest:
        names.setdefault(item.hypothesis.name, []).append(item)
    must = [item for own in names.values() for item in own[:of_a_name]]
    must += [in_order(own, lambda item: -item.visible)[0] for own in names.values()]
    must += [item for item in ranked if item.hypothesis.textbook is not None]
    found = {id(item.hypothesis): item.hypothesis for item in must}
    for item in rest:
        if len(found) >= most:
            break
        found[id(item.hypothesis)] = item.hypothesis
    return list(found.values())


def _ranked(local: _Local, state: State, hypotheses: Sequence[Hypothesis]) -> Iterator[Ranked]:
    """Yield every hypothesis by first order about a state.

    Arguments:
        local: the coordinates of the state.
        state: of the model with or without causes.
        hypotheses: of the same model.
    """
    residual = marginal(state.residual, state.jacobian)
    for start in range(0, len(hypotheses), _CHUNK):
        chunk = hypotheses[start : start + _CHUNK]
        grids, factors = zip(*(_directions(hypothesis) for hypothesis in chunk), strict=True)
        pairs = zip(chunk, factors, strict=True)
        found = [_first_order(local, state, hypothesis, own) for hypothesis, own in pairs]
        forces = np.moveaxis(np.concatenate([force for force, _ in found]), 0, 2)
        slopes = state.rows(forces, np.concatenate([mass for _, mass in found]))
        moves = marginal(state.problem.noise.whiten(slopes.T), state.jacobian).T
        size = np.square(moves).sum(axis=0)
        prior = np.concatenate([np.square(grid).sum(axis=1) for grid in grids])
        along = np.maximum(residual @ moves, 0.0)
        gain = np.square(along) / (size + _SLACK * prior + 1e-30)
        visible = np.sqrt(size / (prior + 1e-30))
        ends = np.cumsum([len(grid) for grid in grids])[:-1]
        both = zip(chunk, np.split(gain, ends), np.split(visible, ends), strict=True)
        for hypothesis, own, seen in both:
            yield Ranked(hypothesis, float(own.max()), float(seen.max()))


class _Local:
    """The coordinates of a state, and how elements move with them.

    Arguments:
        model: large.
        vectors: motions of the coordinates, (n, N).
    """

    def __init__(self, model: Model, vectors: FloatArray) -> None:
        self.vectors, structure = vectors, model.structure
        self.project = Projector(model, vectors)
        self.elements: FloatArray | None = None
        if structure is not None:
            gathered = structure.gather @ vectors
            self.elements = np.asarray(gathered).reshape(-1, 12, vectors.shape[1])


def _directions(hypothesis: Hypothesis) -> tuple[FloatArray, FloatArray]:
    """Return coordinates, (g, k), and factors of the terms, (g, n_terms), to be tried.

    What is there at any magnitude, such as the arms of joints, may be no small change on a fine
    mesh, and first order overrates it: the rest is tried with and without it.
    """
    grid = magnitudes(hypothesis)
    factors = hypothesis.factors(grid)
    always = hypothesis.factors(np.zeros((1, grid.shape[1])))
    if np.abs(always).max() <= _NOTHING:
        return grid, factors
    return np.vstack([grid, grid]), np.vstack([factors, factors - always])


def _first_order(
    local: _Local, state: State, hypothesis: Hypothesis, factors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what a hypothesis exerts on the measured modes, (g, N, m), and its mass, (g,).

    N counts the coordinates of the state.

    Arguments:
        local: the coordinates of the state.
        state: where.
        hypothesis: an effect at a place.
        factors: of its terms, (g, n_terms).
    """
    change = hypothesis.change
    count = local.vectors.shape[1]
    near, values = state.vectors[:count, state.partner], state.eigenvalues[state.partner]
    heavy = np.array([term.matrix == "mass" for term in change.terms])
    blocks = np.array([_crossed(local, term, near, change.extra) for term in change.terms])
    stiff = np.tensordot(factors[:, ~heavy], blocks[~heavy], axes=1)
    mass = np.tensordot(factors[:, heavy], blocks[heavy], axes=1)
    weight = np.zeros(len(factors))
    if state.problem.data.mass is not None:
        weight = factors @ local.project(hypothesis).weights
    if change.extra:
        forces = _condensed(stiff, mass, values, change.extra)
    else:
        forces = stiff - mass * values
    # Coordinates that the causes of the state have added feel nothing.
    return np.pad(forces, ((0, 0), (0, len(state.vectors) - count), (0, 0))), weight


def _condensed(stiff: FloatArray, mass: FloatArray, values: FloatArray, extra: int) -> FloatArray:
    """Return the forces with what a hypothesis adds following each mode, (g, N, m).

    Arguments:
        stiff, mass: (g, N + extra, m + extra).
        values: eigenvalues of the modes, (m,).
    """
    m = len(values)
    dynamic = stiff[..., None] - mass[..., None] * values  # (g, N + extra, m + extra, m)
    own = np.arange(m)
    forces = dynamic[:, :, own, own]
    reach = dynamic[:, :-extra, m:, :]
    inner = np.moveaxis(dynamic[:, -extra:, m:, :], 3, 1)
    # Blunted, since at a resonance first order has no end.
    blunt = _BLUNT * np.abs(stiff[:, -extra:, m:]).max(axis=(1, 2))[:, None, None, None]
    follow = np.linalg.solve(
        inner @ inner + np.square(blunt) * np.eye(extra),
        inner @ np.moveaxis(forces[:, -extra:], 2, 1)[..., None],
    )[..., 0]
    return np.asarray(forces[:, :-extra] - np.einsum("gnej,gje->gnj", reach, follow))


def _crossed(local: _Local, term: Term, near: FloatArray, extra: int) -> FloatArray:
    """Return a fixed matrix between all coordinates and some modes, (N + extra, m + extra)."""
    operator = term.operator
    if isinstance(operator, ElementOperator) and local.elements is not None:
        moved = local.elements[operator.elements]
        pulls = (operator.blocks @ (moved @ near)).reshape(-1, near.shape[1])
        return np.pad(moved.reshape(len(pulls), -1).T @ pulls, (0, extra))
    if isinstance(operator, RowOperator):
        n = len(local.vectors)
        seen = np.asarray(operator.rows[:, :n] @ local.vectors)
        added = operator.rows[:, n:].toarray()
        pulls = operator.core @ np.hstack([seen @ near, added])
        return np.asarray(np.hstack([seen, added]).T @ pulls)
    shapes = local.vectors @ near
    return np.pad(local.vectors.T @ operator.apply(shapes), (0, extra))
