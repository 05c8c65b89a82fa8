"""Measured minus predicted frequency responses of a model, with sensitivities in its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.antiresonances import (
    Antiresonances,
    antiresonance_slopes,
    find_antiresonances,
    predict_antiresonances,
)
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.typing import AnyArray, FloatArray, IntArray
from femubench.core.update.residuals import Prediction, Targets

_EXACT = 1e-3  # of stated deviations: no data are more exact


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
        """Return the responses; raises NotApplicable where there are none."""
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

    def rescaled(self, answer: AnyArray) -> ResponseTargets:
        """Return the data with deviations of every channel as wide as what a model leaves of it.

        It is their most probable factor where nothing was known of it.

        Arguments:
            answer: receptances of the model, like the values.

        Source: Beck & Katafygiotis (1998), the most probable variance of prediction errors.
        """
        known = self.weight > 0.0
        apart = np.where(known, self.responses.receptances - answer, 0.0) * self.weight
        count = np.maximum(2.0 * known.sum(axis=0), 1.0)
        scale = np.sqrt(np.square(np.abs(apart)).sum(axis=0) / count)
        responses = self.responses
        assert responses.deviations is not None
        wider = responses.deviations * np.where(known.any(axis=0), np.maximum(scale, _EXACT), 1.0)
        measured = replace(self.measurement, responses=replace(responses, deviations=wider))
        return ResponseTargets(measured)

    def conceded(self, jacobian: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the information that the factors of `rescaled` take from the parameters, (p, p).

        With a channel's pull g = s'r and its n numbers it is 2/n g g', what is left when the
        logarithm of its factor, whose own information is 2 n, is integrated over.

        Arguments:
            jacobian: s, weighted, (n_rows, p).
            residual: r, weighted, (n_rows,).

        Source: Beck & Katafygiotis (1998), the Hessian with the variance among the unknowns.
        """
        there = self.weight > 0.0
        channel = np.tile(np.flatnonzero(there) % there[0].size, 2)
        pulls = np.zeros((there[0].size, jacobian.shape[1]))
        np.add.at(pulls, channel, jacobian * residual[:, None])
        count = np.maximum(np.bincount(channel, minlength=len(pulls)), 1)
        return np.asarray(2.0 * (pulls.T / count) @ pulls)

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
    """A model's answer to the data: one eigenvalue solution, sensitivities on demand."""

    data: ResponseTargets
    model: Model
    answer: PredictedResponses

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


@dataclass(frozen=True)
class AntiresonanceTargets:
    """Used frequencies and the antiresonances of the given responses, weighted by deviations.

    Arguments:
        measurement: with responses and their deviations.
    """

    statistical: ClassVar[bool] = True
    scattered: ClassVar[bool] = True
    measurement: Measurement

    @cached_property
    def modal(self) -> Targets:
        """Return the frequencies."""
        return Targets(self.measurement, "frequency", statistical=True)

    @cached_property
    def zeros(self) -> Antiresonances:
        """Return the measured antiresonances; raises NotApplicable where there is none."""
        test = self.measurement
        found = find_antiresonances(ResponseTargets(test).responses, test.frequencies, test.damping)
        if not len(found):
            raise NotApplicable("no antiresonance stands out of the noise of the given responses")
        return found

    @cached_property
    def norm(self) -> float:
        """Return the norm of the weighted data."""
        return float(
            np.hypot(self.modal.norm, np.linalg.norm(self.zeros.frequencies / self.zeros.std))
        )

    def predict(self, model: Model, previous: object, mass: float) -> AntiresonancePrediction:
        """Return the answer of a model, as `Targets` do; raises ModelError without modes."""
        answer = PredictedResponses.of(model, self.measurement)
        observer = model.observe(self.measurement.sensors)
        modal = Prediction(self.modal, model, answer.modes, answer.partner, observer, mass)
        return AntiresonancePrediction(self, modal, answer, predict_antiresonances(answer))


@dataclass(frozen=True)
class AntiresonancePrediction:
    """A model's answer to frequencies and antiresonances.

    Arguments:
        zeros: its antiresonances.
    """

    data: AntiresonanceTargets
    modal: Prediction
    answer: PredictedResponses
    zeros: Antiresonances

    @property
    def model(self) -> Model:
        """Return the model."""
        return self.modal.model

    @property
    def partner(self) -> IntArray:
        """Return which of its modes belongs to every measured mode; -1 where none does, (m,)."""
        return self.modal.partner

    @cached_property
    def zero_partner(self) -> IntArray:
        """Return which of its antiresonances belongs to every measured one; -1 for none, (k,)."""
        return self.data.zeros.pair(self.zeros)

    @cached_property
    def residual(self) -> FloatArray:
        """Return weighted measured minus predicted data, nan without a partner, (m + k,)."""
        measured, partner = self.data.zeros, self.zero_partner
        hertz = np.append(self.zeros.frequencies, np.nan)[partner]
        apart = (measured.frequencies - hertz) / measured.std
        return np.concatenate([self.modal.residual, apart])

    def jacobian(self, slopes: MatrixSlopes, masses: Callable[[], FloatArray]) -> FloatArray:
        """Return d (weighted prediction) / d parameter, 0 without a partner, (m + k, p)."""
        partner, there = self.zero_partner, self.zero_partner >= 0
        rows = np.zeros((len(partner), slopes.count))
        own = antiresonance_slopes(self.answer, self.zeros, slopes)
        rows[there] = own[partner[there]] / self.data.zeros.std[there, None]
        return np.vstack([self.modal.jacobian(slopes, masses), rows])
