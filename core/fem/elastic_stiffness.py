"""Stiffness of a meshed frame: elements, joint springs, springs to ground and braces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.attachments import brace_stiffness
from femubench.core.fem.beam import stiffness_matrices
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.typing import SparseArray


def elastic_stiffness(structure: MeshedFrame) -> SparseArray:
    """Return the stiffness without preloads and oscillators, (n, n)."""
    properties = structure.properties
    stiffness = structure.plan.assemble_from(lambda e: stiffness_matrices(properties.take(e)))
    if len(structure.springs):
        rows = structure.spring_rows
        each = rows.data * np.repeat(structure.springs, np.diff(rows.indptr))
        pull = sp.csr_array((each, rows.indices, rows.indptr), shape=rows.shape)
        stiffness = stiffness + pull.T @ rows
    if structure.frame.springs:
        stiffness = stiffness + structure.once(
            "springs",
            structure.interpolation,
            lambda: structure.attached((), structure.frame.springs)[1],
        )
    if structure.frame.braces:
        stiffness = stiffness + brace_stiffness(structure)
    return stiffness
