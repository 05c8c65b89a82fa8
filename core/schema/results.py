"""What comes out of a run: one result a job, in plain data that goes to JSON and back."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from operator import methodcaller
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict, get_args

from femubench.core.display import Shown, count_noun
from femubench.core.schema.bounds import (
    LONGEST_TEXT,
    Decibels,
    Degrees,
    Figure,
    GainFigure,
    Mac,
    Name,
    Note,
    Number,
    Percent,
    Rank,
    Seconds,
    Text,
    Whole,
)
from femubench.core.schema.paired_modes import PairedMode

Status = Literal["ok", "failed", "timeout", "crashed", "diverged", "not-applicable"]
# A result, though there may be no model; everything else is a failure and no result.
DONE: frozenset[Status] = frozenset({"ok", "not-applicable"})
BLOCKS = ("used", "higher", "modified")
UNSEEN = ("higher", "modified")  # what no strategy is given
# The model that a strategy starts from: as an engineer drew it, or with what handbooks give.
Nominal = Literal["drawn", "textbook"]
NOMINALS: tuple[Nominal, ...] = get_args(Nominal)
JobName = tuple[str, str, int, Nominal]  # case, strategy, seed and start


@dataclass(frozen=True, slots=True)
class Block:
    """The error of one set of modes: used, higher or modified.

    Arguments:
        rms_percent: root mean square of the relative frequency errors; a measured mode without
            partner counts 100 %.
        mean_mac: mean over the modes that have a measured shape; None where none has one.
        modes: the pairs.
    """

    rms_percent: Percent
    mean_mac: Mac | None = None
    modes: tuple[PairedMode, ...] = ()


@dataclass(frozen=True, slots=True)
class ResponseBlock:
    """The error of frequency responses at lines and sensors that no strategy was given.

    Arguments:
        rms_db: root mean square error of the log-magnitude, 20 log10 |H|.
        floor_db: what the noise of the measurement makes of it.
        count: of responses, lines times sensors times forces.
        phase_deg: root mean square error of the phase; None in records of before 0.2.0.
    """

    rms_db: Decibels
    floor_db: Decibels
    count: Whole
    phase_deg: Degrees | None = None


if TYPE_CHECKING:
    Blocks: TypeAlias = Mapping[str, Block]
else:
    Blocks = TypedDict("Blocks", dict.fromkeys(BLOCKS, Block), total=False)


@dataclass(frozen=True, slots=True)
class JobResult:
    """The outcome of one (case, strategy, seed), started from one nominal model.

    Arguments:
        case, strategy, seed: the job.
        status: how it ended; anything but ``ok`` has a reason.
        reason: one line, with the measured figure where a self-check failed.
        seconds: wall time of the strategy alone.
        blocks: errors by block name; empty unless the status is ``ok``.
        rigid_body_modes: modes of zero frequency that are rigid-body motions.
        rigid_body_modes_expected: those of the nominal model.
        negative_eigenvalues: of the updated model.
        parameter_count: unknowns that were free.
        evaluations: eigenvalue solutions that the strategy made.
        gain: over the textbook model of the case, -1 to 1; more is better.
        rank: within case, seed and nominal model; 1 is best.
        parameters, history, diagnostics: as the strategy gave them, in plain data.
        traceback: of an exception.
        key: of the job, from everything that decides on its result; empty where it is not known.
        provenance: versions, libraries, processor, commit and digests, in plain data.
        nominal: the model that the strategy started from; ``textbook`` too where the model as drawn
            has all that handbooks give.
        responses: error at held-out frequency responses; None where the case has none.
    """

    case: Name
    strategy: Name
    seed: Whole
    status: Status
    reason: Text = ""
    seconds: Seconds = 0.0
    blocks: Blocks = field(default_factory=dict)
    rigid_body_modes: Whole | None = None
    rigid_body_modes_expected: Whole | None = None
    negative_eigenvalues: Whole | None = None
    parameter_count: Whole | None = None
    evaluations: Whole | None = None
    gain: GainFigure | None = None
    rank: Rank | None = None
    parameters: tuple[Mapping[str, Figure], ...] = ()
    history: tuple[Mapping[str, Number], ...] = ()
    diagnostics: Mapping[str, Number] = field(default_factory=dict)
    traceback: Text = ""
    key: Name = ""
    provenance: Mapping[str, Note] = field(default_factory=dict)
    nominal: Nominal = "drawn"
    responses: ResponseBlock | None = None

    def __post_init__(self) -> None:
        """Keep texts to what can be read again, and take null of JSON for nan."""
        if len(self.reason) > LONGEST_TEXT:
            _set(self, "reason", self.reason[:LONGEST_TEXT])
        if len(self.traceback) > LONGEST_TEXT:
            _set(self, "traceback", self.traceback[-LONGEST_TEXT:])
        if self.parameters:
            _set(self, "parameters", tuple(map(_with_values, self.parameters)))
        if None in chain.from_iterable(map(methodcaller("values"), self.history)):
            _set(self, "history", tuple(map(_with_nan, self.history)))
        if None in self.diagnostics.values():
            _set(self, "diagnostics", _with_nan(self.diagnostics))

    @property
    def rigid_modes_lost(self) -> int:
        """Return how many rigid-body modes the model has less than the nominal one."""
        return max((self.rigid_body_modes_expected or 0) - (self.rigid_body_modes or 0), 0)

    @property
    def unphysical(self) -> bool:
        """Tell whether rigid-body modes were lost or eigenvalues are negative."""
        return self.status == "ok" and bool(self.rigid_modes_lost or self.negative_eigenvalues)

    @property
    def answered(self) -> bool:
        """Tell whether there is a possible model; else that which was given counts."""
        return self.status == "ok" and not self.unphysical


_set = object.__setattr__  # of what nobody else has yet


def _with_nan(figures: Mapping[str, Any]) -> Mapping[str, Number]:
    if None not in figures.values():
        return figures
    return {name: math.nan if value is None else value for name, value in figures.items()}


def _with_values(parameter: Mapping[str, Any]) -> Mapping[str, Any]:
    if parameter.get("before") is not None and parameter.get("after") is not None:
        return parameter
    return {**parameter, **_with_nan({n: parameter.get(n) for n in ("before", "after")})}


def rate(result: JobResult, gain: float | None, rank: int) -> None:
    """Give a result that nobody else has yet its gain and rank."""
    _set(result, "gain", gain)
    _set(result, "rank", rank)


def origins_of(meta: Mapping[str, Any], *kinds: str) -> dict[str, str]:
    """Return from the names of what ran with the cases of a run to the cases they belong to.

    Arguments:
        kinds: ``of`` for twins, ``again`` for jobs that were run a second time; both by default.
    """
    twins = meta.get("twins") or {}
    found = (twins.get(kind) or {} for kind in kinds or ("of", "again"))
    return {name: case for named in found for name, case in named.items()}


@dataclass(frozen=True, repr=False)
class RunData(Shown):
    """All results of one `bench run`.

    Arguments:
        meta: run id, seed, versions, machine, git commit, start time; plain data.
        results: one entry a job.
        companions: results on twins of the cases and of jobs that were run again, which are in no
            figure of the run; ``meta["twins"]`` tells what they belong to.
    """

    meta: Mapping[str, Any]
    results: tuple[JobResult, ...]
    companions: tuple[JobResult, ...] = ()

    @property
    def nominals(self) -> tuple[Nominal, ...]:
        """Return the models that strategies started from, the one that ranks first."""
        asked = {name for names in (self.meta.get("starts") or {}).values() for name in names}
        found = asked | {result.nominal for result in self.results}
        return tuple(name for name in reversed(NOMINALS) if name in found) or ("drawn",)

    @property
    def structures(self) -> Mapping[str, str]:
        """Return the structure of every case; a case that is not there is its own."""
        return dict(self.meta.get("structures") or {})

    @property
    def ranked(self) -> tuple[JobResult, ...]:
        """Return the results that make the ranks: those started from the textbook models."""
        return self.started_from(self.nominals[0])

    def started_from(self, nominal: Nominal) -> tuple[JobResult, ...]:
        """Return the results from one nominal model.

        Where the model as drawn has all that handbooks give, its results stand for both.
        """
        alike = frozenset(self.meta.get("alike") or ())
        return tuple(r for r in self.results if r.nominal == nominal or r.case in alike)

    def rows(self) -> Sequence[tuple[str, str]]:
        """Return what was run and how it ended."""
        count = Counter(result.status for result in self.results)
        size = ", ".join(
            count_noun(len({getattr(result, what) for result in self.results}), noun)
            for what, noun in (("case", "case"), ("strategy", "strategy"), ("seed", "seed"))
        )
        ended = ", ".join(f"{number} {status}" for status, number in count.items())
        title = f"{size}, {count_noun(len(self.results), 'result')} ({ended or 'none'})"
        return [(str(self.meta.get("run", "")), title)]
