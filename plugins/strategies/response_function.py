"""Updating by frequency responses themselves, line by line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench import Measurement, Model
from femubench.effect import Change
from femubench.update import Changes, SensitivityStrategy, UpdateOptions

_OPTIONS = UpdateOptions(residual="frequency", weighting="statistical", responses=True)


@dataclass(frozen=True)
class ResponseFunction(SensitivityStrategy):
    """Fit the given frequency responses by factors on the stiffness of members or groups.

    Measured minus predicted receptances are linear in a change of the dynamic stiffness, H_A -
    H_X = H_A dZ H_X; every line and sensor is one such equation in the factors, weighted by its
    standard deviation. The equations are set up anew at every iterate until no factor moves.
    Modes have the measured damping ratios, the usual one where none was measured.

    The stated deviations of the factors are those of the noise, wider where the responses are
    farther from the last model than noise explains.

    Arguments:
        options: of the iteration, which begins at the factors that fit the used frequencies.
        stiffness_std: prior standard deviation of the logarithm of a factor, which keeps near 1
            what neither frequencies nor responses tell.
        changes: `own` for the above; else as of `SensitivityStrategy`, effects and groups with
            priors of their own.

    The authors' are the equations and their iteration, with the model's responses where none was
    measured, and the weights against noise (after Imregun et al.); ours: the model's responses in
    place of measured ones too, since their noise times a stiffness is larger than what they tell,
    modal damping, the prior, and the start, without which a resonance may stay on a wrong one.

    Source: Lin & Ewins (1990), the equation of the response function method; Imregun, Visser &
    Ewins (1995), on noise and incomplete coordinates.
    """

    name: ClassVar[str] = "response-function"
    citation: ClassVar[str] = (
        "Lin & Ewins (1990), Model updating using FRF data, Proc. 15th International Seminar on "
        "Modal Analysis, Leuven; Imregun, Visser & Ewins (1995), Finite element model "
        "updating using frequency response function data, Mech. Syst. Signal Process. 9, 187-202"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"parts", "responses"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    stiffness_std: float = 0.3
    options: UpdateOptions = _OPTIONS

    def own_changes(self, model: Model, measurement: Measurement) -> tuple[Model, list[Change]]:
        """Return a factor on every member, or on every group of the stiffness."""
        word = "groups" if model.structure is None else "members"
        return model, Changes(model).listed(word, prior_std=self.stiffness_std)

    def list_changes(self, model: Model, measurement: Measurement) -> list[Change]:
        """Return the changes that `changes` names, with their priors."""
        return Changes(model).listed(self.changes, prior_std=self.stiffness_std)
