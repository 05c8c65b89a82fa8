"""One run of a strategy on one problem in a worker, and what that tells of it."""

from __future__ import annotations

import math
import pickle
import random
import time
import tracemalloc
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, cast

import msgspec
import numpy as np

from femubench.core.child.guarded_child import Ending
from femubench.core.conformance.fingerprints import fingerprint, first_difference, global_state
from femubench.core.conformance.problems import UpdatingProblem
from femubench.core.conformance.results import Given, faults_of
from femubench.core.errors import NotApplicable, StrategyFailure, harmless
from femubench.core.fem.model import Model
from femubench.core.plugin.foreign import import_thing
from femubench.core.plugin.variants import Variant
from femubench.core.roles import Result, StrategyRole, list_declared
from femubench.core.run.answers import pack_outcome
from femubench.core.run.jobs import JobOutcome, one_line, plain_outcome

if TYPE_CHECKING:
    from femubench.core.update.strategy import UpdateResult

_LENGTH = 8  # bytes that tell the length of an observation
_LONGEST = 4 * 2**20  # bytes of it
_LONGEST_TEXT = 2_000

Kind = Literal["result", "lacking", "not-applicable", "failed", "error", "stopped"]


@dataclass(frozen=True)
class Want:
    """A trial that a check looks at.

    Arguments:
        scramble: seed of the global random generators, which no strategy should look at.
        traced: whether memory is traced, which slows Python down.
        reference: whether it is the strategy to compare with that runs.
    """

    problem: str
    scramble: int = 0
    traced: bool = False
    reference: bool = False


@dataclass(frozen=True)
class Trial:
    """What a worker is to do: a pickled strategy and what it is given."""

    strategy: bytes
    problem: UpdatingProblem
    want: Want


@dataclass(frozen=True)
class Observation:
    """What was seen, by the word of the worker in which the strategy ran.

    Arguments:
        kind: ``lacking`` where the problem has not what the strategy says that it needs,
            ``error`` for an exception that is no verdict, ``stopped`` for a worker that died or
            had to be stopped.
        text: the reason, in one line, of everything but a result.
        seconds: wall time of the strategy.
        peak: bytes that Python and numpy held at most; None where it was not traced.
        faults: what is wrong with the result, by check.
        changed: the part of model or measurement that was changed in place.
        disturbed: what of the process was changed and not restored.
    """

    problem: str
    kind: Kind
    text: str = ""
    seconds: float = 0.0
    peak: int | None = None
    faults: Mapping[str, str] = field(default_factory=dict)
    changed: str | None = None
    disturbed: str | None = None
    prints: Mapping[str, str] = field(default_factory=dict)

    @property
    def survived(self) -> bool:
        """Tell whether there was a result or an honest refusal."""
        return self.kind not in ("error", "stopped")


def run_trial(trial: Trial) -> bytes:
    """Return the observation of a trial as JSON, and what was handed back; runs in a worker."""
    answer = b""
    try:
        found, answer = _observe(trial)
    except Exception as error:
        found = Observation(trial.problem.name, "error", one_line(error))
    head = msgspec.json.encode(found)
    return len(head).to_bytes(_LENGTH, "big") + head + answer


def read_observation(problem: str, ending: Ending) -> tuple[Observation, bytes]:
    """Return what a worker says that it saw, or how it ended, and what was handed back."""
    if ending.how != "answer":
        return Observation(problem, "stopped", ending.reason, ending.seconds), b""
    size = int.from_bytes(ending.answer[:_LENGTH], "big")
    try:
        text = ending.answer[_LENGTH : _LENGTH + min(size, _LONGEST)]
        found = msgspec.json.decode(text, type=Observation)
    except (msgspec.DecodeError, UnicodeError):
        found = None
    if found is None or found.kind == "lacking":  # what a problem lacks is not for it to say
        return Observation(problem, "error", "what its process sent is no observation"), b""
    texts: dict[str, Any] = {
        name: value and harmless(value[:_LONGEST_TEXT])
        for name in ("text", "changed", "disturbed")
        for value in (getattr(found, name),)
    }
    texts["faults"] = {name: harmless(text[:_LONGEST_TEXT]) for name, text in found.faults.items()}
    seconds = found.seconds if math.isfinite(found.seconds) else ending.seconds
    checked = replace(found, problem=problem, seconds=seconds, **texts)
    return checked, ending.answer[_LENGTH + size :]


