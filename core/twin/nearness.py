"""How far a model is from what was measured: a twin is to be as hard as its case."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femubench.core.case.case import Case
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_measured

FARTHER = 1.5  # times as far as on the case at most


@dataclass(frozen=True)
class Nearness:
    """How near a model is to the modes of one state of a structure.

    Arguments:
        alone: number of measured modes without a partner in the model.
        error: rms of ln(f_predicted / f_measured) of the others.
    """

    alone: int
    error: float


def nearness(case: Case) -> tuple[Nearness, ...]:
    """Return how near the nominal model is, as built and after each design change."""
    return tuple(_nearness(model, measured) for model, measured in _states(case))


def is_as_near(found: tuple[Nearness, ...], known: tuple[Nearness, ...]) -> bool:
    """Tell whether a model is about as near to one structure as another one to another."""
    return all(
        one.alone <= other.alone and one.error <= FARTHER * other.error
        for one, other in zip(found, known, strict=True)
    )


def _states(case: Case) -> Iterator[tuple[Model, Measurement]]:
    yield case.model, case.measurement
    for change in case.modifications:
        yield case.model.attach(change.masses, change.springs), change.measurement


def _nearness(model: Model, measured: Measurement) -> Nearness:
    modes = solve_modes(model)
    partners = pair_measured(measured, modes, model.observe(measured.sensors) @ modes.shapes).index
    paired = partners >= 0
    predicted = modes.natural_frequencies[partners[paired]]
    off = np.log(np.abs(predicted) / measured.frequencies[paired])
    error = np.sqrt(np.square(off).sum() / max(off.size, 1))
    return Nearness(int((~paired).sum()), float(error))
