"""Antiresonances in modal coordinates: to what a change exerts they answer like frequencies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.fit.modal_fit import Problem, State
from femubench.core.modal.antiresonances import Antiresonances
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.typing import FloatArray, IntArray

_CLOSE = 3e-3  # of an eigenvalue: a resonance nearer to a zero than this hides it


@dataclass(frozen=True)
class ZeroRows:
    """Motions in antiresonances, and how a change moves these.

    Under a unit force a structure moves by u; where a receptance between two points vanishes, at
    w, a change of the matrices moves w^2 by u' (dK - w^2 dM) v / (dH / dw^2), u and v the motions
    under a force at either point: a frequency's slope with two motions in place of a shape.

    Arguments:
        vectors: motions under the force in the coordinates of the space, (N, k).
        left: the same under a force where the motion is read, (N, k).
        eigenvalues: w^2, (k,).
        scale: of the work of the forces to d ln f in standard deviations, (k,).
        shares: d ln f, in deviations, by deviations of measured frequencies, were they errors of
            these alone, (k, m).
    """

    problem: Problem
    vectors: FloatArray
    left: FloatArray
    eigenvalues: FloatArray
    scale: FloatArray
    shares: FloatArray

    @classmethod
    def of(
        cls, state: State, zeros: Antiresonances, measured: FrequencyResponses, hertz: FloatArray
    ) -> ZeroRows:
        """Return those of a state.

        Arguments:
            zeros: places of the antiresonances, and their relative deviations.
            hertz: where the model has them, (k,).
        """
        problem, own = state.problem, np.square(2.0 * np.pi * hertz)
        test = problem.data.measurement
        at = [
            np.array([test.sensors.labels.index(label) for label in side.labels])
            for side in (measured.responses, measured.references)
        ]
        seen = problem.space.pad_readings(len(state.vectors)) @ state.vectors
        out, into = seen[at[0][zeros.response]].T, seen[at[1][zeros.force]].T
        gap = state.eigenvalues[:, None] - own
        compliance = 1.0 / np.where(np.abs(gap) < _CLOSE * own, np.copysign(_CLOSE * own, gap), gap)
        steep = np.square(compliance) * out * into
        total = steep.sum(axis=0)
        pole = state.eigenvalues[state.partner]
        spread = test.frequency_std / np.sqrt(np.abs(pole)) * 2.0 * np.pi
        share = steep[state.partner] / total * pole[:, None] / own * spread[:, None]
        return cls(
            problem,
            state.vectors @ (compliance * into),
            state.vectors @ (compliance * out),
            own,
            1.0 / (2.0 * own * total * zeros.std),
            (share / zeros.std).T,
        )

    @property
    def partner(self) -> IntArray:
        """Return the columns of the motions, (k,)."""
        return np.arange(len(self.eigenvalues))

    def rows(self, forces: FloatArray, masses: FloatArray) -> FloatArray:
        """Return d ln f in deviations from modal forces on the motions, (k, p), as `State.rows`."""
        return np.asarray(np.einsum("Nk,Nkp->kp", self.left, forces) * self.scale[:, None])
