"""A run by its parts: what `rank` does, with an executor, starts and a store of the test's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

from femubench.core.case.case import Case
from femubench.core.roles import StrategyRole
from femubench.core.run.executor import Executor, open_executor
from femubench.core.run.runner import Plan, Receivers
from femubench.core.run.starts import Starts
from femubench.core.run.store import Store
from femubench.core.schema.results import RunData
from femubench.core.schema.run_options import RunOptions, split_keywords


def run_jobs(
    cases: Sequence[Case],
    strategies: Sequence[StrategyRole],
    options: RunOptions | None = None,
    *,
    executor: Executor | None = None,
    store: Store | None = None,
    progress: Callable[..., None] | None = None,
    starts: Starts | None = None,
    **keywords: Any,
) -> RunData:
    """Run every strategy on every case with every seed; keywords as of `rank`."""
    given, where = split_keywords(keywords)
    asked = replace(options or RunOptions(), **given)
    plan = Plan(cases, strategies, asked, starts or Starts())
    with open_executor(where) if executor is None else nullcontext(executor) as place:
        return plan.run(place, Receivers(store, progress))
