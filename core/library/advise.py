"""Measure, diagnose, take what is advised, again: ``bench advise``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from femubench.core.diagnosis.budget_advice import next_mode
from femubench.core.errors import InputError
from femubench.core.library.cases import CaseLike, one_case
from femubench.core.library.diagnose import diagnosis_of
from femubench.core.plugin.loader import Plugins
from femubench.core.score.responses import rms

_ERRORS = "error_percent", "left_percent", "std_percent"


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
        budget = found.drawing
        if budget is None:
            expected = "a frame, or matrices in groups, without `[reference]`"
            raise InputError("has no budget of its drawing", file=read.folder, expected=expected)
        mode = None if found.verdict == "named" or not left else next_mode(budget)
        others = [one for one in budget.modes if one.mode in read.held_out]
        off, rest, std = (rms([getattr(m, n) for m in others]) if others else None for n in _ERRORS)
        yield AdviceRound(
            tuple(read.used),
            found.verdict,
            tuple(f"{cause.effect} at {cause.place}" for cause in found.causes),
            sum(len(line.unseen) for line in budget.lines),
            *(off, rest, std),
            mode,
        )
        if mode is None:
            return
        held = tuple(number for number in read.held_out if number != mode)
        read = replace(read, used=tuple(sorted((*read.used, mode))), held_out=held)
        left -= 1
