"""No measurement at all: the drawn model with what handbooks give."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, ParameterEstimate, Strategy, UpdateResult
from femubench.diagnosis import list_effects
from femubench.effect import textbook_model, textbook_values


class Textbook(Strategy):
    """Put the textbook values into the nominal model and look at no data.

    Torsion constants by Bredt or St Venant, shear deformation by Cowper's coefficients, rotary
    inertia. What a strategy leaves of the error beyond this, it owes to the measurement.
    """

    name: ClassVar[str] = "textbook"
    citation: ClassVar[str] = (
        "no update: Bredt (1896) and St Venant for torsion, Timoshenko (1921) and Cowper (1966) "
        "for shear and rotary inertia"
    )
    yardstick: ClassVar[str] = "handbooks"
    needs: ClassVar[frozenset[str]] = frozenset({"elements"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the textbook values.

        Raises:
            NotApplicable: when the model came as matrices.
        """
        known = list_effects()
        repaired = textbook_model(model, known)
        values = [
            ParameterEstimate(
                f"{item.name} of {effect.name}", item.neutral, value, item.unit, places=(place,)
            )
            for effect in known
            for place, found in textbook_values(effect, model).items()
            for item, value in zip(effect.parameters(model, place), found, strict=True)
        ]
        return UpdateResult(repaired, len(values), tuple(values))
