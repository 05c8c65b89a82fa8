"""Frequency responses from forces and motions over time, and the spectra of free decays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.frf import DERIVATIVES, FrequencyResponses
from femubench.core.modal.signals import TimeSignals
from femubench.core.typing import AnyArray, FloatArray

Excitation: TypeAlias = Literal["hits", "random", "decay", "ambient"]
Estimator: TypeAlias = Literal["h1", "h2"]
_KINDS = "--excitation hits, random, decay or ambient"
_TRIGGER, _RARE = 0.1, 0.05  # of the largest force; share of samples above it, of hits
_ONE_HIT, _LEAD = 0.02, 0.005  # of the longest gap: pulses of one hit, what is kept before it
_REST = 0.05  # of the motion after a hit, that a structure may have before it
_SEGMENTS = 6  # of a record under a random force, that overlap by half
_END = 0.003  # of the motion at its beginning, that the window leaves at its end
_POWER = 1e-3  # of the largest of a force, that a line needs
_HIGHEST, _LOUD = 0.45, 10.0  # of the rate; of the power of the noise
_BLOCKS, _JUMP, _STARTS, _DECAYED = 400, 3.0, 0.2, 0.3  # of envelopes of free decays
_FEWEST = 128  # samples of a segment
_MOST_DECAYS = 6  # that are fitted apart, as combinations of all


@dataclass(frozen=True)
class _Event:
    """A hit with what follows it, a decay, a segment: its samples, and those of the force."""

    first: int
    last: int
    record: slice
    pulse: tuple[int, int] = (0, -1)


def guess_excitation(measured: TimeSignals) -> Excitation:
    """Return how a structure was moved: by hits, a random force, or no force that was measured."""
    if not len(measured.forces):
        return "decay" if _find_decays(measured) else "ambient"
    levels = [_force_level(measured, record) for record in measured.records]
    rare = all(np.mean(level > _TRIGGER * level.max()) < _RARE for level in levels)
    return "hits" if rare else "random"


def average_records(
    measured: TimeSignals, excitation: Excitation, estimator: Estimator = "h1"
) -> tuple[FrequencyResponses, str]:
    """Return frequency responses with their deviations, or spectra of decays, and how they came.

    Hits and decays run under one exponential window, laid over force and motion alike, so that it
    moves the poles by its decay and changes nothing else. A random force has Hann's.

    Arguments:
        measured: forces and motions; of decays, motions alone.
        estimator: h1 where the motions have the noise, h2 where the force has it.

    Raises:
        InputError: where no force, no hit or no decay is there.

    Source: Bendat & Piersol (2010), Random data, sections 7.2 and 9.2; Fladung & Rost (1997),
        Application and correction of the exponential window for frequency response functions.
    """
    if excitation != "decay" and not len(measured.forces):
        expected = f"force:3:z as the name of a column, --variables force=NAME, or {_KINDS}"
        raise InputError("no force among the channels", expected=expected)
    finders = {"hits": _find_hits, "random": _cut_segments, "decay": _find_decays}
    nouns = {"hits": "hit", "random": "segment", "decay": "free motion"}
    every = finders[excitation](measured)
    if not every:
        raise InputError(f"no {nouns[excitation]} in these records", expected=_KINDS)
    half = np.median([event.last - event.first for event in every]) / 2
    events = [event for event in every if event.last - event.first >= half]
    length = min(event.last - event.first for event in events)
    if length < _FEWEST:
        expected = f"{_FEWEST} samples or more; {_KINDS}"
        raise InputError(f"{count_noun(length, 'sample')} a {nouns[excitation]}", expected=expected)
    decay, moving = 0.0, 0
    window = np.hanning(length + 1)[:-1]
    if excitation != "random":
        decay, moving = _remainders(measured, events, length)
        window = np.exp(-decay * np.arange(length) / measured.rate)
    hz: FloatArray = np.asarray(np.fft.rfftfreq(length, 1.0 / measured.rate))
    lines = slice(1, int(np.searchsorted(hz, _HIGHEST * measured.rate)))
    spectra = [_spectra(measured, event, window, lines) for event in events]
    said = f"{count_noun(len(every), nouns[excitation])} of {length / measured.rate:.4g} s"
    if excitation == "decay":
        found = _of_decays(measured, np.stack([x for x, _ in spectra], axis=2), hz[lines])
    else:
        said += f" at {count_noun(len(measured.forces), 'point')}, {estimator.upper()}"
        found = _of_forces(measured, spectra, hz[lines], estimator)
    found = found.within(0.0, _highest_heard(spectra, hz[lines]))
    jw = 2j * np.pi * found.frequencies[:, None, None]
    turned = found.values * (jw / (jw + decay)) ** DERIVATIVES[found.quantity]
    for count, what in (
        (len(every) - len(events), " too short and left out"),
        (moving, " of a structure that was not at rest: wait longer"),
        (decay, " 1/s of decay by the exponential window, which the damping is without"),
    ):
        said += f"; {count:.3g}{what}" if count else ""
    return replace(found, values=turned, decay=decay), said


def _force_level(measured: TimeSignals, record: slice) -> FloatArray:
    force = measured.force_values[record]
    return np.asarray(np.linalg.norm(force - np.median(force, axis=0), axis=1))


def _find_hits(measured: TimeSignals) -> list[_Event]:
    """Return every hit with what follows until the next one, or until the record ends."""
    found = []
    for record in measured.records:
        level = _force_level(measured, record)
        above = np.flatnonzero(level > _TRIGGER * level.max(initial=0.0))
        if not len(above):
            continue
        gaps = np.diff(np.append(above, len(level)))
        pulses = np.split(above, np.flatnonzero(gaps[:-1] > _ONE_HIT * gaps.max()) + 1)
        width = max(int(np.ptp(pulse)) for pulse in pulses) + 2
        lead = min(int(above[0]), max(3 * width, int(_LEAD * gaps.max())))
        firsts = [record.start + int(pulse[0]) - lead for pulse in pulses]
        for first, last, pulse in zip(firsts, [*firsts[1:], record.stop], pulses, strict=True):
            force = max(lead - width, 0), lead + int(np.ptp(pulse)) + 2 * width
            found.append(_Event(first, last, record, force))
    return found


def _cut_segments(measured: TimeSignals) -> list[_Event]:
    """Return segments of one length, that overlap by half."""
    shortest = min(record.stop - record.start for record in measured.records)
    length = shortest if len(measured.records) >= _SEGMENTS else shortest // _SEGMENTS
    return [
        _Event(first, first + length, record)
        for record in measured.records
        for first in range(record.start, record.stop - length + 1, max(1, length // 2))
    ]


def _find_decays(measured: TimeSignals) -> list[_Event]:
    """Return the free decays: what follows a jump of the motion, and dies out."""
    found = []
    for record in measured.records:
        values = np.nan_to_num(measured.values[record])
        block = max(8, len(values) // _BLOCKS)
        values = values[: len(values) // block * block] - values.mean(axis=0)
        size = np.maximum(np.sqrt(np.square(values).mean(axis=0)), np.finfo(float).tiny)
        level = np.linalg.norm(values / size, axis=1).reshape(-1, block).max(axis=1, initial=0.0)
        before = np.concatenate([np.zeros(2), level])[: len(level)]
        high = (level > _STARTS * level.max(initial=0.0)) & (level > _JUMP * before)
        jumps = [int(k) for k in np.flatnonzero(high) if not high[max(k - 3, 0) : k].any()]
        ends: list[int] = [*jumps[1:], len(level)]
        for k, end in zip(jumps, ends, strict=False):
            # The force has gone by a block after that in which the motion is largest.
            first = k + int(level[k : k + 3].argmax()) + 2
            own, tenth = level[first : end - 1], max(1, (end - 1 - first) // 10)
            if len(own) > 10 and own[-tenth:].mean() < _DECAYED * own[:tenth].mean():
                begin, stop = (record.start + int(n) * block for n in (first, end - 1))
                found.append(_Event(begin, stop, record))
    return found


def _motions(measured: TimeSignals, event: _Event, length: int) -> FloatArray:
    """Return the motions of an event about their mean in the record, (length, n_sensors)."""
    piece = measured.values[event.first : event.first + length]
    return np.asarray(piece - measured.values[event.record].mean(axis=0))


def _remainders(measured: TimeSignals, events: list[_Event], length: int) -> tuple[float, int]:
    """Return the decay in 1/s with which all dies out, and how many hits met no rest."""
    tenth, size, moving = max(1, length // 10), np.zeros(2), 0
    for event in events:
        piece = np.nan_to_num(_motions(measured, event, length))
        early, late = np.square(piece[: 2 * tenth]).mean(), np.square(piece[-tenth:]).mean()
        size += early, late
        before = piece[: event.pulse[0]]
        moving += len(before) > 1 and bool(np.var(before) > _REST**2 * early)
    left = np.sqrt(size[1] / max(size[0], np.finfo(float).tiny))
    return float(np.log(max(left / _END, 1.0)) * measured.rate / length), moving


def _spectra(
    measured: TimeSignals, event: _Event, window: FloatArray, lines: slice
) -> tuple[AnyArray, AnyArray]:
    """Return the spectra of motions and forces of an event, (n_f, n_sensors), (n_f, n_forces)."""
    length = len(window)
    motions = np.fft.rfft(_motions(measured, event, length) * window[:, None], axis=0)
    if not len(measured.forces):
        return motions[lines], motions[lines, :0]
    force = measured.force_values[event.first : event.first + length]
    force = force - np.median(measured.force_values[event.record], axis=0)
    if event.pulse[1] > 0:
        force[: event.pulse[0]] = force[event.pulse[1] :] = 0.0
    return motions[lines], np.fft.rfft(force * window[:, None], axis=0)[lines]


def _highest_heard(spectra: list[tuple[AnyArray, AnyArray]], hz: FloatArray) -> float:
    """Return up to where the motions stand out of their noise, in Hz, and half as much more."""
    power = np.sum([np.square(np.abs(np.nan_to_num(motion))) for motion, _ in spectra], axis=0)
    level = (power / np.maximum(power.sum(axis=0), np.finfo(float).tiny)).sum(axis=1)
    level = np.convolve(level, np.ones(max(9, len(hz) // 200)), "same")
    return 1.5 * float(hz[level >= min(_LOUD * np.quantile(level, 0.05), level.max())][-1])


def _of_decays(measured: TimeSignals, values: AnyArray, hz: FloatArray) -> FrequencyResponses:
    """Return decays as responses to as many references as say something of their own."""
    if np.isfinite(values).all():  # not so where sensors moved from record to record
        count = min(values.shape[2], len(measured.sensors), _MOST_DECAYS)
        flat = values.reshape(-1, values.shape[2])
        values = values @ np.linalg.svd(flat, full_matrices=False)[2][:count].conj().T
    references = Sensors.unplaced((f"decay {k + 1}" for k in range(values.shape[2])), "x")
    return FrequencyResponses(measured.sensors, references, hz, values, "free decay")


def _of_forces(
    measured: TimeSignals, spectra: list[tuple[AnyArray, AnyArray]], hz: FloatArray, way: Estimator
) -> FrequencyResponses:
    """Return the averages of all events at which the same forces acted."""
    size = len(hz), len(measured.sensors), len(measured.forces)
    values, deviations = np.full(size, np.nan, dtype=complex), np.full(size, np.nan)
    power = np.array([np.square(np.abs(force)).sum(axis=0) for _, force in spectra])
    acting, strong = power > _POWER**2 * power.max(), np.zeros(len(hz), dtype=bool)
    for active in np.unique(acting[acting.any(axis=1)], axis=0):
        rows = np.flatnonzero((acting == active).all(axis=1))
        f = np.stack([spectra[k][1][:, active] for k in rows])  # (events, n_f, p)
        level = np.square(np.abs(f)).mean(axis=0).min(axis=1)
        strong |= level > _POWER * level.max()
        for o in range(size[1]):
            x = np.stack([spectra[k][0][:, o] for k in rows])
            seen = np.isfinite(x).all(axis=1)
            if seen.sum() >= active.sum():
                values[:, o, active], deviations[:, o, active] = _estimate(x[seen], f[seen], way)
    if not strong.any():
        raise InputError("no force acts", expected=_KINDS)
    band = slice(strong.argmax(), len(hz) - strong[::-1].argmax())
    known = deviations[band] if np.isfinite(deviations).any() else None
    sides = measured.sensors, measured.forces
    return FrequencyResponses(*sides, hz[band], values[band], measured.quantity, known)


def _estimate(x: AnyArray, f: AnyArray, way: Estimator) -> tuple[AnyArray, FloatArray]:
    """Return the response of one sensor to the forces, and deviations, (n_f, p) each.

    Arguments:
        x: spectra of the motion, (events, n_f).
        f: of the forces, (events, n_f, p).
        way: h1, or h2 where one force acts at a time.
    """
    events, _, p = f.shape
    crossed = np.einsum("ef,efp->fp", x, f.conj())
    inverse = np.linalg.pinv(np.einsum("efp,efq->fpq", f, f.conj()), rcond=1e-12, hermitian=True)
    found = np.einsum("fp,fpq->fq", crossed, inverse)
    total = np.square(np.abs(x)).sum(axis=0)[:, None]
    left = np.maximum(total - np.einsum("fp,fp->f", found, crossed.conj()).real[:, None], 0.0)
    if way == "h2":
        if p > 1:
            raise InputError("several forces at once", expected="--estimator h1")
        found = np.divide(total, crossed.conj(), out=found, where=crossed != 0.0)
    if events <= p:
        return found, np.full(found.shape, np.nan)
    own = np.einsum("fpp->fp", inverse).real / (2.0 * (events - p))
    return found, np.sqrt(np.maximum(left * own, 0.0))
