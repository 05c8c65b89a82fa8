"""Every hypothesis at a few magnitudes at once: where to start, and what is hopeless.

Each hypothesis acts in a small basis: the lowest modes and the first-order response of the higher
ones to it (Fox & Kapoor 1968), so that thousands of candidates cost one batched eigensolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import log_ndtr

from femubench.core.fit.modal_basis import Space
from femubench.core.fit.modal_fit import Problem, State, signed_hz
from femubench.core.fit.noise import marginal
from femubench.core.fit.projection import Projection
from femubench.core.inference.settings import settings
from femubench.core.ties import in_order, least
from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Screened:
    """A hypothesis on the atlas.

    Arguments:
        projection: the hypothesis.
        grid: coordinates that were tried, (g, k).
        residuals: in units of the noise there, (g, n_data).
        x: the most probable coordinates by interpolation, (k,).
        cost: chi-square plus prior there.
        log_evidence: about, as for `Fit`.
    """

    projection: Projection
    grid: FloatArray = field(repr=False)
    residuals: FloatArray = field(repr=False)
    x: FloatArray
    cost: float
    log_evidence: float


def interpolate_best(
    projections: Sequence[Projection], residuals: FloatArray, still: FloatArray
) -> list[Screened]:
    """Return the best point of every hypothesis.

    Arguments:
        projections: the hypotheses.
        residuals: on their grids one after the other, (sum of g, n_data).
        still: residuals of the base model, (n_data,).
    """
    last = np.cumsum([len(p.hypothesis.grid) for p in projections])
    own = [
        residuals[stop - len(p.hypothesis.grid) : stop]
        for p, stop in zip(projections, last, strict=True)
    ]
    found: dict[int, Screened] = {}
    alike: dict[tuple[int, bool], list[int]] = {}
    for i, p in enumerate(projections):
        h = p.hypothesis
        if len(h.parameters) == 1:
            alike.setdefault((len(h.grid), h.still), []).append(i)
        else:
            point, least_cost = _in_cells(h.grid, own[i])
            spread = -0.5 * least_cost - 0.5 * _spread(own[i], h.grid)
            found[i] = Screened(p, h.grid, own[i], point, least_cost, float(spread))
    for (_, begins), members in alike.items():
        rows = np.array([own[i] for i in members])
        x = np.array([projections[i].hypothesis.grid[:, 0] for i in members])
        if begins:
            x = np.hstack([x, np.zeros((len(x), 1))])
            rows = np.concatenate([rows, np.broadcast_to(still, (len(x), 1, len(still)))], axis=1)
            order = np.argsort(x, axis=1)
            x = np.take_along_axis(x, order, axis=1)
            rows = np.take_along_axis(rows, order[:, :, None], axis=1)
        sided = np.array([projections[i].hypothesis.one_sided[0] for i in members], dtype=bool)
        for i, place, cost, evidence in zip(members, *_on_chords(x, rows, sided), strict=True):
            p = projections[i]
            best = np.array([place])
            found[i] = Screened(p, p.hypothesis.grid, own[i], best, float(cost), float(evidence))
    return [found[i] for i in range(len(projections))]


def _in_cells(grid: FloatArray, residuals: FloatArray) -> tuple[FloatArray, float]:
    """Return the best point of a grid, residuals linear within its cells in two coordinates."""
    cost = np.square(residuals).sum(axis=1) + np.square(grid).sum(axis=1)
    best = int(least(cost))
    if grid.shape[1] != 2:
        return grid[best], float(cost[best])
    axes = [np.unique(column) for column in grid.T]
    rows = residuals.reshape(*map(len, axes), -1)
    corner = np.stack(np.meshgrid(*(axis[:-1] for axis in axes), indexing="ij"), axis=2)
    size = np.stack(np.meshgrid(*map(np.diff, axes), indexing="ij"), axis=2)
    here = rows[:-1, :-1]
    sides = np.stack([rows[1:, :-1] - here, rows[:-1, 1:] - here], axis=3)
    turned = np.swapaxes(sides, 2, 3)
    normal = turned @ sides + np.square(size)[..., None] * np.eye(2)
    right = (turned @ here[..., None])[..., 0] + size * corner
    # In units of its own columns: two that act alike, and far beyond the prior, are none to digits.
    unit = np.sqrt(np.diagonal(normal, axis1=2, axis2=3))
    normal = normal / unit[..., :, None] / unit[..., None, :] + settings.negligible**2 * np.eye(2)
    solution = np.linalg.solve(normal, (right / unit)[..., None])[..., 0]
    share = np.clip(-solution / unit, 0.0, 1.0)
    x = corner + share * size
    left = here + (sides @ share[..., None])[..., 0]
    value = np.square(left).sum(axis=2) + np.square(x).sum(axis=2)
    if value.size == 0 or value.min() >= cost[best]:
        return grid[best], float(cost[best])
    cell = np.unravel_index(least(value.ravel()), value.shape)
    return x[cell], float(value[cell])


def _on_chords(
    x: FloatArray, rows: FloatArray, sided: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the best points on the chords between neighbours, their costs and evidences.

    Arguments:
        x: ascending, (h, g).
        rows: residuals there, (h, g, n_data).
        sided: whether x cannot be negative, (h,).
    """
    if x.shape[1] == 1:
        cost = np.square(rows[:, 0]).sum(axis=1) + np.square(x[:, 0])
        return x[:, 0], cost, -0.5 * cost
    chord, width = np.diff(rows, axis=1), np.diff(x, axis=1)
    a = np.square(chord).sum(axis=2) + np.square(width)
    b = np.einsum("hgi,hgi->hg", chord, rows[:, :-1]) + width * x[:, :-1]
    # On a long way modes change places: its ends are known, and nothing between.
    t = np.where(width > settings.long_step, -2.0 * b > a, np.clip(-b / a, 0.0, 1.0))
    cost = np.square(rows[:, :-1]).sum(axis=2) + np.square(x[:, :-1]) + 2 * b * t + a * t**2
    best = np.arange(len(x)), least(cost)
    place = x[best] + t[best] * width[best]
    curvature = a[best] / np.square(width[best])
    evidence = -0.5 * cost[best] - 0.5 * np.log(curvature)
    half = np.log(2.0) + log_ndtr(place * np.sqrt(curvature))
    return place, cost[best], evidence + np.where(sided, half, 0.0)


