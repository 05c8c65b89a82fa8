"""Antiresonances: where receptances vanish between resonances, as measured and of a model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.frf import FrequencyResponses, dynamic_stiffness, losses
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.receptances import PredictedResponses, paired_slopes
from femubench.core.typing import BoolArray, FloatArray, IntArray

SAME = 1.25  # ratio of frequencies within which two may be the same one
_SIDE = 4  # lines on each side of a change of sign that say where the zero is
_REACH = 1.15  # ratio of frequencies within which they lie
_SHARP = 0.01  # of the frequency: one whose deviation is larger says nothing
_STEEP = 5.0  # deviations: with less of a slope through zero a channel may hold noise alone
_HIDDEN = 0.01, 2.0  # of a resonance, and dampings of it, within which it hides the zero
_GRID, _STEPS, _BEYOND = 2000, 3, 1.5


@dataclass(frozen=True)
class Antiresonances:
    """Zeros of the real part of receptances.

    Arguments:
        frequencies: in Hz, (k,).
        response, force: of which sensor and force each is, (k,).
        below: which of the measured modes have their resonance below it, (k, m).
        std: standard deviations in Hz, (k,); zeros of a model.
    """

    frequencies: FloatArray
    response: IntArray
    force: IntArray
    below: BoolArray
    std: FloatArray

    def __len__(self) -> int:
        return len(self.frequencies)

    def take(self, kept: BoolArray | IntArray) -> Antiresonances:
        """Return some of them."""
        return Antiresonances(*(getattr(self, f.name)[kept] for f in fields(self)))

    def pair(self, other: Antiresonances) -> IntArray:
        """Return which of others is each: the one as high between the same resonances; else -1.

        Where others have more there, or fewer, none is; nor where they are too far apart.
        """
        found, there = np.full(len(self), -1), other._by_place
        for place, rows in self._by_place.items():
            partners = there.get(place, [])
            if len(partners) == len(rows):
                found[rows] = partners
        apart = np.abs(np.log(other.frequencies[found] / self.frequencies)) if len(other) else 0.0
        return np.where(apart < np.log(SAME), found, -1)

    @cached_property
    def _by_place(self) -> dict[tuple[int, int, bytes], list[int]]:
        """Return the zeros of every response and force between two resonances, ascending."""
        found: dict[tuple[int, int, bytes], list[int]] = {}
        for i in np.argsort(self.frequencies, kind="stable"):
            place = int(self.response[i]), int(self.force[i]), self.below[i].tobytes()
            found.setdefault(place, []).append(int(i))
        return found


def find_antiresonances(
    measured: FrequencyResponses, poles: FloatArray, damping: FloatArray
) -> Antiresonances:
    """Return the antiresonances of measured responses with their standard deviations.

    The real part of a receptance times (1 - f^2 / f_r^2) of all resonances has no pole, and is
    smooth: about each of its changes of sign a parabola in f^2 is fitted to eight lines.

    Arguments:
        measured: with deviations.
        poles: resonances between the lines in Hz, (m,).
        damping: their ratios, (m,); nan where unknown.
    """
    hertz, sides = measured.frequencies, np.arange(-_SIDE + 1, _SIDE + 1)
    smooth = np.prod(1.0 - np.square(hertz[:, None] / poles), axis=1)
    values, std = measured.receptances, measured.receptance_std * np.abs(smooth)[:, None, None]
    rows: list[tuple[float, int, int, float]] = []
    for o, e in np.ndindex(values.shape[1:]):
        y, size = values[:, o, e].real * smooth, np.abs(values[:, o, e])
        last = 0.0  # noise may change the sign several times about one zero
        for at in np.flatnonzero(y[1:] * y[:-1] < 0.0):
            own = at + sides
            if own[0] < 0 or own[-1] >= len(hertz) or hertz[own[-1]] > _REACH**2 * hertz[own[0]]:
                continue
            known = std[own, o, e]
            peak = size[[at, at + 1]].sum() > size[own[[0, -1]]].sum()
            if peak or not (np.isfinite(known) & (known > 0.0)).all():
                continue
            zero, sigma = _zero_of(hertz[own], y[own], known)
            if hertz[own[1]] < zero < hertz[own[-2]] and sigma < _SHARP * zero and zero > last:
                rows.append((zero, o, e, sigma))
                last = hertz[at + 2]
    found = np.array(rows).reshape(-1, 4)
    return _shown(found, poles, damping, poles)


def frequency_shares(test: Measurement, zeros: Antiresonances) -> FloatArray:
    """Return by how much each antiresonance moves with a resonance, d ln f0 / d ln f, (k, m).

    By the residues A of the measured modes, which with an inertia below and a flexibility above
    the lines fit each channel, and what they make of dH = -A dw_r^2 / (w_r^2 - w^2)^2.

    Arguments:
        test: with the responses that the antiresonances were found in.
    """
    measured, values = test.responses, test.eigenvalues
    assert measured is not None
    damping = test.damping_of(np.arange(len(test)), len(test))
    square, lines = np.square(2.0 * np.pi * zeros.frequencies), 2.0 * np.pi * measured.frequencies
    terms = 1.0 / dynamic_stiffness(values, measured.frequencies, damping)
    terms = np.column_stack([terms, 1.0 / np.square(lines), np.ones(len(lines))])
    found = np.zeros((len(zeros), len(test)))
    for o, e in set(zip(zeros.response.tolist(), zeros.force.tolist(), strict=True)):
        own = (zeros.response == o) & (zeros.force == e)
        weight = 1.0 / measured.receptance_std[:, o, e]
        rows, right = terms * weight[:, None], np.nan_to_num(measured.receptances[:, o, e]) * weight
        whole = np.vstack([rows.real, rows.imag]), np.append(right.real, right.imag)
        *residues, inertia, _ = np.linalg.lstsq(*whole, rcond=None)[0]
        steep = residues / np.square(values - square[own, None])
        total = steep.sum(axis=1) - inertia / np.square(square[own])
        found[own] = steep * values / (total * square[own])[:, None]
    return found


def _zero_of(hertz: FloatArray, y: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Return the zero of a parabola in f^2 that is nearest to the middle, and its deviation."""
    middle = float(np.mean(hertz[_SIDE - 1 : _SIDE + 1]))
    x = np.square(hertz / middle) - 1.0
    terms = x[:, None] ** np.arange(3)
    covariance = np.linalg.inv((terms / std[:, None]).T @ (terms / std[:, None]))
    a = covariance @ (terms / np.square(std)[:, None]).T @ y
    roots = np.roots(a[::-1])
    real = roots[np.abs(roots.imag) < np.abs(x).max()].real
    if not len(real):
        return 0.0, np.inf
    root = float(real[np.abs(real).argmin()])
    power = root ** np.arange(3)
    slope = a[1] + 2.0 * a[2] * root
    turn = np.array([0.0, 1.0, 2.0 * root])
    if abs(slope) < _STEEP * np.sqrt(turn @ covariance @ turn):
        return 0.0, np.inf
    sigma = float(np.sqrt(power @ covariance @ power)) / abs(slope)
    zero = middle * np.sqrt(max(1.0 + root, 0.0))
    return float(zero), 0.5 * middle**2 * sigma / max(float(zero), 1e-300)


