"""Every hypothesis at a few magnitudes at once: where to start, and what is hopeless.

Each hypothesis acts in a small basis: the lowest modes and the first-order response of the higher
ones to it (Fox & Kapoor 1968), so that thousands of candidates cost one batched eigensolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import log_ndtr

from femubench.core.diagnosis.effect import EffectParameter
from femubench.core.diagnosis.fit import Problem, State, signed_hz
from femubench.core.diagnosis.hypothesis import Hypothesis
from femubench.core.diagnosis.space import Projection, Space
from femubench.core.typing import FloatArray

_SINGLE = (0.12, 0.5, 1.3, 2.6)
_DOUBLE = (0.03, 0.2, 0.7, 1.8)
_STIFF = 0.01
_OSCILLATOR = (0.4, 1.2, 2.2)
_RESPONSES = 6
_FAR = 1e18
_REFERENCE = 0.6


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
    grid: FloatArray
    residuals: FloatArray
    x: FloatArray
    cost: float
    log_evidence: float


def grid_of(hypothesis: Hypothesis) -> FloatArray:
    """Return the coordinates at which a hypothesis is tried, (g, k)."""
    parameters = hypothesis.parameters
    if hypothesis.change.extra and len(parameters) == 2:
        first = [v for v in _OSCILLATOR if v <= parameters[0].range[1]]
        second = np.linspace(*parameters[1].range, 14)[1:]
        return np.array(list(product(first, second)))
    sizes = _SINGLE if len(parameters) == 1 else _DOUBLE
    return np.array(list(product(*(_points(parameter, sizes) for parameter in parameters))))


def _points(parameter: EffectParameter, sizes: Sequence[float]) -> list[float]:
    low, high = parameter.range
    if parameter.scaling == "compliance":
        # Its arm stays rigid however stiff the spring: x = 0 is no model without the effect.
        sizes = (_STIFF, *sizes)
    wanted = list(sizes) if parameter.one_sided else [-s for s in reversed(sizes)] + list(sizes)
    inside = [x for x in wanted if low <= x <= high]
    return inside or [0.5 * (low + high)]


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
    groups: dict[int, list[Projection]] = {}
    for projection in projections:
        groups.setdefault(projection.extra, []).append(projection)
    found: dict[int, Screened] = {}
    for extra, members in groups.items():
        grids = [grid_of(p.hypothesis) for p in members]
        residuals = _residuals(problem, members, grids, extra)
        still = base.residual
        if yielding is not None:
            residuals, still = _eased(residuals, yielding), _eased(still, yielding)
        start = 0
        for projection, grid in zip(members, grids, strict=True):
            own = residuals[start : start + len(grid)]
            start += len(grid)
            found[id(projection)] = _interpolated(projection, grid, own, still)
    return [found[id(projection)] for projection in projections]


def _eased(residuals: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return residuals whose squares are those after the best linear move within a prior."""
    along, size, _ = np.linalg.svd(slopes, full_matrices=False)
    taken = 1.0 - 1.0 / np.sqrt(1.0 + np.square(size))
    return np.asarray(residuals - (residuals @ along * taken) @ along.T)


def _residuals(
    problem: Problem, members: Sequence[Projection], grids: Sequence[FloatArray], extra: int
) -> FloatArray:
    """Return the residuals of all candidates in units of the noise, (sum of g, n_data)."""
    space, data = problem.space, problem.data
    wanted = min(len(space), space.rigid + 2 * len(data.measurement) + 4)
    tracked = min(wanted, space.rigid + len(data.measurement) + 3)
    bases = _bases(space, members, wanted, tracked, extra)
    stiffness, mass, readings, weight = [], [], [], []
    for projection, basis, grid in zip(members, bases, grids, strict=True):
        terms = basis.T @ (projection.terms @ basis)
        factors = projection.hypothesis.factors(grid)
        heavy = projection.is_mass
        own = space.eigenvalues @ np.square(basis[: len(space)])
        idle = ~basis.any(axis=0)
        grown = np.where(idle, _FAR, own)
        size = basis.shape[1]
        unit = np.eye(size)
        unit[wanted : wanted + extra, wanted : wanted + extra] = 0.0
        light = (basis[: len(space), :].T * space.eigenvalues) @ basis[: len(space), :]
        light[range(size), range(size)] = grown
        stiffness.append(light + np.tensordot(factors[:, ~heavy], terms[~heavy], axes=1))
        mass.append(unit + np.tensordot(factors[:, heavy], terms[heavy], axes=1))
        seen = space.readings @ basis[: len(space)]
        readings.append(np.broadcast_to(seen, (len(grid), *seen.shape)))
        weight.append(space.mass + factors @ projection.weights)
    values, vectors = _solve(np.concatenate(stiffness), np.concatenate(mass))
    count = min(values.shape[1], wanted)
    hertz = data.corrected(signed_hz(values[:, :count]), space.zero)
    seen = np.concatenate(readings) @ vectors[:, :, :count]
    partner = data.pair(hertz, seen)
    rows = np.arange(len(partner))[:, None]
    paired = np.moveaxis(seen, 2, 1)[rows, partner]
    raw = data.residual(hertz[rows, partner], np.moveaxis(paired, 1, 2), np.concatenate(weight))
    return problem.noise.whiten(raw + problem.offset)