def _spread(residuals: FloatArray, grid: FloatArray) -> float:
    """Return about ln det of the curvature from the widest differences on a grid."""
    span = np.ptp(grid, axis=0)
    steep = np.linalg.norm(residuals - residuals.mean(axis=0), axis=1).max()
    return float(np.log(1.0 + np.square(steep / np.maximum(span, 1e-9))).sum())


def screen(
    problem: Problem,
    base: State,
    projections: Sequence[Projection],
    yielding: FloatArray | None = None,
) -> list[Screened]:
    """Return every hypothesis with its best magnitude by interpolation on the atlas.

    Arguments:
        problem: data and modal coordinates of the base model.
        base: the base model itself, no hypothesis in it.
        projections: the hypotheses.
        yielding: sensitivities of causes that the base model holds, and that may still move to
            make room, in units of the noise, (n_data, k).
    """
    if not projections:
        return []
    # Modes beyond the last partner matter as neighbours that may come down among them.
    top = max(problem.space.rigid + len(base.partner), int(base.partner.max(initial=-1)) + 1)
    still = base.residual
    if yielding is None:
        residuals = problem.noise.residual(_kept(problem, projections, top) + problem.offset)
    else:
        raw = _residuals(problem, projections, top) + problem.offset
        residuals = marginal(problem.noise.residual(raw), yielding)
        still = marginal(still, yielding)
    density = problem.noise.log_density
    return [
        replace(item, log_evidence=item.log_evidence + density)
        for item in interpolate_best(projections, residuals, still)
    ]


def likely(
    screened: Sequence[Screened], still: FloatArray, state: State, least: float
) -> list[Projection]:
    """Return the hypotheses that promise most with causes, were what they do to add up.

    It does not, but nearly enough to tell what is not worth an eigensolution.

    Arguments:
        screened: hypotheses on the model without these causes.
        still: residuals of that model, (n_data,).
        state: the model with the causes in it.
        least: what chi-square must promise to fall by.
    """
    projections = [item.projection for item in screened]
    if not projections:
        return []
    both = np.concatenate([item.residuals for item in screened]) + (state.residual - still)
    seen = marginal(both, state.jacobian), marginal(state.residual, state.jacobian)
    rows = interpolate_best(projections, *seen)
    promising = in_order(
        (row for row in rows if state.chi2 - row.cost > least), lambda row: row.cost
    )
    return [row.projection for row in promising[: settings.shortlist]]


