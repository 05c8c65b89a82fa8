"""Stated standard deviations that no test has: of the component that scales a shape, of rounding.

A shape is divided by one of its components, which then repeats exactly: its scatter over the tests
is 0 or 1e-16. It was measured no better than the others, so it gets what they have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.modal.measurement import OUT_OF_PHASE, Measurement
from femubench.core.typing import BoolArray, FloatArray

_ROUNDING = 1e-12  # of the quantity itself
_NEGLIGIBLE = 0.01  # of the median of the others; real tests came down to 0.075
_MOST_NAMED = 6


def with_floor(
    measurement: Measurement, file: str, frequency_share: float, shape_share: float
) -> tuple[Measurement, tuple[str, ...]]:
    """Return a measurement without deviations of next to nothing, and what was changed.

    A deviation below a hundredth of the median of its mode, or below 1e-12 of the quantity, is
    raised to that median; frequencies are compared relative to themselves over the modes.

    Arguments:
        measurement: as read; nan where no deviation is known.
        frequency_share, shape_share: relative deviations where no other one is stated.
    """
    m, stated = measurement, []
    relative, low = _raised(m.frequency_std / m.frequencies, np.ones(len(m)), frequency_share)
    frequency_std = np.where(low, relative * m.frequencies, m.frequency_std)
    if low.any():
        modes = ", ".join(str(m.numbers[k]) for k in np.flatnonzero(low))
        stated.append(
            _sentence(file, f"the frequency of mode {modes}", relative[low], "the frequency")
        )
    shape_std, lows = m.shape_std.copy(), np.zeros(m.shapes.shape, dtype=bool)
    for k in range(len(m)):
        known = np.isfinite(m.shapes[:, k])
        size = np.abs(m.shapes[known, k]).max(initial=0.0)
        raised, low = _raised(m.shape_std[known, k], np.full(known.sum(), size), shape_share)
        shape_std[known, k] = raised
        lows[known, k] = low
    if lows.any():
        share = (shape_std / np.abs(np.nan_to_num(m.shapes)).max(axis=0, initial=0.0))[lows]
        stated.append(_sentence(file, _places(m, lows), share, "the largest component"))
    if not stated:
        return m, ()
    return replace(m, frequency_std=frequency_std, shape_std=shape_std), tuple(stated)


def say_what_phases_lose(measurement: Measurement, file: str) -> list[str]:
    """Return a sentence where turning shapes real loses much of them, else none.

    Arguments:
        measurement: as read.
        file: for the sentence.
    """
    if (lost := measurement.out_of_phase) is None or not (large := lost >= OUT_OF_PHASE).any():
        return []
    pairs = zip(lost[large], np.flatnonzero(large), strict=True)
    named = [f"{100.0 * share:.0f} % of mode {measurement.numbers[k]}" for share, k in pairs]
    return [
        f"{file}: shapes were turned real, and what was out of phase in them is lost: "
        + f"{_name_first(named, 'modes')}."
    ]


def _raised(std: FloatArray, size: FloatArray, share: float) -> tuple[FloatArray, BoolArray]:
    """Return deviations with those of next to nothing raised, and which these are."""
    own = std > _ROUNDING * size
    usual = float(np.median(std[own])) if own.any() else np.nan
    low = np.isfinite(std) & ~(own & (std >= _NEGLIGIBLE * usual))
    return np.where(low, share * size if np.isnan(usual) else usual, std), low


def _sentence(file: str, what: str, shares: FloatArray, of: str) -> str:
    low, high = 100.0 * float(shares.min()), 100.0 * float(shares.max())
    taken = f"{low:.2g}" if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {high:.2g}"
    return (
        f"{file} states next to no deviation for {what}, as of what scales a shape: "
        f"taken as {taken} % of {of}."
    )


def _places(m: Measurement, lows: BoolArray) -> str:
    rows, named = np.flatnonzero(lows.any(axis=1)), []
    for s in rows:
        modes = ", ".join(str(m.numbers[k]) for k in np.flatnonzero(lows[s]))
        named.append(f"{m.sensors.labels[s]} (mode {modes})")
    return "the shape at " + _name_first(named, "sensors")


def _name_first(named: list[str], what: str) -> str:
    """Return the first of what is named, and how many more there are."""
    more = [f"{len(named) - _MOST_NAMED} more {what}"] if len(named) > _MOST_NAMED else []
    return ", ".join([*named[:_MOST_NAMED], *more])
