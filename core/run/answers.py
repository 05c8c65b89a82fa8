"""What a worker hands back, as bytes that can do nothing but hold data.

A strategy's process has no friends: whatever comes out of it is a status, a head of JSON and arrays
of numbers, read with a schema; the model is told as its difference from the nominal one.
"""

from __future__ import annotations

import json
import math
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from femubench.core.errors import FemubenchError, StrategyFailure, harmless
from femubench.core.fem.model import Model
from femubench.core.run.jobs import JobOutcome, one_line
from femubench.core.run.plain_arrays import BytesError, Shelf, opened
from femubench.core.run.plain_model import model_from_plain, model_to_plain
from femubench.core.schema.results import Status

# The first byte tells how a job ended, so that nobody else has to read an answer that is judged.
_STATUS: Mapping[int, Status] = {
    ord("o"): "ok", ord("f"): "failed", ord("d"): "diverged", ord("n"): "not-applicable"
}  # fmt: skip
_LONGEST_REPORT = 2 * 2**20  # bytes of the head of what has not succeeded
_APART = ("status", "model", "samples")  # what is no JSON
_LONGEST_TEXT = 100_000
_LONGEST_NAME = 500
_LONGEST_REASON = 2_000
_LONGEST_PLACES = 10_000
_MOST_FIGURES = 200_000
_LONGEST_FIGURES = 4 * 2**20  # characters: a file of a run has room for many results


class AnswerError(FemubenchError):
    """A worker handed back something that is no outcome."""


def packed(outcome: JobOutcome, nominal: Model | None = None) -> bytes:
    """Return an outcome as bytes; one that cannot be sent has failed.

    Arguments:
        nominal: the model that the job started from; of an outcome without a model None will do.
    """
    try:
        return _sealed(outcome, nominal)
    except StrategyFailure as error:
        reason, trace = str(error), traceback.format_exc()
    except Exception as error:
        reason, trace = f"the result cannot be sent back: {one_line(error)}", traceback.format_exc()
    return _sealed(JobOutcome("failed", reason, trace, outcome.seconds), None)


def _sealed(outcome: JobOutcome, nominal: Model | None) -> bytes:
    head = {f.name: getattr(outcome, f.name) for f in fields(outcome) if f.name not in _APART}
    head |= {"reason": _clean(outcome.reason, _LONGEST_REASON)}
    head |= {"traceback": _clean(outcome.traceback, _LONGEST_TEXT)}
    shelf = Shelf()
    if outcome.model is not None and nominal is not None:
        head |= model_to_plain(outcome.model, outcome.samples, nominal, shelf)
    letter = next(letter for letter, status in _STATUS.items() if status == outcome.status)
    return bytes([letter]) + shelf.sealed(head)


def _clean(text: str, longest: int) -> str:
    return text[:longest].encode("utf-8", "replace").decode("utf-8")


def status_of(data: bytes) -> Status:
    """Return how a job ended, without a look at the rest; raises AnswerError."""
    status = _STATUS.get(data[0]) if data else None
    if status is None:
        raise AnswerError("the result cannot be read: it does not say how the job ended")
    return status


def head_of(data: bytes) -> JobOutcome:
    """Return an outcome without its model; of one to be judged nothing but that it is ``ok``.

    Raises:
        AnswerError: when the bytes are none.
    """
    status = status_of(data)
    if status == "ok":
        return JobOutcome(status)
    try:
        return _checked(status, opened(memoryview(data)[1:], _LONGEST_REPORT)[0])
    except Exception as error:  # whatever a stranger's text does to its reader
        raise _unreadable(error) from error


def unpacked(data: bytes, nominal: Model) -> JobOutcome:
    """Return an outcome with its model.

    Arguments:
        nominal: the model that the job started from, of the case.

    Raises:
        AnswerError: when the bytes are none, or hold what is no model of the case.
    """
    if status_of(data) != "ok":
        return head_of(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            head, arrays = opened(memoryview(data)[1:])
            model, samples = model_from_plain(head, arrays, nominal)
        return replace(_checked("ok", head), model=model, samples=samples)
    except Exception as error:
        raise _unreadable(error) from error


def _unreadable(error: Exception) -> AnswerError:
    what = str(error) if isinstance(error, FemubenchError) else one_line(error)
    if isinstance(error, StrategyFailure):
        return AnswerError(what)
    where = "result cannot be read" if isinstance(error, BytesError) else "updated model"
    return AnswerError(f"the {where}: {' '.join(what.split())[:_LONGEST_REASON]}")


def _checked(status: Status, head: Mapping[str, Any]) -> JobOutcome:
    parameters, history = list(head["parameters"]), list(head["history"])
    if len(parameters) > _MOST_FIGURES or sum(map(len, history)) > _MOST_FIGURES:
        raise BytesError("more figures than anybody reads")
    found = {
        "parameters": tuple(_parameter(item) for item in parameters),
        "history": tuple(_figures(item) for item in history),
        "diagnostics": _figures(head["diagnostics"]),
    }
    length = len(json.dumps(found))
    if length > _LONGEST_FIGURES:
        raise BytesError(f"{length} characters of figures, allowed {_LONGEST_FIGURES}")
    return JobOutcome(
        status=status,
        reason=_text(head["reason"], _LONGEST_REASON),
        traceback=_lines(head["traceback"]),
        seconds=_seconds(head["seconds"]),
        evaluations=_count(head["evaluations"]),
        discrepancy_std=_std(head.get("discrepancy_std")),
        parameter_count=_count(head["parameter_count"]),
        **found,  # type: ignore[arg-type]
    )


def _text(value: object, longest: int = _LONGEST_NAME) -> str:
    """Return a text on one line, which no terminal obeys."""
    return harmless(_said(value)[:longest])[:longest]


def _lines(value: object) -> str:
    """Return a text of several lines, which no terminal obeys; of a long one the end."""
    lines = _said(value)[-_LONGEST_TEXT:].split("\n")
    clean = ("".join(c if c.isprintable() else ascii(c)[1:-1] for c in line) for line in lines)
    return "\n".join(clean)[-_LONGEST_TEXT:]


def _said(value: object) -> str:
    if not isinstance(value, str):
        raise BytesError(f"{repr(value)[:40]} is no text")
    return value.encode("utf-8", "replace").decode("utf-8")


def _count(value: object) -> int | None:
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**63:
        raise BytesError(f"{repr(value)[:40]} is no count")
    return value


def _seconds(value: object) -> float:
    number = _number(value)
    if not math.isfinite(number):
        raise BytesError(f"{number} is no time")
    return max(number, 0.0)


def _std(value: object) -> float | None:
    if value is None:
        return None
    number = _number(value)
    if not 0.0 <= number < math.inf:
        raise BytesError(f"{number} is no standard deviation")
    return number


def _parameter(item: Mapping[str, Any]) -> dict[str, Any]:
    std, places = item["std"], _text(item.get("places", ""), _LONGEST_PLACES)
    return {
        "name": _text(item["name"]),
        "before": _number(item["before"]),
        "after": _number(item["after"]),
        "unit": _text(item["unit"]),
        "std": None if std is None else _number(std),
        **({"places": places} if places else {}),
    }


def _figures(item: Mapping[str, Any]) -> dict[str, float]:
    return {_text(name): _number(value) for name, value in item.items()}


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BytesError(f"{repr(value)[:40]} is no number")
    try:
        return float(value)
    except OverflowError:
        raise BytesError("a whole number is too large") from None
