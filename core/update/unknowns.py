"""Which parameters an update may change, in which range, and how it goes about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.fem.joints import JointGroup, all_elements, elements_at
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray
from femubench.core.update.residuals import Residual


@dataclass(frozen=True)
class Unknown:
    """One parameter that an update may change, with its range.

    Arguments:
        parameter: what it acts on.
        start: initial value; 1 for a factor.
        lower, upper: limits of the value.
        signed: whether it may change its sign; it then moves by multiples of |start|, else by
            factors, so that it stays positive.
        fatal: whether an optimum at a limit is a divergence rather than a result.
        prior_std: standard deviation of ln(value / start), or of (value - start) / |start| of a
            signed one; None for no prior.
    """

    parameter: Parameter
    start: float = 1.0
    lower: float = 0.05
    upper: float = 20.0
    signed: bool = False
    fatal: bool = False
    prior_std: float | None = None


@dataclass(frozen=True)
class UpdateOptions:
    """How the iteration goes.

    Arguments:
        residual: the modal quantity that is fitted: ``eigenvalue``, ``relative-eigenvalue`` or
            ``frequency``.
        weighting: ``unit`` for W_ee = I, ``statistical`` for the inverse covariance of the data.
        shapes: take mode shapes as data too (statistical weighting).
        damping: beta, which stands for alpha / pct^2 of the paper, as a share of z_m'W z_m: of
            what s's is for a factor on the whole stiffness.
        max_iterations: steps at most.
        tolerance: the iteration ends when no scaled parameter moves by more,
        cost_tolerance: or when three steps in a row lower the cost by no more than this share:
            parameters that hardly matter drift on for ever.
        max_step: longest step of a scaled parameter in one iteration.
        halvings: how often a step that makes the cost grow is halved.
    """

    residual: Residual = "eigenvalue"
    weighting: str = "unit"
    shapes: bool = False
    damping: float = 1e-5
    max_iterations: int = 100
    tolerance: float = 1e-6
    cost_tolerance: float = 1e-4
    max_step: float = 0.5
    halvings: int = 8

    def __post_init__(self) -> None:
        if self.weighting not in ("unit", "statistical"):
            raise ValueError(f"weighting {self.weighting!r} is neither 'unit' nor 'statistical'")
        if self.shapes and self.weighting != "statistical":
            raise ValueError("mode shapes as data need statistical weighting")


class Scaling:
    """From scaled coordinates q (0 at the start) to parameter values and back."""

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        self.unknowns = unknowns
        self.start = np.array([u.start for u in unknowns])
        self.signed = np.array([u.signed for u in unknowns])
        self.lower = self._coordinate(np.array([u.lower for u in unknowns]))
        self.upper = self._coordinate(np.array([u.upper for u in unknowns]))
        std = np.array([np.inf if u.prior_std is None else u.prior_std for u in unknowns])
        self.precision = 1.0 / np.square(std)

    def _coordinate(self, values: FloatArray) -> FloatArray:
        ratio = np.where(self.signed, 1.0, values / self.start)
        return np.where(self.signed, (values - self.start) / np.abs(self.start), np.log(ratio))

    def values(self, q: FloatArray) -> FloatArray:
        """Return parameter values, (p,)."""
        grown = self.start * np.exp(np.where(self.signed, 0.0, q))
        return np.where(self.signed, self.start + np.abs(self.start) * q, grown)

    def slope(self, q: FloatArray) -> FloatArray:
        """Return d value / d q, with a factor counted about its present value as 1, (p,)."""
        values = self.values(q)
        factor = np.array([u.parameter.is_factor for u in self.unknowns])
        grow = np.where(self.signed, np.abs(self.start), values)
        return np.where(factor, 1.0, grow)


def stiffness_quantity(structure: Structure) -> str:
    """Return ``EI`` in plane, as Horton et al. have it, else ``E``: bending and torsion alike."""
    return "EI" if structure.frame.plane == "in-plane" else "E"


def global_stiffness(source: Model | Structure, *, prior_std: float | None = None) -> Unknown:
    """Return one factor on the stiffness of all members, of matrices on the whole stiffness.

    Arguments:
        source: the nominal model, or the structure of a frame.
        prior_std: of its logarithm; None for no prior.

    Examples:
        >>> update.global_stiffness(structure).parameter.name
        'E all members'
    """
    structure = source.structure if isinstance(source, Model) else source
    if structure is None:
        parameter = Parameter("stiffness all", "E", ("all",))
    else:
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

    Examples:
        >>> update.joint_stiffness(structure, joints[0]).parameter.name
        'E at L'
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

    Examples:
        >>> levels = [[update.global_stiffness(structure)], [joint, joint]]
        >>> [len(update.carried_by(levels, count)) for count in (1, 2, 3)]
        [1, 1, 3]
    """
    taken: list[Unknown] = []
    for level in levels:
        if len(taken) + len(level) > count:
            break
        taken.extend(level)
    return taken or list(levels[0][:1])
