"""The hypotheses of a large model that are worth coordinates of their own.

All of them are ranked by what they do to first order, which one basis gives exactly for all: with
the response to forces at the sensors in it, the modes alone bring every force to every reading.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.change.hypothesis import Hypothesis, magnitudes
from femubench.core.fit.modal_fit import Fit, Problem, State, fit, state_at
from femubench.core.fit.noise import marginal
from femubench.core.fit.projection import Projection, Projector
from femubench.core.fit.static_response import LargeProblem
from femubench.core.inference.effort import Effort
from femubench.core.inference.grid_search import Screened, residuals_at, screen
from femubench.core.inference.settings import settings
from femubench.core.ties import in_order, least
from femubench.core.typing import FloatArray


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
    projector = problem.common.projector
    ranked = _ranked(projector, state_at(problem, (), np.zeros(0)), problem.hypotheses)
    chosen = _chosen(ranked, settings.large_shortlist, settings.leading)
    space = replace(problem.space, projections=tuple(projector(h) for h in chosen))
    return replace(problem, space=space)


def screen_hypotheses(
    problem: Problem, base: State, projections: Sequence[Projection], effort: Effort
) -> list[Screened]:
    """Return the atlas; of a large model, each hypothesis in coordinates of its own."""
    if not isinstance(problem, LargeProblem) or not projections:
        return screen(problem, base, projections)
    spaces = problem.common.first_response(problem.space, projections)
    tried: list[Screened | None] = []
    for number, (own, projection) in enumerate(zip(spaces, projections, strict=True)):
        if tried and effort.stops():
            break
        effort.step(number, len(projections))
        tried.append(_tried(replace(problem, space=own), projection))
    return [item for item in tried if item is not None]


def _tried(own: Problem, projection: Projection) -> Screened | None:
    """Return a hypothesis at a few magnitudes, and where some steps from the best one lead.

    None where it makes the mass indefinite at all of them.

    Arguments:
        own: the data in coordinates of its own.
        projection: the hypothesis in those that it shares.
    """
    parts = own.space.projections
    grid, raw = residuals_at(own, parts[0], magnitudes(projection.hypothesis, settings.large_sizes))
    if not len(grid):
        return None
    residuals = own.noise.residual(raw + own.offset)
    best = least(np.square(residuals).sum(axis=1) + np.square(grid).sum(axis=1))
    found = fit(own, parts, grid[best], steps=settings.few_steps)
    assert found is not None
    state = found.state
    return Screened(projection, grid, residuals, state.x, state.cost, found.log_evidence)


def rebase_problem(problem: Problem, seed: Fit) -> Problem:
    """Return the data in the modal coordinates of the model with some causes in it.

    Arguments:
        problem: without the causes.
        seed: their fit.
    """
    state = seed.state
    if not isinstance(problem, LargeProblem):
        space = problem.space.rebase(seed.parts, state.x)
        return replace(problem, space=space, offset=state.problem.offset)
    found = problem.common.enrich(problem.space, seed.parts)
    space = found.space
    own = replace(problem, space=space, offset=state.problem.offset)
    there = state_at(own, space.projections, state.x)
    taken = {id(part.hypothesis) for part in seed.parts}
    free = [h for h in problem.hypotheses if id(h) not in taken]
    problem.common.forget()  # one of two as large arrays at a time
    ranked = _ranked(Projector(problem.model, found.vectors), there, free)
    known = {id(p.hypothesis): p for p in problem.space.projections}
    chosen = _chosen(ranked, settings.large_shortlist // 4, settings.of_a_kind)
    parts = [known.get(id(h)) or problem.common.projector(h) for h in chosen]
    partners = tuple(map(found.project, parts))
    rebased = replace(space, projections=partners).rebase(space.projections, state.x)
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


def _ranked(projector: Projector, state: State, hypotheses: Sequence[Hypothesis]) -> list[Ranked]:
    """Return every hypothesis by first order about a state.

    Arguments:
        projector: on the motions of the coordinates of the state, without those that its causes
            have added, (n, N).
        state: of the model with or without causes.
        hypotheses: of the same model.
    """
    count = projector.vectors.shape[1]
    near, values = state.vectors[:count, state.partner], state.eigenvalues[state.partner]
    weighed = state.problem.data.mass is not None
    found: list[Ranked] = []
    waiting: list[tuple[Hypothesis, _Pulls]] = []
    many = 0
    for hypothesis in hypotheses:
        pulls = _pulls(projector, hypothesis, near, values, weighed)
        waiting.append((hypothesis, pulls))
        many += len(pulls.masses)
        if many >= settings.block or hypothesis is hypotheses[-1]:
            found += _gains(state, waiting)
            waiting, many = [], 0
    return found


def _gains(state: State, some: Sequence[tuple[Hypothesis, _Pulls]]) -> Iterator[Ranked]:
    """Yield hypotheses with what their forces do to the data."""
    residual = marginal(state.residual, state.jacobian)
    forces = np.moveaxis(np.concatenate([pulls.forces for _, pulls in some]), 0, 2)
    # Coordinates that the causes of the state have added feel nothing.
    forces = np.pad(forces, ((0, len(state.vectors) - len(forces)), (0, 0), (0, 0)))
    slopes = state.rows(forces, np.concatenate([pulls.masses for _, pulls in some]))
    each = marginal(state.problem.noise.whiten(slopes.T), state.jacobian)
    last = 0
    for hypothesis, pulls in some:
        first, last = last, last + len(pulls.masses)
        moves = pulls.shares @ each[first:last]
        size, prior = np.square(moves).sum(axis=1), np.square(pulls.grid).sum(axis=1)
        along = np.maximum(moves @ residual, 0.0)
        gain = np.square(along) / (size + settings.large_slack * prior + 1e-30)
        visible = np.sqrt(size / (prior + 1e-30))
        yield Ranked(hypothesis, float(gain.max()), float(visible.max()))


@dataclass(frozen=True)
class _Pulls:
    """What a hypothesis exerts on the measured modes, as sums of a few fixed forces.

    Arguments:
        grid: coordinates that are tried, (g, k).
        shares: of the forces there, (g, d).
        forces: on the coordinates, (d, N, m).
        masses: by which each makes the structure heavier in kg, (d,).
    """

    grid: FloatArray
    shares: FloatArray
    forces: FloatArray
    masses: FloatArray


def _pulls(
    projector: Projector,
    hypothesis: Hypothesis,
    near: FloatArray,
    values: FloatArray,
    weighed: bool,
) -> _Pulls:
    """Return what a hypothesis exerts on some modes.

    Arguments:
        projector: on the motions of the coordinates.
        hypothesis: an effect at a place.
        near, values: the modes in the coordinates, (N, m), and their eigenvalues, (m,).
        weighed: whether the mass is a datum.
    """
    grid, factors = hypothesis.directions
    if hypothesis.change.extra:
        return _followed(projector(hypothesis), grid, factors, near, values)
    terms = hypothesis.change.terms
    heavy = np.array([term.matrix == "mass" for term in terms])
    forces = np.array(projector.cross(terms, near))
    forces *= np.where(heavy[:, None], -values, 1.0)[:, None]
    weights = projector(hypothesis).weights if weighed else np.zeros(len(terms))
    return _Pulls(grid, factors, forces, weights)


def _followed(
    part: Projection, grid: FloatArray, factors: FloatArray, near: FloatArray, values: FloatArray
) -> _Pulls:
    """Return what a hypothesis exerts whose added coordinates follow each mode.

    Arguments:
        part: the hypothesis.
        grid, factors: as in `Hypothesis.directions`.
        near, values: as in `_pulls`.
    """
    count, m = near.shape
    rows, added = part.rows[:, :count], part.rows[:, count:]
    still = np.zeros((len(grid), len(rows), len(rows)))
    stiff, mass = (part.core(factors, mass=kind) for kind in (False, True))
    stiff, mass = still if stiff is None else stiff, still if mass is None else mass
    dynamic = stiff[:, None] - mass[:, None] * values[:, None, None]  # (g, m, p, p)
    seen = np.broadcast_to((rows @ near).T[..., None], (len(grid), m, len(rows), 1))
    inner = added.T @ dynamic @ added
    # Blunted, since at a resonance first order has no end.
    blunt = settings.approximation * np.abs(added.T @ stiff @ added).max(axis=(1, 2))
    blunt = blunt[:, None, None, None]
    follow = np.linalg.solve(
        inner @ inner + np.square(blunt) * np.eye(part.extra),
        inner @ (added.T @ dynamic @ seen),
    )
    pulls = (dynamic @ (seen - added @ follow))[..., 0]  # (g, m, p)
    if m * len(rows) < len(grid):
        # Each row by itself on each mode by itself: fewer than there are points.
        apart = np.einsum("pN,jk->jpNk", rows, np.eye(m))
        forces, shares = apart.reshape(-1, count, m), pulls.reshape(len(grid), -1)
    else:
        forces, shares = np.swapaxes(pulls @ rows, 1, 2), np.eye(len(grid))
    nothing, weight = np.zeros((1, count, m)), (factors @ part.weights)[:, None]
    masses = np.append(np.zeros(len(forces)), 1.0)
    return _Pulls(grid, np.hstack([shares, weight]), np.concatenate([forces, nothing]), masses)
