"""What antiresonances say of explanations next to the modes that these were found by.

The search knows modes alone. Where frequency responses are given, the weight of what it found is
multiplied by the density of the measured antiresonances given the modes, under each explanation:
linear in its causes and in the perturbations of the model error, whose scales stay. Structure and
reference share these, so that of both mostly the change counts.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from scipy.special import gammainc, gammaln, hyp1f1

from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import extend_model
from femubench.core.fit.modal_fit import State
from femubench.core.fit.zero_rows import ZeroRows
from femubench.core.inference.examine import Examination, before_of
from femubench.core.inference.model_error import (
    Inadequacy,
    antiresonance_errors,
    error_slopes,
    kind,
)
from femubench.core.inference.posterior import Explanation, Posterior
from femubench.core.inference.settings import settings
from femubench.core.modal.antiresonances import (
    Antiresonances,
    find_antiresonances,
    predict_antiresonances,
)
from femubench.core.modal.correlated_errors import root_of
from femubench.core.modal.eigen import Modes
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.typing import FloatArray, IntArray

_SCATTER = ("element stiffness", "element mass")


@dataclass(frozen=True)
class Witness:
    """Measured antiresonances of one state of a structure next to those of the nominal model.

    Arguments:
        test: with responses.
        zeros: what was measured and the model has too; deviations are relative.
        drawn: ln of the model's, (k,).
        state: the nominal model compared with the modes of the test.
        rows: the model's motions in them.
    """

    test: Measurement
    zeros: Antiresonances
    drawn: FloatArray
    state: State
    rows: ZeroRows

    @classmethod
    def of(cls, model: Model, state: State, test: Measurement) -> Witness | None:
        """Return what the responses of a test show; None where that is nothing."""
        if test.responses is None or test.responses.deviations is None:
            return None
        found = find_antiresonances(test.responses, test.frequencies, test.damping)
        own = predict_antiresonances(PredictedResponses.of(model, test))
        partner = found.pair(own)
        kept = partner >= 0
        if not kept.any():
            return None
        share = np.hypot(found.std / found.frequencies, settings.reachable_antiresonance_std)
        zeros = replace(found, std=share).take(kept)
        hertz = own.frequencies[partner[kept]]
        rows = ZeroRows.of(state, zeros, test.responses, hertz)
        return cls(test, zeros, np.log(hertz), state, rows)

    def __len__(self) -> int:
        return len(self.zeros)

    @property
    def residual(self) -> FloatArray:
        """Return residuals of modes and antiresonances at the nominal model, (n + k,)."""
        return np.append(self.state.raw, self.apart(self.drawn))

    @property
    def noise(self) -> FloatArray:
        """Return their covariance by the measurement: both follow the errors of frequencies."""
        found, n = np.eye(len(self.state.raw) + len(self)), len(self.state.raw)
        shares, correlation = self.rows.shares, self.test.frequency_correlation
        shares = shares if correlation is None else shares @ root_of(correlation)
        found[n:, n:] += shares @ shares.T
        found[n:, : shares.shape[1]], found[: shares.shape[1], n:] = shares, shares.T
        return found

    def apart(self, logarithms: FloatArray) -> FloatArray:
        """Return measured minus predicted in deviations, (k,)."""
        return np.asarray((np.log(self.zeros.frequencies) - logarithms) / self.zeros.std)

    def predicted(self, model: Model) -> FloatArray:
        """Return ln of the antiresonances of another model, (k,).

        Where it has more of them between two resonances, or fewer, the nearest to the nominal
        model's at that sensor; its own where there is none.
        """
        own = predict_antiresonances(PredictedResponses.of(model, self.test))
        found, logs = self.drawn.copy(), np.log(own.frequencies)
        for i, j in enumerate(self.zeros.pair(own)):
            same = (own.response == self.zeros.response[i]) & (own.force == self.zeros.force[i])
            there = np.flatnonzero(same) if j < 0 else np.array([j])
            if len(there):
                found[i] = logs[there[np.abs(logs[there] - self.drawn[i]).argmin()]]
        return found

    def slopes(self, modes: Modes) -> dict[str, FloatArray]:
        """Return sensitivities to the model error, of the modes' data and of these behind them."""
        own = antiresonance_errors(self.rows, modes)
        return {
            name: np.vstack([rows, own.get(name, np.zeros((len(self), rows.shape[1])))])
            for name, rows in error_slopes(self.state.problem, modes).items()
        }


