"""The rule of the boards: what a model gains over the textbook one out of the given band.

The rule was fixed in version 1, before any structure was made to decide on it. Its numbers and its
version stand in every run, and the version names the numbers that are not its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from femubench.core.modal.correlation import mac
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import LEAST_SENSORS, Pairing
from femubench.core.schema.bounds import LEAST_KEPT_MAC, read_rule_number
from femubench.core.schema.paired_modes import ModeBefore, PairedMode, PartnerCandidate
from femubench.core.schema.results import Block
from femubench.core.typing import FloatArray

WIDEST_KEPT = math.log(2.0)  # of candidates that a run keeps, as their least MAC


@dataclass(frozen=True)
class Rule:
    """The numbers of the rule.

    Arguments:
        window: largest |ln(f_j / f_i)| of a candidate: a mode that is off by more than a factor of
            two does not describe the measured one, as in the pairing.
        mac: least MAC of a candidate: below one half, shapes share less than they differ in.
        above: candidates reach up to so many times the highest measured frequency of their state;
            above, nobody measured, and a model must not pay for what a test could not find.
        cap: largest error of a mode, ln 1.4: a lost mode costs no more than one that is off by the
            widest window of a pairing by frequency alone, so that no prediction is worse than none.
        same_mac: least MAC of a tested and a modified mode that are one: 393 of the first suite's
            500 modified modes have such a tested one, and at less two modes have mixed.
        change_cap: largest error of a change by a modification: beyond it the change was missed,
            and how far says nothing more.
        floor: of both errors of a gain: 0.2 % is what a good test repeats, and differences below
            are no gain.
        change_share: of a gain, the change under a modification: it needs the right cause, the
            frequencies out of band the right size, and neither replaces the other.
        visible: least weight, of a partner's, of a candidate that counts as a false mode: a tenth
            of a peak's height is seen next to it.
    """

    window: float = math.log(2.0)
    mac: float = 0.5
    above: float = 1.1
    cap: float = math.log(1.4)
    same_mac: float = 0.8
    change_cap: float = 0.1
    floor: float = 0.002
    change_share: float = 0.5
    visible: float = 0.1
    version: ClassVar[str] = "1"

    def to_json(self) -> dict[str, Any]:
        """Return the numbers with the version, which names the numbers that are not its own."""
        usual = Rule()
        changed = [f.name for f in fields(self) if getattr(self, f.name) != getattr(usual, f.name)]
        return {"version": " ".join([self.version, *changed]), **asdict(self)}

    @classmethod
    def of(cls, meta: Mapping[str, Any]) -> Rule:
        """Return the rule of a run; of one that states none, that of this version.

        Raises:
            InputError: for a number that is out of its bounds.
        """
        stated = {k: v for k, v in (meta.get("rule") or {}).items() if k != "version"}
        return cls(**{name: read_rule_number(name, value) for name, value in stated.items()})

    def changed(self, words: Iterable[str]) -> Rule:
        """Return the rule with other numbers.

        Arguments:
            words: ``KEY=VALUE`` each.

        Raises:
            InputError: for another key, or a number that is out of its bounds.
        """
        stated = {key: value for key, _, value in (word.partition("=") for word in words)}
        return replace(self, **{key: read_rule_number(key, value) for key, value in stated.items()})


@dataclass(frozen=True)
class ModelErrors:
    """The errors of a model on a case; nan where the case has no such modes.

    Arguments:
        error: mean |ln(f_p / f_m)| out of band: of the held-out modes, and of the modified ones
            above the highest given frequency, each block with the same weight; of a case that holds
            nothing back, of the given modes.
        change: mean error of the change of a mode's ln f by a modification.
        band: as `error`, of the modified modes in the given band.
        shape: mean 1 - MAC of the unseen modes with a measured shape.
        false_modes: modes that the sensors would see and no test found.
    """

    error: float
    change: float
    band: float
    shape: float
    false_modes: int


@dataclass(frozen=True)
class CaseGain:
    """What a model gains over the textbook model of its case, each in [-1, 1].

    Arguments:
        gain: the mean of the two others, by the share of the rule.
        error: of the frequencies out of band; nan where there are none.
        change: of the changes by modifications; nan where there are none.
    """

    gain: float
    error: float
    change: float


def find_candidates(
    measurement: Measurement, frequencies: FloatArray, readings: FloatArray, pairing: Pairing
) -> list[tuple[PartnerCandidate, ...]]:
    """Return by measured mode the predicted ones that may stand for it, but are nobody's partner.

    The weight w = (phi_i' r_j)^2 / (phi_i' phi_i) is the height of the peak of mode j in a response
    that is filtered for the measured shape phi_i; it is given in parts of the partner's.

    Arguments:
        measurement: m modes.
        frequencies: of the model, in Hz, (p,).
        readings: of its mass-normalised shapes at the sensors, (n_sensors, p).
        pairing: of the two.
    """
    taken = np.isin(np.arange(len(frequencies)), pairing.index)
    shapes = np.where(np.isfinite(measurement.shapes), measurement.shapes, 0.0)
    heights = np.square(np.abs(shapes.conj().T @ readings))
    likeness = mac(measurement.shapes, readings)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(np.log(frequencies[None, :] / measurement.frequencies[:, None]))
    kept = (likeness >= LEAST_KEPT_MAC) & (apart <= WIDEST_KEPT) & ~taken
    found = []
    for i, partner in enumerate(pairing.index):
        shaped = partner >= 0 and np.isfinite(pairing.mac[i])
        columns = np.flatnonzero(kept[i]) if shaped else ()
        weights = {j: float(heights[i, j] / heights[i, partner]) for j in columns}
        found.append(
            tuple(
                PartnerCandidate(float(frequencies[j]), weight, float(likeness[i, j]))
                for j, weight in weights.items()
                if np.isfinite(weight)
            )
        )
    return found


def find_tested_modes(tested: Measurement, modified: Measurement) -> list[ModeBefore | None]:
    """Return by modified mode the tested one of its shape, where each is the other's nearest.

    Arguments:
        tested, modified: the modes of the structure before and after a modification.
    """
    if tested.sensors.labels != modified.sensors.labels or not len(tested):
        return [None] * len(modified)
    there = [np.isfinite(item.shapes).sum(axis=0) >= LEAST_SENSORS for item in (modified, tested)]
    likeness = np.where(
        there[0][:, None] & there[1][None, :], mac(modified.shapes, tested.shapes), 0.0
    )
    nearest = likeness.argmax(axis=1)
    rows = range(len(modified))
    return [
        ModeBefore(tested.numbers[j], float(likeness[i, j]))
        if likeness[i, j] >= LEAST_KEPT_MAC and likeness[:, j].argmax() == i
        else None
        for i, j in zip(rows, nearest.tolist(), strict=True)
    ]


@dataclass(frozen=True)
class MeasuredModes:
    """The measured modes of a case, as the errors of models on it rest on them.

    Arguments:
        rule: of the boards.
        top: highest given frequency, Hz.
        limits: up to which frequency a mode may be a candidate, Hz, by modification.
        tested: from a modified mode, its modification and number, to the number of the tested one
            of its shape.
    """

    rule: Rule
    top: float
    limits: Mapping[str | None, float]
    tested: Mapping[tuple[str | None, int], int]

    @classmethod
    def of(cls, textbook: Mapping[str, Block], rule: Rule) -> MeasuredModes:
        """Return the modes of a case from what its textbook model predicts of them."""
        limits: dict[str | None, float] = {}
        for mode in (mode for block in textbook.values() for mode in block.modes):
            known = limits.get(mode.modification, 0.0)
            limits[mode.modification] = max(known, rule.above * mode.measured_hz)
        tested = {
            (mode.modification, mode.number): mode.before.number
            for mode in _modes(textbook, "modified")
            if mode.before is not None and mode.before.mac >= rule.same_mac
        }
        top = max((mode.measured_hz for mode in _modes(textbook, "used")), default=0.0)
        return cls(rule, top, limits, tested)

    def errors(self, blocks: Mapping[str, Block]) -> ModelErrors:
        """Return the errors of a model on the case.

        Arguments:
            blocks: what it predicts.
        """
        rule = self.rule
        parts: dict[str, list[float]] = {"used": [], "higher": [], "above": [], "band": []}
        false: set[tuple[str | None, float]] = set()
        shapes = []
        for name in ("used", "higher", "modified"):
            for mode in _modes(blocks, name):
                others = self.candidates_of(mode)
                parts[self.band_of(name, mode)].append(_mean_error(mode, others, rule.cap))
                false |= {(mode.modification, c.hz) for c in others if c.weight >= rule.visible}
                if name != "used" and mode.mac is not None:
                    shapes.append(1.0 - mode.mac)
        unseen = [parts[name] for name in ("higher", "above") if parts[name]]
        change = _mean(self._change_errors(blocks))
        if not unseen and math.isnan(change):
            unseen = [parts["used"]]
        error = _mean([_mean(part) for part in unseen])
        return ModelErrors(error, change, _mean(parts["band"]), _mean(shapes), len(false))

    def band_of(self, block: str, mode: PairedMode) -> str:
        """Return where a mode counts: modified ones in the given ``band`` or ``above`` it."""
        return block if block != "modified" else "band" if mode.measured_hz <= self.top else "above"

    def candidates_of(self, mode: PairedMode) -> list[PartnerCandidate]:
        """Return what else of the model than its partner may stand for a measured mode."""
        if not mode.candidates:
            return []
        rule = self.rule
        highest = self.limits.get(mode.modification, rule.above * mode.measured_hz)
        return [
            other
            for other in mode.candidates
            if mode.predicted_hz is not None
            and other.mac >= rule.mac
            and other.hz <= highest
            and abs(math.log(other.hz / mode.measured_hz)) <= rule.window
        ]

    def _change_errors(self, blocks: Mapping[str, Block]) -> list[float]:
        """Return the error of every change of a mode that was found before and after."""
        known = {m.number: m for name in ("used", "higher") for m in _modes(blocks, name)}
        own = {(m.modification, m.number): m for m in _modes(blocks, "modified")}
        cap, found = self.rule.change_cap, []
        for mode, number in self.tested.items():
            if number not in known:
                continue
            before, after, error = known[number], own.get(mode), cap
            hz = before.predicted_hz or 0.0, (after and after.predicted_hz) or 0.0
            if after is not None and min(hz) > 0.0:
                measured = math.log(after.measured_hz / before.measured_hz)
                error = min(abs(math.log(hz[1] / hz[0]) - measured), cap)
            found.append(error)
        return found


def find_gain(own: ModelErrors, textbook: ModelErrors, rule: Rule) -> CaseGain:
    """Return what a model gains: the part of the textbook model's error that it removes.

    (R - E) / max(R, E, floor), which is minus the part of its own error that it adds where that is
    the larger one; out of band and of the changes, where the case has both the mean of the two.

    Arguments:
        own, textbook: their errors on one case.
    """
    parts = [
        (r - e) / max(r, e, rule.floor)
        for e, r in ((own.error, textbook.error), (own.change, textbook.change))
    ]
    shares = (1.0 - rule.change_share, rule.change_share)
    known = [(part, share) for part, share in zip(parts, shares, strict=True) if part == part]
    total = sum(share for _, share in known)
    gain = sum(part * share for part, share in known) / total if total else math.nan
    return CaseGain(gain, *parts)


def _mean_error(mode: PairedMode, others: Sequence[PartnerCandidate], cap: float) -> float:
    """Return the weighted mean error of a mode; the cap without a partner of a real frequency."""
    if mode.predicted_hz is None or mode.predicted_hz <= 0.0:
        return cap
    # numpy takes ten times as long for the few that there are, and a board has 1e5 modes.
    total, weights = min(abs(math.log(mode.predicted_hz / mode.measured_hz)), cap), 1.0
    for one in others:
        total += one.weight * min(abs(math.log(one.hz / mode.measured_hz)), cap)
        weights += one.weight
    return total / weights


def _modes(blocks: Mapping[str, Block], name: str) -> tuple[PairedMode, ...]:
    return blocks[name].modes if name in blocks else ()


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan
