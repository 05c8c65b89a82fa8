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
    """
    omega = 2.0 * np.pi * np.asarray(frequencies)[:, None]
    ratio = np.broadcast_to(np.nan_to_num(np.asarray(damping, dtype=float)), len(modes))
    root = np.sqrt(np.abs(modes.eigenvalues))
    dynamic = modes.eigenvalues - omega**2 + 2j * ratio * root * omega
    if not dynamic.all():
        raise ModelError("the receptance is infinite at a frequency of an undamped mode")
    out, into = response @ modes.shapes, excitation @ modes.shapes
    return np.asarray(np.einsum("im,fm,jm->fij", out, 1.0 / dynamic, into))
