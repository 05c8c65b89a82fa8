"""The model of a family that has given frequencies and the smallest equation error."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from equation_readings import Reading, expanded, modes_of, nominal_of, system
from ladder_settings import patterns
from scipy.optimize import least_squares

from femubench import StrategyFailure
from femubench.fem import FloatArray


def nearest_with(reading: Reading, target: FloatArray) -> tuple[float, float, float, float]:
    """Return equation errors over the inertia forces, and the largest change of a parameter.

    Arguments:
        reading: which equations, with shapes expanded by the nominal model.
        target: five frequencies in Hz that the model shall have.

    Returns:
        Errors of the nominal model, of least squares, and of the best model near the nominal one
        with exactly those frequencies; its largest relative change of a parameter.
    """
    nominal = nominal_of(reading)
    change = patterns(reading.family, reading.tied, reading.only, nominal, reading.sharing)
    wanted = np.square(2.0 * np.pi * nominal.frequencies)
    shapes = reading.scale * expanded(reading, nominal, nominal.stiffness, nominal.measured)
    a, b, size = system(reading, nominal, change, shapes, wanted)
    sharp = size / 0.01  # 0.01 Hz weighs as much as the inertia forces

    def rows(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        _, hz, modes = modes_of(nominal, nominal.stiffness + np.einsum("j,jab->ab", x, change))
        slope = np.einsum("am,jab,bm->mj", modes[:, :5], change, modes[:, :5], optimize=True)
        slope /= 8.0 * np.pi**2 * hz[:5, None]
        away = np.append(a @ x - b, sharp * (hz[:5] - target))
        return away, np.vstack([a, sharp * slope])

    x = least_squares(
        lambda x: rows(x)[0], np.zeros(len(change)), lambda x: rows(x)[1], bounds=(-0.99, np.inf)
    ).x
    errors = [float(np.linalg.norm(a @ y - b)) / size for y in (0.0 * x, la.lstsq(a, b)[0], x)]
    missed = modes_of(nominal, nominal.stiffness + np.einsum("j,jab->ab", x, change))[1][:5]
    if np.abs(missed - target).max() > 0.05:
        raise StrategyFailure("no model with these frequencies was reached")
    return errors[0], errors[1], errors[2], float(np.abs(x).max())
