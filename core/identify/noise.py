"""The level of the noise by channel and by frequency, from what a fit leaves."""

from __future__ import annotations

import numpy as np

from femubench.core.identify.basis import RESIDUALS, Lines
from femubench.core.identify.modal_fit import ModalFit, predicted
from femubench.core.typing import AnyArray, BoolArray, FloatArray

_WINDOW = 61  # lines over which the level is averaged


def first_weights(lines: Lines, poles: AnyArray, seen: BoolArray) -> FloatArray:
    """Return one over the noise of every channel that no candidate explains, (n_out, n_ref).

    Arguments:
        lines: the data.
        poles: of the candidates, in rad/s, (n,).
        seen: which channels were measured, (n_out, n_ref).
    """
    functions = lines.modes(poles)[:, :, :2].reshape(len(lines.values), -1)
    functions = np.concatenate([functions, lines.residuals()], axis=1)
    functions = functions / np.linalg.norm(functions, axis=0)
    flat = lines.values.reshape(len(functions), -1)
    left = flat - functions @ np.linalg.lstsq(functions, flat, rcond=1e-10)[0]
    freedom = max(1, len(flat) - functions.shape[1])
    return _inverse(np.square(left).sum(axis=0) / freedom, seen)


def _inverse(variance: FloatArray, seen: BoolArray) -> FloatArray:
    floor = 1e-24 * float(variance.max(initial=0.0)) or 1.0
    return np.where(seen, 1.0 / np.sqrt(np.maximum(variance.reshape(seen.shape), floor)), 0.0)


def noise_left(fit: ModalFit, lines: Lines, seen: BoolArray) -> tuple[Lines, FloatArray]:
    """Return lines and weights with the noise that a fit leaves.

    Its course over frequency is that of all channels together, its level that of each.

    Arguments:
        fit: of the lines.
        lines: the data.
        seen: which channels were measured, (n_out, n_ref).
    """
    error = lines.responses - predicted(fit, lines)
    left = np.square(np.abs(error * fit.weights)).sum(axis=(1, 2))
    window = min(_WINDOW, len(left) // 4)
    kernel = np.ones(window)
    level = np.convolve(left, kernel, "same") / np.convolve(np.ones_like(left), kernel, "same")
    level = np.sqrt(np.maximum(level / level.mean(), 1e-6))
    noise = lines.noise * level
    rescaled = Lines.of(lines.omega, lines.derivative, lines.raw, noise)
    error = error / level[:, None, None]
    unknowns = 2 * len(fit.poles) * sum(seen.shape) / max(1, int(seen.sum())) + RESIDUALS
    freedom = max(1.0, 2 * len(level) - unknowns)
    return rescaled, _inverse(np.square(np.abs(error)).sum(axis=0) / freedom, seen)
