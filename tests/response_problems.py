"""A frame with a simulated test: modes and frequency responses of a truth with three factors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from femubench import Case, Measurement, Model, solve_modes
from femubench.core.conformance.problems import measure, sensors_of, small_frame
from femubench.core.modal.frf import ResponseSplit
from femubench.core.typing import FloatArray
from femubench.modal import FrequencyResponses, receptance
from femubench.update import Changes

MEMBERS = ("AB", "BC", "BD")
DAMPING = np.array([0.006, 0.01, 0.008, 0.012])


def simulate(
    factors: FloatArray, noise: float = 0.01, lines: int = 120, highest: float = 420.0
) -> tuple[Model, Measurement]:
    """Return a nominal model, and what a test of it would give with factors on its members.

    Modes up to the fourth have damping ratios of their own, all others their median. The noise of
    a line is a share of its magnitude, and of the median magnitude of its channel.

    Arguments:
        factors: on the stiffness of each of three members, (3,).
        noise: its share.
        lines: number of lines from 10 Hz on.
        highest: of them, in Hz.
    """
    frame = small_frame("out-of-plane", members=MEMBERS)
    model, sensors = Model.of(frame), sensors_of(frame)
    truth = Changes(model).parameterise("members").at(np.log(factors))
    measured = replace(measure(truth, sensors), damping=DAMPING)
    modes = solve_modes(truth)
    ratio = np.full(len(modes), np.median(DAMPING))
    ratio[: len(DAMPING)] = DAMPING
    hertz = np.linspace(10.0, highest, lines)
    rows = truth.observe(sensors)
    values = receptance(modes, rows, rows[:1], hertz, ratio)
    size = np.abs(values)
    std = noise * np.hypot(size, np.median(size, axis=0))
    force = sensors.take([0])
    responses = FrequencyResponses(sensors, force, hertz, values, "receptance", std)
    return model, replace(measured, responses=responses)


def simulated_case(factors: FloatArray, noise: float = 0.01) -> Case:
    """Return the case of such a frame: lines to 250 Hz at five sensors used, the rest held out."""
    model, test = simulate(factors, noise)
    measured = test.with_noise(np.random.default_rng(0))
    split = ResponseSplit(((9.0, 250.0),), ((255.0, 420.0),), test.sensors.labels[-1:])
    plain = replace(measured, responses=None)
    return Case(
        *("simulated", "Frame with simulated responses", "simulated", Path()),
        model, plain, (1, 2, 3), (4,), frfs=measured.responses, split=split,
    )  # fmt: skip
