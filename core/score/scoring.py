"""What a model predicts of the measured modes: blocks of errors, rigid-body modes, signs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import scipy.linalg as la
from msgspec import structs

from femubench.core.case.case import Case, Modification
from femubench.core.fem.model import Model
from femubench.core.modal.close_modes import align_close_modes
from femubench.core.modal.correlation import find_seen_modes
from femubench.core.modal.eigen import (
    DENSE_LIMIT,
    Modes,
    enough_modes,
    modes_of,
    modes_up_to,
    once_for,
    zero_tolerance,
)
from femubench.core.modal.many_changes import ManyChanges
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import LEAST_SENSORS, WINDOW, pair_measured
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, ResponseBlock
from femubench.core.score.bounded_gain import find_candidates, find_tested_modes
from femubench.core.score.predicted_spread import MORE, Spread
from femubench.core.score.responses import score_responses
from femubench.core.typing import FloatArray

_SAME_MOTION = 0.9  # squared cosine between a zero mode and the nominal rigid-body motions


@dataclass(frozen=True)
class Reference:
    """What the nominal model of a case gives, so that no score depends on who else runs.

    Arguments:
        blocks: the errors of the nominal model by block name.
        zero: eigenvalue up to which a mode counts as one of zero frequency, rad^2/s^2.
        rigid: the rigid-body motions that the nominal model leaves free, (n, r).
    """

    blocks: Mapping[str, Block]
    zero: float
    rigid: FloatArray

    @property
    def rms_percent(self) -> dict[str, float]:
        """Return the rms error by block name, the denominators of every score."""
        return {name: block.rms_percent for name, block in self.blocks.items()}


@dataclass(frozen=True)
class JudgedModel:
    """A model judged against a case.

    Arguments:
        blocks: errors by block name.
        rigid_body_modes: zero-frequency modes that are rigid-body motions of the nominal model.
        negative_eigenvalues: of the model as tested, without modifications.
        responses: error at held-out frequency responses; None where the case has none.
    """

    blocks: dict[str, Block]
    rigid_body_modes: int
    negative_eigenvalues: int
    responses: ResponseBlock | None = None


def frequency_error(mode: PairedMode) -> float:
    """Return |f_p / f_m - 1|; 1 for a mode without partner or with an imaginary one."""
    if mode.predicted_hz is None or mode.predicted_hz <= 0.0:
        return 1.0
    return abs(mode.predicted_hz / mode.measured_hz - 1.0)


def predict_block(
    model: Model, measurement: Measurement, modification: str | None
) -> tuple[PairedMode, ...]:
    """Return what a model predicts of every measured mode, paired by shape and frequency.

    Arguments:
        model: with its modification already attached.
        measurement: the modes to pair, in one assignment.
        modification: name of the design change; None for the structure as tested.

    Raises:
        ModelError: when the model has no modes or a sensor lies off the structure.

    Examples:
        >>> [round(mode.predicted_hz) for mode in results.predict_block(model, measurement, None)]
        [256, 278, 581]
    """
    return _predict(model, _modes_for(model, (measurement,)), measurement, modification)


def pair_modified(
    model: Model,
    change: Modification,
    spread: Spread | None = None,
    many: ManyChanges | None = None,
) -> tuple[PairedMode, ...]:
    """Return what a model predicts of a modified structure, computed once for this very model.

    Arguments:
        spread: of the model before the change; None where there is none.
        many: of this model, where it is at hand; else the modified one is solved by itself.

    Raises:
        ModelError: when the modified model has no modes or a sensor lies off the structure.
        NotApplicable: where a member is to be taken of matrices.
    """

    def make() -> tuple[Modification, Spread | None, tuple[PairedMode, ...]]:
        changed, modes = change.modify(model), None
        if many is not None and not change.alteration:
            count, top = len(change.measurement) + MORE, _highest((change.measurement,))
            modes = many.proven(change.masses, change.springs, count, top)
        if modes is None:
            modes = _modes_for(changed, (change.measurement,))
        # With change and spread, so that nothing else gets their numbers as long as this is kept.
        moved = spread and spread.after(change, changed)
        return change, spread, _predict(changed, modes, change.measurement, change.name, moved)

    return once_for(model, ("modified", id(change), id(spread)), make)[2]


def many_modifications(
    model: Model, changes: Sequence[Modification], modes: Modes | None = None
) -> ManyChanges | None:
    """Return what gives the modes of a model after its modifications; None where it is small.

    Arguments:
        changes: to come, each on the model as it is.
        modes: of the model, where they are at hand; without them two changes have to pay for them.

    Raises:
        ModelError: when the model has no modes.
    """
    if model.size <= DENSE_LIMIT or len(changes) < (2 if modes is None else 1):
        return None
    if modes is None:
        modes = _modes_for(model, [change.measurement for change in changes])
    return ManyChanges(model, modes)


def score_model(case: Case, model: Model) -> dict[str, Block]:
    """Return the errors of a model by block: used, higher, modified, where the case has data.

    Used and higher modes are paired in one assignment, so that none is predicted twice.

    Raises:
        ModelError: when the model has no modes.
    """
    return _blocks(case, model, _modes_for(model, (case.measurement,)))


def reference_of(case: Case) -> Reference:
    """Return what the nominal model gives, with which every other model is compared.

    Raises:
        ModelError: when the nominal model has no modes.
    """
    modes = _modes_for(case.model, (case.measurement,))
    blocks = _blocks(case, case.model, modes)
    if "modified" in blocks:
        tested = [
            mode
            for change in case.modifications
            for mode in find_tested_modes(case.measurement, change.measurement)
        ]
        pairs = zip(blocks["modified"].modes, tested, strict=True)
        linked = tuple(structs.replace(pair, before=mode) for pair, mode in pairs)
        blocks["modified"] = replace(blocks["modified"], modes=linked)
    return Reference(blocks, zero_tolerance(modes), rigid_modes_of(case.model))


def judge(
    case: Case, model: Model, reference: Reference, spread: Spread | None = None
) -> JudgedModel:
    """Return errors, rigid-body modes kept and negative eigenvalues of a model.

    A rigid-body mode is kept where |lambda| <= 1e-6 times the first elastic eigenvalue of the
    nominal model, an eigenvalue is negative below minus that.

    Arguments:
        spread: how far the strategy says that its model may be off; None where it says nothing.

    Raises:
        ModelError: when the model has no modes.
    """
    modes = _modes_for(model, (case.measurement,))
    negative = int(np.count_nonzero(modes.eigenvalues < -reference.zero))
    blocks = _blocks(case, model, modes, spread)
    # Of the rigid-body motions that are kept the spaces are compared, not the modes: among several
    # zero modes the eigenvectors are arbitrary.
    still = modes.shapes[:, np.abs(modes.eigenvalues) <= reference.zero]
    same = model.size == case.model.size
    rigid = reference.rigid if same else rigid_modes_of(model)
    mass = case.model.mass if same else model.mass
    if still.shape[1] == 0 or rigid.shape[1] == 0:
        kept = 0
    else:
        values, turn = la.eigh(still.T @ (mass @ still))
        keep = values > 1e-12 * values[-1]
        basis = still @ (turn[:, keep] / np.sqrt(values[keep]))
        cosines = la.svdvals(rigid.T @ (mass @ basis))
        kept = int(np.count_nonzero(np.square(cosines) > _SAME_MOTION))
    return JudgedModel(blocks, kept, negative, score_responses(case, model))


def _modes_for(model: Model, measurements: Sequence[Measurement]) -> Modes:
    """Return all modes of a small model, of a large one those that could find a partner."""
    if model.size <= DENSE_LIMIT:
        return modes_of(model)
    top, most = _highest(measurements), max(len(item) for item in measurements)
    return modes_up_to(model, top, enough_modes(model, most) or model.size)


def _highest(measurements: Sequence[Measurement]) -> float:
    """Return the frequency in Hz up to which a mode could be the partner of a measured one."""
    return WINDOW * max(float(item.frequencies.max(initial=0.0)) for item in measurements)


def _predict(
    model: Model,
    modes: Modes,
    measurement: Measurement,
    modification: str | None,
    spread: Spread | None = None,
) -> tuple[PairedMode, ...]:
    elastic = modes.elastic
    readings = np.asarray(model.observe(measurement.sensors) @ elastic.shapes)
    readings = np.where(find_seen_modes(readings), readings, 0.0)
    frequencies = elastic.natural_frequencies
    # Modes within two standard deviations of each other are one to the test.
    closeness = 2.0 * float(np.median(measurement.frequency_std / measurement.frequencies))
    readings = align_close_modes(frequencies, readings, measurement.shapes, closeness)
    pairing = pair_measured(measurement, elastic, readings)
    std: list[float | None] = [None] * len(measurement)
    if spread is not None:
        whole = np.append(np.flatnonzero(~modes.rigid), -1)[pairing.index]
        std = spread.std_of(modes, whole, measurement.frequency_std)
    return tuple(
        PairedMode(
            number=number,
            measured_hz=float(measured),
            predicted_hz=float(frequencies[partner]) if partner >= 0 else None,
            mac=None if np.isnan(likeness) else float(likeness),
            modification=modification,
            predicted_std_hz=deviation,
            candidates=others,
        )
        for number, measured, partner, likeness, deviation, others in zip(
            measurement.numbers,
            measurement.frequencies,
            pairing.index,
            pairing.mac,
            std,
            find_candidates(measurement, frequencies, readings, pairing),
            strict=True,
        )
    )


def _blocks(
    case: Case, model: Model, modes: Modes, spread: Spread | None = None
) -> dict[str, Block]:
    tested = case.measurement.select(chain(case.used, case.held_out))
    own = _predict(model, modes, tested, None, spread)
    shaped = _with_shape(tested)
    first, changes = len(case.used), case.modifications
    many = many_modifications(model, changes, modes)
    modified = [pair_modified(model, change, spread, many) for change in changes]
    parts = {
        "used": (own[:first], shaped[:first]),
        "higher": (own[first:], shaped[first:]),
        "modified": (  # every mode of every change counts alike
            tuple(pair for pairs in modified for pair in pairs),
            [flag for change in changes for flag in _with_shape(change.measurement)],
        ),
    }
    return {name: _block(*part) for name, part in parts.items() if part[0]}


def _with_shape(measurement: Measurement) -> list[bool]:
    return list((np.isfinite(measurement.shapes).sum(axis=0) >= LEAST_SENSORS).tolist())


def _block(pairs: tuple[PairedMode, ...], shaped: Sequence[bool]) -> Block:
    errors = np.array([frequency_error(pair) for pair in pairs])
    likeness = [pair.mac or 0.0 for pair, has in zip(pairs, shaped, strict=True) if has]
    mean_mac = float(np.mean(likeness)) if likeness else None
    return Block(100.0 * float(np.sqrt(np.mean(np.square(errors)))), mean_mac, pairs)
