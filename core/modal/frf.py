"""Receptances from modes and damping."""

from __future__ import annotations

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.modal.eigen import Modes
from femubench.core.typing import FloatArray, SparseArray


def receptance(
    modes: Modes,
    response: SparseArray,
    excitation: SparseArray,
    frequencies: FloatArray,
    damping: FloatArray | float = 0.0,
) -> FloatArray:
    """Return displacement over force, complex, (n_frequencies, n_response, n_excitation).

    Arguments:
        modes: mass-normalised modes, rigid-body modes included.
        response, excitation: readings and forces from dofs, (n_response, n), (n_excitation, n).
        frequencies: in Hz, (n_f,).
        damping: viscous damping ratio of every mode or of all; ignored at zero frequency.

    Raises:
        ModelError: at the very frequency of an undamped mode, such as 0 Hz of a free structure.

    Source: Ewins (2000), Modal Testing, (2.45): sum of phi_i phi_j / (lambda - w^2 + 2 i z w_r w).

    Examples:
        >>> modal.receptance(modes, readings, readings[:1], np.linspace(100.0, 300.0, 5)).shape
        (5, 13, 1)
    """
    ratio = np.broadcast_to(np.nan_to_num(np.asarray(damping, dtype=float)), len(modes))
    out, into = response @ modes.shapes, excitation @ modes.shapes
    return modal_sum(modes.eigenvalues, out, into, frequencies, ratio)


def modal_sum(
    eigenvalues: FloatArray,
    out: FloatArray,
    into: FloatArray,
    frequencies: FloatArray,
    damping: FloatArray | float,
) -> FloatArray:
    """Return the receptance of modes that are known at the readings alone.

    Arguments:
        eigenvalues: in rad^2/s^2, (m,).
        out, into: mass-normalised shapes at responses and forces, (n_response, m), (n_force, m).
        frequencies: in Hz, (n_f,).
        damping: viscous damping ratio of every mode, or of all.

    Raises:
        ModelError: at the very frequency of an undamped mode.
    """
    omega = 2.0 * np.pi * np.asarray(frequencies)[:, None]
    root = np.sqrt(np.abs(eigenvalues))
    dynamic = eigenvalues - omega**2 + 2j * damping * root * omega
    if not dynamic.all():
        raise ModelError("the receptance is infinite at a frequency of an undamped mode")
    return np.asarray(np.einsum("im,fm,jm->fij", out, 1.0 / dynamic, into))
