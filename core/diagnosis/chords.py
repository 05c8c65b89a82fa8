"""Between the magnitudes at which hypotheses were tried: residuals on straight lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from femubench.core.diagnosis.projection import Projection
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
    grid: FloatArray
    residuals: FloatArray
    x: FloatArray
    cost: float
    log_evidence: float


def interpolated(
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
            found[i] = _best_of_grid(p, own[i])
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


def _best_of_grid(projection: Projection, residuals: FloatArray) -> Screened:
    grid = projection.hypothesis.grid
    point, least = _in_cells(grid, residuals)
    evidence = -0.5 * least - 0.5 * _spread(residuals, grid)
    return Screened(projection, grid, residuals, point, least, float(evidence))


def _in_cells(grid: FloatArray, residuals: FloatArray) -> tuple[FloatArray, float]:
    """Return the best point of a grid in two coordinates, residuals linear within its cells."""
    cost = np.square(residuals).sum(axis=1) + np.square(grid).sum(axis=1)
    best = int(cost.argmin())
    axes = [np.unique(column) for column in grid.T]
    rows = residuals.reshape(*map(len, axes), -1)
    corner = np.stack(np.meshgrid(*(axis[:-1] for axis in axes), indexing="ij"), axis=2)
    size = np.stack(np.meshgrid(*map(np.diff, axes), indexing="ij"), axis=2)
    here = rows[:-1, :-1]
    sides = np.stack([rows[1:, :-1] - here, rows[:-1, 1:] - here], axis=3)
    turned = np.swapaxes(sides, 2, 3)
    normal = turned @ sides + np.square(size)[..., None] * np.eye(2)
    right = (turned @ here[..., None])[..., 0] + size * corner
    share = np.clip(-np.linalg.solve(normal, right[..., None])[..., 0], 0.0, 1.0)
    x = corner + share * size
    left = here + (sides @ share[..., None])[..., 0]
    value = np.square(left).sum(axis=2) + np.square(x).sum(axis=2)
    if value.size == 0 or value.min() >= cost[best]:
        return grid[best], float(cost[best])
    cell = np.unravel_index(value.argmin(), value.shape)
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
    t = np.clip(-b / a, 0.0, 1.0)
    cost = np.square(rows[:, :-1]).sum(axis=2) + np.square(x[:, :-1]) + 2 * b * t + a * t**2
    best = np.arange(len(x)), cost.argmin(axis=1)
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
