"""Least-squares fit of poles, shapes and participations together, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from femubench.core.identify.basis import RESIDUALS, Lines, Products, turning
from femubench.core.typing import AnyArray, BoolArray, FloatArray

_MOST_STEPS = 30
_ENOUGH = 0.01  # decrease of the misfit in units of the noise


@dataclass(frozen=True)
class ModalModel:
    """A modal model with poles, shapes and participations, rank one a mode.

    Arguments:
        poles: in rad/s, (n,).
        participation: of the references, the largest one of a mode 1, (n_ref, n).
        shapes: complex, (n_out, n).
        residuals: real numbers of what lies outside of the band, (n_out, n_ref, 4).
        weights: one over the standard deviation of each channel's noise, (n_out, n_ref).
        misfit: weighted sum of squares, by channel, (n_out, n_ref).
        pole_covariance: of real and imaginary parts, (n, 2, 2).
        shape_covariance: of real, then imaginary parts at the outputs, (n, 2 n_out, 2 n_out).
    """

    poles: AnyArray
    participation: AnyArray
    shapes: AnyArray
    residuals: FloatArray
    weights: FloatArray
    misfit: FloatArray
    pole_covariance: FloatArray
    shape_covariance: FloatArray


@dataclass(frozen=True)
class _Outputs:
    """The linear part of one output at given poles: its solution and its normal equations."""

    solution: FloatArray
    normal: FloatArray
    mixed: FloatArray
    misfit: FloatArray


@dataclass(frozen=True)
class _Point:
    """Where the fit stands: shared unknowns, what is best for every output, and the next step."""

    poles: AnyArray
    participation: AnyArray
    outputs: tuple[_Outputs, ...]
    normal: FloatArray
    gradient: FloatArray

    @property
    def misfit(self) -> FloatArray:
        return np.array([output.misfit for output in self.outputs])


def fit_modes(
    lines: Lines, poles: AnyArray, participation: AnyArray, weights: FloatArray
) -> ModalModel:
    """Return the modal model that fits best.

    For given poles and participations the shapes are a linear problem, output by output; the
    shared unknowns move by steps of Gauss and Newton with Levenberg's damping.

    Arguments:
        poles: to start from, in rad/s, (n,).
        participation: likewise, (n_ref, n).
        weights: of the channels, 0 where nothing was measured, (n_out, n_ref).

    Source: Golub & Pereyra (1973), The differentiation of pseudo-inverses and nonlinear least
        squares problems whose variables separate; Pintelon, Guillaume & Schoukens (2007),
        Uncertainty calculation in (operational) modal analysis, for the covariance.
    """
    point = _point(lines, poles, _scaled(participation), weights)
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        better = None
        while better is None and damping < 1e6:
            # Poles and participations after one damped step.
            step = _solved(point.normal, point.gradient, damping)
            n, references = len(point.poles), len(point.participation)
            change = np.zeros((1 + references, n, 2))
            change.reshape(-1)[_free(point.participation)] = step
            complex_change = change[..., 0] + 1j * change[..., 1]
            moved = point.poles + complex_change[0], point.participation + complex_change[1:]
            if (moved[0].real < 0.0).all():
                trial = _point(lines, *moved, weights)
                if trial.misfit.sum() < point.misfit.sum():
                    better = trial
            damping *= 0.1 if better is not None else 10.0
        if better is None:
            break
        gain = point.misfit.sum() - better.misfit.sum()
        point = better
        if gain < _ENOUGH + 1e-12 * point.misfit.sum():
            break
    return _result(point, weights)


def _scaled(participation: AnyArray) -> AnyArray:
    largest = np.abs(participation).argmax(axis=0)
    return np.asarray(participation / participation[largest, np.arange(participation.shape[1])])


def _free(participation: AnyArray) -> BoolArray:
    """Tell which shared unknowns are free: all but the largest participation of every mode."""
    references, n = participation.shape
    free = np.ones((1 + references, n, 2), dtype=bool)
    free[1 + np.abs(participation).argmax(axis=0), np.arange(n)] = False
    return free.reshape(-1)


def _point(lines: Lines, poles: AnyArray, participation: AnyArray, weights: FloatArray) -> _Point:
    products = Products.of(lines, poles)
    n, references = len(poles), len(participation)
    at = np.arange(4 * n).reshape(n, 4)
    first, second = at[:, :2].reshape(-1), at[:, 2:].reshape(-1)
    turns = [turning(row) for row in participation]
    shared = 2 * n * (1 + references)
    normal, gradient = np.zeros((shared, shared)), np.zeros(shared)
    outputs = []
    for o, weight in enumerate(np.square(weights)):
        data = products.data[:, o]
        linear = _linear(products.gram, data, first, turns, weight)
        shape = linear[1][: 2 * n].reshape(n, 2) @ [1.0, 1j]
        # Columns: what shapes, then residuals, then shared unknowns do to the base functions.
        size = 2 * n + RESIDUALS * references
        own, mixed = linear[0], np.zeros((size, shared))
        misfit = np.zeros(references)
        for i in range(references):
            if not weight[i]:
                continue
            moves = np.zeros((4 * n + RESIDUALS, shared))
            moves[second, : 2 * n] = turning(shape * participation[i])
            block = slice(2 * n * (1 + i), 2 * n * (2 + i))
            moves[first, block] = turning(shape)
            local = _local(first, turns[i], i, size)
            coefficients = local @ linear[1]
            seen = products.gram @ moves
            left = data[:, i] - products.gram @ coefficients
            normal += weight[i] * (moves.T @ seen)
            mixed += weight[i] * (local.T @ seen)
            gradient += weight[i] * (moves.T @ left)
            total = products.squares[o, i] - coefficients @ (data[:, i] + left)
            misfit[i] = weight[i] * max(total, 0.0)
        outputs.append(_Outputs(linear[1], own, mixed, misfit))
        normal -= mixed.T @ _solved(own, mixed)
    free = _free(participation)
    return _Point(poles, participation, tuple(outputs), normal[np.ix_(free, free)], gradient[free])


def _local(first: AnyArray, turn: FloatArray, reference: int, size: int) -> FloatArray:
    """Return what shape and residuals of an output do to the base functions at one reference."""
    n2 = len(first)
    found = np.zeros((2 * n2 + RESIDUALS, size))
    found[first, :n2] = turn
    at = n2 + RESIDUALS * reference
    found[2 * n2 :, at : at + RESIDUALS] = np.eye(RESIDUALS)
    return found


def _linear(
    gram: FloatArray, data: FloatArray, first: AnyArray, turns: list[FloatArray], weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the normal matrix of one output's shape and residuals, and the solution."""
    size = len(first) + RESIDUALS * len(turns)
    normal, right = np.zeros((size, size)), np.zeros(size)
    for i, turn in enumerate(turns):
        if weight[i]:
            local = _local(first, turn, i, size)
            normal += weight[i] * (local.T @ gram @ local)
            right += weight[i] * (local.T @ data[:, i])
    return normal, _solved(normal, right)