def _bases(
    space: Space, members: Sequence[Projection], low: int, tracked: int, extra: int
) -> FloatArray:
    """Return a basis for every hypothesis, (h, N + extra, low + extra + responses)."""
    n = len(space)
    kept = min(_RESPONSES, n - low)
    bases = np.zeros((len(members), n + extra, low + extra + kept))
    bases[:, range(low), range(low)] = 1.0
    bases[:, n + np.arange(extra), low + np.arange(extra)] = 1.0
    if kept <= 0:
        return bases
    values = space.eigenvalues
    gap = values[:tracked] - values[low:, None]
    response = np.empty((len(members), n - low, tracked))
    for i, projection in enumerate(members):
        response[i] = _forces(projection, low, n, tracked, values) / gap
    gram = np.swapaxes(response, 1, 2) @ response
    size, turn = np.linalg.eigh(gram)
    size, turn = size[:, -kept:], turn[:, :, -kept:]
    visible = size > 1e-10 * np.maximum(size[:, -1:], 1e-30)
    scale = np.where(visible, 1.0 / np.sqrt(np.where(visible, size, 1.0)), 0.0)
    bases[:, low:n, low + extra :] = response @ (turn * scale[:, None, :])
    return bases


def _forces(
    projection: Projection, low: int, n: int, tracked: int, values: FloatArray
) -> FloatArray:
    """Return what a typical magnitude exerts on the high modes, (n - low, tracked)."""
    hypothesis = projection.hypothesis
    bottom, top = hypothesis.bounds
    x = np.clip(_REFERENCE * np.ones(len(bottom)), bottom, top)[None]
    factors = hypothesis.factors(x)[0]
    block = projection.terms[:, low:n, :tracked]
    heavy = projection.is_mass
    stiff = np.tensordot(factors[~heavy], block[~heavy], axes=1)
    return np.asarray(stiff - np.tensordot(factors[heavy], block[heavy], axes=1) * values[:tracked])


def _solve(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues and mass-normalised vectors of a batch; the hopeless ones far away."""
    try:
        lower = np.linalg.cholesky(mass)
    except np.linalg.LinAlgError:
        bad = np.linalg.eigvalsh(mass)[:, 0] <= 0.0
        mass, stiffness = mass.copy(), stiffness.copy()
        mass[bad], stiffness[bad] = np.eye(mass.shape[1]), _FAR * np.eye(mass.shape[1])
        lower = np.linalg.cholesky(mass)
    half = np.linalg.solve(lower, stiffness)
    inner = np.linalg.solve(lower, np.swapaxes(half, 1, 2))
    values, vectors = np.linalg.eigh(inner)
    return values, np.linalg.solve(np.swapaxes(lower, 1, 2), vectors)


def _interpolated(
    projection: Projection, grid: FloatArray, residuals: FloatArray, still: FloatArray
) -> Screened:
    """Return the best point: on the chords between neighbours, or the best point of a grid."""
    if grid.shape[1] > 1:
        point, least = _in_cells(grid, residuals)
        evidence = -0.5 * least - 0.5 * _spread(residuals, grid)
        return Screened(projection, grid, residuals, point, least, float(evidence))
    x, rows = grid[:, 0], residuals
    if np.all(np.abs(projection.hypothesis.factors(np.zeros((1, 1)))) < 1e-12):
        order = np.argsort(np.append(x, 0.0))
        x = np.append(x, 0.0)[order]
        rows = np.vstack([residuals, still])[order]
    if len(x) == 1:
        cost = float(rows[0] @ rows[0] + x[0] ** 2)
        return Screened(projection, grid, residuals, x, cost, -0.5 * cost)
    chord, width = np.diff(rows, axis=0), np.diff(x)
    a = np.square(chord).sum(axis=1) + width**2
    b = np.einsum("gi,gi->g", chord, rows[:-1]) + width * x[:-1]
    t = np.clip(-b / a, 0.0, 1.0)
    cost = np.square(rows[:-1]).sum(axis=1) + x[:-1] ** 2 + 2 * b * t + a * t**2
    best = int(cost.argmin())
    place = x[best] + t[best] * width[best]
    curvature = a[best] / width[best] ** 2
    evidence = -0.5 * cost[best] - 0.5 * np.log(curvature)
    if projection.hypothesis.one_sided[0]:
        evidence += np.log(2.0) + log_ndtr(place * np.sqrt(curvature))
    return Screened(
        projection, grid, residuals, np.array([place]), float(cost[best]), float(evidence)
    )


def _in_cells(grid: FloatArray, residuals: FloatArray) -> tuple[FloatArray, float]:
    """Return the best point of a grid in two coordinates, residuals linear within its cells."""
    first, second = (np.unique(column) for column in grid.T)
    shape = (len(first), len(second))
    cost = np.square(residuals).sum(axis=1) + np.square(grid).sum(axis=1)
    best = int(cost.argmin())
    place, least = grid[best], float(cost[best])
    rows = residuals.reshape(*shape, -1)
    for i, j in product(range(shape[0] - 1), range(shape[1] - 1)):
        corner = np.array([first[i], second[j]])
        size = np.array([first[i + 1] - first[i], second[j + 1] - second[j]])
        sides = np.stack([rows[i + 1, j] - rows[i, j], rows[i, j + 1] - rows[i, j]], axis=1)
        normal = sides.T @ sides + np.diag(size**2)
        share = np.clip(-np.linalg.solve(normal, sides.T @ rows[i, j] + size * corner), 0.0, 1.0)
        x = corner + share * size
        left = rows[i, j] + sides @ share
        value = float(left @ left + x @ x)
        if value < least:
            place, least = x, value
    return place, least


def _spread(residuals: FloatArray, grid: FloatArray) -> float:
    """Return about ln det of the curvature from the widest differences on a grid."""
    span = np.ptp(grid, axis=0)
    steep = np.linalg.norm(residuals - residuals.mean(axis=0), axis=1).max()
    return float(np.log(1.0 + np.square(steep / np.maximum(span, 1e-9))).sum())