@dataclass(frozen=True)
class JointEvidence:
    """Modes and antiresonances together, of a structure and of it as it was.

    Data stand in the order: modes and antiresonances of the reference, those of the structure.

    Arguments:
        present: the structure.
        known: residuals of the reference at the nominal model, (r,).
        error: model error of the modes; None for a beam model.
        whole: that of all data.
        scatter: sensitivities of all data to the scatter of elements, in its deviations, (n, p).
        noise: covariance of all data by the measurement, (n, n).
        by_modes: which data the modes are.
    """

    present: Witness
    known: FloatArray
    error: Inadequacy | None
    whole: Inadequacy | None
    scatter: FloatArray
    noise: FloatArray
    by_modes: IntArray

    @classmethod
    def of(cls, seen: Examination, present: Witness) -> JointEvidence:
        """Return that of an examination by the modes, and of what responses show."""
        slopes, earlier, known = [present.slopes(seen.modes)], None, np.zeros(0)
        blocks, modes = [present.noise], [len(present.state.raw)]
        if seen.reference is not None:
            before = before_of(seen.problem, seen.reference)
            reference = Witness.of(seen.model, before, seen.reference)
            if reference is None:
                known, earlier = before.raw, error_slopes(before.problem, seen.modes)
            else:
                known, earlier = reference.residual, reference.slopes(seen.modes)
            slopes.insert(0, earlier)
            blocks.insert(0, np.eye(len(known)) if reference is None else reference.noise)
            modes.insert(0, len(before.raw))
        error = whole = seen.error
        if error is not None:
            widths = {kind(n): float(w) for n, w in zip(error.names, error.widths, strict=True)}
            shared = error.unshared, error.log_prior
            whole = Inadequacy.of(slopes[-1], earlier, known, widths, *shared)
        rows = [
            np.hstack([own.get(name, own["general"][:, :0]) for name in _SCATTER]) for own in slopes
        ]
        by_modes = [np.arange(len(block)) < n for block, n in zip(blocks, modes, strict=True)]
        return cls(
            *(present, known, error, whole, seen.tolerance * np.vstack(rows)),
            np.asarray(la.block_diag(*blocks)),
            np.flatnonzero(np.concatenate(by_modes)),
        )

    def covariance(self, state: State, moved: FloatArray) -> FloatArray:
        """Return that of all data under an explanation, its causes at their fit, (n, n).

        Arguments:
            state: the explanation.
            moved: by how much it moves each antiresonance, in deviations, (k,).
        """
        scales, whole = state.problem.noise.scales, self.whole
        if scales is None or self.error is None or whole is None:
            return np.asarray(self.noise + self.scatter @ self.scatter.T)
        if self.error.own_share(scales) > 0.0:
            own = self.error.add_own_error(self.present.state, state).change
            whole = replace(whole, change=np.append(own, np.abs(moved)))
        return np.asarray(whole.covariance(scales) + self.noise - np.eye(len(self.noise)))

    def log_evidence(self, explanation: Explanation) -> float:
        """Return ln of the density of the antiresonances, given the modes and an explanation.

        Raises:
            FemubenchError: when the explanation makes no model that can be solved.
        """
        state, witness = explanation.fit.state, self.present
        model = state.problem.model
        model = extend_model(model, state.parts, state.x) if state.parts else model
        predicted = witness.predicted(model)
        slopes = np.zeros((len(witness), 0))
        if state.parts:
            test = witness.test.responses
            assert test is not None
            rows = ZeroRows.of(state, witness.zeros, test, np.exp(predicted))
            pulled = rows.vectors, rows.eigenvalues
            forces = state.problem.space.forces(state.parts, state.x, *pulled)
            slopes = rows.rows(*forces)
        slopes = np.vstack([state.slopes, slopes])
        apart = np.append(state.raw, witness.apart(predicted)) + slopes @ state.x
        total = self.covariance(state, (predicted - witness.drawn) / witness.zeros.std)
        total[len(self.known) :, len(self.known) :] += slopes @ slopes.T
        every = np.append(self.known, apart)
        modes = total[np.ix_(self.by_modes, self.by_modes)]
        misfit, volume = _whiten(every, total)
        of_modes, volume_of_modes = _whiten(every[self.by_modes], modes)
        further = len(every) - len(self.by_modes)
        return log_scaled_density(misfit - of_modes, further) - volume + volume_of_modes


def _whiten(values: FloatArray, covariance: FloatArray) -> tuple[float, float]:
    """Return chi-square of values, and half of ln of their covariance's determinant."""
    factor = la.cholesky(covariance, lower=True)
    white = la.solve_triangular(factor, values, lower=True)
    return float(white @ white), float(np.log(factor.diagonal()).sum())


def log_scaled_density(misfit: float, count: int) -> float:
    """Return ln of a normal density whose deviations may all be larger by one unknown factor.

    Arguments:
        misfit: chi-square by the stated deviations.
        count: of the data.

    Source: Gelman et al. (2013), Bayesian Data Analysis, 3.2: p(s) ~ 1 / s, here for s > 1, less
    what all data of this count have in common. Where nothing meets the data, ratios of misfits
    count and no longer their differences.
    """
    shape, half = 0.5 * count, 0.5 * misfit
    if half < shape:  # the incomplete gamma function as a series: it may be too small to be written
        return float(np.log(hyp1f1(1.0, shape + 1.0, half) / shape) - half)
    return float(gammaln(shape) + np.log(gammainc(shape, half)) - shape * np.log(half))


def weigh_by_antiresonances(seen: Examination, responses: FrequencyResponses | None) -> Examination:
    """Return an examination with the evidence of antiresonances in the weights.

    Explanations that are far behind by the modes, or make no model, have that of the least likely.

    Arguments:
        seen: by the modes; its reference may have responses too.
        responses: that are given of the structure; None for none.
    """
    test = replace(seen.problem.data.measurement, responses=responses)
    present = Witness.of(seen.model, seen.nominal, test)
    if present is None:
        return seen
    joint, explanations = JointEvidence.of(seen, present), seen.posterior.explanations
    found = np.full(len(explanations), np.nan)
    for place, explanation in enumerate(explanations[: settings.shortlist]):
        if explanations[0].log_weight - explanation.log_weight < settings.lag:
            with suppress(FemubenchError, la.LinAlgError):
                found[place] = joint.log_evidence(explanation)
    if not np.isfinite(found).any():
        return seen
    gains = np.where(np.isfinite(found), found, np.nanmin(found))
    weighed = [replace(e, further=float(gain)) for e, gain in zip(explanations, gains, strict=True)]
    return replace(seen, posterior=Posterior.of(weighed), antiresonances=len(present))