def _shown(
    found: FloatArray, poles: FloatArray, damping: FloatArray, resonances: FloatArray
) -> Antiresonances:
    """Return those of some zeros that no resonance hides.

    Arguments:
        found: frequency, response, force and deviation of each, (k, 4).
        poles, damping: of all modes near, (q,).
        resonances: of the measured modes there, nan where there is none, (m,).
    """
    near = np.abs(found[:, :1] / poles - 1.0)
    limit = np.maximum(_HIDDEN[0], _HIDDEN[1] * np.nan_to_num(damping))
    own = found[(near > limit).all(axis=1)]
    index = own[:, 1:3].astype(int)
    below = resonances < own[:, :1]
    return Antiresonances(own[:, 0], index[:, 0], index[:, 1], below, own[:, 3])


def predict_antiresonances(answer: PredictedResponses) -> Antiresonances:
    """Return the zeros of a model's receptances about the lines, with its damping."""
    parts = list(zeros_by_force(answer))
    names = (field.name for field in fields(Antiresonances))
    return Antiresonances(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))


def zeros_by_force(answer: PredictedResponses) -> Iterator[Antiresonances]:
    """Yield the same under one force after the other."""
    modes, lines = answer.modes, answer.at[2]
    hertz = np.sqrt(np.abs(modes.eigenvalues)) / (2.0 * np.pi)
    grid = np.geomspace(lines[0] / _BEYOND, lines[-1] * _BEYOND, _GRID)
    inner = (hertz > grid[0]) & (hertz < grid[-1])
    own = hertz[np.maximum(answer.partner, 0)]
    own = np.where(answer.partner >= 0, own, np.nan)
    # Undamped, so real. A line at the very frequency of a mode is none of the grid's by chance.
    dynamic = modes.eigenvalues - np.square(2.0 * np.pi * grid)[:, None]
    smooth = np.prod(1.0 - np.square(grid[:, None] / hertz[inner]), axis=1)[:, None] / dynamic
    out, into = answer.read
    for e, force in enumerate(into):
        values = smooth @ (out * force).T
        at, o = np.nonzero(values[1:] * values[:-1] < 0.0)
        one, two = values[at, o], values[at + 1, o]
        zero = grid[at] + (grid[at + 1] - grid[at]) * one / (one - two)
        # The product vanishes at a resonance that a sensor does not see, and no receptance does.
        true = (np.abs(zero[:, None] / hertz[inner] - 1.0) > _HIDDEN[0]).all(axis=1)
        zero, pairs = zero[true], out[o[true]] * force
        for _ in range(_STEPS):  # Newton's, to where the damping takes it
            value, slope = _real_and_slope(answer, zero, pairs)
            zero = zero - np.clip(value / slope, -_HIDDEN[0] * zero, _HIDDEN[0] * zero)
        place = np.full(len(zero), e), np.zeros(len(zero))
        found = np.column_stack([zero, o[true], *place])
        yield _shown(found, hertz[inner], answer.ratios[inner], own)


