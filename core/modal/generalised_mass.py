"""Shapes scaled to a generalised mass of 1."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.model import Model
from femubench.core.typing import FloatArray


def generalised_masses(model: Model, shapes: FloatArray) -> FloatArray:
    """Return phi' M phi of every shape, (m,).

    Arguments:
        model: whose mass counts.
        shapes: at all its dofs, (n, m).
    """
    return np.asarray(np.einsum("ij,ij->j", shapes, model.mass_times(shapes)))