def _residuals(problem: Problem, projections: Sequence[Projection], top: int) -> FloatArray:
    """Return the residuals of all candidates in deviations of the measurement, (sum of g, n_data).

    Arguments:
        problem: data and modal coordinates.
        projections: the hypotheses.
        top: number of modes up to the last one that has a measured partner.
    """
    space = problem.space
    low = min(len(space), top + settings.modes_kept)
    tracked = min(len(space), top + settings.modes_tracked)
    counts = [len(p.hypothesis.grid) for p in projections]
    first = np.concatenate([[0], np.cumsum(counts)])
    hertz = np.zeros((first[-1], low))
    seen = np.zeros((first[-1], len(space.readings), low))
    responses, few = _responses(space, projections, low, tracked)
    kinds: dict[tuple[int, bool, bool], list[int]] = {}
    for i, p in enumerate(projections):
        kinds.setdefault((p.extra, bool(p.is_mass.any()), bool(few[i])), []).append(i)
    for (_, _, small), members in kinds.items():
        most = settings.responses // 2 if small else settings.responses
        kept = min(most, responses.shape[2])
        chosen = responses[members][:, :, responses.shape[2] - kept :]
        rows = np.concatenate([np.arange(first[i], first[i + 1]) for i in members])
        own = [projections[i] for i in members]
        hertz[rows], seen[rows] = _modes(space, own, chosen, low)
    mass = [space.mass + p.hypothesis.grid_factors @ p.weights for p in projections]
    return _compared(problem, hertz, seen, np.concatenate(mass))


