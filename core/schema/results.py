"""What comes out of a run: one result a job, in plain data that goes to JSON and back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields as fields_of
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

from femubench.core.display import Shown, counted
from femubench.core.schema.bounds import (
    READING,
    Mac,
    Name,
    Percent,
    Rank,
    Score,
    Seconds,
    Text,
    Whole,
)
from femubench.core.schema.details import DETAILS, decoded
from femubench.core.schema.paired_modes import PairedMode, Row, rows_from_texts, rows_of

Status = Literal["ok", "failed", "timeout", "crashed", "diverged", "not-applicable"]
STATUSES: tuple[Status, ...] = get_args(Status)
# A result, though there may be no model; everything else is a failure and no result.
DONE: frozenset[Status] = frozenset({"ok", "not-applicable"})
BLOCKS = ("used", "higher", "modified")
UNSEEN = ("higher", "modified")  # what no strategy is given
# The model that a strategy starts from: as an engineer drew it, or with what handbooks give.
Nominal = Literal["drawn", "textbook"]
NOMINALS: tuple[Nominal, ...] = get_args(Nominal)


_set = object.__setattr__  # of what nobody else has yet


class _Stored:
    """What may come from a store, of which a part is read when it is asked for."""

    __slots__ = ("_unread",)


@dataclass(frozen=True, slots=True)
class Block(_Stored):
    """The error of one set of modes: used, higher or modified.

    Arguments:
        rms_percent: root mean square of the relative frequency errors; a measured mode without
            partner counts 100 %.
        mean_mac: mean over the modes that have a measured shape; None where none has one.
        modes: the pairs.
    """

    __pydantic_config__: ClassVar = READING

    rms_percent: Percent
    mean_mac: Mac | None
    modes: tuple[PairedMode, ...] = ()

    if not TYPE_CHECKING:

        def __getattr__(self, name):  # noqa: ANN001, ANN204 - checkers know the fields
            """Decode the modes of a stored block when they are asked for."""
            if name != "modes":
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            text, own = self._unread
            (found,) = rows_from_texts([text])
            _set(self, name, tuple(PairedMode(*row) for row in found.get(own, ())))
            return self.modes


@dataclass(frozen=True, slots=True)
class JobResult(_Stored):
    """The outcome of one (case, strategy, seed), started from one nominal model.

    Arguments:
        case, strategy, seed: the job.
        status: how it ended; anything but ``ok`` has a reason.
        reason: one line, with the measured figure where a self-check failed; of a model that is
            ``ok`` how many partners it has, where these are too many.
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
        surplus_partners: modes of it that could be partners of measured ones beyond those of the
            nominal model, where they are too many for a prediction; else 0.
        start_percent: rms error by block of the model that a strategy was given which is not
            applicable; empty where that is the textbook model.
    """

    __pydantic_config__: ClassVar = READING

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
    parameters: tuple[Mapping[str, Any], ...] = ()
    history: tuple[Mapping[str, float], ...] = ()
    diagnostics: Mapping[str, float] = field(default_factory=dict)
    traceback: str = ""
    key: Name = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    nominal: Nominal = "drawn"
    surplus_partners: Whole | None = None
    start_percent: Mapping[str, Percent] = field(default_factory=dict)

    if not TYPE_CHECKING:

        def __getattr__(self, name):  # noqa: ANN001, ANN204 - checkers know the fields
            """Decode the details of a stored result when the first of them is asked for."""
            if name not in DETAILS:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            for detail, value in decoded(self._unread[0]).items():
                if not _is_there(self, detail):
                    _set(self, detail, value)
            return getattr(self, name)

    def changed(self, **fields: object) -> JobResult:
        """Return this result with other figures; details that are not decoded stay so."""
        made = object.__new__(JobResult)
        for name in _PARTS:
            if name in fields or _is_there(self, name):
                _set(made, name, fields[name] if name in fields else getattr(self, name))
        return made

    @property
    def rigid_modes_lost(self) -> int:
        """Return how many rigid-body modes the model has less than the nominal one."""
        return max((self.rigid_body_modes_expected or 0) - (self.rigid_body_modes or 0), 0)

    @property
    def unphysical(self) -> bool:
        """Tell whether rigid-body modes were lost, eigenvalues are negative or partners surplus."""
        damage = self.rigid_modes_lost or self.negative_eigenvalues or self.surplus_partners
        return self.status == "ok" and bool(damage)


_NOTHING = b"", None, None
_PARTS = ("_unread", *(field.name for field in fields_of(JobResult)))


def _is_there(thing: _Stored, name: str) -> bool:
    try:
        object.__getattribute__(thing, name)
    except AttributeError:
        return False
    return True


def leave_unread(result: JobResult, modes: bytes | None, details: bytes) -> None:
    """Let a result that nobody else has yet decode modes and details when they are asked for.

    Arguments:
        modes: text for `rows_from_texts`; None where its blocks have them.
        details: text of a table of JSON; see `decoded`.
    """
    for name in DETAILS:
        object.__delattr__(result, name)
    _set(result, "_unread", (details, modes, result.blocks))
    if modes is not None:
        for name, block in result.blocks.items():
            object.__delattr__(block, "modes")
            _set(block, "_unread", (modes, name))


def rate(result: JobResult, score: float, rank: int) -> None:
    """Give a result that nobody else has yet its score and rank."""
    _set(result, "score", score)
    _set(result, "rank", rank)


def mode_rows(results: Iterable[JobResult]) -> list[Mapping[str, Sequence[Row]]]:
    """Return the modes of every result by block; those of stored ones are decoded at once.

    Raises:
        InputError: where the text of some is damaged.
    """
    listed = [(result.blocks, getattr(result, "_unread", _NOTHING)) for result in results]
    # A result that was given other blocks has none of the text.
    texts = [unread[1] if unread[2] is blocks else None for blocks, unread in listed]
    read = iter(rows_from_texts([text for text in texts if text is not None]))
    return [
        {name: rows_of(block.modes) for name, block in blocks.items()}
        if text is None
        else next(read)
        for (blocks, _), text in zip(listed, texts, strict=True)
    ]


def origins_of(meta: Mapping[str, Any], *kinds: str) -> dict[str, str]:
    """Return from the names of what ran beside the cases of a run to the cases they belong to.

    Arguments:
        meta: of the run.
        kinds: ``of`` for twins, ``again`` for jobs that were run a second time; both by default.
    """
    told = meta.get("twins") or {}
    found = (told.get(kind) or {} for kind in kinds or ("of", "again"))
    return {name: case for named in found for name, case in named.items()}


@dataclass(frozen=True, repr=False)
class Run(Shown):
    """All results of one `bench run`.

    Arguments:
        meta: run id, seed, versions, machine, git commit, start time; plain data.
        results: one entry a job.
        beside: results on twins of the cases and of jobs that were run again, which are in no
            figure of the run; ``meta["twins"]`` tells what they belong to.
    """

    meta: Mapping[str, Any]
    results: tuple[JobResult, ...]
    beside: tuple[JobResult, ...] = ()

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
