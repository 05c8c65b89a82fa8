"""How alike mode shapes are: MAC, auto-MAC, modal scale factor, with missing sensors left out."""

from __future__ import annotations

from typing import Any

import numpy as np

from femubench.core.typing import BoolArray, FloatArray

UNSEEN = 1e-9  # of the largest reading of any mode


def find_seen_modes(readings: Any) -> BoolArray:  # noqa: ANN401 - real or complex arrays
    """Tell which modes the sensors see, (m,).

    What is left of a mode that moves across all sensors is rounding, of which a MAC, or a scale
    of its own, would make a shape like any other.

    Arguments:
        readings: real or complex shapes with scales of one order, (n_sensors, m); nan where
            missing.
    """
    largest = np.abs(_columns(readings)[0]).max(axis=0, initial=0.0)
    return np.asarray(largest > UNSEEN * largest.max(initial=0.0))


def mac(a: Any, b: Any) -> FloatArray:  # noqa: ANN401 - real or complex arrays
    """Return the modal assurance criterion |a'b|^2 / (a'a b'b) of every pair, (m_a, m_b).

    A pair is compared at the sensors that both have; it scores 0 where they share none or a
    shape is zero at all of them.

    Arguments:
        a: real or complex shapes, (n_sensors, m_a) or (n_sensors,); nan where missing.
        b: the same sensors, (n_sensors, m_b) or (n_sensors,).

    Source: Allemang & Brown 1982, A correlation coefficient for modal vector analysis.

    Examples:
        >>> print(modal.mac(measurement.shapes, readings @ modes.shapes[:, [3, 4, 5]]).round(2))
        [[0.98 0.05 0.  ]
         [0.01 0.97 0.  ]
         [0.   0.   1.  ]]
    """
    left, has_left = _filled(a)
    right, has_right = _filled(b)
    if len(left) != len(right):
        raise ValueError(f"shapes at {len(left)} and at {len(right)} sensors cannot be compared")
    inner = np.square(np.abs(left.conj().T @ right))
    norms = (np.square(np.abs(left)).T @ has_right) * (has_left.T @ np.square(np.abs(right)))
    ratio = np.divide(inner, norms, out=np.zeros(norms.shape), where=norms > 0.0)
    return np.asarray(np.minimum(ratio, 1.0))


def modal_scale_factor(
    measured: Any,  # noqa: ANN401 - real or complex arrays
    predicted: Any,  # noqa: ANN401
    weights: FloatArray | None = None,
) -> Any:  # noqa: ANN401
    """Return the factors s for which s * predicted fits measured best, column by column, (m,).

    Weighted least squares over the sensors that both have, s = p'Wm / p'Wp; 0 where the
    predicted shape is zero there. Complex as soon as one of the two is.

    Arguments:
        measured: (n_sensors, m) or (n_sensors,); nan where missing.
        weights: W >= 0, e.g. 1/sigma^2, (n_sensors,) or (n_sensors, m); None for equal ones.

    Source: Allemang 1980, Investigation of some multiple input/output FRF techniques.
    """
    left, has_left = _columns(measured)
    right, has_right = _columns(predicted)
    if left.shape != right.shape:
        raise ValueError(f"shapes {left.shape} and {right.shape} do not go in pairs")
    both = (has_left & has_right).astype(float)
    if weights is not None:
        given = np.asarray(weights, dtype=float)
        both = np.where(both > 0.0, given if given.ndim == 2 else given[:, None], 0.0)
    size = (both * np.square(np.abs(right))).sum(axis=0)
    inner = (both * right.conj() * left).sum(axis=0)
    return np.divide(inner, size, out=np.zeros_like(inner), where=size > 0.0)


def _columns(shapes: Any) -> tuple[Any, BoolArray]:  # noqa: ANN401
    """Return shapes as columns, zero where missing, and where they are not missing."""
    array = np.asarray(shapes)
    array = array.astype(complex if np.iscomplexobj(array) else float)
    array = array[:, None] if array.ndim == 1 else array
    present = np.isfinite(array)
    return np.where(present, array, 0.0), present


def _filled(shapes: Any) -> tuple[Any, FloatArray]:  # noqa: ANN401
    """Return the same, scaled so that no square can overflow or vanish, presence as 0 and 1."""
    array, present = _columns(shapes)
    largest = np.abs(array).max(axis=0, initial=0.0)
    return array / np.where(largest > 0.0, largest, 1.0), present.astype(float)
