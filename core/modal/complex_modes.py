"""Real mode shapes from measured complex ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femubench.core.typing import FloatArray


def real_modes(shapes: NDArray[np.complex128], align_phase: bool = False) -> FloatArray:
    """Return the modulus of every component times the sign of its real part.

    The rule presumes a scale that makes the mode nearly real. Exporters that write residues or
    velocities scale it nearly imaginary, and then the real parts are noise and so are their signs.

    Arguments:
        shapes: (n_sensors, m); nan where nothing was measured.
        align_phase: first turn every mode by the phase that makes it as real as possible, so that
            the rule holds for any complex scale.

    Source: Ahmadian, Gladwell & Ismail (1997), section 3.

    Examples:
        >>> print(modal.real_modes(np.array([[3 + 4j], [-5 + 0j]])))
        [[ 5.]
         [-5.]]
    """
    values = np.asarray(shapes, dtype=np.complex128)
    if align_phase:
        values = values * np.exp(-1j * mean_phase(values))
    sign = np.where(values.real < 0.0, -1.0, 1.0)
    return np.asarray(np.abs(values) * np.where(np.isnan(values.real), np.nan, sign))


def phase_loss(shapes: NDArray[np.complex128]) -> FloatArray:
    """Return the share of the norm of every mode that lies across its line, 0 to 0.71, (m,).

    It is what turning the mode real loses; 0 of a real mode, whatever its scale. With the modal
    phase collinearity it is sqrt((1 - sqrt(MPC)) / 2).

    Arguments:
        shapes: (n_sensors, m); nan where nothing was measured.
    """
    values = np.nan_to_num(np.asarray(shapes, dtype=np.complex128))
    across = np.linalg.norm((values * np.exp(-1j * mean_phase(values))).imag, axis=0)
    size = np.linalg.norm(values, axis=0)
    return np.asarray(across / np.where(size > 0.0, size, 1.0))


def mean_phase(shapes: NDArray[np.complex128]) -> FloatArray:
    """Return the phase of the line that every mode lies closest to, -pi/2..pi/2, (m,).

    It maximises the sum of squared real parts of the mode turned back by it: half the phase of
    the sum of squares.
    """
    total = np.nansum(np.square(np.asarray(shapes, dtype=np.complex128)), axis=0)
    return np.asarray(0.5 * np.angle(total))
