"""Which answers on stretched twins are those on their cases again, though the data are others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from math import log

import numpy as np

from femubench.core.schema.results import UNSEEN, Block, JobResult, RunData
from femubench.core.score.ranking import Scale

# An answer corrects more than a tenth of the textbook model's error; it is carried where a quarter
# of the modes moves by less than a twentieth of what the truth does. Pairs of other modes move.
_ANSWER, _MOVED, _QUARTER = 0.1, 0.05, 0.25
_FEWEST_TWINS = 2  # the answer of one parameter may be the same on one by chance
Job = tuple[str, str, int]  # strategy, case and seed


def carried_answers(
    run: RunData, scale: Scale, ran: Iterable[JobResult], origins: Mapping[str, str]
) -> frozenset[Job]:
    """Return the jobs on cases of which the answer is the same on each of the stretched twins.

    An answer is what it does to the textbook model's unseen frequencies out of band. On a twin of
    other spans, sections or materials other data are given: an answer that does not move is known
    from the case. It may fit the twin too, of which the drawing lacks the same as that of the case.

    Arguments:
        ran: results on twins.
        origins: from twins to their cases.
    """
    kinds = run.meta["twins"].get("kinds") or {}
    first = {(r.strategy, r.case, r.seed): r for r in run.ranked if r.answered}
    found: dict[Job, list[bool]] = defaultdict(list)
    for result in ran:
        job = result.strategy, origins.get(result.case, ""), result.seed
        if job in first and result.answered and "stretched" in kinds.get(result.case, ()):
            found[job].append(_is_carried(scale, first[job], result))
    return frozenset(j for j, each in found.items() if len(each) >= _FEWEST_TWINS and all(each))


def _is_carried(scale: Scale, here: JobResult, there: JobResult) -> bool:
    listed = [
        _logs(scale, result.case, blocks)
        for result in (here, there)
        for blocks in (result.blocks, scale.blocks[result.case])
    ]
    modes = [mode for mode in listed[0] if all(mode in other for other in listed)]
    if not modes:
        return False
    own, textbook, twin, twin_textbook = (np.array([one[m] for m in modes]) for one in listed)
    # Answer and truth relative to the textbook model, (modes, 2).
    own, twin = own - textbook[:, :1], twin - twin_textbook[:, :1]
    (answer, truth), (_, needed) = np.median(np.abs([own, twin - own]), axis=1)
    moved = np.quantile(np.abs(twin - own)[:, 0], _QUARTER)
    return bool(answer > _ANSWER * truth and moved < _MOVED * needed)


def _logs(
    scale: Scale, case: str, blocks: Mapping[str, Block]
) -> dict[tuple[str | None, int], tuple[float, float]]:
    """Return ln of predicted and measured frequency by unseen mode out of band."""
    return {
        (mode.modification, mode.number): (log(mode.predicted_hz), log(mode.measured_hz))
        for name in UNSEEN
        if name in blocks
        for mode in blocks[name].modes
        if mode.predicted_hz is not None and mode.predicted_hz > 0.0
        if scale.modes[case].band_of(name, mode) != "band"
    }