def residuals_at(
    problem: Problem, projection: Projection, grid: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where a hypothesis leaves the mass definite, and the residuals there in deviations.

    Arguments:
        problem: data and modal coordinates, all of which are taken.
        projection: the hypothesis in them.
        grid: its coordinates that are tried, (g, k).

    Returns:
        coordinates (h, k), h <= g, and residuals (h, n_data).
    """
    space, rows = problem.space, projection.rows
    factors = projection.hypothesis.factors(grid)
    size = len(space) + projection.extra
    own = np.arange(len(space))
    stiffness, mass = np.zeros((2, len(grid), size, size))
    stiffness[:, own, own], mass[:, own, own] = space.eigenvalues, 1.0
    heavy = projection.core(factors, mass=True)
    for target, core in ((stiffness, projection.core(factors, mass=False)), (mass, heavy)):
        if core is not None:
            target += rows.T @ (core @ rows)
    count = min(size, space.rigid + 2 * len(problem.data.measurement) + settings.spare_modes)
    values, vectors = _solve(stiffness, None if heavy is None else mass, count)
    kept = values[:, 0] < settings.far / 2.0
    seen = space.pad_readings(size) @ vectors[kept]
    weight = space.mass + factors[kept] @ projection.weights
    return grid[kept], _compared(problem, signed_hz(values[kept]), seen, weight)


def _compared(
    problem: Problem, hertz: FloatArray, seen: FloatArray, mass: FloatArray
) -> FloatArray:
    """Return the residuals of candidates in deviations of the measurement, (g, n_data).

    Arguments:
        hertz, seen: their modes, (g, q), and the readings of these, (g, n_sensors, q).
        mass: of the structure in kg, (g,).
    """
    data, zero = problem.data, problem.space.zero
    seen = data.align(hertz, seen, zero)
    hertz, seen = data.predict(hertz, seen, zero)
    partner = data.pair(hertz, seen)
    each = np.arange(len(partner))[:, None]
    paired = np.moveaxis(np.moveaxis(seen, 2, 1)[each, partner], 1, 2)
    return np.asarray(data.residual(hertz[each, partner], paired, mass))


def _kept(problem: Problem, projections: Sequence[Projection], top: int) -> FloatArray:
    """Return the same, worked out once for all kinds of noise."""
    known = problem.space, problem.data, projections
    key = "atlas", top, *map(id, known)
    # Kept with what it is of, so that nothing else has those addresses meanwhile.
    if key not in problem.kept:
        problem.kept[key] = (known, _residuals(problem, projections, top))
    found: FloatArray = problem.kept[key][1]
    return found


def _responses(
    space: Space, projections: Sequence[Projection], low: int, tracked: int
) -> tuple[FloatArray, FloatArray]:
    """Return the main responses of the higher modes, orthonormal, the largest last.

    Returns:
        responses (h, N - low, kept), zero where there is none, and whether few will do, (h,).
    """
    n = len(space)
    values = space.eigenvalues
    response = np.empty((len(projections), n - low, tracked))
    for i, projection in enumerate(projections):
        response[i] = _forces(projection, low, n, tracked, values)
    response /= values[:tracked] - values[low:, None]
    kept = min(settings.responses, n - low, tracked)
    gram = np.swapaxes(response, 1, 2) @ response
    size, turn = np.linalg.eigh(gram)
    few, half = np.ones(len(projections), dtype=bool), settings.responses // 2
    if kept > half:
        # What is left out moves the modes by its square.
        few = size[:, -half - 1] <= settings.minor * size[:, -1]
    size, turn = size[:, tracked - kept :], turn[:, :, tracked - kept :]
    visible = size > 1e-10 * np.maximum(size[:, -1:], 1e-30)
    scale = np.where(visible, 1.0 / np.sqrt(np.where(visible, size, 1.0)), 0.0)
    return response @ (turn * scale[:, None, :]), few


def _forces(
    projection: Projection, low: int, n: int, tracked: int, values: FloatArray
) -> FloatArray:
    """Return what a typical magnitude exerts on the high modes, (n - low, tracked)."""
    factors, near = projection.hypothesis.typical_factors, projection.rows[:, :tracked]
    force = np.zeros(near.shape)
    stiff, heavy = (projection.core(factors, mass=mass) for mass in (False, True))
    if stiff is not None:
        force = stiff @ near
    if heavy is not None:
        force = force - heavy @ near * values[:tracked]
    return np.asarray(projection.rows[:, low:n].T @ force)


def _modes(
    space: Space, members: Sequence[Projection], responses: FloatArray, low: int
) -> tuple[FloatArray, FloatArray]:
    """Return Hz and readings of the lowest modes of all candidates, (g, low), (g, n_sensors, low).

    Arguments:
        space: modal coordinates.
        members: hypotheses with the same added coordinates, all with or all without mass.
        responses: of the higher modes, (h, N - low, kept).
        low: number of modes that are kept as they are.
    """
    n, extra, kept = len(space), members[0].extra, responses.shape[2]
    size, heavy = low + extra + kept, bool(members[0].is_mass.any())
    counts = [len(p.hypothesis.grid) for p in members]
    last = np.cumsum(counts)
    stiffness = np.empty((last[-1], size, size))
    mass = np.empty(stiffness.shape if heavy else (0, size, size))
    plain = _unloaded(space, responses, low, extra)
    unit = np.diag(np.repeat([1.0, 0.0, 1.0], [low, extra, kept]))
    for projection, response, base, stop in zip(members, responses, plain, last, strict=True):
        own = slice(stop - len(projection.hypothesis.grid), stop)
        known = projection.rows
        rows = np.hstack([known[:, :low], known[:, n:], known[:, low:n] @ response])
        # Terms are fewer than candidates, and what they do is smaller in the small basis.
        within = replace(projection, rows=rows, cores=rows.T @ (projection.cores @ rows))
        factors = projection.hypothesis.grid_factors
        for target, start, kind in ((stiffness, base, False), (mass, unit, True)):
            if kind and not heavy:
                continue
            change = within.core(factors, mass=kind)
            target[own] = start if change is None else start + change
    values, vectors = _solve(stiffness, mass if heavy else None, low)
    readings = np.zeros((len(members), len(space.readings), size))
    readings[:, :, :low] = space.readings[:, :low]
    readings[:, :, low + extra :] = space.readings[:, low:n] @ responses
    return signed_hz(values), np.repeat(readings, counts, axis=0) @ vectors


def _unloaded(space: Space, responses: FloatArray, low: int, extra: int) -> FloatArray:
    """Return the stiffness without a hypothesis in the small bases, (h, size, size)."""
    kept = responses.shape[2]
    start, size = low + extra, low + extra + kept
    plain = np.zeros((len(responses), size, size))
    plain[:, range(low), range(low)] = space.eigenvalues[:low]
    high = np.swapaxes(responses, 1, 2) @ (space.eigenvalues[low:, None] * responses)
    plain[:, start:, start:] = high
    own = plain[:, range(start, size), range(start, size)]
    idle = ~responses.any(axis=1)
    plain[:, range(start, size), range(start, size)] = np.where(idle, settings.far, own)
    return plain


def _solve(
    stiffness: FloatArray, mass: FloatArray | None, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest eigenvalues and mass-normalised vectors of a batch.

    Those with an indefinite mass are hopeless, and go far away.
    """
    if mass is None:
        values, vectors = np.linalg.eigh(stiffness)
        return values[:, :count], vectors[:, :, :count]
    try:
        lower = np.linalg.cholesky(mass)
    except np.linalg.LinAlgError:
        bad = np.linalg.eigvalsh(mass)[:, 0] <= 0.0
        mass, stiffness = mass.copy(), stiffness.copy()
        mass[bad], stiffness[bad] = np.eye(mass.shape[1]), settings.far * np.eye(mass.shape[1])
        lower = np.linalg.cholesky(mass)
    # One inverse costs less than three solutions with as many right-hand sides.
    inverse = np.linalg.inv(lower)
    turned = np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh(inverse @ stiffness @ turned)
    return values[:, :count], turned @ vectors[:, :, :count]
