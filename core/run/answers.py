"""What a worker hands back, as bytes that can do nothing but hold data.

A strategy's process has no friends: whatever comes out of it is read with a schema, and the model
by a reader that knows the classes of a model and no others (Python documentation, pickle,
"Restricting Globals").
"""

from __future__ import annotations

import io
import json
import math
import pickle
import traceback
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, get_args

from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.run.jobs import JobOutcome, one_line
from femubench.core.schema.results import Status

_HEAD = 8  # bytes that hold the length of the head
_LONGEST_HEAD = 64 * 2**20  # bytes
_APART = ("model", "samples")  # what is no JSON
_LONGEST_TEXT = 100_000
_LONGEST_NAME = 500
_LONGEST_REASON = 2_000
_MOST_FIGURES = 200_000
_NUMPY = ("numpy", "numpy._core", "numpy.core", "scipy.sparse")
_NAMES = {
    "builtins": {"complex", "frozenset", "object", "set", "slice"},
    "collections": {"OrderedDict"},
    "copyreg": {"_reconstructor"},
    "functools": {"partial"},
    "types": {"MappingProxyType"},
    "femubench.core.case.nodes": {"MatrixGeometry"},
}
_NUMPY_NAMES = frozenset(
    {"_reconstruct", "_frombuffer", "scalar", "dtype", "ndarray"}
    | {
        f"{form}_{kind}"
        for form in ("csr", "csc", "coo", "dia", "bsr")
        for kind in ("array", "matrix")
    }
)
# Where the classes of a model live; functions there (a section's kappa) compute and do no more.
_OURS = ("femubench.core.fem.", "femubench.core.fem.model", "femubench.core.modal.measurement")


class AnswerError(FemubenchError):
    """A worker handed back something that is no outcome."""


def packed(outcome: JobOutcome) -> bytes:
    """Return an outcome as bytes; one that cannot be sent has failed."""
    try:
        parts = outcome.model, outcome.samples
        model = b"" if outcome.model is None else pickle.dumps(parts, protocol=5)
        head = {f.name: getattr(outcome, f.name) for f in fields(outcome) if f.name not in _APART}
        text = json.dumps(head).encode()
    except Exception as error:
        reason = f"the result cannot be sent back: {one_line(error)}"
        failed = JobOutcome("failed", reason, traceback.format_exc(), outcome.seconds)
        return packed(failed)
    return len(text).to_bytes(_HEAD, "big") + text + model


def head_of(data: bytes) -> JobOutcome:
    """Return an outcome without its model.

    Raises:
        AnswerError: when the bytes are none.
    """
    size = int.from_bytes(data[:_HEAD], "big")
    if size > _LONGEST_HEAD:
        raise AnswerError(f"its own report has {size} bytes, allowed {_LONGEST_HEAD}")
    try:
        head = json.loads(data[_HEAD : _HEAD + size])
        return _checked(head)
    except Exception as error:  # whatever a stranger's text does to its reader
        raise AnswerError(f"the result cannot be read: {one_line(error)}") from error


def unpacked(data: bytes) -> JobOutcome:
    """Return an outcome with its model.

    Raises:
        AnswerError: when the bytes are none, or hold what a model has no use for.
    """
    outcome = head_of(data)
    if outcome.status != "ok":
        return outcome
    start = _HEAD + int.from_bytes(data[:_HEAD], "big")
    try:
        held = _ModelReader(io.BytesIO(memoryview(data)[start:])).load()
    except AnswerError:
        raise
    except Exception as error:
        raise AnswerError(f"the result cannot be read: {one_line(error)}") from error
    model, samples = held if type(held) is tuple and len(held) == 2 else (held, ())
    if type(model) is not Model:
        raise AnswerError(f"the updated model is {type(model).__name__}, expected femubench.Model")
    if not (type(samples) is tuple and all(type(sample) is Model for sample in samples)):
        raise AnswerError("the samples of the updated model are no tuple of femubench.Model")
    return replace(outcome, model=model, samples=samples)


class _ModelReader(pickle.Unpickler):
    """Reads models and refuses every other class by name."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401 - as pickle has it
        """Return a class or function that a model may hold.

        Raises:
            AnswerError: for any other.
        """
        known = name in _NAMES.get(module, ())
        numeric = module.startswith(_NUMPY) and name in _NUMPY_NAMES
        ours = module.startswith(_OURS) and "." not in name
        if not (known or numeric or ours):
            what = f"the updated model holds {module}.{name}"
            raise AnswerError(f"{what}, which cannot be taken over: expected femubench's own parts")
        found = super().find_class(module, name)
        if ours and getattr(found, "__module__", None) != module:
            raise AnswerError(
                f"the updated model holds {module}.{name}, which is not defined there"
            )
        return found


def _checked(head: Mapping[str, Any]) -> JobOutcome:
    if head["status"] not in get_args(Status):
        raise ValueError(f"status {head['status']!r}")
    parameters, history = list(head["parameters"]), list(head["history"])
    if len(parameters) > _MOST_FIGURES or sum(map(len, history)) > _MOST_FIGURES:
        raise ValueError("more figures than anybody reads")
    return JobOutcome(
        status=head["status"],
        reason=str(head["reason"])[:_LONGEST_REASON],
        traceback=str(head["traceback"])[:_LONGEST_TEXT],
        seconds=max(_number(head["seconds"]), 0.0),
        evaluations=_count(head["evaluations"]),
        discrepancy_std=_std(head.get("discrepancy_std")),
        parameter_count=_count(head["parameter_count"]),
        parameters=tuple(_parameter(item) for item in parameters),
        history=tuple(_figures(item) for item in history),
        diagnostics=_figures(head["diagnostics"]),
    )


def _count(value: object) -> int | None:
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**63:
        raise ValueError(f"{str(value)[:40]} is no count")
    return value


def _std(value: object) -> float | None:
    if value is None:
        return None
    number = _number(value)
    if not 0.0 <= number < math.inf:
        raise ValueError(f"{number} is no standard deviation")
    return number


def _parameter(item: Mapping[str, Any]) -> dict[str, Any]:
    std = item["std"]
    return {
        "name": str(item["name"])[:_LONGEST_NAME],
        "before": _number(item["before"]),
        "after": _number(item["after"]),
        "unit": str(item["unit"])[:_LONGEST_NAME],
        "std": None if std is None else _number(std),
    }


def _figures(item: Mapping[str, Any]) -> dict[str, float]:
    return {str(name)[:_LONGEST_NAME]: _number(value) for name, value in item.items()}


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return float(value)
