"""Whether a structure changed, by its two measurements alone: no model has a say in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from femubench.core.case.modes import FREQUENCY_STD
from femubench.core.inference.settings import settings
from femubench.core.modal.close_modes import align_close_modes, clusters_of
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import LEAST_SENSORS, Pairing, pair_modes
from femubench.core.schema.diagnosis import ModeChange, States
from femubench.core.typing import FloatArray, IntArray

_LEAST_P = 1e-300  # numbers end near it
_SETTLED = 3  # reweighted fits of a scale: it changes the deviations by little


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


@dataclass(frozen=True)
class _Couple:
    """Two states, whose modes are paired.

    Arguments:
        pairing: of the present modes, close modes of either state turned towards the other's.
        groups: from a mode of the reference to the close modes that it may turn into, itself too.
    """

    present: _State
    reference: _State
    pairing: Pairing
    groups: dict[int, IntArray]

    @classmethod
    def of(cls, present: Measurement, reference: Measurement) -> _Couple:
        """Return two states paired by shape and frequency."""
        now, before = _State(present), _State(reference)
        # Closer than a test can tell frequencies apart, modes are a space and no single shapes.
        closeness = float(np.median([*now.frequency_share, *before.frequency_share]))
        old, new = reference.frequencies, present.frequencies
        turned = align_close_modes(old, reference.shapes, present.shapes, closeness)
        shapes = align_close_modes(new, present.shapes, turned, closeness)
        pairing = pair_modes(new, shapes, old, turned)
        paired = pairing.index >= 0
        moved = old.copy()
        moved[pairing.index[paired]] = new[paired]
        groups: dict[int, IntArray] = {}
        # Modes that only one of the two tests tells apart are as close.
        for group in (*clusters_of(old, closeness), *clusters_of(moved, closeness)):
            for j in group.tolist():
                groups[j] = max(groups.get(j, group), group, key=len)
        return cls(now, before, pairing, groups)

    @cached_property
    def partners(self) -> tuple[IntArray, IntArray]:
        """Return the present modes that have a partner, and the partners."""
        rows = np.flatnonzero(self.pairing.index >= 0)
        return rows, self.pairing.index[rows]

    @cached_property
    def change(self) -> FloatArray:
        """Return ln of the ratio of the frequencies of each pair."""
        (now, before), pair = self.partners, (self.present.given, self.reference.given)
        return np.log(pair[0].frequencies[now] / pair[1].frequencies[before])

    @cached_property
    def covariance(self) -> FloatArray:
        """Return the covariance of these changes."""
        now, before = self.partners
        return self.present.covariance(now) + self.reference.covariance(before)

    def shape_p(self, now: int, before: int) -> float | None:
        """Return the probability of as large a difference of two shapes, were it noise.

        The reference has what scale it likes, and close modes may turn into each other. None where
        fewer than three sensors compare them.
        """
        p, r = self.present, self.reference
        columns = self.groups.get(before, np.array([before]))
        shape, space = p.given.shapes[:, now], r.given.shapes[:, columns]
        own, others = np.square(p.shape_std[:, now]), np.square(r.shape_std[:, columns])
        known = np.isfinite(shape) & np.isfinite(space).all(axis=1)
        known &= (own > 0.0) & (others > 0.0).all(axis=1)
        degrees = int(known.sum()) - len(columns)
        if degrees < LEAST_SENSORS - 1:
            return None
        shape, space, own, others = shape[known], space[known], own[known], others[known]
        variance = own
        for _ in range(_SETTLED):
            root = np.sqrt(variance)
            scale = np.linalg.lstsq(space / root[:, None], shape / root, rcond=None)[0]
            variance = own + others @ np.square(scale)
        chi2 = np.square(shape - space @ scale) / variance
        return max(float(chdtrc(degrees, chi2.sum())), _LEAST_P)

    @cached_property
    def rows(self) -> tuple[ModeChange, ...]:
        """Return how each mode that both states have changed."""
        p, r = self.present.given, self.reference.given
        found = []
        stds = np.sqrt(np.diag(self.covariance))
        for i, j, change, std in zip(*self.partners, self.change, stds, strict=True):
            likeness = float(self.pairing.mac[i])
            row = ModeChange(
                mode=p.numbers[i],
                reference_mode=r.numbers[j],
                reference_hz=float(r.frequencies[j]),
                present_hz=float(p.frequencies[i]),
                change_percent=100.0 * float(np.expm1(change)),
                std_percent=100.0 * float(std),
                deviations=float(change / std),
                mac=likeness if np.isfinite(likeness) else None,
                shape_p=self.shape_p(int(i), int(j)),
            )
            found.append(row)
        return tuple(found)

    @cached_property
    def alone(self) -> tuple[tuple[tuple[int, float], ...], ...]:
        """Return label and frequency of modes that only reference, or only present has.

        A mode outside of the band that both tests cover was perhaps not looked for.
        """
        states = self.reference.given, self.present.given
        low = max(m.frequencies.min() for m in states)
        high = min(m.frequencies.max() for m in states)
        return tuple(
            tuple(
                (m.numbers[k], float(m.frequencies[k]))
                for k in range(len(m))
                if k not in taken and low < m.frequencies[k] < high
            )
            for m, taken in zip(states, reversed(self.partners), strict=True)
        )


def compare_states(present: Measurement, reference: Measurement) -> States:
    """Return how two measurements of one structure differ, in the stated deviations of both.

    A shape counts as two data however many sensors saw it, by Fisher's sum of -2 ln p: else some
    hundred readings that agree would hide a frequency that does not. So does a mode that one state
    lacks in the band of both, with the probability that a test misses one.

    Arguments:
        present, reference: all modes that were measured, one at least, at the same sensors.

    Source: Fisher (1932), Statistical Methods for Research Workers, 21.1, for the sum.
    """
    couple = _Couple.of(present, reference)
    lost, new = couple.alone
    odds = [row.shape_p for row in couple.rows if row.shape_p is not None]
    odds += [settings.prior_missed_mode] * len([*lost, *new])
    moved = couple.change @ np.linalg.pinv(couple.covariance, hermitian=True) @ couple.change
    chi2 = float(moved) - 2.0 * float(np.log(odds).sum())
    count = len(couple.rows) + 2 * len(odds)
    mass = None
    if present.total_mass is not None and reference.total_mass is not None:
        (now, std), (before, other) = present.total_mass, reference.total_mass
        mass = (now - before, float(np.hypot(std, other)))
        if mass[1] > 0.0:
            chi2, count = chi2 + (mass[0] / mass[1]) ** 2, count + 1
    p = float(chdtrc(count, chi2)) if count else 1.0
    return States(
        verdict="differs" if p < settings.noise_p else "agrees",
        p=p,
        chi2=chi2,
        count=count,
        modes=couple.rows,
        lost=lost,
        new=new,
        mass_change=mass,
    )


def _filled(shares: FloatArray, usual: float) -> FloatArray:
    """Return deviations, the median of all where one is missing; the usual one without any."""
    known = np.isfinite(shares) & (shares > 0.0)
    return np.where(known, shares, np.median(shares[known]) if known.any() else usual)
