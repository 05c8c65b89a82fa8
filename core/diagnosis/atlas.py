"""Every hypothesis at a few magnitudes at once: where to start, and what is hopeless.

Each hypothesis acts in a small basis: the lowest modes and the first-order response of the higher
ones to it (Fox & Kapoor 1968), so that thousands of candidates cost one batched eigensolution.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench.core.diagnosis.chords import Screened, interpolated
from femubench.core.diagnosis.fit import Problem, State, signed_hz
from femubench.core.diagnosis.projection import Projection
from femubench.core.diagnosis.space import Space
from femubench.core.typing import FloatArray

_RESPONSES, _FEW = 6, 3
_MINOR = 1e-4  # of the largest squared response: what is left out moves the modes by its square
_KEPT, _TRACKED = 5, 3  # modes beyond the last partner: in the basis, and with their response
_LIKELY = 40  # that are looked at beside causes
_FAR = 1e18


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
    residuals, still = _residuals(problem, projections, top), base.residual
    if yielding is not None:
        residuals, still = _eased(residuals, yielding), _eased(still, yielding)
    return interpolated(projections, residuals, still)


def likely(
    screened: Sequence[Screened], still: FloatArray, state: State, least: float
) -> list[Projection]:
    """Return the hypotheses that promise most beside causes, were what they do to add up.

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
    eased = _eased(both, state.jacobian), _eased(state.residual, state.jacobian)
    rows = interpolated(projections, *eased)
    promising = [row for row in rows if state.chi2 - row.cost > least]
    promising.sort(key=lambda row: row.cost)
    return [row.projection for row in promising[:_LIKELY]]


def _eased(residuals: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return residuals whose squares are those after the best linear move within a prior."""
    along, size, _ = np.linalg.svd(slopes, full_matrices=False)
    taken = 1.0 - 1.0 / np.sqrt(1.0 + np.square(size))
    return np.asarray(residuals - (residuals @ along * taken) @ along.T)


def _residuals(problem: Problem, projections: Sequence[Projection], top: int) -> FloatArray:
    """Return the residuals of all candidates in units of the noise, (sum of g, n_data).

    Arguments:
        problem: data and modal coordinates.
        projections: the hypotheses.
        top: number of modes up to the last one that has a measured partner.
    """
    space, data = problem.space, problem.data
    low, tracked = min(len(space), top + _KEPT), min(len(space), top + _TRACKED)
    counts = [len(p.hypothesis.grid) for p in projections]
    first = np.concatenate([[0], np.cumsum(counts)])
    hertz = np.zeros((first[-1], low))
    seen = np.zeros((first[-1], len(space.readings), low))
    responses, few = _responses(space, projections, low, tracked)
    kinds: dict[tuple[int, bool, bool], list[int]] = {}
    for i, p in enumerate(projections):
        kinds.setdefault((p.extra, bool(p.is_mass.any()), bool(few[i])), []).append(i)
    for (_, _, small), members in kinds.items():
        kept = min(_FEW if small else _RESPONSES, responses.shape[2])
        chosen = responses[members][:, :, responses.shape[2] - kept :]
        rows = np.concatenate([np.arange(first[i], first[i + 1]) for i in members])
        own = [projections[i] for i in members]
        hertz[rows], seen[rows] = _modes(space, own, chosen, low)
    hertz = data.corrected(hertz, space.zero)
    partner = data.pair(hertz, seen)
    mass = [space.mass + p.hypothesis.grid_factors @ p.weights for p in projections]
    each = np.arange(len(partner))[:, None]
    paired = np.moveaxis(np.moveaxis(seen, 2, 1)[each, partner], 1, 2)
    raw = data.residual(hertz[each, partner], paired, np.concatenate(mass))
    return problem.noise.whiten(raw + problem.offset)


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
    kept = min(_RESPONSES, n - low, tracked)
    gram = np.swapaxes(response, 1, 2) @ response
    size, turn = np.linalg.eigh(gram)
    few = np.ones(len(projections), dtype=bool)
    if kept > _FEW:
        few = size[:, -_FEW - 1] <= _MINOR * size[:, -1]
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
        factors = projection.hypothesis.grid_factors
        for target, start, kind in ((stiffness, base, False), (mass, unit, True)):
            core = projection.core(factors, mass=kind)
            if kind and not heavy:
                continue
            target[own] = start if core is None else start + rows.T @ (core @ rows)
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
    plain[:, range(start, size), range(start, size)] = np.where(idle, _FAR, own)
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
        mass[bad], stiffness[bad] = np.eye(mass.shape[1]), _FAR * np.eye(mass.shape[1])
        lower = np.linalg.cholesky(mass)
    # One inverse costs less than three solutions with as many right-hand sides.
    inverse = np.linalg.inv(lower)
    turned = np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh(inverse @ stiffness @ turned)
    return values[:, :count], turned @ vectors[:, :, :count]


__all__ = ["Screened", "likely", "screen"]
