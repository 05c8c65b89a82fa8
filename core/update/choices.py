"""The parameters that the sensitivity strategies share, and how many of them data can carry."""

from __future__ import annotations

from collections.abc import Sequence

from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure
from femubench.core.update.joints import JointGroup, all_elements, elements_at
from femubench.core.update.unknowns import Unknown


def stiffness_quantity(structure: Structure) -> str:
    """Return ``EI`` in plane, as Horton et al. have it, else ``E``: bending and torsion alike."""
    return "EI" if structure.frame.plane == "in-plane" else "E"


def global_stiffness(structure: Structure, *, prior_std: float | None = None) -> Unknown:
    """Return one factor on the stiffness of all members.

    Arguments:
        structure: the frame.
        prior_std: of its logarithm; None for no prior.
    """
    quantity = stiffness_quantity(structure)
    parameter = Parameter(f"{quantity} all members", quantity, all_elements(structure))
    return Unknown(parameter, fatal=prior_std is None, prior_std=prior_std)


def joint_stiffness(
    structure: Structure, group: JointGroup, *, prior_std: float | None = None
) -> Unknown:
    """Return one factor on the stiffness of the elements that touch joints.

    Arguments:
        structure: the frame.
        group: which ends.
        prior_std: of its logarithm; None for no prior.
    """
    quantity = stiffness_quantity(structure)
    parameter = Parameter(f"{quantity} at {group.name}", quantity, elements_at(structure, group))
    return Unknown(parameter, lower=0.01, upper=100.0, prior_std=prior_std)


def carried_by(levels: Sequence[Sequence[Unknown]], count: int) -> list[Unknown]:
    """Return the unknowns of the leading levels that so many data determine.

    Only as many parameters as measured frequencies are set free, as in the source; a level is
    taken as a whole or not at all, except that the first always gives one.

    Arguments:
        levels: parameters by descending importance.
        count: number of measured frequencies.

    Source: Horton et al. (1999), section 2.
    """
    taken: list[Unknown] = []
    for level in levels:
        if len(taken) + len(level) > count:
            break
        taken.extend(level)
    return taken or list(levels[0][:1])
