"""Stiffness factors: one for the whole frame, or some for the elements at the joints."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.update import (
    OWN,
    Unknown,
    UpdateOptions,
    checked_set,
    global_stiffness,
    groups_within,
    groups_within_count,
    joint_stiffness,
    sensitivity_update,
    stiffness_factors,
)


@dataclass(frozen=True)
class _Factors(Strategy):
    """Base class of updates of stiffness factors by the sensitivity method."""

    options: UpdateOptions = field(default_factory=UpdateOptions)
    parameters: str = OWN

    def __post_init__(self) -> None:
        checked_set(self.parameters, own=True)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors that fit the used frequencies."""
        if self.parameters == OWN:
            unknowns = self.unknowns(model, len(measurement))
        else:
            unknowns = stiffness_factors(model, self.parameters)
        return sensitivity_update(model, unknowns, measurement, self.options)

    @abstractmethod
    def unknowns(self, model: Model, count: int) -> list[Unknown]:
        """Return the factors, where so many frequencies were measured."""


@dataclass(frozen=True)
class Global(_Factors):
    """Scale the stiffness of all members by one factor.

    In plane the factor is on EI, as in the paper. Out of plane and in 3-D it is on E, that is on
    EI, GJ, EA and GA together: with EI alone the torsion of the members would stay as it was, and
    the update would no longer be one of the whole structure. Of matrices it is on all of the
    stiffness.

    Arguments:
        options: of the iteration; the residual is that of frequencies, in which one factor has to
            compromise between all modes, while the paper's absolute eigenvalues
            (``residual=eigenvalue``) leave the choice to the highest.
        parameters: `own` for the factor above; else one on E of each of the `elements`, `members`,
            `sections`, `materials` or `sets` of the case, or on the `groups` of matrices.

    Source: Horton et al. (1999), table 4(a).
    """

    name: ClassVar[str] = "global"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, equation (4), table 4(a)"
    )
    settings: ClassVar[tuple[str, ...]] = (
        "residual=eigenvalue",
        "residual=relative-eigenvalue",
        "damping=1e-3",
    )

    options: UpdateOptions = field(default_factory=partial(UpdateOptions, residual="frequency"))

    def unknowns(self, model: Model, count: int) -> list[Unknown]:
        """Return one factor on all members, or on the whole matrix."""
        return [global_stiffness(model)]


@dataclass(frozen=True)
class Local(_Factors):
    """Scale the bending stiffness of the elements that touch joints.

    One factor for every joint type and role: at joints that a member passes, one for the elements
    that branch off and one for the two of the member that passes; else one for all elements of
    the joint. With more groups than measured frequencies all joints count as one type, and if
    need be all their elements as one group. In plane the factors are on EI, else on E.

    Of matrices the groups have factors: each its own, or each support and all that is no support,
    or supports and structure, or one for all: the finest that is no more than the frequencies.

    Arguments:
        options: of the iteration.
        parameters: `own` for the factors above; else one on E of each of the `elements`, `members`,
            `sections`, `materials` or `sets` of the case, or on the `groups` of matrices.

    Source: Horton et al. (1999), table 4(b).
    """

    name: ClassVar[str] = "local"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, equation (4), table 4(b)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"parts", "joints"})
    settings: ClassVar[tuple[str, ...]] = (
        "residual=frequency",
        "residual=relative-eigenvalue",
        "damping=1e-3",
    )

    def unknowns(self, model: Model, count: int) -> list[Unknown]:
        """Return the factors on the elements at joints, or on groups."""
        if model.structure is None:
            return groups_within_count(model, count)
        structure = model.structure
        return [joint_stiffness(structure, g) for g in groups_within(structure.frame, count)]
