"""What comes out of a run: one result a job, in plain data that goes to JSON and back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

from annotated_types import Ge, Gt, Le, Lt, MaxLen

from femubench.core.display import Shown, counted
from femubench.core.schema.details import DETAILS, decoded

Status = Literal["ok", "failed", "timeout", "crashed", "diverged", "not-applicable"]
STATUSES: tuple[Status, ...] = get_args(Status)
# A result, though there may be no model; everything else is a failure and no result.
DONE: frozenset[Status] = frozenset({"ok", "not-applicable"})
BLOCKS = ("used", "higher", "modified")
UNSEEN = ("higher", "modified")  # what no strategy is given
# The model that a strategy starts from: as an engineer drew it, or with what handbooks give.
Nominal = Literal["drawn", "textbook"]
NOMINALS: tuple[Nominal, ...] = get_args(Nominal)

# The bounds of what is read; within them all figures of a run can be computed.
LONGEST_TEXT = 100_000  # characters of a reason or a traceback
Name = Annotated[str, MaxLen(1_000)]
Text = Annotated[str, MaxLen(LONGEST_TEXT)]
Whole = Annotated[int, Ge(0), Lt(2**63)]
Hertz = Annotated[float, Ge(1e-45), Le(1e30)]
# Bounded so that the square of a relative error is a number.
PredictedHertz = Annotated[float, Ge(-1e100), Le(1e100)]
StdHertz = Annotated[float, Ge(0), Le(1e100)]
Percent = Annotated[float, Ge(0), Le(1e150)]
Mac = Annotated[float, Ge(-1e-6), Le(1 + 1e-6)]
Seconds = Annotated[float, Ge(0)]
Score = Annotated[float, Gt(0), Le(1e150)]
Rank = Annotated[int, Ge(1), Lt(2**63)]
_READING = {"extra": "ignore", "allow_inf_nan": False}
_UNREAD = "_unread"


@dataclass(frozen=True, slots=True)
class PairedMode:
    """One measured mode and the model's mode that was paired with it by shape.

    Arguments:
        number: label of the measured mode.
        measured_hz: its frequency.
        predicted_hz: the model's; None where no mode of the model matches. A negative number
            stands for an imaginary frequency.
        mac: of the two shapes, 0..1; None where nothing was paired or no shape was measured.
        modification: name of the design change; None for the structure as tested.
        predicted_std_hz: standard deviation of what a test would find about `predicted_hz`, its
            own error of measurement included; None where the strategy does not say.
    """

    __pydantic_config__: ClassVar = _READING

    number: Whole
    measured_hz: Hertz
    predicted_hz: PredictedHertz | None
    mac: Mac | None
    modification: Text | None = None
    predicted_std_hz: StdHertz | None = None


@dataclass(frozen=True, slots=True)
class Block:
    """The error of one set of modes: used, higher or modified.

    Arguments:
        rms_percent: root mean square of the relative frequency errors; a measured mode without
            partner counts 100 %.
        mean_mac: mean over the modes that have a measured shape; None where none has one.
        modes: the pairs.
    """

    __pydantic_config__: ClassVar = _READING

    rms_percent: Percent
    mean_mac: Mac | None
    modes: tuple[PairedMode, ...]


@dataclass(frozen=True)
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
        score: how much of the textbook model's error on unseen data is left: geometric mean over
            the unseen blocks of (rms + 0.05 %) / (its rms + 0.05 %). Less is better.
        rank: within case, seed and nominal model; 1 is best.
        parameters, history, diagnostics: as the strategy gave them, in plain data.
        traceback: of an exception, for whoever asks for it.
        key: of the job, from everything that decides on its result; empty where it is not known.
        provenance: versions, libraries, processor, commit and digests, in plain data.
        nominal: the model that the strategy started from; ``textbook`` too where the model as drawn
            has all that handbooks give.
    """

    __pydantic_config__: ClassVar = _READING

    case: Name
    strategy: Name
    seed: Whole
    status: Status
    reason: Text = ""
    seconds: Seconds = 0.0
    blocks: Mapping[str, Block] = field(default_factory=dict)
    rigid_body_modes: Whole | None = None
    rigid_body_modes_expected: Whole | None = None
    negative_eigenvalues: Whole | None = None
    parameter_count: Whole | None = None
    evaluations: Whole | None = None
    score: Score | None = None
    rank: Rank | None = None
    # By factories, so that the class has no attributes of these names: see `__getattr__`.
    parameters: tuple[Mapping[str, Any], ...] = field(default_factory=tuple)
    history: tuple[Mapping[str, float], ...] = field(default_factory=tuple)
    diagnostics: Mapping[str, float] = field(default_factory=dict)
    traceback: str = field(default_factory=str)
    key: Name = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    nominal: Nominal = "drawn"

    if not TYPE_CHECKING:

        def __getattr__(self, name):  # noqa: ANN001, ANN204 - checkers know the fields
            """Decode the details of a stored result when the first of them is asked for."""
            own = vars(self)
            if name not in DETAILS or _UNREAD not in own:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            for detail, value in decoded(own[_UNREAD]).items():
                own.setdefault(detail, value)
            return own[name]

    def changed(self, **fields: object) -> JobResult:
        """Return this result with other figures; details that are not decoded stay so."""
        return _made(vars(self) | fields)

    @property
    def rigid_modes_lost(self) -> int:
        """Return how many rigid-body modes the model has less than the nominal one."""
        return max((self.rigid_body_modes_expected or 0) - (self.rigid_body_modes or 0), 0)

    @property
    def unphysical(self) -> bool:
        """Tell whether rigid-body modes were lost or eigenvalues are negative."""
        return self.status == "ok" and bool(self.rigid_modes_lost or self.negative_eigenvalues)


def leave_unread(result: JobResult, details: bytes) -> None:
    """Let a result that nobody else has yet decode its details when they are asked for.

    Arguments:
        details: text of a table of JSON; see `decoded`.
    """
    own = vars(result)
    for name in DETAILS:
        del own[name]
    own[_UNREAD] = details


def _made(fields: Mapping[str, object]) -> JobResult:
    made = object.__new__(JobResult)
    vars(made).update(fields)
    return made


@dataclass(frozen=True, repr=False)
class Run(Shown):
    """All results of one `bench run`.

    Arguments:
        meta: run id, seed, versions, machine, git commit, start time; plain data.
        results: one entry a job.
    """

    meta: Mapping[str, Any]
    results: tuple[JobResult, ...]

    @property
    def nominals(self) -> tuple[Nominal, ...]:
        """Return the models that strategies started from, the one that ranks first."""
        told = {name for names in (self.meta.get("starts") or {}).values() for name in names}
        found = told | {result.nominal for result in self.results}
        return tuple(name for name in reversed(NOMINALS) if name in found) or ("drawn",)

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
            counted(len({getattr(result, what) for result in self.results}), noun)
            for what, noun in (("case", "case"), ("strategy", "strategy"), ("seed", "seed"))
        )
        ended = ", ".join(f"{number} {status}" for status, number in count.items())
        title = f"{size}, {counted(len(self.results), 'result')} ({ended or 'none'})"
        return [(str(self.meta.get("run", "")), title)]
