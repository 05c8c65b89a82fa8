"""Modes that lie closer together than a test can tell: only the space they span has a meaning."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.typing import FloatArray, IntArray


def clusters_of(frequencies: FloatArray, closeness: float) -> list[IntArray]:
    """Return groups of two or more neighbouring modes, each within a share of its first.

    Arguments:
        frequencies: Hz, in any order, negative for imaginary ones, (p,).
        closeness: largest relative distance from the first to the last mode of a group.
    """
    order = np.argsort(frequencies)
    groups: list[IntArray] = []
    start = 0
    for stop in range(1, len(order) + 1):
        first = frequencies[order[start]]
        if stop == len(order) or frequencies[order[stop]] - first > closeness * abs(first):
            if stop - start > 1:
                groups.append(order[start:stop])
            start = stop
    return groups


def align_close_modes(
    frequencies: FloatArray, shapes: FloatArray, measured: FloatArray, closeness: float
) -> FloatArray:
    """Return shapes in which modes of nearly one frequency are turned towards measured ones.

    The eigenvectors of nearly repeated eigenvalues mix at the least perturbation of the model, so
    that none of them need look like a measured mode that their space contains. Within each group
    an orthogonal matrix turns them to the measured shapes that the space holds best; frequencies
    and mass-orthogonality are not touched.

    Arguments:
        frequencies: of the model in Hz, (p,).
        shapes: mass-normalised, at the sensors, (n_sensors, p).
        measured: (n_sensors, m); nan where missing.
        closeness: relative distance below which frequencies count as one.

    Source: D'Ambrogio & Fregolent (2003), Higher-order MAC for the correlation of close and
    multiple modes.
    """
    seen = np.isfinite(measured).all(axis=1)
    aligned = np.array(shapes, dtype=float)
    for group in clusters_of(frequencies, closeness):
        turn = turn_towards(aligned[np.ix_(seen, group)], measured[seen])
        if turn is not None:
            aligned[:, group] = aligned[:, group] @ turn
    return aligned


def turn_towards(space: FloatArray, measured: FloatArray) -> FloatArray | None:
    """Return the orthogonal matrix that turns close modes to the shapes that they hold best.

    None where the sensors cannot tell the modes from each other.

    Arguments:
        space: the close modes at the sensors, (n_sensors, k).
        measured: (n_sensors, m), no cell missing.
    """
    count = space.shape[1]
    if len(space) < count:
        return None
    along, size, across = np.linalg.svd(space, full_matrices=False)
    if size[-1] <= size[0] * max(space.shape) * np.finfo(float).eps:
        return None
    # The share of a shape within the space is its MAC with what the space makes of it.
    held = along.T @ measured
    norm = np.square(measured).sum(axis=0)
    likeness = np.square(held).sum(axis=0) / np.where(norm > 0.0, norm, 1.0)
    # In the order in which they were measured: of shapes held equally well rounding would choose.
    best = np.sort(np.argsort(-likeness, kind="stable")[:count])
    target = across.T @ (held[:, best] / size[:, None])
    length = np.linalg.norm(target, axis=0)
    target *= likeness[best] / np.where(length > 0.0, length, 1.0)
    left, _, right = np.linalg.svd(target)
    turn = np.asarray(left[:, : len(best)] @ right)
    return turn if len(best) == count else np.column_stack([turn, la.null_space(turn.T)])