def _solved(normal: FloatArray, right: FloatArray, damping: float = 1e-13) -> FloatArray:
    """Return the solution of a problem whose columns are brought to one length, and damped.

    What was not measured has no column: its unknowns stay zero.
    """
    length = np.sqrt(np.diag(normal))
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
    unit = normal * scale[:, None] * scale[None, :]
    unit[np.diag_indices(len(unit))] = 1.0 + damping
    rows = right * (scale if right.ndim == 1 else scale[:, None])
    found = scipy.linalg.solve(unit, rows, assume_a="sym")
    return np.asarray(found * (scale if right.ndim == 1 else scale[:, None]))


def _result(point: _Point, weights: FloatArray) -> ModalModel:
    n, references = len(point.poles), len(point.participation)
    free = _free(point.participation)
    shared = _solved(point.normal, np.eye(len(point.normal)))
    poles = np.zeros((len(free), len(free)))
    poles[np.ix_(free, free)] = shared
    solutions = np.array([output.solution for output in point.outputs])
    shapes = solutions[:, : 2 * n].reshape(-1, n, 2)
    count = len(solutions)
    covariance = np.zeros((n, 2, count, 2, count))
    follow = np.zeros((count, n, 2, len(shared)))
    for o, output in enumerate(point.outputs):
        inverse = _solved(output.normal, np.eye(len(output.normal)))[: 2 * n]
        follow[o] = (inverse @ output.mixed)[:, free].reshape(n, 2, -1)
        own = inverse[:, : 2 * n].reshape(n, 2, n, 2)
        at = np.arange(n)
        covariance[at, :, o, :, o] = own[at, :, at, :]
    # What the covariance of the shared unknowns adds to that of the shapes.
    moved = follow @ shared
    covariance += np.asarray(np.einsum("oraf,prbf->raobp", moved, follow, optimize=True))
    at = np.arange(n)
    own_poles = poles[: 2 * n, : 2 * n].reshape(n, 2, n, 2)[at, :, at, :]
    return ModalModel(
        poles=point.poles,
        participation=point.participation,
        shapes=shapes @ np.array([1.0, 1j]),
        residuals=solutions[:, 2 * n :].reshape(count, references, RESIDUALS),
        weights=weights,
        misfit=point.misfit,
        pole_covariance=own_poles,
        shape_covariance=covariance.reshape(n, 2 * count, 2 * count),
    )


def predict_responses(fit: ModalModel, lines: Lines) -> AnyArray:
    """Return the responses of a fit at the lines, whitened, complex, (n_f, n_out, n_ref)."""
    base = lines.modes(fit.poles)[:, :, :2]
    residues = fit.shapes[:, None, :] * fit.participation[None]  # (out, ref, n)
    pairs = np.stack([residues.real, residues.imag], axis=3)
    found: FloatArray = np.einsum("fnk,oink->foi", base, pairs, optimize=True)
    found += np.einsum("fk,oik->foi", lines.residuals(), fit.residuals)
    half = len(found) // 2
    return np.asarray(found[:half] + 1j * found[half:])
