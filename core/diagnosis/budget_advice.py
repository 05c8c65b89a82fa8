"""Which mode to measure next, so that a budget of errors knows more."""

from __future__ import annotations

import numpy as np

from femubench.core.case.case import Case
from femubench.core.diagnosis.budget import Budget, frequency_slopes
from femubench.core.fit.modal_fit import variance_of
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Advice
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray


def advise_modes(budget: Budget, case: Case) -> tuple[Advice, ...]:
    """Return the modes that say most of what the drawing lacks, if they were used too.

    Of as many further modes as are used; the separation is the variance of a mode's prediction in
    those of what no class of a budget is.
    """
    state, count = budget.state, len(case.used)
    numbers = np.array([mode.mode for mode in budget.modes])
    used = state.partner[[mode.used for mode in budget.modes]]
    moving = np.flatnonzero(~state.problem.space.still(state.eigenvalues))
    further = np.setdiff1d(moving, used)[:count]
    variance = variance_of(frequency_slopes(state, further), budget.covariance)
    separation = variance / settings.budget_rest[0] ** 2
    space, labels = state.problem.space, case.measurement.sensors.labels
    seen = np.abs(space.pad_readings(len(state.vectors)) @ state.vectors[:, further])
    found = []
    rows = zip(further, separation, np.sqrt(variance), seen.T, strict=True)
    for mode, size, std, reading in rows:
        if size < settings.visible_deviations:  # hardly more than is not known anyhow
            continue
        hertz = state.frequencies[mode]
        low, high = hertz * (1.0 - std), hertz * (1.0 + std)
        where = " and ".join(labels[i] for i in np.argsort(-reading)[: settings.least_modes])
        held = numbers[state.partner == mode].tolist()
        what = f"use mode {held[0]}" if held else "measure and use the mode"
        text = f"{what} between {low:.4g} and {high:.4g} Hz, where {where} move most"
        found.append(Advice(text, float(size)))
    return tuple(in_order(found, lambda advice: -advice.separation))[: settings.of_a_kind]


def open_variance(budget: Budget) -> FloatArray:
    """Return the variance of ln f of every measured mode, (m,); 0 for those that are used."""
    variance = variance_of(frequency_slopes(budget.state), budget.covariance)
    return np.where([mode.used for mode in budget.modes], 0.0, variance)


def loosest_mode(budget: Budget) -> int | None:
    """Return the unused mode whose frequency is known least; None where all are known well."""
    variance = open_variance(budget)
    row = int(variance.argmax())
    least = settings.visible_deviations * settings.budget_rest[0] ** 2
    return budget.modes[row].mode if variance[row] >= least else None
