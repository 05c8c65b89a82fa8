"""Judging what a strategy handed back, in a process that holds the data it was not shown."""

from __future__ import annotations

import json
import traceback
import warnings
from dataclasses import dataclass, fields, replace
from typing import Any

from msgspec import Struct

from femubench.core.case.case import Case
from femubench.core.errors import FemubenchError, NotApplicable, StrategyFailure
from femubench.core.run.answers import AnswerError, pack_outcome, unpack_outcome
from femubench.core.run.jobs import Job, JobOutcome, one_line, perform_job
from femubench.core.run.model_checks import check_model
from femubench.core.schema.records import encode
from femubench.core.schema.results import JobResult, Nominal, Status
from femubench.core.score.predicted_spread import Spread
from femubench.core.score.scoring import Reference, judge

_JUDGED = ("model", "samples", "discrepancy_std")  # of an outcome, and no part of the result


@dataclass(frozen=True)
class Dossier:
    """What it takes to judge an answer.

    Arguments:
        case: the case and its `Reference`, pickled by this program; empty where the judge has it.
        answer: of the strategy's worker, from `pack_outcome`; nobody has looked into it yet.
        strategy, seed, nominal: of the job.
        exhibited: whether its exhibit is wanted too.
    """

    case: bytes
    answer: bytes
    strategy: str
    seed: int
    nominal: Nominal = "drawn"
    exhibited: bool = False


class JudgeAnswer(Struct):
    """The result of a job, and its exhibit where one was wanted."""

    result: JobResult
    exhibit: dict[str, Any] | None = None


def run_strategy(job: Job) -> bytes:
    """Return the pack_outcome outcome of a job; runs in a worker."""
    return pack_outcome(*perform_job(job))


def run_judge(verdict: Dossier, case: Case, reference: Reference) -> bytes:
    """Return the result of a job and its exhibit as JSON; runs in a judge's process."""
    try:
        outcome = unpack_outcome(verdict.answer, case.model)
    except AnswerError as error:
        outcome = JobOutcome("failed", str(error), traceback.format_exc())
    job = verdict.strategy, verdict.seed, verdict.nominal
    result = judge_outcome(case, reference, job, outcome)
    exhibit = _exhibit(case, outcome, result) if verdict.exhibited else None
    return encode(JudgeAnswer(result, exhibit))


def _exhibit(case: Case, outcome: JobOutcome, result: JobResult) -> dict[str, Any] | None:
    """Return the pictures of a result; what goes wrong with them is no fault of the result."""
    if outcome.model is None or result.status != "ok":
        return None
    from femubench.core.drawing.prediction import exhibit_of

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = exhibit_of(case, outcome.model, outcome.parameters)
        json.dumps(found, allow_nan=False)
    except Exception:
        return None
    return found


def judge_outcome(
    case: Case, reference: Reference, job: tuple[str, int, Nominal], outcome: JobOutcome
) -> JobResult:
    """Return the result of a job: its model checked and judged; a model that fails has failed.

    Arguments:
        case: with the nominal model that the strategy started from.
        reference: what the textbook model of the case gives.
        job: strategy, seed, and which nominal model it is.
    """
    strategy, seed, nominal = job
    own = {f.name: getattr(outcome, f.name) for f in fields(outcome) if f.name not in _JUDGED}
    expected = reference.rigid.shape[1]
    result = JobResult(
        case.name, strategy, seed, **own, rigid_body_modes_expected=expected, nominal=nominal
    )
    return result if outcome.model is None else _judged(result, case, outcome, reference)


def _judged(result: JobResult, case: Case, outcome: JobOutcome, reference: Reference) -> JobResult:
    assert outcome.model is not None
    try:
        with warnings.catch_warnings():
            # An ill-conditioned model shows in its figures.
            warnings.simplefilter("ignore")
            check_model(outcome.model, case.model)
            judgement = judge(case, outcome.model, reference, _spread(outcome))
    except Exception as error:
        reason = str(error) if isinstance(error, FemubenchError) else one_line(error)
        status: Status = "not-applicable" if isinstance(error, NotApplicable) else "failed"
        return replace(result, status=status, reason=reason, traceback=traceback.format_exc())
    return replace(result, **vars(judgement))


def _spread(outcome: JobOutcome) -> Spread | None:
    """Return what a strategy says of its model's error, every sample checked."""
    if outcome.discrepancy_std is None or outcome.model is None:
        return None
    for number, sample in enumerate(outcome.samples, start=1):
        try:
            check_model(sample, outcome.model)
        except StrategyFailure as error:
            raise StrategyFailure(f"sample {number}: {error}") from error
    return Spread(outcome.model, outcome.samples, outcome.discrepancy_std)
