"""Which mode to measure next, so that a budget of errors knows more of all that are open.

Frequencies that depend on the same entries err together. One more that is used, with variance r^2
of what no class is, takes c_ij^2 / (c_ii + r^2) off the variance c_jj of another; the mode that
takes most off all of them says most.

Source: Chaloner & Verdinelli (1995), Statistical Science 10, for sums of variances.
"""

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

    Of as many further modes as are used; the separation is the variance that all of them lose, in
    those of what no class of a budget is.
    """
    state, count = budget.state, len(case.used)
    numbers = np.array([mode.mode for mode in budget.modes])
    used = state.partner[[mode.used for mode in budget.modes]]
    moving = np.flatnonzero(~state.problem.space.still(state.eigenvalues))
    further = np.setdiff1d(moving, used)[:count]
    slopes = frequency_slopes(state, further)
    separation = weigh_modes(slopes, budget.covariance)
    deviations = np.sqrt(variance_of(slopes, budget.covariance))
    space, labels = state.problem.space, case.measurement.sensors.labels
    seen = np.abs(space.pad_readings(len(state.vectors)) @ state.vectors[:, further])
    found = []
    rows = zip(further, separation, deviations, seen.T, strict=True)
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


def weigh_modes(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return what variance all modes lose by using one, in those of what no class is, (m,).

    Arguments:
        slopes: of ln f in the coordinates, (m, k).
        covariance: of the coordinates, (k, k).
    """
    together, rest = slopes @ covariance @ slopes.T, settings.budget_rest[0] ** 2
    return np.asarray(np.square(together).sum(axis=0) / (together.diagonal() + rest) / rest)


def weigh_unused(budget: Budget) -> FloatArray:
    """Return what measured modes say of all that are not used, (m,); 0 for those that are."""
    unused = np.array([not mode.used for mode in budget.modes])
    slopes = frequency_slopes(budget.state) * unused[:, None]
    return weigh_modes(slopes, budget.covariance)


def next_mode(budget: Budget) -> int | None:
    """Return the unused mode that says most of all of them; None where all are known well."""
    size = weigh_unused(budget)
    row = int(size.argmax())
    return budget.modes[row].mode if size[row] >= settings.visible_deviations else None
