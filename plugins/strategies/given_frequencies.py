"""Yardsticks that know nothing but the given frequencies: met alone, or with all others shifted."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult, solve_modes
from femubench.modal import pair_measured
from femubench.update import with_measured_frequencies


class Meet(Strategy):
    """Put the given frequencies on the modes of the model and leave all else as it is.

    K + M Phi (Lambda_m - Lambda) Phi' M has the measured eigenvalues, the shapes of the model and
    all of its other frequencies. What a strategy leaves of the error beyond this, it owes to more
    than meeting what it was given.
    """

    name: ClassVar[str] = "meet"
    citation: ClassVar[str] = (
        "no knowledge of the structure: the exchange of eigenvalues in Baruch & Bar-Itzhack (1978) "
        "with the model's own shapes"
    )
    yardstick: ClassVar[str] = "the given frequencies met and nothing else"
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the given frequencies.

        Raises:
            SelfCheckFailed: when the frequencies are not met to 1e-8.
        """
        return UpdateResult(with_measured_frequencies(model, measurement), len(measurement))


class Shifted(Meet):
    """Put the given frequencies on the modes of the model and carry half of their ratios on.

    The stiffness is scaled so that all frequencies move by half of the mean ln(f_m / f_p) of the
    given modes; these are then exchanged as by `meet`. A strategy that knows the structure has to
    be better than this.
    """

    name: ClassVar[str] = "shifted"
    citation: ClassVar[str] = (
        "no knowledge of the structure: the given ratios of frequencies, carried on by half"
    )
    yardstick: ClassVar[str] = "the given ratios carried on"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the scaled model with the given frequencies.

        Raises:
            SelfCheckFailed: when the frequencies are not met to 1e-8.
        """
        modes = solve_modes(model, min(model.size, 4 * len(measurement) + 16))
        readings = model.observe(measurement.sensors) @ modes.shapes
        index = pair_measured(measurement, modes, readings).index
        own = modes.natural_frequencies[index]
        there = (index >= 0) & (own > 0.0)
        ratios = np.log(measurement.frequencies[there] / own[there])
        # Eigenvalues go with the square of the half.
        factor = float(np.exp(ratios.mean())) if there.any() else 1.0
        change = model.stiffness_change
        scaled = replace(
            model,
            stiffness=factor * model.stiffness,
            stiffness_change=change and replace(change, core=factor * change.core),
        )
        found = super().update(scaled, measurement, rng)
        return replace(found, parameter_count=found.parameter_count + 1)
