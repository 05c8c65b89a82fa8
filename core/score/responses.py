"""How well a model predicts the frequency responses that no strategy was given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from femubench.core.case.case import Case
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.schema.results import ResponseBlock

_RANGE = 1e-6  # of the largest response: no test resolves less than 120 dB below it
_DECIBEL = 20.0 / np.log(10.0)


def score_responses(case: Case, model: Model) -> ResponseBlock | None:
    """Return the error of a model's log-magnitudes and phases at held-out lines and sensors.

    What noise exceeds is not counted. The model's modes have the damping ratios of the measured
    modes, held-out ones among them, that they are paired with, or the damping that the case states:
    no strategy is asked for any.
    A model that has no response has no block.
    """
    if case.frfs is None or case.split is None:
        return None
    hidden = case.split.unseen(case.frfs)
    shown = np.asarray(hidden.any(axis=1))
    lines = case.frfs.at_lines(shown)
    size = np.abs(np.nan_to_num(lines.receptances))
    std = lines.receptance_std
    counted = hidden[shown][:, :, None] & (size > std)
    if not counted.any():
        return None
    measured = replace(case.measurement, responses=lines)
    try:
        answer = PredictedResponses.of(model, measured).receptances[counted]
    except ModelError:
        return None
    least = _RANGE * float(size[counted].max())
    ratio = np.hypot(np.abs(answer), least) / np.hypot(size[counted], least)
    floor = rms(_DECIBEL * std[counted] / size[counted])
    phase = np.angle(answer * lines.receptances[counted].conj(), deg=True)
    return ResponseBlock(rms(_DECIBEL * np.log(ratio)), floor, int(counted.sum()), rms(phase))


def rms(values: ArrayLike) -> float:
    """Return the root mean square of some numbers, one at least."""
    return float(np.sqrt(np.mean(np.square(values))))
