"""How far a mode shape is from a real one."""

from __future__ import annotations

import numpy as np

from femubench.core.modal.complex_modes import mean_phase, phase_loss
from femubench.core.typing import AnyArray, FloatArray

LEAST_COLLINEAR = 0.8  # of a mode from records over time, whose errors are no white noise


def phase_collinearity(shapes: AnyArray) -> FloatArray:
    """Return the modal phase collinearity of every mode: 1 on a line, 0 on a circle, (m,).

    Arguments:
        shapes: complex, (n, m).

    Source: Juang & Pappa (1985), An eigensystem realization algorithm, modal phase collinearity;
        here about the origin, without taking out a mean.
    """
    return np.asarray(np.square(1.0 - 2.0 * np.square(phase_loss(shapes))))


def mean_phase_deviation(shapes: AnyArray) -> FloatArray:
    """Return the mean angle in degrees of the components to their common line, (m,).

    Components count by their size.

    Arguments:
        shapes: complex, (n, m).

    Source: Reynders, Houbrechts & De Roeck (2012), Fully automated (operational) modal analysis,
        (5)-(7): the line is the first right singular vector of real and imaginary parts.
    """
    values = np.asarray(shapes)
    turned, size = values * np.exp(-1j * mean_phase(values)), np.abs(values)
    angle = np.degrees(np.arctan2(np.abs(turned.imag), np.abs(turned.real)))
    return np.asarray((size * angle).sum(axis=0) / size.sum(axis=0))