def _observe(trial: Trial) -> tuple[Observation, bytes]:
    strategy: StrategyRole = import_subject(pickle.loads(trial.strategy))
    problem = trial.problem
    # What is handed over may be spoilt; the problem itself is needed to judge the result.
    model, measurement = pickle.loads(pickle.dumps((problem.model, problem.measurement)))
    given = UpdatingProblem(problem.name, model, measurement)
    before = _inputs(given)
    random.seed(trial.want.scramble)
    np.random.seed(trial.want.scramble)  # noqa: NPY002 - so that two runs find another state
    around = global_state()
    found, result = _call_strategy(strategy, given, trial)
    disturbed = first_difference(around, global_state())
    found = replace(found, changed=first_difference(before, _inputs(given)), disturbed=disturbed)
    if result is None:
        return found, b""
    with warnings.catch_warnings(), np.errstate(all="warn"):
        warnings.simplefilter("ignore")
        faults = faults_of(Given(problem, result, promises_of(strategy)))
    found = replace(found, faults=faults, prints=fingerprint(result, "result"))
    try:
        outcome = plain_outcome(result)
    except Exception as error:
        outcome = JobOutcome("failed", one_line(error))
    return found, pack_outcome(outcome, problem.model)


def import_subject(subject: Any) -> Any:  # noqa: ANN401 - any role
    """Return a subject whose code is there: in a worker that of a third party may be imported."""
    if isinstance(subject, Variant):
        return replace(subject, base=import_thing(subject.base))
    return import_thing(subject)


def _inputs(given: UpdatingProblem) -> dict[str, str]:
    return fingerprint(given.model, "model") | fingerprint(given.measurement, "measurement")


def _call_strategy(
    strategy: StrategyRole, given: UpdatingProblem, trial: Trial
) -> tuple[Observation, UpdateResult | None]:
    rng = np.random.default_rng(np.random.SeedSequence([0, *given.name.encode()]))
    name, start = given.name, time.perf_counter()
    if trial.want.traced:
        tracemalloc.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = strategy.update(given.model, given.measurement, rng)
    except NotApplicable as error:
        return _refusal(name, "not-applicable", error), None
    except StrategyFailure as error:
        return _refusal(name, "failed", error), None
    except BaseException as error:
        return Observation(name, "error", one_line(error)), None
    seconds = time.perf_counter() - start
    peak = tracemalloc.get_traced_memory()[1] if trial.want.traced else None
    tracemalloc.stop()
    wrong, model = "", getattr(result, "model", None)
    if not isinstance(cast(object, result), Result):
        wrong = f"update returned {type(result).__name__} instead of UpdateResult"
    elif not isinstance(model, Model):
        wrong = f"the updated model is {type(model).__name__} instead of Model"
    if wrong:
        return Observation(name, "error", wrong, seconds), None
    # Its model is the data class, as was just seen, and the rest is read by name alone.
    return Observation(name, "result", "", seconds, peak), cast("UpdateResult", result)


def promises_of(strategy: StrategyRole) -> frozenset[str]:
    """Return what a strategy says that it keeps, with or without options."""
    promises: object = list_declared(strategy, "promises")
    return promises if isinstance(promises, frozenset) else frozenset()


def _refusal(name: str, kind: Kind, error: Exception) -> Observation:
    text = " ".join(str(error).split())
    if not text:
        return Observation(name, "error", f"{type(error).__name__} without a sentence")
    return Observation(name, kind, text)
