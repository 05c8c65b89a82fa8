"""Stiffness factors: one for the whole frame, or some for the elements at the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

from femubench import Measurement, Model
from femubench.effect import Change
from femubench.update import Changes, Joints, SensitivityStrategy, UpdateOptions


@dataclass(frozen=True)
class Global(SensitivityStrategy):
    """Scale the stiffness of all members by one factor.

    In plane the factor is on EI, as in the paper. Out of plane and in 3-D it is on E, that is on
    EI, GJ, EA and GA together: with EI alone the torsion of the members would stay as it was, and
    the update would no longer be one of the whole structure. Of matrices it is on all of the
    stiffness.

    Arguments:
        options: of the iteration; the residual is that of frequencies, in which one factor has to
            compromise between all modes, while the paper's absolute eigenvalues
            (``residual=eigenvalue``) leave the choice to the highest.
        changes: `own` for the above; else as of `SensitivityStrategy`.

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

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Model, list[Change]]:
        """Return one factor on all members, or on the whole matrix."""
        return model, [Changes(model).stiffness()]


@dataclass(frozen=True)
class Local(SensitivityStrategy):
    """Scale the bending stiffness of the elements that touch joints.

    One factor for every joint type and role: at joints that a member passes, one for the elements
    that branch off and one for the two of the member that passes; else one for all elements of
    the joint. With more groups than measured frequencies all joints count as one type, and if
    need be all their elements as one group. In plane the factors are on EI, else on E.

    Of matrices the groups have factors: each its own, or each support and all that is no support,
    or supports and structure, or one for all: the finest that is no more than the frequencies.

    Arguments:
        options: of the iteration.
        changes: `own` for the above; else as of `SensitivityStrategy`.

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

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Model, list[Change]]:
        """Return the factors on the elements at joints, or on groups."""
        structure, count = model.structure, len(measurement)
        if structure is None:
            return model, Changes(model).groups_within(count)
        groups = Joints(structure).groups_within(count)
        return model, [Changes(structure).joint(group) for group in groups]
