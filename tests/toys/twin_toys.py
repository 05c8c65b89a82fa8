"""Strategies that know a case by heart, or that answer otherwise every time."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
from harness_toys import Toy
from numpy.random import Generator

from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.update.strategy import UpdateResult

# What stands in the case, copied by hand: the used modes to know it by, and what is held out.
FRAME_SOLID = (231.4113, 278.1306, 543.2607, 859.9597)


class Memory(Toy):
    """Knows a case by its first frequency, and its held-out frequencies by heart."""

    def __init__(self, known: tuple[float, ...] = FRAME_SOLID) -> None:
        self.known = np.array(known)

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        given = np.min(measurement.frequencies)
        if abs(given / self.known[0] - 1.0) > 0.03:  # also of noisy data
            return UpdateResult(model)
        modes = solve_modes(model).elastic.take(slice(0, len(self.known)))
        moved = np.square(2.0 * np.pi * self.known) - modes.eigenvalues
        basis = model.mass_times(modes.shapes)
        change = LowRank(basis, np.diag(moved))
        return UpdateResult(replace(model, stiffness_change=change), parameter_count=len(moved))


class Chance(Toy):
    """Draws random numbers that nobody gave it."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        factor = 1.0 + 1e-9 * int.from_bytes(os.urandom(4), "big") / 2**32
        return UpdateResult(replace(model, stiffness=(factor * model.stiffness)))


class Drawn(Toy):
    """Draws its random numbers from the generator that it is given."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        factor = 1.0 + 0.02 * float(rng.uniform())
        return UpdateResult(replace(model, stiffness=(factor * model.stiffness)))


class Ratios(Memory):
    """Knows ratios of frequencies by heart, and scales them by those that it is given."""

    name = "ratios"

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        # The mean of what is given says the scale better than one frequency.
        given = np.sort(measurement.frequencies)
        scale = float(np.exp(np.mean(np.log(given / self.known[: len(given)]))))
        modes = solve_modes(model).elastic.take(slice(0, len(self.known)))
        moved = np.square(2.0 * np.pi * scale * self.known) - modes.eigenvalues
        change = LowRank(model.mass_times(modes.shapes), np.diag(moved))
        return UpdateResult(replace(model, stiffness_change=change), parameter_count=len(moved))
