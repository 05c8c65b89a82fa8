"""The noise of the data: measurement and ordinary scatter of the elements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la

from femubench.core.typing import FloatArray

_FEW = 4  # from this share of all data on, a change of the covariance is no longer one of few


@dataclass(frozen=True)
class Noise:
    """The distribution of the residuals: measurement, scatter of the elements, model error.

    Arguments:
        factor: lower Cholesky factor of the covariance, (n_data, n_data).
        mean: what the residuals are expected to be, (n_data,); not zero where a reference says
            what the model gets wrong.
        log_weight: ln of the probability of this noise, and of the reference under it.
        beam: whether the structure is taken for a beam model with ordinary scatter.
        scales: of the model error, (k,); None for a beam model.
        trust: power of the evidence; below 1 where the noise is itself a guess.
    """

    factor: FloatArray
    mean: FloatArray | float = 0.0
    log_weight: float = 0.0
    beam: bool = True
    scales: FloatArray | None = None
    trust: float = 1.0

    @classmethod
    def of(cls, slopes: FloatArray, tolerance: float) -> Noise:
        """Return the noise of data with sensitivities to independent scatters.

        Arguments:
            slopes: d prediction / d relative change of one element, (n_data, n_scatter).
            tolerance: standard deviation of a relative change.
        """
        covariance = np.eye(len(slopes)) + tolerance**2 * (slopes @ slopes.T)
        return cls(np.asarray(la.cholesky(covariance, lower=True)))

    @cached_property
    def _inverse(self) -> FloatArray:
        identity = np.eye(len(self.factor))
        return np.asarray(la.solve_triangular(self.factor, identity, lower=True))

    @cached_property
    def log_density(self) -> float:
        """Return ln of the density at the mean, without (2 pi)^(n/2), and ln of the weight."""
        return self.log_weight - float(np.log(self.factor.diagonal()).sum())

    def residual(self, raw: FloatArray) -> FloatArray:
        """Return residuals in units of the noise, same shape."""
        return self.whiten(raw - self.mean)

    def whiten(self, rows: FloatArray) -> FloatArray:
        """Return vectors along the last axis in units of the noise, same shape."""
        return np.asarray(rows @ self._inverse.T)

    def reweigh(self, rows: FloatArray, ratios: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return chi-square, (k,), and ln of the root of the determinant, of reweighed data, (k,).

        The mean is no part of it, nor the weight. What is not measurement stays as it is, so that
        a few deviations change few entries of the diagonal: a change of low rank (Woodbury).

        Arguments:
            rows: residuals in the deviations that this noise is of, (k, n_data).
            ratios: of these deviations over the other ones, (k, n_data).
        """
        white = self.whiten(rows)
        chi2 = np.square(white).sum(axis=1)
        log_det = np.full(len(rows), float(np.log(self.factor.diagonal()).sum()))
        for i in np.flatnonzero((ratios != 1.0).any(axis=1)):
            own = np.flatnonzero(ratios[i] != 1.0)
            added = 1.0 / np.square(ratios[i, own]) - 1.0
            if _FEW * len(own) > len(self.factor):
                total = self.factor @ self.factor.T
                total[own, own] += added
                lower = la.cholesky(total, lower=True, overwrite_a=True)
                chi2[i] = np.square(la.solve_triangular(lower, rows[i], lower=True)).sum()
                log_det[i] = np.log(lower.diagonal()).sum()
                continue
            felt = self._inverse[:, own]
            inner = np.eye(len(own)) + added[:, None] * (felt.T @ felt)
            along = white[i] @ felt
            chi2[i] -= along @ np.linalg.solve(inner, added * along)
            log_det[i] += 0.5 * np.linalg.slogdet(inner)[1]
        return chi2, log_det


def marginal(rows: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return vectors in units of noise and linear causes together: (I + J J')^(-1/2) times each.

    The squares of marginal residuals are what is left after the best move of the causes within
    their standard normal prior.

    Arguments:
        rows: residuals or slopes in units of the noise along the last axis, (..., n_data).
        slopes: J, the derivatives of the data by the causes, (n_data, k).
    """
    along, size, _ = np.linalg.svd(slopes, full_matrices=False)
    taken = 1.0 - 1.0 / np.sqrt(1.0 + np.square(size))
    return np.asarray(rows - (rows @ along * taken) @ along.T)
