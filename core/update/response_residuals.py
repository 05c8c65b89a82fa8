"""Measured minus predicted frequency responses of a model, with sensitivities in its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.eigen import Modes
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.typing import AnyArray, FloatArray, IntArray


@dataclass(frozen=True)
class ResponseTargets:
    """Frequency responses as data, each weighted by its inverse standard deviation.

    Arguments:
        measurement: with responses and their deviations; its modes say what damping a mode has.
    """

    statistical: ClassVar[bool] = True
    scattered: ClassVar[bool] = True  # what no model of the kind can follow widens deviations
    measurement: Measurement

    @property
    def responses(self) -> FrequencyResponses:
        """Return the responses.

        Raises:
            NotApplicable: where there are none.
        """
        found = self.measurement.responses
        if found is None or found.deviations is None:
            raise NotApplicable("no frequency responses are given: frfs and responses in the case")
        return found

    @cached_property
    def weight(self) -> FloatArray:
        """Return 1/sigma of every receptance, 0 where there is none, like the values."""
        return np.asarray(1.0 / self.responses.receptance_std)

    @cached_property
    def norm(self) -> float:
        """Return the norm of the weighted data."""
        return float(np.linalg.norm(self.weight * np.nan_to_num(self.responses.receptances)))

    def predict(self, model: Model, previous: object, mass: float) -> ResponsePrediction:
        """Return the answer of a model, as `Targets` do; raises ModelError without modes."""
        return ResponsePrediction(self, model, PredictedResponses.of(model, self.measurement))

    def weigh(self, values: AnyArray) -> FloatArray:
        """Return real, then imaginary parts of complex data over their deviations, (n_rows, ...).

        Arguments:
            values: like the receptances along the first three axes.
        """
        there = self.weight > 0.0
        own = (values[there].T * self.weight[there]).T
        return np.concatenate([own.real, own.imag])


@dataclass(frozen=True)
class ResponsePrediction:
    """A model's answer to the data: one eigenvalue solution, sensitivities on demand.

    Arguments:
        data: what it is compared with.
        model: with its present parameter values.
        answer: its receptances.
    """

    data: ResponseTargets
    model: Model
    answer: PredictedResponses

    @property
    def modes(self) -> Modes:
        """Return its modes, as of `response_modes`."""
        return self.answer.modes

    @property
    def partner(self) -> IntArray:
        """Return which of its modes belongs to every measured mode; -1 where none does, (m,)."""
        return self.answer.partner

    @cached_property
    def residual(self) -> FloatArray:
        """Return weighted measured minus predicted responses, (n_rows,)."""
        return self.data.weigh(self.data.responses.receptances - self.answer.receptances)

    def jacobian(self, slopes: MatrixSlopes, masses: object) -> FloatArray:
        """Return d (weighted prediction) / d parameter, (n_rows, p), as of `Prediction`."""
        return self.data.weigh(self.answer.slopes(slopes))