def _real_and_slope(
    answer: PredictedResponses, hertz: FloatArray, pairs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the real part of receptances, each at a frequency of its own, and its slope, (k,).

    Arguments:
        pairs: shapes at the response times those at the force of each, (k, m).
    """
    omega, values = 2.0 * np.pi * hertz[:, None], answer.modes.eigenvalues
    lost, growing = losses(values, answer.damping)
    dynamic, turn = values - np.square(omega), -2.0 * omega
    if lost.any() or growing.any():
        dynamic, turn = dynamic + 1j * (lost + omega * growing), turn + 1j * growing
    terms = pairs / dynamic
    slope = -2.0 * np.pi * (terms * (turn / dynamic)).sum(axis=1).real
    return terms.sum(axis=1).real, slope


def antiresonance_slopes(
    answer: PredictedResponses, found: Antiresonances, slopes: MatrixSlopes
) -> FloatArray:
    """Return d antiresonance / d parameter in Hz, (k, p), of the slopes of the matrices.

    On a zero of Re H(f, x) it is -Re(dH/dx) / Re(dH/df).
    """
    out, into = answer.read
    one, other = out[found.response], into[found.force]
    own = paired_slopes(answer.modes, one, other, found.frequencies, slopes, answer.damping)
    _, by_frequency = _real_and_slope(answer, found.frequencies, one * other)
    return np.asarray(-own.real / by_frequency[:, None])
