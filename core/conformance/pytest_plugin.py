"""A pytest plugin: ``--femubench my-method`` adds the conformance checks; a fixture takes times.

Nothing but pytest is imported until the option or the fixture is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from femubench.core.conformance import SECONDS

if TYPE_CHECKING:
    from femubench.core.conformance.checking import Subject
    from femubench.core.conformance.kit import Check
    from femubench.core.update.strategy import UpdateResult

_WARNINGS = pytest.StashKey[list[str]]()
# Case: strategy: median in s, the strategies in the order in which they were timed.
_TIMES = pytest.StashKey[dict[str, dict[str, float]]]()


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


def pytest_configure(config: pytest.Config) -> None:
    """Offer the fixture, which depends on another only where that is installed."""
    timer = config.pluginmanager.hasplugin("benchmark")
    config.pluginmanager.register(_Speed() if timer else _NoSpeed(), "femubench-speed")


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


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:  # noqa: ANN401
    """Show what is no failure but should be known."""
    lines = config.stash.get(_WARNINGS, [])
    if lines:
        terminalreporter.section("femubench warnings")
        for line in lines:
            terminalreporter.line(line)
    for case, times in config.stash.get(_TIMES, {}).items():
        first, of_first = next(iter(times.items()))
        terminalreporter.section(f"median time of an update on {case}, as a multiple of {first}")
        for strategy, seconds in times.items():
            multiple = seconds / of_first
            terminalreporter.line(f"{strategy:24} {1e3 * seconds:9.3g} ms {multiple:9.3g}")


class _Speed:
    """The fixture where there is pytest-benchmark."""

    @pytest.fixture
    def strategy_speed(
        self,
        benchmark: Any,  # noqa: ANN401 - pytest-benchmark is untyped
        pytestconfig: pytest.Config,
    ) -> Callable[[str, str], UpdateResult]:
        """Time `update` with pytest-benchmark: ``strategy_speed("my-method", CASE)``.

        The arguments are those of ``bench run``: a strategy, with options where wanted, and a case
        by its name or folder. Times on one case share a group, so that one table compares them;
        below it stands the multiple of the median of the strategy that was timed first.
        """
        times = pytestconfig.stash.setdefault(_TIMES, {})
        return partial(_timed, benchmark, times)


class _NoSpeed:
    """The fixture where there is none."""

    @pytest.fixture
    def strategy_speed(self) -> None:
        """Skip the test."""
        pytest.skip("strategy_speed needs pytest-benchmark: pip install pytest-benchmark")


def _timed(
    benchmark: Any,  # noqa: ANN401 - pytest-benchmark is untyped
    times: dict[str, dict[str, float]],
    strategy: str,
    case: str,
) -> UpdateResult:
    """Return what the strategy gives; its time goes into the table of the benchmark."""
    import numpy as np
    from threadpoolctl import threadpool_limits

    from femubench.core.case.reader import read_case
    from femubench.core.errors import NotApplicable
    from femubench.core.plugin.loader import load_plugins
    from femubench.core.plugin.variants import strategy_of

    plugins = load_plugins()
    update = strategy_of(strategy, plugins.strategies).update
    owner = next((s for s in plugins.scenarios.values() if case in s.cases), None)
    folder = Path(case) if owner is None else owner.folder(case)
    readers = tuple(plugins.readers.values())
    read = read_case(folder, readers=readers, installed=owner is not None)
    given = read.used_measurement()
    benchmark.group = f"update on {case}"
    try:
        with threadpool_limits(1):  # as `bench run` does
            result: UpdateResult = benchmark(
                lambda: update(read.model, given, np.random.default_rng(0))
            )
    except NotApplicable as reason:
        pytest.skip(f"{strategy} on {case}: {reason}")
    if benchmark.stats is not None:  # --benchmark-disable calls once and takes no time
        times.setdefault(case, {})[strategy] = benchmark.stats.stats.median
    return result


class _Kit(pytest.Collector):
    """All checks of one plugin."""

    def __init__(self, *, subject: Subject, **rest: Any) -> None:  # noqa: ANN401 - pytest's own
        super().__init__(**rest)
        self.subject = subject

    def collect(self) -> Iterator[pytest.Item]:
        for check in self.subject.checks:
            yield _CheckItem.from_parent(self, name=check.name, check=check)


class _CheckItem(pytest.Item):
    """One check."""

    parent: _Kit

    def __init__(self, *, check: Check, **rest: Any) -> None:  # noqa: ANN401 - pytest's own
        super().__init__(**rest)
        self.check = check

    def runtest(self) -> None:
        from femubench.core.conformance.kit import judge_check, prepare

        bench = self.parent.subject.bench
        if self.check.role == "strategy":
            same = (item for item in self.session.items if isinstance(item, _CheckItem))
            prepare([item.check for item in same if item.parent is self.parent], bench)
        verdict = judge_check(self.check, bench)
        if verdict.status == "fail":
            raise ConformanceError(verdict.message)
        if verdict.status == "not-applicable":
            pytest.skip(verdict.message)
        if verdict.status == "warn":
            self.config.stash[_WARNINGS].append(f"{self.nodeid}: {verdict.message}")

    def repr_failure(self, excinfo: Any, style: Any = None) -> Any:  # noqa: ANN401 - pytest's own
        if isinstance(excinfo.value, ConformanceError):
            return f"{self.parent.subject.name}: {self.check.name}: {excinfo.value}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[str, None, str]:
        return "femubench", None, self.nodeid
