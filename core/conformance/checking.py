"""Find a plugin by name, run its checks, and put the findings into plain data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from femubench.core.conformance import SECONDS, effect_checks, other_checks, strategy_checks
from femubench.core.conformance.kit import (
    CHECKS,
    Bench,
    Check,
    Role,
    Status,
    Verdict,
    judge_check,
    prepare,
)
from femubench.core.conformance.problems import UpdatingProblem
from femubench.core.errors import InputError
from femubench.core.plugin.loader import Plugins, show_entry
from femubench.core.plugin.validation import KINDS, did_you_mean
from femubench.core.plugin.variants import strategy_of

# Importing them fills the list.
_SOURCES = (strategy_checks, effect_checks, other_checks)


@dataclass(frozen=True)
class Subject:
    """A plugin that is checked."""

    role: Role
    name: str
    bench: Bench

    @property
    def checks(self) -> tuple[Check, ...]:
        """Return the checks that concern it."""
        return checks_of(self.role)


@dataclass(frozen=True)
class CheckResult:
    """A check and its verdict."""

    check: Check
    verdict: Verdict


def checks_of(role: Role) -> tuple[Check, ...]:
    """Return the checks of a role in the order in which they are shown."""
    return tuple(check for check in CHECKS if check.role == role)


def subjects(
    name: str, plugins: Plugins, *, cases: Sequence[UpdatingProblem] = (), seconds: float = SECONDS
) -> list[Subject]:
    """Return every strategy, effect, reader and scenario of a name.

    Arguments:
        name: of a plugin; a strategy may have options, as in ``bench run -s``.

    Raises:
        InputError: when there is none of that name.
    """
    found = [
        Subject(role, name, _bench(role, item, plugins, cases, seconds))
        for role, item in _named(name, plugins)
    ]
    if not found:
        known = {word for role in get_args(Role) for word in getattr(plugins, KINDS[role])}
        near = did_you_mean(name, sorted(known)) or "; bench plugins list shows what there is"
        raise InputError(f"no strategy, effect, reader or scenario {name!r}{near}")
    return found


def findings(subject: Subject) -> Iterator[CheckResult]:
    """Run all checks of a subject, side by side where they can."""
    if subject.role == "strategy":
        prepare(subject.checks, subject.bench)
    for check in subject.checks:
        yield CheckResult(check, judge_check(check, subject.bench))


def counts(found: Iterable[CheckResult]) -> dict[str, int]:
    """Return how many checks have each status."""
    statuses = [finding.verdict.status for finding in found]
    return {status: statuses.count(status) for status in get_args(Status)}


def to_json(subject: Subject, found: Sequence[CheckResult]) -> dict[str, Any]:
    """Return the findings as plain data."""
    return {
        "role": subject.role,
        "name": subject.name,
        "checks": [
            {
                "check": finding.check.name,
                "status": finding.verdict.status,
                "message": finding.verdict.message,
                "sentence": finding.check.sentence,
            }
            for finding in found
        ],
        "counts": counts(found),
    }


def _named(name: str, plugins: Plugins) -> Iterator[tuple[Role, Any]]:
    if name.partition(":")[0] in plugins.strategies:
        yield "strategy", strategy_of(name, plugins.strategies)
    for role in get_args(Role)[1:]:
        offered = getattr(plugins, KINDS[role])
        if name in offered:
            yield role, show_entry(offered, name)


def _bench(
    role: Role,
    item: Any,  # noqa: ANN401 - any role
    plugins: Plugins,
    cases: Sequence[UpdatingProblem],
    seconds: float,
) -> Bench:
    if role == "strategy":
        named = plugins.strategies.values()
        reference = next((s for s in named if getattr(s, "cost_reference", False)), None)
        return Bench(item, reference=reference, cases=cases, seconds=seconds)
    helpers = tuple(plugins.readers.values()) if role == "scenario" else ()
    return Bench(item, helpers=helpers, seconds=seconds)
