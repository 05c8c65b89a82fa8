"""What is known of the groups of a model from matrices before any measurement."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.model import Model
from femubench.core.modal.eigen import once_for
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.typing import FloatArray, SparseArray

STRUCTURE_STD = 0.1  # of ln(factor)
SUPPORT_FACTOR = 5.0  # as likely as not
QUARTILE = 0.6744897501960817  # of the standard normal distribution
_FORCE = 1e-8  # of the forces that cancel each other in a rigid-body motion


def support_groups(model: Model) -> frozenset[str]:
    """Return the groups of the stiffness that hold the structure to ground.

    A group is a support where its matrix couples no two dofs, or where a rigid-body motion costs
    it force. The latter is asked only where positions and directions of the dofs are right, that
    is, where some group that couples dofs is free of force in all rigid-body motions.

    Examples:
        >>> modal.support_groups(model)
        frozenset()
    """
    return once_for(model, "support groups", lambda: _support_groups(model))


def _support_groups(model: Model) -> frozenset[str]:
    apart = {name for name, part in model.groups.items() if not _couples(part)}
    rigid = rigid_body_vectors(model.dofs)
    rest = {name: part for name, part in model.groups.items() if name not in apart}
    held = {name for name, part in rest.items() if _force(part, rigid) > _FORCE}
    return frozenset(apart | held if len(held) < len(rest) else apart)


def _couples(part: SparseArray) -> bool:
    entries = part.tocoo()
    return bool(np.any(entries.data[entries.row != entries.col] != 0.0))


def _force(part: SparseArray, rigid: FloatArray) -> float:
    """Return the largest force of a rigid-body motion, relative to those that make it up."""
    whole = (abs(part) @ np.abs(rigid)).max(axis=0, initial=0.0)
    force = np.abs(part @ rigid).max(axis=0, initial=0.0)
    return float((force / np.where(whole > 0.0, whole, 1.0)).max(initial=0.0))


def group_prior_std(model: Model, name: str) -> float:
    """Return the standard deviation of ln(factor) of a group.

    What the case states: a factor of so much up or down is as likely as not. Else 0.1, and what
    belongs to a factor of five for a support.

    Arguments:
        model: from matrices.
        name: of a group of its stiffness or mass.

    Examples:
        >>> modal.group_prior_std(model, "deck")
        0.1
    """
    if name in model.group_priors:
        return float(np.log(model.group_priors[name]) / QUARTILE)
    if name in support_groups(model):
        return float(np.log(SUPPORT_FACTOR) / QUARTILE)
    return STRUCTURE_STD
