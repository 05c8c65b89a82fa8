"""What a worker hands back, as bytes that can do nothing but hold data.

A strategy's process has no friends: whatever comes out of it is a status, a report and arrays of
numbers, read as the classes that they are; of the model it is the difference from the nominal one.
"""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import msgspec

from femubench.core.errors import FemubenchError, StrategyFailure, harmless, harmless_lines
from femubench.core.fem.model import Model
from femubench.core.run.jobs import Estimate, JobOutcome, Report, one_line
from femubench.core.run.plain_arrays import BytesError, Shelf, open_bytes
from femubench.core.run.plain_model import PlainModel, model_from_plain, model_to_plain
from femubench.core.schema.bounds import LONGEST_TEXT
from femubench.core.schema.results import Status

# The first byte tells how a job ended, so that nobody else has to read an answer that is judged.
_STATUS: Mapping[int, Status] = {
    ord("o"): "ok", ord("f"): "failed", ord("d"): "diverged", ord("n"): "not-applicable"
}  # fmt: skip
_LONGEST_REPORT = 2 * 2**20  # bytes of the head of what has not succeeded
_LONGEST_NAME = 500
_LONGEST_REASON = 2_000
_LONGEST_PLACES = 10_000
_LONGEST_FIGURES = 4 * 2**20  # bytes: a file of a run has room for many results


class _Answer(msgspec.Struct):
    report: Report
    model: PlainModel | None = None


class AnswerError(FemubenchError):
    """A worker handed back something that is no outcome."""


def pack_outcome(outcome: JobOutcome, nominal: Model | None = None) -> bytes:
    """Return an outcome as bytes; one that cannot be sent has failed.

    Arguments:
        nominal: the model that the job started from; of an outcome without a model None will do.
    """
    try:
        return _pack(outcome, nominal)
    except StrategyFailure as error:
        reason, trace = str(error), traceback.format_exc()
    except Exception as error:
        reason, trace = f"the result cannot be sent back: {one_line(error)}", traceback.format_exc()
    return _pack(JobOutcome("failed", reason, trace, outcome.seconds), None)


def _pack(outcome: JobOutcome, nominal: Model | None) -> bytes:
    said = {field.name: getattr(outcome, field.name) for field in fields(Report)}
    said["reason"] = outcome.reason[:_LONGEST_REPORT]
    said["traceback"] = outcome.traceback[:LONGEST_TEXT]
    shelf, plain = Shelf(), None
    if outcome.model is not None and nominal is not None:
        plain = model_to_plain(outcome.model, outcome.samples, nominal, shelf)
    letter = next(letter for letter, status in _STATUS.items() if status == outcome.status)
    return bytes([letter]) + shelf.seal(_Answer(Report(**said), plain))


def read_status(data: bytes) -> Status:
    """Return how a job ended, without a look at the rest; raises AnswerError."""
    status = _STATUS.get(data[0]) if data else None
    if status is None:
        raise AnswerError("the result cannot be read: it does not say how the job ended")
    return status


def read_report(data: bytes) -> JobOutcome:
    """Return an outcome without its model; of one to be judged nothing but that it is ``ok``.

    Raises:
        AnswerError: when the bytes are none.
    """
    status = read_status(data)
    if status == "ok":
        return JobOutcome(status)
    if len(data) > _LONGEST_REPORT:
        raise AnswerError(f"the result cannot be read: {len(data)} bytes without a model")
    try:
        answer, _ = open_bytes(_Answer, memoryview(data)[1:])
        return _outcome(status, answer.report)
    except Exception as error:  # what the text of anybody does to its reader
        raise _unreadable(error) from error


def unpack_outcome(data: bytes, nominal: Model) -> JobOutcome:
    """Return an outcome with its model.

    Arguments:
        nominal: the model that the job started from, of the case.

    Raises:
        AnswerError: when the bytes are none, or hold what is no model of the case.
    """
    if read_status(data) != "ok":
        return read_report(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer, arrays = open_bytes(_Answer, memoryview(data)[1:])
            if answer.model is None:
                raise BytesError("there is no model")
            model, samples = model_from_plain(answer.model, arrays, nominal)
        return replace(_outcome("ok", answer.report), model=model, samples=samples)
    except Exception as error:
        raise _unreadable(error) from error


def _unreadable(error: Exception) -> AnswerError:
    what = str(error) if isinstance(error, FemubenchError) else one_line(error)
    if isinstance(error, StrategyFailure):
        return AnswerError(what)
    where = "result cannot be read" if isinstance(error, BytesError) else "updated model"
    return AnswerError(f"the {where}: {' '.join(what.split())[:_LONGEST_REASON]}")


def _outcome(status: Status, report: Report) -> JobOutcome:
    """Return a report as an outcome; none of its words is obeyed by a terminal."""
    figures: dict[str, Any] = {
        "parameters": tuple(map(_harmless_estimate, report.parameters)),
        "history": tuple(map(_harmless_figures, report.history)),
        "diagnostics": _harmless_figures(report.diagnostics),
    }
    length = len(msgspec.json.encode(figures))
    if length > _LONGEST_FIGURES:
        raise BytesError(f"{length} bytes of figures, allowed {_LONGEST_FIGURES}")
    said = {field.name: getattr(report, field.name) for field in fields(Report)}
    said["reason"] = _harmless(report.reason, _LONGEST_REASON)
    # Of a long one the end.
    said["traceback"] = harmless_lines(report.traceback[-LONGEST_TEXT:])[-LONGEST_TEXT:]
    return JobOutcome(**{**said, **figures, "status": status})


def _harmless(text: str, longest: int = _LONGEST_NAME) -> str:
    """Return a text on one line, which no terminal obeys."""
    return harmless(text[:longest])[:longest]


def _harmless_estimate(item: Estimate) -> Estimate:
    found = Estimate(**{**item, "name": _harmless(item["name"]), "unit": _harmless(item["unit"])})
    if "places" in item:
        found["places"] = _harmless(item["places"], _LONGEST_PLACES)
    return found


def _harmless_figures(item: Mapping[str, float]) -> dict[str, float]:
    return {_harmless(name): value for name, value in item.items()}
