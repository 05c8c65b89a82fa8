"""One job: a strategy on a model and its used modes, and what became of it."""

from __future__ import annotations

import hashlib
import pickle
import time
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, NotRequired, TypedDict

import numpy as np
from msgspec import Meta

from femubench.core.errors import Diverged, NotApplicable, StrategyFailure
from femubench.core.fem.joints import place_words
from femubench.core.fem.model import Model, differ
from femubench.core.modal.eigen import count_evaluations
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import CAPABILITIES, Result, list_declared
from femubench.core.schema.bounds import Seconds, Whole
from femubench.core.schema.results import Status
from femubench.core.update.uncertainty import MOST_SAMPLES

_LONGEST_TEXT = 100_000  # characters of a message or a traceback
_MOST_FIGURES = 200_000
_MOST_LINKS = 20  # of a chain of exceptions


@dataclass(frozen=True)
class Job:
    """All that a worker process is given; neither the case nor its name is among it.

    Arguments:
        strategy, model, measurement: pickled, so that the bytes of a large model exist once for
            all strategies and whatever goes wrong with them goes wrong inside `execute`.
        words: seed of the random generator.
    """

    strategy: bytes
    model: bytes
    measurement: bytes
    words: tuple[int, ...]


class Estimate(TypedDict):
    """A parameter before and after an update, and what it says where it sits."""

    name: str
    before: float
    after: float
    unit: str
    std: float | None
    places: NotRequired[str]


_Figures = Annotated[Mapping[str, float], Meta(max_length=_MOST_FIGURES)]


@dataclass(frozen=True)
class Report:
    """What a strategy says of its update, in plain data.

    Arguments:
        seconds: wall time of the strategy alone.
        evaluations: eigenvalue solutions it made.
        discrepancy_std: relative standard deviation of a frequency that the samples do not show;
            None where the strategy says nothing of its uncertainty.
    """

    status: Status
    reason: str = ""
    traceback: str = ""
    seconds: Seconds = 0.0
    evaluations: Whole | None = None
    discrepancy_std: Seconds | None = None
    parameter_count: Whole | None = None
    parameters: Annotated[tuple[Estimate, ...], Meta(max_length=_MOST_FIGURES)] = ()
    history: Annotated[tuple[_Figures, ...], Meta(max_length=_MOST_FIGURES)] = ()
    diagnostics: _Figures = field(default_factory=dict)


@dataclass(frozen=True)
class JobOutcome(Report):
    """What a strategy left behind, before anybody has judged it.

    Arguments:
        model: the updated model; None unless the status is ``ok``.
        samples: models that are as probable as each other, their matrices on its dofs.
    """

    model: Model | None = None
    samples: tuple[Model, ...] = ()


def pickle_strategy(thing: object) -> bytes:
    """Return a strategy as bytes for a worker.

    A class that lives in a script, a notebook or a function has no name by which a worker could
    import it: its code goes along, and the worker never sees the rest of the script.
    """
    try:
        plain = pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception:
        plain = b""
    if plain and b"__main__" not in plain:
        return plain
    import cloudpickle

    code: bytes = cloudpickle.dumps(thing)
    return code


def seed_words(case: str, strategy: str, seed: int) -> tuple[int, ...]:
    """Return the seed of a job's random generator: the same on every machine and in any order.

    The names go in as a hash, since a generator shows its seed to anyone who holds it.
    """
    digest = hashlib.sha256("\0".join((str(seed), case, strategy)).encode()).digest()
    return tuple(int(word) for word in np.frombuffer(digest, dtype="<u4"))


def missing_capability(needs: frozenset[str], model: Model, measurement: Measurement) -> str | None:
    """Return why a strategy with these needs cannot run, None where it can.

    Raises:
        ValueError: for a need that is not one of `CAPABILITIES`.
    """
    unknown = sorted(needs - set(CAPABILITIES))
    if unknown:
        raise ValueError(f"unknown need {unknown[0]!r}, expected one of {', '.join(CAPABILITIES)}")
    if "shapes" in needs and not measurement.has_shapes:
        return "needs measured mode shapes, and a used mode has none"
    if "responses" in needs and measurement.responses is None:
        return "needs frequency responses: declare frfs and responses in [measurement] of the case"
    if model.structure is None:
        # Who takes groups needs joints of frames alone.
        kinds = ("elements", "geometry", *(() if "parts" in needs else ("joints",)))
        lacking = [need for need in kinds if need in needs]
        if lacking:
            return f"needs {lacking[0]}, and the model is a pair of matrices: kind 'frame' has them"
        if "parts" in needs and not model.groups:
            return "needs parts of the stiffness to scale: declare [[model.groups]] in the case"
        return None
    frame = model.structure.frame
    if "joints" in needs and all(len(frame.ends_at(joint.name)) < 2 for joint in frame.joints):
        return "needs joints, and no two members of the frame meet"
    return None


def execute(job: Job) -> JobOutcome:
    """Run one job in this process and tell how it ended; no exception of a strategy gets out."""
    return perform_job(job)[0]


