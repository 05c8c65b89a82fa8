"""Shapes on a common footing: real as far as they can be, of a scale that says nothing."""

from __future__ import annotations

import numpy as np

from femubench.core.modal.complex_modes import mean_phase
from femubench.core.typing import AnyArray, FloatArray


def scaled_shapes(shapes: AnyArray, covariance: FloatArray) -> tuple[AnyArray, FloatArray]:
    """Return shapes as real as they can be with the largest real part 1, and their deviations.

    The scale of a shape is arbitrary: what only changes it is taken out of the deviations, which
    are those of a shape of fixed length. No component is without one.

    Arguments:
        shapes: complex, (n_out, m).
        covariance: of real, then imaginary parts, (m, 2 n_out, 2 n_out).
    """
    angle = mean_phase(shapes)
    turned = shapes * np.exp(-1j * angle)
    largest = np.abs(turned.real).argmax(axis=0)
    scale = turned.real[largest, np.arange(turned.shape[1])]
    deviations = np.zeros(shapes.shape)
    count = len(shapes)
    for k in range(shapes.shape[1]):
        real = turned[:, k].real
        to_real = np.hstack([np.cos(angle[k]) * np.eye(count), np.sin(angle[k]) * np.eye(count)])
        across = (np.eye(count) - np.outer(real, real) / (real @ real)) @ to_real
        spread = np.einsum("ia,ab,ib->i", across, covariance[k], across)
        deviations[:, k] = np.sqrt(np.maximum(spread, 0.0)) / abs(scale[k])
    return turned / scale, deviations
