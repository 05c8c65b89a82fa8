"""Runs every (case, strategy, seed) in a process of its own and judges what comes back."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.child.limits import Limits
from femubench.core.errors import InputError
from femubench.core.files import make_folder
from femubench.core.pace import OnAdvance
from femubench.core.roles import StrategyRole
from femubench.core.run.executor import Executor
from femubench.core.run.provenance import home_of, plan_digest, run_meta
from femubench.core.run.recording import Progress, Results, begin_run, record_end
from femubench.core.run.schedule import Answers, Workload
from femubench.core.run.slots import Slots
from femubench.core.run.starts import Starts
from femubench.core.run.stopping import stopping
from femubench.core.run.store import Store
from femubench.core.schema.results import JobName, RunData, origins_of
from femubench.core.schema.run_options import RunOptions
from femubench.core.score.ranking import list_models, rank_results
from femubench.core.score.repeatability import unsteady
from femubench.core.score.scoring import Reference, reference_of


@dataclass(frozen=True)
class Receivers:
    """What takes the results of a run as they come.

    Arguments:
        progress: called with (result, jobs done, jobs in all).
        advance: called with how far that is which is not in the store, and how long the rest takes.
        keep_answer: takes the answer of every job that has a model, as the judge is given it.
    """

    store: Store | None = None
    progress: Progress | None = None
    advance: OnAdvance | None = None
    keep_answer: Callable[[JobName, bytes], None] | None = None


@dataclass(frozen=True)
class Plan:
    """A run before it is run: every strategy on every case with every seed.

    Arguments:
        cases, strategies: each under a name of its own.
        options: its seeds and limits, and which stored results it takes.
        starts: the nominal models, the cases as given where left out; and the twins.
        request: what was asked for, in plain data that is kept with the results.
    """

    cases: Sequence[Case]
    strategies: Sequence[StrategyRole]
    options: RunOptions = field(default_factory=RunOptions)
    starts: Starts = field(default_factory=Starts)
    request: Mapping[str, Any] = field(default_factory=dict)

    @property
    def jobs(self) -> int:
        """Return the number of jobs."""
        models = sum(1 for _ in self.starts.of_all(self.cases))
        return models * len(self.strategies) * len(self.options.all_seeds)

    @property
    def slots(self) -> Slots:
        """Return the jobs."""
        return Slots(self.starts.of_all(self.cases), self.strategies, self.options.all_seeds)

    def run(
        self, executor: Executor, receivers: Receivers = Receivers(), answers: Answers | None = None
    ) -> RunData:
        """Run the jobs, each in a process of its own.

        Ctrl-C lets the jobs that run come to their end, once more stops them; what is done is kept.

        Arguments:
            answers: of jobs that are not to be run, only judged.

        Raises:
            InputError: for two of one name, or a run that another process works on.
            ModelError: when the nominal model of a case cannot be solved.
        """
        cases, strategies, options = self.cases, self.strategies, self.options
        starts, store = self.starts, receivers.store
        _check_names(case=[*cases, *starts.companions.twins], strategy=strategies)
        if store is not None:
            make_folder(store.folder)
        executor.admit(strategies, options.memory)
        share = executor.share if options.memory is None else options.memory
        enclosure = executor.enclosure()
        asked: dict[str, Any] = {
            **{"seed": options.seed, "timeout": options.timeout, "memory": share},
            **{"jobs": executor.workers, "sandbox": enclosure.sandbox},
            **({"sandbox_reason": enclosure.reason} if enclosure.reason else {}),
        }
        limits = self._limits(Limits(options.timeout, share, sandbox=executor.sandbox), store)
        with threadpool_limits(1), ExitStack() as stack:
            references = starts.companions.add_repeated(self._solve_yardsticks())
            slots = self.slots
            asked |= {"request": dict(self.request), "plan": plan_digest(slots.keys)}
            about = starts.about(cases)
            about |= starts.companions.about(references, about["yardstick"])
            about["models"] = list_models(starts.predict(cases, references))
            yardsticks = {case.name: references[case.name] for case in cases}
            slots.meta = run_meta(cases, strategies, yardsticks, slots.seeds, asked, about)
            meta, known = begin_run(stack, store, slots.meta, options.overwrite, options.resume)
            ending = stack.enter_context(record_end(store, meta["run"]))
            results = Results(slots, store, meta["run"], receivers.progress, receivers.advance)
            wanted = stack.enter_context(stopping()).until(results.keep(known, executor.workers))
            keep = receivers.keep_answer
            workload = Workload(slots, references, limits, results.shelf, answers or {}, keep)
            for one in executor.compute(workload, wanted):
                results.add(*one)
            others, done = origins_of(meta), results.in_order()
            ranked = rank_results([r for r in done if r.case not in others], meta)
            found = RunData(meta, ranked, tuple(result for result in done if result.case in others))
            if origins_of(meta, "again"):
                ending["unsteady"] = unsteady(found)
        return replace(found, meta={**meta, **ending})

    def _limits(self, usual: Limits, store: Store | None) -> dict[str, Limits]:
        """Return the limits on the jobs of every strategy, and what they see."""
        # The module of a strategy may be in no folder of code.
        names = {home_of(strategy)[1] for strategy in self.strategies} - {"__main__"}
        files = {getattr(sys.modules.get(name), "__file__", None) for name in names}
        code = tuple(sorted(os.path.abspath(file) for file in files if file))
        # No strategy is to see the folders of the cases and of the results.
        folders = {c.folder.absolute() for c in self.cases if (c.folder / "case.toml").is_file()}
        folders |= {store.folder.absolute()} if store else set()
        usual = replace(usual, hidden=tuple(sorted(map(str, folders))), shown=code)
        own = self.options.timeouts
        return {
            strategy.name: replace(usual, seconds=own.get(strategy.name, usual.seconds))
            for strategy in self.strategies
        }

    def _solve_yardsticks(self) -> dict[str, Reference]:
        """Return what the yardstick of every case gives, solved once for those that share it."""
        solved: dict[tuple[int, int, int], Reference] = {}
        found = {}
        for case in map(self.starts.yardstick, (*self.cases, *self.starts.companions.twins)):
            same = id(case.model), id(case.measurement), id(case.modifications)
            if same not in solved:
                solved[same] = reference_of(case)
            found[case.name] = solved[same]
        return found


def _check_names(**given: Sequence[Case] | Sequence[StrategyRole]) -> None:
    for kind, things in given.items():
        names = [thing.name for thing in things]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"{kind} {twice[0]!r} occurs twice", expected="every name once")
