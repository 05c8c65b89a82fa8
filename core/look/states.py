"""Whether a structure changed, by its two measurements alone: no model has a say in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from femubench.core.case.modes import FREQUENCY_STD
from femubench.core.inference.settings import settings
from femubench.core.modal.antiresonances import find_antiresonances, frequency_shares
from femubench.core.modal.close_modes import align_close_modes, clusters_of
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import LEAST_SENSORS, Pairing, pair_modes
from femubench.core.schema.diagnosis import LoneMode, ModeChange, States, ZeroChange
from femubench.core.typing import FloatArray, IntArray


@dataclass(frozen=True)
class _State:
    """A measurement with a deviation for every datum."""

    given: Measurement

    @cached_property
    def frequency_share(self) -> FloatArray:
        """Return the relative deviations of the frequencies, (m,)."""
        return _filled(self.given.frequency_std / self.given.frequencies, FREQUENCY_STD)

    def covariance(self, modes: IntArray) -> FloatArray:
        """Return that of the logarithms of some frequencies, (k, k)."""
        share, correlation = self.frequency_share[modes], self.given.frequency_correlation
        own = np.eye(len(modes)) if correlation is None else correlation[np.ix_(modes, modes)]
        return np.asarray(share[:, None] * own * share)

    @cached_property
    def shape_std(self) -> FloatArray:
        """Return the deviations of the shapes, (n_sensors, m); 0 where none is known at all.

        One and the same share of each mode's own largest reading says nothing of the sensors, and
        makes a mode that they hardly see absurdly sharp: it is taken of the largest of all modes.
        """
        largest = np.abs(np.nan_to_num(self.given.shapes)).max(axis=0, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = self.given.shape_std / largest
        filled = _filled(share, 0.0)
        alike = filled.size > 0 and np.ptp(filled) <= 1e-6 * filled.max()
        return np.asarray(filled * (largest.max() if alike else largest))


def compare_states(present: Measurement, reference: Measurement) -> States:
    """Return how two measurements of one structure differ, in the stated deviations of both.

    A shape counts as two data however many sensors saw it, by Fisher's sum of -2 ln p: else some
    hundred readings that agree would hide a frequency that does not. So does a mode that one state
    lacks in the band of both, with the probability that a test misses one; and so do all
    antiresonances together that the responses of both show.

    Arguments:
        present, reference: all modes that were measured, one at least, at the same sensors, with
            responses or without.

    Source: Fisher (1932), Statistical Methods for Research Workers, 21.1, for the sum.
    """
    now, before = _State(present), _State(reference)
    pairing, groups = _pair(now, before)
    mine = np.flatnonzero(pairing.index >= 0)
    other = pairing.index[mine]
    change = np.log(present.frequencies[mine] / reference.frequencies[other])
    covariance = now.covariance(mine) + before.covariance(other)
    rows = tuple(
        ModeChange(
            mode=present.numbers[i],
            reference_mode=reference.numbers[j],
            reference_hz=float(reference.frequencies[j]),
            present_hz=float(present.frequencies[i]),
            change_percent=100.0 * float(np.expm1(ln)),
            std_percent=100.0 * float(std),
            deviations=float(ln / std),
            mac=float(pairing.mac[i]) if np.isfinite(pairing.mac[i]) else None,
            shape_p=_shape_p(now, int(i), before, groups.get(int(j), np.array([j]))),
        )
        for i, j, ln, std in zip(mine, other, change, np.sqrt(np.diag(covariance)), strict=True)
    )
    # Outside of the band that both tests cover a mode was perhaps not looked for.
    low = max(m.frequencies.min() for m in (present, reference))
    high = min(m.frequencies.max() for m in (present, reference))
    lost, new = (
        tuple(
            LoneMode(m.numbers[k], float(m.frequencies[k]))
            for k in np.setdiff1d(np.arange(len(m)), taken)
            if low < m.frequencies[k] < high
        )
        for m, taken in ((reference, other), (present, mine))
    )
    odds = [row.shape_p for row in rows if row.shape_p is not None]
    odds += [settings.prior_missed_mode] * len([*lost, *new])
    zeros, zeros_p = _zero_changes(now, before, mine, other)
    odds += [] if zeros_p is None else [zeros_p]
    moved = change @ np.linalg.pinv(covariance, hermitian=True) @ change
    chi2, count = float(moved) - 2.0 * float(np.log(odds).sum()), len(rows) + 2 * len(odds)
    mass = None
    if present.total_mass is not None and reference.total_mass is not None:
        kg, std = np.transpose([present.total_mass, reference.total_mass])
        mass = float(kg[0] - kg[1]), float(np.hypot(*std))
        if mass[1] > 0.0:
            chi2, count = chi2 + (mass[0] / mass[1]) ** 2, count + 1
    p = float(chdtrc(count, chi2)) if count else 1.0
    verdict: Literal["differs", "agrees"] = "differs" if p < settings.noise_p else "agrees"
    return States(verdict, p, chi2, count, rows, lost, new, mass, zeros, zeros_p)


def _pair(now: _State, before: _State) -> tuple[Pairing, dict[int, IntArray]]:
    """Return the partners of the present modes, and the close modes of those of the reference."""
    new, old = now.given.frequencies, before.given.frequencies
    # Closer than a test can tell frequencies apart, modes are a space and no single shapes.
    closeness = float(np.median([*now.frequency_share, *before.frequency_share]))
    turned = align_close_modes(old, before.given.shapes, now.given.shapes, closeness)
    pairing = pair_modes(
        new, align_close_modes(new, now.given.shapes, turned, closeness), old, turned
    )
    paired = pairing.index >= 0
    moved = old.copy()
    moved[pairing.index[paired]] = new[paired]
    groups: dict[int, IntArray] = {}
    # Modes that only one of the two tests tells apart are as close.
    for group in (*clusters_of(old, closeness), *clusters_of(moved, closeness)):
        for j in group.tolist():
            groups[j] = max(groups.get(j, group), group, key=len)
    return pairing, groups


def _shape_p(now: _State, mode: int, before: _State, columns: IntArray) -> float | None:
    """Return the probability of as large a difference of two shapes, were it noise.

    The reference has what scale it likes, and turns into the close modes among its columns. None
    where fewer than three sensors compare them.
    """
    shape, space = now.given.shapes[:, mode], before.given.shapes[:, columns]
    own, others = np.square(now.shape_std[:, mode]), np.square(before.shape_std[:, columns])
    known = np.isfinite(shape) & np.isfinite(space).all(axis=1)
    known &= (own > 0.0) & (others > 0.0).all(axis=1)
    degrees = int(known.sum()) - len(columns)
    if degrees < LEAST_SENSORS - 1:
        return None
    shape, space, own, others = shape[known], space[known], own[known], others[known]
    variance = own
    for _ in range(settings.few_steps):
        root = np.sqrt(variance)
        scale = np.linalg.lstsq(space / root[:, None], shape / root, rcond=None)[0]
        variance = own + others @ np.square(scale)
    chi2 = np.square(shape - space @ scale) / variance
    return _p_of(degrees, float(chi2.sum()))


def _zero_changes(
    now: _State, before: _State, mine: IntArray, other: IntArray
) -> tuple[tuple[ZeroChange, ...], float | None]:
    """Return how antiresonances moved that both states have between the modes of both.

    They move with the resonances, so that errors of these are theirs too. The second value is the
    probability of as large differences, were they noise; None without antiresonances.

    Arguments:
        mine, other: the modes of both, of the present state and of the reference.
    """
    found, labels = [], now.given.sensors.labels
    for state, modes in ((now.given, mine), (before.given, other)):
        if (lines := state.responses) is None or lines.deviations is None:
            return (), None
        zeros = find_antiresonances(lines, state.frequencies, state.damping)
        shares = frequency_shares(state, zeros)
        # Both count the same modes and sensors.
        sides = (lines.responses, zeros.response), (lines.references, zeros.force)
        at = [
            np.array([labels.index(label) if label in labels else -1 for label in side.labels])[k]
            for side, k in sides
        ]
        zeros = replace(zeros, below=zeros.below[:, modes], response=at[0], force=at[1])
        found.append((zeros, shares))
    (zeros, shares), (old, old_shares) = found
    partner = zeros.pair(old)
    kept = np.flatnonzero((partner >= 0) & (zeros.response >= 0) & (zeros.force >= 0))
    if not len(kept):
        return (), None
    covariance = np.zeros((len(kept), len(kept)))
    for side, own, share in (
        (now, zeros.take(kept), shares[kept]),
        (before, old.take(partner[kept]), old_shares[partner[kept]]),
    ):
        relative = np.hypot(own.std / own.frequencies, settings.reachable_antiresonance_std)
        every = side.covariance(np.arange(len(side.given)))
        covariance += np.diag(np.square(relative)) + share @ every @ share.T
    hz, was = zeros.frequencies[kept], old.frequencies[partner[kept]]
    ln, std = np.log(hz / was), np.sqrt(np.diag(covariance))
    moved = zip(kept, was, hz, 100.0 * np.expm1(ln), ln / std, strict=True)
    rows = tuple(
        ZeroChange(labels[zeros.response[k]], labels[zeros.force[k]], *map(float, values))
        for k, *values in moved
    )
    return rows, _p_of(len(kept), float(ln @ np.linalg.solve(covariance, ln)))


def _p_of(degrees: int, chi2: float) -> float:
    """Return the probability of as large a chi-square, never 0."""
    return max(float(chdtrc(degrees, chi2)), float(np.finfo(float).tiny))


def _filled(shares: FloatArray, usual: float) -> FloatArray:
    """Return deviations, the median of all where one is missing; the usual one without any."""
    known = np.isfinite(shares) & (shares > 0.0)
    return np.where(known, shares, np.median(shares[known]) if known.any() else usual)
