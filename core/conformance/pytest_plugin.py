"""A pytest plugin: ``pytest --femubench my-method`` adds one test for every conformance check.

Nothing but pytest is imported until that option is given.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from femubench.core.conformance import SECONDS

if TYPE_CHECKING:
    from femubench.core.conformance.checking import Subject
    from femubench.core.conformance.kit import Check

_WARNINGS = pytest.StashKey[list[str]]()


class ConformanceError(Exception):
    """A check that failed; its text is the one line that is shown."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("femubench")
    group.addoption(
        "--femubench",
        action="append",
        default=[],
        metavar="NAME",
        help="Check this femubench plugin: a strategy, effect, reader or scenario.",
    )
    group.addoption(
        "--femubench-timeout",
        type=float,
        default=SECONDS,
        metavar="SECONDS",
        help=f"What one trial of a check may take. Default: {SECONDS:g}.",
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Add the checks of every plugin that was named."""
    names = config.getoption("femubench")
    if not names:
        return
    config.stash[_WARNINGS] = []
    from femubench.core.conformance.checking import subjects
    from femubench.core.errors import InputError
    from femubench.core.plugin.loader import load_plugins

    plugins = load_plugins()
    seconds = config.getoption("femubench_timeout")
    for name in dict.fromkeys(names):
        try:
            found = subjects(name, plugins, seconds=seconds)
        except InputError as error:
            broken = "".join(f"\n{fault}" for fault in plugins.broken)
            raise pytest.UsageError(f"--femubench: {error}{broken}") from None
        for subject in found:
            # A name that several roles share needs the role to tell its tests apart.
            shown = name if len(found) == 1 else f"{name} ({subject.role})"
            node = _Kit.from_parent(
                session, name=shown, nodeid=f"femubench::{shown}", subject=subject
            )
            items.extend(node.collect())


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:  # noqa: ANN401
    """Show what is no failure but should be known."""
    lines = config.stash.get(_WARNINGS, [])
    if lines:
        terminalreporter.section("femubench warnings")
        for line in lines:
            terminalreporter.line(line)


class _Kit(pytest.Collector):
    """All checks of one plugin."""

    def __init__(self, *, subject: Subject, **rest: Any) -> None:  # noqa: ANN401 - pytest's own
        super().__init__(**rest)
        self.subject = subject

    def collect(self) -> Iterator[pytest.Item]:
        for check in self.subject.checks:
            yield _Item.from_parent(self, name=check.name, check=check)


class _Item(pytest.Item):
    """One check."""

    parent: _Kit

    def __init__(self, *, check: Check, **rest: Any) -> None:  # noqa: ANN401 - pytest's own
        super().__init__(**rest)
        self.check = check

    def runtest(self) -> None:
        from femubench.core.conformance.kit import judged, prepare

        bench = self.parent.subject.bench
        if self.check.role == "strategy":
            prepare(self._chosen(), bench)
        verdict = judged(self.check, bench)
        if verdict.status == "fail":
            raise ConformanceError(verdict.message)
        if verdict.status == "not-applicable":
            pytest.skip(verdict.message)
        if verdict.status == "warn":
            self.config.stash[_WARNINGS].append(f"{self.nodeid}: {verdict.message}")

    def _chosen(self) -> list[Check]:
        """Return the checks that run in this session, whose trials can run side by side."""
        same = (item for item in self.session.items if isinstance(item, _Item))
        return [item.check for item in same if item.parent is self.parent]

    def repr_failure(self, excinfo: Any, style: Any = None) -> Any:  # noqa: ANN401 - pytest's own
        if isinstance(excinfo.value, ConformanceError):
            return f"{self.parent.subject.name}: {self.check.name}: {excinfo.value}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[str, None, str]:
        return "femubench", None, self.nodeid
