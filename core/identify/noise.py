"""The level of the noise by channel and by frequency, from what a fit leaves."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from femubench.core.identify.basis import RESIDUALS, Lines
from femubench.core.identify.modal_fit import ModalModel, predict_responses
from femubench.core.typing import AnyArray, BoolArray, FloatArray

# Lines over which the level is averaged: these, and as many as give so many values of all channels.
_SHORTEST, _ENOUGH = 9, 300
_LEAST_LEFT = 0.1  # of the noise around a resonance, that a fit may be thought to leave
_BEST = 1e-4  # noise of a channel over its rms: less is no measurement


def first_weights(lines: Lines, poles: AnyArray, seen: BoolArray) -> FloatArray:
    """Return one over the noise of every channel that no candidate explains, (n_out, n_ref).

    Arguments:
        poles: of the candidates, in rad/s, (n,).
        seen: which channels were measured, (n_out, n_ref).
    """
    functions = lines.modes(poles)[:, :, :2].reshape(len(lines.values), -1)
    functions = np.concatenate([functions, lines.residuals()], axis=1)
    functions = functions / np.linalg.norm(functions, axis=0)
    flat = lines.values.reshape(len(functions), -1)
    left = flat - functions @ np.linalg.lstsq(functions, flat, rcond=1e-10)[0]
    freedom = max(1, len(flat) - functions.shape[1])
    return _inverse(np.square(left).sum(axis=0) / freedom, lines, seen)


def _inverse(variance: FloatArray, lines: Lines, seen: BoolArray) -> FloatArray:
    """Return one over the noise of every channel; no channel is better than `_BEST`."""
    power = np.square(lines.values).mean(axis=0)
    least = np.maximum(variance.reshape(seen.shape), _BEST**2 * power)
    alive = seen & (power > 0.0)
    return np.asarray(np.divide(1.0, np.sqrt(least), out=np.zeros_like(least), where=alive))


def noise_left(
    fit: ModalModel, lines: Lines, seen: BoolArray, *, rough: bool = False
) -> tuple[Lines, FloatArray]:
    """Return lines and weights with the noise that a fit leaves.

    Its course over frequency is that of all channels together, its level that of each.

    Arguments:
        seen: which channels were measured, (n_out, n_ref).
        rough: take the course over frequency from second differences of the lines alone, in which
            a mode that the fit lacks does not show.
    """
    error = lines.responses - predict_responses(fit, lines)
    scaled = error * fit.weights
    if rough:
        padded = np.concatenate([scaled[1:2], scaled, scaled[-2:-1]])
        scaled = (padded[:-2] - 2.0 * scaled + padded[2:]) / np.sqrt(6.0)
    left = np.square(np.abs(scaled)).sum(axis=(1, 2))
    window = min(max(_SHORTEST, -(-_ENOUGH // max(1, int(seen.sum())))), len(left) // 4)
    kernel = np.ones(window)
    level = np.convolve(left, kernel, "same") / np.convolve(np.ones_like(left), kernel, "same")
    level = np.sqrt(np.maximum(level / level.mean(), 1e-6))
    noise = lines.noise * level
    rescaled = Lines.of(lines.omega, lines.derivative, lines.raw, noise)
    error = error / level[:, None, None]
    unknowns = 2 * len(fit.poles) * sum(seen.shape) / max(1, int(seen.sum())) + RESIDUALS
    freedom = max(1.0, 2 * len(level) - unknowns)
    return rescaled, _inverse(np.square(np.abs(error)).sum(axis=0) / freedom, rescaled, seen)


def unevenness(fit: ModalModel, lines: Lines) -> FloatArray:
    """Return the noise around each mode's resonance over what the weights say, (n, 2).

    The noise of a channel need not follow the course of all channels: where it follows the
    channel's own response it is largest where a mode is seen best. The first column weighs lines
    as poles depend on them, the second as shapes do.
    """
    error = np.square(np.abs((lines.responses - predict_responses(fit, lines)) * fit.weights))
    resonance = _resonance(fit, lines)
    seen = (
        np.abs(fit.shapes)[:, None, :] * np.abs(fit.participation)[None] * fit.weights[:, :, None]
    )
    found = []
    for lens in (resonance, np.sqrt(resonance)):
        there = np.square(lens), np.square(seen)
        whole = there[0].sum(axis=0) * there[1].sum(axis=(0, 1))
        found.append(np.einsum("fn,oin,foi->n", *there, error, optimize=True) / (2.0 * whole))
    return np.stack(found, axis=1)


def noise_kept(fit: ModalModel, lines: Lines, decay: float) -> FloatArray:
    """Return the share of the noise around each resonance that a fit leaves, (n, 2).

    Columns are those of `unevenness`. The rest is taken for the mode: of few lines, alike under an
    exponential window, it is most. Functions that channels share count by the unknowns that one
    channel has of them.

    Arguments:
        decay: of the window, in 1/s.
    """
    half, n = len(lines.omega), len(fit.poles)
    base, rest = lines.modes(fit.poles), lines.residuals()
    parts = [rest, *(base[:, :, at].reshape(2 * half, -1) for at in ([0, 1], [2, 3]))]
    functions = np.concatenate(parts, axis=1)
    own = np.linalg.qr(functions / np.linalg.norm(functions, axis=0))[0]
    count = max(1, int(np.count_nonzero(fit.weights)))
    ranks = min(1.0, (sum(fit.weights.shape) - 1) / count)
    share = np.repeat([1.0, ranks, 1.0 / count], [rest.shape[1], 2 * n, 2 * n])
    # White noise under e^-wt: how lines that are k apart go together.
    seconds = 2.0 * np.pi / float(np.diff(lines.omega).mean())
    column = 1.0 / (1.0 + 1j * np.pi * np.arange(half) / (decay * seconds))
    spread = scipy.linalg.matmul_toeplitz((column, column.conj()), own[:half] + 1j * own[half:])
    noisy = np.concatenate([spread.real, spread.imag])
    root = np.sqrt(share)
    left = 1.0 - 2.0 * (own * noisy) @ share
    left += np.einsum("fa,ab,fb->f", own * root, own.T @ noisy, own * root, optimize=True)
    squares = [np.square(_resonance(fit, lines)), _resonance(fit, lines)]
    level = 0.5 * (left[:half] + left[half:])
    found = [np.maximum(level @ lens / lens.sum(axis=0), _LEAST_LEFT) for lens in squares]
    return np.stack(found, axis=1)


def _resonance(fit: ModalModel, lines: Lines) -> FloatArray:
    """Return how much a change of each pole changes every line, whitened, (n_f, n)."""
    found = np.abs((1j * lines.omega[:, None]) ** lines.derivative / lines.noise[:, None])
    return np.asarray(found / np.square(np.abs(1j * lines.omega[:, None] - fit.poles)))
