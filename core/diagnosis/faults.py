"""Faults of data and input in a diagnosis: as causes, as words, and the case without them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from femubench.core.case.case import Case
from femubench.core.diagnosis.words import join_names, percent
from femubench.core.inference.charge import Charge, Repaired
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Cause, CauseParameter


def correct_case(case: Case, repaired: Iterable[Repaired]) -> Case:
    """Return a case with its faults corrected, or the datum discounted that is wrong.

    Design changes keep their own data: whether those have the fault too is not known.
    """
    for fault in repaired:
        charge = replace(fault.charge, model=case.model, measurement=case.measurement)
        model, measurement = charge.repaired
        case = replace(case, model=model, measurement=measurement)
    return case


def fault_causes(repaired: Iterable[Repaired]) -> list[Cause]:
    """Return faults as causes, on the side of the data or of the input."""
    return [
        Cause(
            fault.charge.fault.name,
            fault.charge.suspect.place,
            tuple(_parameters(fault.charge)),
            fault.probability,
            fault.charge.suspect.words,
            side=fault.charge.fault.side,
        )
        for fault in repaired
    ]


def _parameters(charge: Charge) -> list[CauseParameter]:
    known = [CauseParameter(name, value, 0.0, "") for name, value in charge.suspect.known.items()]
    p = charge.suspect.parameter
    if p is None:
        return known
    h = settings.slope_step
    low, value, high = (float(p.value(np.array(charge.x + step))) for step in (-h, 0.0, h))
    std = charge.std * abs(high - low) / (2.0 * h)
    return [*known, CauseParameter(p.name, value, std, p.unit, wording=p.wording)]


def with_faults(sentence: str, repaired: Sequence[Cause], loose: Sequence[Cause]) -> str:
    """Return the sentence of a verdict with the faults that were corrected or only stated."""
    if repaired:
        sentence = (
            f"{_describe(repaired)}. With that corrected: {sentence[0].lower()}{sentence[1:]}"
        )
    return f"{sentence} {_describe(loose)}." if loose else sentence


def _describe(faults: Iterable[Cause]) -> str:
    text = join_names(
        f"{cause.summary} (probability {percent(cause.probability)})" for cause in faults
    )
    return text[0].upper() + text[1:]
