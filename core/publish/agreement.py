"""Results of one job from several runs: one finding where they agree, a conflict where not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from femubench.core.publish.submissions import Submission
from femubench.core.schema.results import JobResult
from femubench.core.score.ranking import Scale

# What results are measured by, of a case by its name and digest.
Scales = Mapping[tuple[str, str], Scale]
# Two machines round differently, and an ill-conditioned update magnifies it.
_AGREES = 1e-3
_OFFSET_PERCENT = 0.05  # added to both errors: one that is met is rounding
# These say what a machine could bear, not what the job gives.
NO_RESULT = frozenset({"timeout", "crashed"})


@dataclass(frozen=True)
class Outcome:
    """What the runs say on one job.

    Arguments:
        others: what the other runs say, each a finding without others.
    """

    result: JobResult
    runs: tuple[Submission, ...]
    others: tuple[Outcome, ...] = ()

    @property
    def machines(self) -> int:
        """Return the number of different machines that agree."""
        return len({machine_of(run) for run in self.runs})


def findings_of(submissions: Iterable[Submission], scales: Scales) -> list[Outcome]:
    """Return one finding for every job, in the order of case, strategy, seed and key.

    Of contradicting results that counts on which most machines agree, of equals the worst.

    Arguments:
        submissions: oldest first.
        scales: that the worst is found with. Those of a run could make its own result look
            worse than it is, and so let it count.
    """
    groups: dict[tuple[str, str, int, str], list[Outcome]] = {}
    for item in submissions:
        for result in item.run.ranked:
            # The names go with the key: a forged key must not put two jobs together.
            stated = (result.provenance[name] for name in ("case", "strategy", "femubench"))
            key = "\0".join((result.key, *map(str, stated)))
            job = result.case, result.strategy, result.seed, key
            listed = groups.setdefault(job, [])
            for number, known in enumerate(listed):
                if agree(known.result, result):
                    listed[number] = replace(known, runs=(*known.runs, item))
                    break
            else:
                listed.append(Outcome(result, (item,)))
    return [_settle_outcomes(groups[job], scales) for job in sorted(groups)]


def agree(first: JobResult, second: JobResult) -> bool:
    """Tell whether two results are the same but for rounding."""
    if first.status != second.status or first.blocks.keys() != second.blocks.keys():
        return False
    errors = (
        (first.blocks[name].rms_percent, second.blocks[name].rms_percent) for name in first.blocks
    )
    near = all(abs(a - b) <= _AGREES * (min(a, b) + _OFFSET_PERCENT) for a, b in errors)
    return near and first.unphysical == second.unphysical


def machine_of(item: Submission) -> tuple[str, str, str]:
    """Return what tells a machine from another."""
    machine = item.run.meta["machine"]
    return str(machine["cpu"]), str(machine["blas"]), str(machine["platform"])


def _settle_outcomes(found: Sequence[Outcome], scales: Scales) -> Outcome:
    sound = [item for item in found if item.result.status not in NO_RESULT] or list(found)
    if all(item.result.status in NO_RESULT for item in found):
        sound = [replace(found[0], runs=tuple(run for item in found for run in item.runs))]

    def order(item: Outcome) -> tuple[int, float, str]:
        result = item.result
        scale = scales[result.case, str(result.provenance["case"])]
        gain = scale.gain(result.case, scale.errors(result)).gain
        return -item.machines, gain, item.runs[0].name

    first, *rest = sorted(sound, key=order)
    return replace(first, others=tuple(rest))
