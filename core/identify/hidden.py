"""Where what a fit leaves still resonates."""

from __future__ import annotations

import numpy as np

from femubench.core.identify.basis import Lines
from femubench.core.identify.modal_fit import ModalModel, predict_responses
from femubench.core.typing import AnyArray

_DAMPING = (0.0025, 0.006, 0.015)
_STEP = 0.004  # between frequencies that are looked at, relative
_MOST = 12
_BLOCK = 64
_APART = 2.0  # half-power bandwidths between candidates


def find_hidden_poles(lines: Lines, fit: ModalModel) -> tuple[AnyArray, AnyArray]:
    """Return poles that would explain most of what a fit leaves, (n,), and participations.

    What is left is compared with single resonances on a grid of frequencies and dampings: a mode
    that the forces hardly move is no pole of a model that has to follow its neighbours.

    Returns participations (n_ref, n).
    """
    left = (lines.responses - predict_responses(fit, lines)) * fit.weights
    low, high = lines.omega[0], lines.omega[-1]
    omega = np.geomspace(low, high, max(2, int(np.log(high / low) / _STEP)))
    damping = np.repeat(_DAMPING, len(omega))
    poles = np.tile(omega, len(_DAMPING)) * (-damping + 1j * np.sqrt(1.0 - damping**2))
    weight = (1j * lines.omega) ** lines.derivative / lines.noise
    square = np.square(np.abs(weight)).astype(np.float32)
    flat = (weight[:, None, None] * left.conj()).reshape(len(weight), -1).T.astype(np.complex64)
    residues = np.empty((len(poles), len(flat)), dtype=np.complex64)
    # Some at once, which the processor keeps at hand: all lines by all poles fill the memory.
    for first in range(0, len(poles), _BLOCK):
        some = slice(first, first + _BLOCK)
        apart = (lines.omega[:, None] - poles.imag[some]).astype(np.float32)
        decay = -poles.real[some].astype(np.float32)
        size = 1.0 / (np.square(apart) + np.square(decay))  # of 1 / (decay + i apart), squared
        shapes = np.empty(size.shape, dtype=np.complex64)
        shapes.real, shapes.imag = decay * size, -apart * size
        residues[some] = (flat @ shapes / np.sqrt(square @ size)).conj().T
    residues = residues.reshape(-1, *left.shape[1:])
    gains = np.square(np.abs(residues)).sum(axis=(1, 2))
    # The largest gains that are not side by side.
    best: list[int] = []
    for k in np.argsort(-gains):
        width = _APART * max(abs(poles[k].real), _STEP * abs(poles[k]))
        if all(abs(poles[k].imag - poles[j].imag) > width for j in best):
            best.append(int(k))
        if len(best) == _MOST:
            break
    found = np.divide(
        residues[best], fit.weights, out=np.zeros_like(residues[best]), where=fit.weights > 0.0
    )
    forces = np.linalg.svd(found, full_matrices=False)[2][:, 0, :]
    return poles[best], forces.T
