"""Measure, diagnose, take what is advised, again: ``bench advise``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.diagnosis.budget import budget_of, loosest_mode
from femubench.core.errors import InputError
from femubench.core.library.cases import CaseLike, one_case
from femubench.core.library.diagnose import diagnosis_of
from femubench.core.plugin.loader import Plugins


@dataclass(frozen=True)
class AdviceRound:
    """What is known after so many of the advised modes were measured.

    Arguments:
        used: modes.
        verdict, causes: of a diagnosis by these.
        unseen: numbers of the budget that these modes do not see.
        drawing_percent, left_percent: rms errors of the other modes, drawing and extended model;
            None where no mode is left.
        std_percent: deviation that the extended model predicts for them, rms.
        next_mode: that is advised; None at the end.
    """

    used: tuple[int, ...]
    verdict: str
    causes: tuple[str, ...]
    unseen: int
    drawing_percent: float | None
    left_percent: float | None
    std_percent: float | None
    next_mode: int | None


def play_advice(
    case: CaseLike, plugins: Plugins, rounds: int | None = None
) -> Iterator[AdviceRound]:
    """Yield rounds until a name stands alone, or no held-out mode would say more.

    Arguments:
        case: whose held-out modes are the laboratory.
        rounds: that are measured at most; None for as many as it takes.

    Raises:
        InputError: when the case holds no modes back, or there is no budget of it.
    """
    read = one_case(case, plugins)
    if not read.held_out:
        expected = "`held_out` modes, which are measured one by one"
        raise InputError("holds nothing back", file=read.folder, expected=expected)
    left = len(read.held_out) if rounds is None else rounds
    while True:
        found = diagnosis_of(read, None, plugins)
        budget = budget_of(read, plugins.effects.values()) if read.reference is None else None
        if budget is None:
            expected = "a frame, or matrices in groups, without `[reference]`"
            raise InputError("has no budget of its drawing", file=read.folder, expected=expected)
        mode = None if found.verdict == "named" or not left else loosest_mode(budget)
        others = [one for one in budget.modes if one.mode in read.held_out]
        yield AdviceRound(
            tuple(read.used),
            found.verdict,
            tuple(f"{cause.effect} at {cause.place}" for cause in found.causes),
            sum(len(line.unseen) for line in budget.lines),
            _rms(one.error_percent for one in others),
            _rms(one.left_percent for one in others),
            _rms(one.std_percent for one in others),
            mode,
        )
        if mode is None:
            return
        held = tuple(number for number in read.held_out if number != mode)
        read = replace(read, used=tuple(sorted((*read.used, mode))), held_out=held)
        left -= 1


def _rms(values: Iterable[float]) -> float | None:
    squares = np.square(list(values))
    return float(np.sqrt(squares.mean())) if len(squares) else None
