"""Which clusters of poles are modes: those without which the data are not explained."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from femubench.core.identify.basis import RESIDUALS, Lines, Products
from femubench.core.typing import AnyArray, FloatArray, IntArray

_BLOCK = 4  # functions of a mode
_SURE = 8.0  # standard deviations above what a mode of noise explains


def explained(
    lines: Lines,
    chosen: AnyArray,
    candidates: AnyArray,
    weights: FloatArray,
) -> FloatArray:
    """Return how much smaller the misfit gets by each candidate, in units of the noise, (n,).

    Residues are free in every channel, and so are small changes of the chosen poles: what only
    makes up for an error of theirs explains nothing.

    Arguments:
        lines: the data.
        chosen: poles of the modes so far, in rad/s, (k,).
        candidates: poles, (n,).
        weights: of the channels, 0 where nothing was measured, (n_out, n_ref).
    """
    products = Products.of(lines, np.concatenate([chosen, candidates]))
    count = _BLOCK * len(chosen)
    at = count + _BLOCK * np.arange(len(candidates))[:, None] + [0, 1]
    known = np.concatenate([np.arange(count), len(products.gram) - 1 - np.arange(RESIDUALS)])
    length = np.sqrt(np.diag(products.gram))
    gram = products.gram / np.outer(length, length)
    data = products.data.reshape(len(gram), -1) / length[:, None]
    own = gram[np.ix_(known, known)] + 1e-10 * np.eye(len(known))
    factor = scipy.linalg.cho_factor(own)
    solved = scipy.linalg.cho_solve(factor, np.concatenate([gram[known], data[known]], axis=1))
    weight = np.square(weights).reshape(-1)
    found = np.zeros(len(candidates))
    for k, pair in enumerate(at):
        to_known = gram[np.ix_(known, pair)]
        rest = gram[np.ix_(pair, pair)] - to_known.T @ solved[:, pair]
        left = data[pair] - to_known.T @ solved[:, len(gram) :]
        if np.linalg.eigvalsh(rest)[0] > 1e-8:
            found[k] = np.sum(weight * np.einsum("ac,ac->c", left, np.linalg.solve(rest, left)))
    return found


def least_gain(weights: FloatArray) -> float:
    """Return the gain above which a mode is no noise: what chance gives, far in its tail.

    Arguments:
        weights: of the channels, 0 where nothing was measured.

    Source: Laurent & Massart (2000), Adaptive estimation of a quadratic functional by model
        selection, lemma 1, for the tail of a sum of squares.
    """
    freedom = 2.0 * np.count_nonzero(weights)
    return float(freedom + _SURE * np.sqrt(2.0 * freedom) + _SURE**2)


def select(lines: Lines, candidates: AnyArray, weights: FloatArray, chosen: AnyArray) -> IntArray:
    """Return the candidates that are modes besides the chosen ones, the strongest first.

    Arguments:
        lines: the data.
        candidates: poles, in rad/s.
        weights: of the channels, (n_out, n_ref).
        chosen: poles that are in already.
    """
    found: list[int] = []
    while len(found) < len(candidates):
        rest = np.setdiff1d(np.arange(len(candidates)), found)
        gain = explained(
            lines, np.concatenate([chosen, candidates[found]]), candidates[rest], weights
        )
        if gain.max() < least_gain(weights):
            break
        found.append(int(rest[gain.argmax()]))
    return np.array(found, dtype=np.int64)
