"""Checks, their verdicts, and the bench on which things are tried in workers."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias, get_args

from femubench.core.child.limits import MIB, Limits
from femubench.core.child.workers import run_apart
from femubench.core.conformance import SECONDS
from femubench.core.conformance.judging import Handed, confirm_observation, judge_handed
from femubench.core.conformance.problems import PLAIN, UpdatingProblem, problem
from femubench.core.conformance.trial import (
    Observation,
    Trial,
    Want,
    import_subject,
    promises_of,
    read_observation,
    run_trial,
)
from femubench.core.errors import harmless
from femubench.core.plugin.foreign import is_foreign
from femubench.core.plugin.variants import Variant
from femubench.core.roles import StrategyRole, list_declared
from femubench.core.run.executor import count_workers
from femubench.core.run.jobs import missing_capability, one_line, pickle_strategy

Status = Literal["pass", "fail", "warn", "not-applicable"]
Role = Literal["strategy", "effect", "reader", "scenario"]
MEMORY = 1024 * MIB
UNSENT = "not looked at: it cannot be sent to a worker"
_LONGEST = 2_000  # characters of a message


@dataclass(frozen=True)
class Verdict:
    """What a check found: its status, and one line on what was seen and what was expected."""

    status: Status
    message: str = ""


def pass_check(message: str = "") -> Verdict:
    """Return that all is well."""
    return Verdict("pass", message)


def fail_check(message: str) -> Verdict:
    """Return what was seen and what was expected."""
    return Verdict("fail", " ".join(message.split()))


def warn_of(message: str) -> Verdict:
    """Return what may be meant, but should be known."""
    return Verdict("warn", " ".join(message.split()))


def not_applicable(message: str) -> Verdict:
    """Return why there was nothing to check."""
    return Verdict("not-applicable", message)


@dataclass(frozen=True)
class Check:
    """One thing that a plugin must keep.

    Arguments:
        name: one word, for the command line and the docs.
        sentence: what must hold.
        judge: from a bench to a verdict.
        wants: the trials that it will look at, so that they can run side by side.
        first: whether it comes before the plain run and needs no result of it.
    """

    role: Role
    name: str
    sentence: str
    judge: Judge
    wants: Wants
    first: bool


Judge: TypeAlias = Callable[["Bench"], Verdict]
Wants: TypeAlias = Callable[["Bench"], Sequence[Want]]
CHECKS: list[Check] = []


def check(
    role: Role, name: str, sentence: str, *, wants: Wants = lambda bench: (), first: bool = False
) -> Callable[[Judge], Judge]:
    """Put a function on the list of checks."""

    def put(judge: Judge) -> Judge:
        CHECKS.append(Check(role, name, sentence, judge, wants, first))
        return judge

    return put


def check_apart(
    role: Role, name: str, sentence: str, *, first: bool = False, code_alone: bool = False
) -> Callable[[Callable[..., Verdict]], Callable[..., Verdict]]:
    """Put a function on the list of checks that a worker calls with the subject and the helpers.

    Arguments:
        role, name, sentence, first: as in `Check`.
        code_alone: whether it runs nothing of the subject, so that built-in ones need no worker.
    """

    def put(function: Callable[..., Verdict]) -> Callable[..., Verdict]:
        def judge(bench: Bench) -> Verdict:
            subject = bench.subject
            owner = subject.base if isinstance(subject, Variant) else subject
            if code_alone and not is_foreign(owner):
                return function(subject)
            return bench.apart(function, *bench.helpers)

        check(role, name, sentence, first=first)(judge)
        return function

    return put


class Bench:
    """Where one plugin is tried; every trial runs once, in a process of its own.

    Arguments:
        reference: the strategy that time and memory are compared with, if there is one.
        helpers: what a check in a worker is given as well, e.g. readers.
        jobs: number of workers; None for the number of processors.
    """

    def __init__(
        self,
        subject: Any,  # noqa: ANN401 - any role
        *,
        reference: StrategyRole | None = None,
        cases: Sequence[UpdatingProblem] = (),
        helpers: Sequence[object] = (),
        seconds: float = SECONDS,
        memory: int = MEMORY,
        jobs: int | None = None,
    ) -> None:
        self.subject, self.reference, self.helpers = subject, reference, helpers
        self.cases = {item.name: item for item in cases}
        self.limits = Limits(seconds=seconds, memory=memory)
        self._jobs = count_workers(jobs)
        self._seen: dict[Want, Observation] = {}

    @cached_property
    def code(self) -> bytes | str:
        """Return the pickled subject, or in one line why it cannot be pickled."""
        try:
            data = pickle_strategy(self.subject)
        except Exception as error:
            return one_line(error)
        return data

    @cached_property
    def sound(self) -> str | None:
        """Return why there is no use in further trials; None where the plain one came back."""
        if isinstance(self.code, str):
            return UNSENT
        if not self.observe([Want(PLAIN)])[0].survived:
            return f"not looked at: nothing came back from the {PLAIN}"
        return None

    def observe(self, wants: Sequence[Want]) -> list[Observation]:
        """Return what is seen in some trials; those that have not run yet run now."""
        missing = [want for want in dict.fromkeys(wants) if want not in self._seen]
        self._seen |= {want: kept for want in missing if (kept := self._unrun(want)) is not None}
        tasks = {}
        for want in missing:
            code = pickle_strategy(self.reference) if want.reference else self.code
            assert isinstance(code, bytes)
            if want not in self._seen:
                tasks[want] = run_trial, Trial(code, self._problem(want), want)
        apart = replace(self.limits, sandbox="auto")
        observed = {
            want: read_observation(want.problem, ending)
            for want, ending in run_apart(tasks, apart, self._jobs).items()
        }
        handed = {
            want: (judge_handed, Handed(self._problem(want), answer, promises_of(strategy)))
            for want, (seen, answer) in observed.items()
            for strategy in (self._strategy(want),)
            if seen.kind == "result"
        }
        judged = run_apart(handed, self.limits, self._jobs)
        for want, (seen, _) in observed.items():
            self._seen[want] = confirm_observation(seen, judged[want]) if want in judged else seen
        return [self._seen[want] for want in wants]

    def _unrun(self, want: Want) -> Observation | None:
        """Return what is known without a run: that the problem lacks what the strategy needs."""
        given = self._problem(want)
        try:
            needs = frozenset(list_declared(self._strategy(want), "needs"))
            reason = missing_capability(needs, given.model, given.measurement)
        except Exception as error:  # whatever it says that it needs
            return Observation(want.problem, "error", one_line(error))
        return None if reason is None else Observation(want.problem, "lacking", reason)

    def _strategy(self, want: Want) -> Any:  # noqa: ANN401 - a strategy of anybody's
        return self.reference if want.reference else self.subject

    def _problem(self, want: Want) -> UpdatingProblem:
        return self.cases.get(want.problem) or problem(want.problem)

    def apart(self, function: Callable[..., Verdict], *further: object) -> Verdict:
        """Return the verdict of a function that runs in a worker.

        Arguments:
            function: importable by name; its first argument is the subject.
        """
        if isinstance(self.code, str):
            return not_applicable(UNSENT)
        task = (_judged, (function, pickle.dumps((self.subject, *further))))
        ending = run_apart({0: task}, self.limits, 1)[0]
        if ending.how != "answer":
            return fail_check(f"{ending.reason}, expected an answer")
        try:
            status, message = json.loads(ending.answer)
            if status in get_args(Status):
                return Verdict(status, harmless(str(message)[:_LONGEST]))
        except (ValueError, TypeError, RecursionError):
            pass
        return fail_check("what its process sent is no verdict")


def _judged(task: tuple[Callable[..., Verdict], bytes]) -> bytes:
    """Return the verdict of a function as JSON; runs in a worker."""
    function, arguments = task
    try:
        subject, *further = pickle.loads(arguments)
        verdict = function(import_subject(subject), *further)
    except BaseException as error:
        verdict = fail_check(f"{one_line(error)}, expected no exception")
    return json.dumps([verdict.status, verdict.message]).encode()


def _sendable(subject: object, what: str) -> Verdict:
    try:
        pickle_strategy(subject)
    except Exception as error:
        return fail_check(f"{one_line(error)}, expected {what} that pickle can send")
    return pass_check()


def picklable(bench: Bench, what: str) -> Verdict:
    """Judge whether the subject can be sent to a worker."""
    if is_foreign(bench.subject):
        return bench.apart(_sendable, what)
    if isinstance(bench.code, str):
        return fail_check(f"{bench.code}, expected {what} that pickle can send")
    return pass_check()


def judge_check(check: Check, bench: Bench) -> Verdict:
    """Return the verdict of one check."""
    if check.role == "strategy" and not check.first and bench.sound:
        return not_applicable(bench.sound)
    return check.judge(bench)


def prepare(checks: Sequence[Check], bench: Bench) -> None:
    """Run the trials that some checks will look at, side by side."""
    if bench.sound is None:
        bench.observe([want for check in checks for want in check.wants(bench)])
