"""Shape functions of beam elements along their flexible length, a whole batch at a time."""

from __future__ import annotations

import numpy as np

from femubench.core.typing import AnyArray, FloatArray

AXIAL = np.array([0, 6])
TWIST = np.array([3, 9])
# (v, rz) pairs with dv/dx = rz; (w, ry) pairs need the sign of the slope turned.
BEND_XY = np.array([1, 5, 7, 11])
BEND_XZ = np.array([2, 4, 8, 10])
SLOPE_SIGN = np.array([1.0, -1.0, 1.0, -1.0])
_REACH = 0.5 * float(np.sqrt(0.6))
# Points and weights on 0..1, exact up to the fifth degree.
GAUSS = ((0.5 - _REACH, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + _REACH, 5.0 / 18.0))


def interpolation(x: float, L: AnyArray, phi_y: AnyArray, phi_z: AnyArray) -> AnyArray:
    """Return displacement and rotation inside many elements, (n, 6, 12), local axes.

    Arguments:
        x: position as a share of the length, 0..1.
        L: flexible length in m, (n,).
        phi_y, phi_z: ratios of shear to bending flexibility; 0 for cubic functions, (n,).
    """
    rows = np.zeros((len(L), 6, 12), dtype=np.result_type(L, phi_y, phi_z))
    for i, columns in ((0, AXIAL), (3, TWIST)):
        rows[:, i, columns] = [1.0 - x, x]
    rows[:, [[1], [5]], BEND_XY] = np.moveaxis(bending_functions(x, L, phi_y), -1, 0)
    across = np.moveaxis(bending_functions(x, L, phi_z), -1, 0) * SLOPE_SIGN
    rows[:, [[2], [4]], BEND_XZ] = across * [[1.0], [-1.0]]
    return rows


def cubic_rates(x: float, L: FloatArray) -> FloatArray:
    """Return the derivatives of displacement and rotation in x, (n, 6, 12), cubic functions.

    Arguments:
        x: position as a share of the length, 0..1.
        L: flexible length in m, (n,).
    """
    rows = np.zeros((len(L), 6, 12))
    for i, columns in ((0, AXIAL), (3, TWIST)):
        rows[:, i, columns] = np.array([-1.0, 1.0]) / L[:, None]
    _, slope = bending_functions(x, L, np.zeros_like(L))
    bend = np.array([(12 * x - 6) / L**2, (6 * x - 4) / L, (6 - 12 * x) / L**2, (6 * x - 2) / L]).T
    rows[:, 1, BEND_XY], rows[:, 5, BEND_XY] = slope.T, bend
    rows[:, 2, BEND_XZ], rows[:, 4, BEND_XZ] = slope.T * SLOPE_SIGN, -bend * SLOPE_SIGN
    return rows


def bending_functions(x: float, L: AnyArray | float, phi: AnyArray | float) -> AnyArray:
    """Return deflection and slope of the section for (w, slope) at both ends, (2, 4, ...).

    Source: Friedman & Kosmatka (1993), (20)-(21); with phi = 0 Hermite's cubic functions.
    """
    c = 1.0 / (1.0 + phi)
    cubic = 2 * x**3 - 3 * x**2 - phi * x
    w = [
        c * (cubic + 1 + phi),
        c * L * (x**3 - (2 + phi / 2) * x**2 + (1 + phi / 2) * x),
        -c * cubic,
        c * L * (x**3 - (1 - phi / 2) * x**2 - phi / 2 * x),
    ]
    slope = 6 * c / L * (x**2 - x)
    theta = [
        slope,
        c * (3 * x**2 - (4 + phi) * x + 1 + phi),
        -slope,
        c * (3 * x**2 - (2 - phi) * x),
    ]
    return np.array([w, theta])


def rigid_part(x: float, L: float) -> FloatArray:
    """Return the same at a rigid end, x < 0 or x > 1, (2, 4)."""
    if x < 0.0:
        return np.array([[1.0, x * L, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    return np.array([[0.0, 0.0, 1.0, (x - 1.0) * L], [0.0, 0.0, 0.0, 1.0]])
