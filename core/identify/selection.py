"""Which poles are modes: those without which the data are not explained."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from femubench.core.identify.basis import RESIDUALS, Lines, Products
from femubench.core.typing import AnyArray, BoolArray, FloatArray, IntArray

_BLOCK = 4  # functions of a mode
_SURE = 8.0  # standard deviations above what a mode of noise explains


def find_gain(
    products: Products, chosen: IntArray, candidates: IntArray, weights: FloatArray
) -> FloatArray:
    """Return how much smaller the misfit gets by each candidate, in units of the noise, (n,).

    Residues are free in every channel, and so are small changes of the chosen poles: what only
    makes up for an error of theirs explains nothing.

    Arguments:
        chosen: positions of the modes so far among the poles.
        candidates: likewise, (n,).
        weights: of the channels, 0 where nothing was measured, (n_out, n_ref).
    """
    size = len(products.gram)
    own = (_BLOCK * chosen[:, None] + np.arange(_BLOCK)).ravel()
    known = np.concatenate([own, size - 1 - np.arange(RESIDUALS)])
    length = np.sqrt(np.diag(products.gram))
    gram = products.gram / np.outer(length, length)
    data = products.data.reshape(size, -1) / length[:, None]
    factor = scipy.linalg.cho_factor(gram[np.ix_(known, known)] + 1e-10 * np.eye(len(known)))
    solved = scipy.linalg.cho_solve(factor, np.concatenate([gram[known], data[known]], axis=1))
    weight = np.square(weights).reshape(-1)
    found = np.zeros(len(candidates))
    for k, candidate in enumerate(candidates):
        pair = _BLOCK * candidate + np.arange(2)
        to_known = gram[np.ix_(known, pair)]
        rest = gram[np.ix_(pair, pair)] - to_known.T @ solved[:, pair]
        left = data[pair] - to_known.T @ solved[:, size:]
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
    """Return the candidates that are modes apart from the chosen ones, the strongest first.

    Arguments:
        candidates: poles, in rad/s.
        weights: of the channels, (n_out, n_ref).
        chosen: poles that are in already.
    """
    products = Products.of(lines, np.concatenate([chosen, candidates]))
    inside = list(range(len(chosen)))
    waiting = list(range(len(chosen), len(chosen) + len(candidates)))
    while waiting:
        gains = find_gain(products, np.array(inside, dtype=int), np.array(waiting), weights)
        if gains.max() < least_gain(weights):
            break
        inside.append(waiting.pop(int(gains.argmax())))
    return np.array(inside[len(chosen) :], dtype=np.int64) - len(chosen)


def find_needed(lines: Lines, poles: AnyArray, weights: FloatArray) -> BoolArray:
    """Tell which modes the data need with all others, (n,); at most one is not, the weakest.

    Arguments:
        poles: in rad/s, (n,).
        weights: of the channels, (n_out, n_ref).
    """
    keep = np.ones(len(poles), dtype=bool)
    products, every = Products.of(lines, poles), np.arange(len(poles))
    gains = [find_gain(products, np.delete(every, k), every[[k]], weights)[0] for k in every]
    if len(poles) > 1:
        keep[np.argmin(gains)] = min(gains) >= least_gain(weights)
    return keep