def perform_job(job: Job) -> tuple[JobOutcome, Model | None]:
    """Return how one job ended in this process, and the model that it started from."""
    try:
        parts = (job.strategy, job.model, job.measurement)
        strategy, model, measurement = map(pickle.loads, parts)
        reason = missing_capability(frozenset(list_declared(strategy, "needs")), model, measurement)
    except Exception as error:
        return JobOutcome("failed", one_line(error), _traceback(error)), None
    if reason is not None:
        return JobOutcome("not-applicable", reason), model
    before = _digest(model)
    rng = np.random.default_rng(np.random.SeedSequence(job.words))
    start = time.perf_counter()
    with warnings.catch_warnings(), count_evaluations() as counter:
        # A result is judged by its figures; what numerical libraries mutter on the way is not.
        warnings.simplefilter("ignore")
        try:
            outcome = plain_outcome(strategy.update(model, measurement, rng))
        except BaseException as error:  # Ctrl-C does not reach a worker: this is the strategy's own
            status: Status = "failed"
            if isinstance(error, NotApplicable | Diverged):
                status = "diverged" if isinstance(error, Diverged) else "not-applicable"
            reason = one_line(error)
            if isinstance(error, NotApplicable | StrategyFailure):
                reason = _text(error) or type(error).__name__
            elif isinstance(error, MemoryError):
                reason = f"out of memory: {reason}"
            outcome = JobOutcome(status, reason, _traceback(error))
    if outcome.status == "ok":
        try:  # entries may have changed places
            same = before is not None and _digest(model) == before
            changed = not same and differ(model, pickle.loads(job.model))
        except Exception:  # what it holds now is no matrix
            changed = True
        if changed:
            what = "the nominal model was changed in place, expected a new one"
            outcome = JobOutcome("failed", what)
    seconds = time.perf_counter() - start
    return replace(outcome, seconds=seconds, evaluations=counter.count), model


def _digest(model: Model) -> bytes | None:
    """Return a digest of the matrices of a model; None where they are of another form."""
    found = hashlib.blake2b(digest_size=16)
    for matrix in (model.mass, model.stiffness):
        if matrix.format not in ("csc", "csr"):
            return None
        for part in (matrix.data, matrix.indices, matrix.indptr):
            found.update(np.ascontiguousarray(part).data)
    return found.digest()


def one_line(error: BaseException) -> str:
    """Return ``ExceptionType: message`` in one line, whatever the exception's own text does."""
    text = _text(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _text(error: BaseException) -> str:
    """Return the beginning of an exception's own text in one line; nothing where it has none."""
    try:
        return " ".join(str(error)[:_LONGEST_TEXT].split())
    except BaseException:  # Ctrl-C does not reach a worker: this is the strategy's own
        return ""


def _traceback(error: BaseException | None) -> str:
    """Return the end of an exception's traceback and of those that it came from.

    That of the standard library takes a minute for a message of some hundred megabytes.
    """
    parts: list[str] = []
    while error is not None and len(parts) < _MOST_LINKS:
        lines = traceback.format_tb(error.__traceback__)
        parts.append(f"Traceback (most recent call last):\n{''.join(lines)}{one_line(error)}\n")
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return "\n".join(reversed(parts))[-_LONGEST_TEXT:]


def plain_outcome(result: Result) -> JobOutcome:
    """Return a result as an outcome; raises TypeError, ValueError for figures that are none."""
    if not isinstance(result, Result):
        raise TypeError(f"update returned {type(result).__name__}, expected UpdateResult")
    if not isinstance(result.model, Model):
        raise TypeError(f"the updated model is {type(result.model).__name__}, expected Model")
    count = int(result.parameter_count)
    if not 0 <= count < 2**63:
        raise ValueError(f"parameter_count is {str(count)[:20]}, expected the number of unknowns")
    samples, discrepancy = _uncertainty(result, result.model)
    return JobOutcome(
        status="ok",
        model=result.model,
        samples=samples,
        discrepancy_std=discrepancy,
        parameter_count=count,
        parameters=tuple(_parameter(item, result.model) for item in result.parameters),
        history=tuple(_figures(item) for item in result.history),
        diagnostics=_figures(result.diagnostics),
    )


def _uncertainty(result: Result, model: Model) -> tuple[tuple[Model, ...], float | None]:
    """Return samples as nothing but matrices, and the discrepancy; None for a mere point."""
    stated = getattr(result, "uncertainty", None)
    if stated is None:
        return (), None
    samples = tuple(stated.samples)
    if len(samples) > MOST_SAMPLES:
        raise ValueError(f"uncertainty has {len(samples)} samples, allowed {MOST_SAMPLES}")
    discrepancy = float(stated.discrepancy_std)
    if not (np.isfinite(discrepancy) and discrepancy >= 0.0):
        raise ValueError(f"discrepancy_std is {discrepancy:g}, expected a finite number >= 0")
    for number, sample in enumerate(samples, start=1):
        if not isinstance(sample, Model):
            raise TypeError(f"sample {number} is {type(sample).__name__}, expected Model")
        if sample.dofs.direction != model.dofs.direction:
            raise ValueError(f"sample {number} has other degrees of freedom than the updated model")
    own = {"dofs": model.dofs, "geometry": model.geometry, "structure": model.structure}
    return tuple(replace(sample, **own, groups={}) for sample in samples), discrepancy


def _parameter(item: Any, model: Model) -> Estimate:  # noqa: ANN401 - a `ParameterEstimate`
    places = place_words(model.structure, getattr(item, "places", ()))
    found = Estimate(
        name=str(item.name),
        before=float(item.before),
        after=float(item.after),
        unit=str(item.unit),
        std=None if item.std is None else float(item.std),
    )
    return {**found, "places": places} if places else found


def _figures(item: Mapping[str, float]) -> dict[str, float]:
    return {str(name): float(value) for name, value in item.items()}
