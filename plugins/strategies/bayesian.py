"""The most probable parameters, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench import Measurement, Model
from femubench.effect import Change
from femubench.update import (
    Changes,
    Joints,
    SensitivityStrategy,
    UpdateOptions,
)

_OPTIONS = UpdateOptions(residual="frequency", weighting="statistical", damping=0.0, restarts=1)


@dataclass(frozen=True)
class Bayesian(SensitivityStrategy):
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
        changes: `own` for the parameters above; else what takes the place of stiffness, torsion and
            joints, as of `SensitivityStrategy`: factors with the prior of the stiffness, groups
            and effects with their own.

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

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Model, list[Change]]:
        """Return the parameters above with their priors, or those of the groups."""
        if model.groups:
            return model, self.list_changes(model, measurement)
        stiffness = Changes(model).stiffness(prior_std=self.stiffness_std)
        structure, mass = model.structure, self._mass(model, measurement)
        if structure is None:
            return model, [stiffness, *mass]
        torsion = []
        if structure.frame.plane != "in-plane":
            every = structure.elements
            torsion = [
                Change.scale_property("GJ all members", "GJ", every, prior_std=self.torsion_std)
            ]
        joints = [
            Changes(structure).joint(group, prior_std=self.joint_std)
            for group in Joints(structure).groups()
        ]
        return model, [stiffness, *torsion, *mass, *joints]

    def list_changes(self, model: Model, measurement: Measurement) -> list[Change]:
        """Return the changes that `changes` names and the mass, each with its prior."""
        words = "groups" if self.changes == self.OWN else self.changes
        listed = Changes(model).listed(words, prior_std=self.stiffness_std)
        return listed + self._mass(model, measurement)

    def _mass(self, model: Model, measurement: Measurement) -> list[Change]:
        """Return factors on groups of the mass, or the density where the structure was weighed."""
        mass = Changes(model).groups("mass", own_prior=True)
        if mass or measurement.total_mass is None:
            return mass
        every = ("all",) if model.structure is None else model.structure.elements
        name = "density all members"
        return [Change.scale_property(name, "density", every, prior_std=self.density_std)]
