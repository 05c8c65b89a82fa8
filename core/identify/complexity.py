"""How far a mode shape is from a real one."""

from __future__ import annotations

import numpy as np

from femubench.core.typing import AnyArray, FloatArray

LEAST_COLLINEAR = 0.8  # of a mode from records over time, whose errors are no white noise


def phase_collinearity(shapes: AnyArray) -> FloatArray:
    """Return the modal phase collinearity of every mode: 1 on a line, 0 on a circle, (m,).

    Arguments:
        shapes: complex, (n, m).

    Source: Juang & Pappa (1985), An eigensystem realization algorithm, modal phase collinearity;
        here about the origin, without taking out a mean.
    """
    xx, yy = np.square(shapes.real).sum(axis=0), np.square(shapes.imag).sum(axis=0)
    xy = (shapes.real * shapes.imag).sum(axis=0)
    return np.asarray((np.square(xx - yy) + 4.0 * np.square(xy)) / np.square(xx + yy))


def mean_phase_deviation(shapes: AnyArray) -> FloatArray:
    """Return the mean angle in degrees of the components to their common line, (m,).

    Components count by their size.

    Arguments:
        shapes: complex, (n, m).

    Source: Reynders, Houbrechts & De Roeck (2012), Fully automated (operational) modal analysis,
        (5)-(7): the line is the first right singular vector of real and imaginary parts.
    """
    found = []
    for shape in np.asarray(shapes).T:
        parts = np.stack([shape.real, shape.imag], axis=1)
        line = np.linalg.svd(parts, full_matrices=False)[2][0]
        size = np.abs(shape)
        along = np.abs(parts @ line) / np.where(size > 0.0, size, 1.0)
        angle = np.arccos(np.clip(along, 0.0, 1.0))
        found.append(np.degrees((size * angle).sum() / size.sum()))
    return np.array(found)
