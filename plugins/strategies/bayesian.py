"""The most probable parameters, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.fem import Parameter
from femubench.update import (
    OWN,
    Unknown,
    UpdateOptions,
    all_elements,
    checked_set,
    global_stiffness,
    group_factors,
    joint_groups,
    joint_stiffness,
    sensitivity_update,
    stiffness_factors,
)

_OPTIONS = UpdateOptions(residual="frequency", weighting="statistical", damping=0.0)


@dataclass(frozen=True)
class Bayesian(Strategy):
    """Weigh measured modes against prior knowledge by their covariances.

    Parameters are the stiffness of all members; out of plane and in 3-D their torsional rigidity;
    one factor for the elements at joints of every type and role; and the density where the
    structure was weighed (without that only the ratio of stiffness to density shows). All have
    log-normal priors about the nominal value, so there may be more of them than data. The result
    is the maximum of the posterior density, its covariance the inverse of s'Ws + P.

    Of matrices every group of stiffness or mass has a factor with the prior of its own; where
    there are no groups, the whole stiffness has one.

    Arguments:
        stiffness_std: prior standard deviation of ln(E or EI).
        torsion_std: of ln(GJ).
        joint_std: of the logarithm of a joint factor.
        density_std: of ln(density).
        options: of the iteration; `shapes` takes the shapes at the sensors as data too.
        parameters: `own` for the parameters above; else one factor on E of each of the `elements`,
            `members`, `sections`, `materials` or `sets` of the case, with the prior of the
            stiffness, in place of stiffness, torsion and joints; or on the `groups` of matrices.

    Source: Horton et al. (1999), equation (4) with W_ee and W_theta the inverse covariances;
    Friswell & Mottershead (1995), Finite Element Model Updating in Structural Dynamics, ch. 8.
    """

    name: ClassVar[str] = "bayesian"
    citation: ClassVar[str] = (
        "Friswell & Mottershead (1995), Finite Element Model Updating in Structural Dynamics, "
        "chapter 8; Horton et al. (1999), equation (4) with the covariances of data and parameters"
    )
    settings: ClassVar[tuple[str, ...]] = (
        "stiffness_std=0.05",
        "joint_std=0.25",
        "joint_std=1.0",
        "shapes=true",
    )

    stiffness_std: float = 0.1
    torsion_std: float = 0.3
    joint_std: float = 0.5
    density_std: float = 0.1
    options: UpdateOptions = _OPTIONS
    parameters: str = OWN

    def __post_init__(self) -> None:
        checked_set(self.parameters, own=True)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the most probable model, parameters with standard deviations."""
        unknowns = self.unknowns(model, weighed=measurement.total_mass is not None)
        return sensitivity_update(model, unknowns, measurement, self.options)

    def unknowns(self, model: Model, *, weighed: bool) -> list[Unknown]:
        """Return the parameters with their priors.

        Arguments:
            model: the nominal one.
            weighed: whether the total mass was measured.
        """
        structure = model.structure
        everywhere = ("all",) if structure is None else all_elements(structure)
        mass = group_factors(model, "mass", own_prior=True)
        if weighed and not mass:
            density = Parameter("density all members", "density", everywhere)
            mass = [Unknown(density, prior_std=self.density_std)]
        word = "groups" if self.parameters == OWN and model.groups else self.parameters
        if word != OWN:
            return stiffness_factors(model, word, prior_std=self.stiffness_std) + mass
        unknowns = [global_stiffness(model, prior_std=self.stiffness_std)]
        if structure is None:
            return unknowns + mass
        if structure.frame.plane != "in-plane":
            torsion = Parameter("GJ all members", "GJ", everywhere)
            unknowns.append(Unknown(torsion, prior_std=self.torsion_std))
        unknowns += mass
        groups = joint_groups(structure.frame)
        return unknowns + [joint_stiffness(structure, g, prior_std=self.joint_std) for g in groups]
