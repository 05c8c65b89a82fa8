"""Strategies ranked on cases: what ``bench run`` does."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from femubench.core.case.case import Case
from femubench.core.child.sandbox import Sandbox
from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.model import differ
from femubench.core.files import make_folder
from femubench.core.library.cases import CaseLike, case_words, listed, read_cases, usable_plugins
from femubench.core.pace import Told
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.validation import check_strategy, chosen
from femubench.core.plugin.variants import Variant, labelled, strategy_of
from femubench.core.roles import Strategy
from femubench.core.run.beside import Beside, beside
from femubench.core.run.executor import Executor, executor_of
from femubench.core.run.frames import modes_frame, results_frame
from femubench.core.run.recording import Overwrite, Progress
from femubench.core.run.runner import run_jobs
from femubench.core.run.starts import Start, Starts
from femubench.core.run.store import Store
from femubench.core.schema import records as serial, results
from femubench.core.score.leaderboard import is_test, leaderboard
from femubench.core.study.skill import skill_by
from femubench.core.twin.twins import Twin, twins_of

if TYPE_CHECKING:
    import pandas as pd

StrategyLike = str | Strategy | type[Strategy]
DEFAULT_STORE = "femubench-results"
DEFAULT_TIMEOUT = 600.0  # s
MOST_TWINS = 100
Twins = int | tuple[int, int | None]  # how many, and from which seed; None draws one
_Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True)
class Request:
    """What decides on the results of a run, in words that can be kept with it and asked for again.

    Arguments:
        cases: names of scenarios or of their cases, and absolute folders.
        strategies: names, with options.
        seeds: number of draws of noise; None for the data as recorded.
        seed: the first one.
        nominal: the model that all start from, as drawn, with its textbook values, or both.
        timeout: seconds that a job may take.
        timeouts: the same for single strategies.
        memory: bytes that a job may take; None for an even share.
        twins: of every case whose truth was computed.
        twin_seed: from which they are drawn.
    """

    cases: tuple[str, ...]
    strategies: tuple[str, ...]
    seeds: Annotated[int, Field(ge=1)] | None = None
    seed: Annotated[int, Field(ge=0)] = 0
    nominal: Start = "both"
    timeout: _Seconds = DEFAULT_TIMEOUT
    timeouts: Mapping[str, _Seconds] = field(default_factory=dict)
    memory: Annotated[int, Field(ge=1)] | None = None
    twins: Annotated[int, Field(ge=0, le=MOST_TWINS)] = 0
    twin_seed: Annotated[int, Field(ge=0)] = 0

    @property
    def all_seeds(self) -> range:
        """Return the seeds: 0 is the data as recorded, several are draws of noise and no other."""
        first = self.seed if self.seeds is None else self.seed + 1
        return range(first, first + (self.seeds or 1))

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        plain: dict[str, Any] = TypeAdapter(Request).dump_python(self, mode="json")
        return plain


def request_of(run: results.Run) -> Request:
    """Return what a stored run was asked for.

    Raises:
        InputError: when it was not kept, as by earlier versions and by calls from Python.
    """
    kept = run.meta.get("request")
    if isinstance(kept, Mapping) and "study" in kept:
        what = f"run {run.meta.get('run')} is a study"
        raise InputError(what, expected="`bench study FILE`, which goes on where it stopped")
    if not isinstance(kept, Mapping) or not {"cases", "strategies"} <= kept.keys():
        what = f"run {run.meta.get('run')} does not tell what it was asked for"
        raise InputError(what, expected="a run of `bench run` of this version")
    try:
        found = TypeAdapter(Request).validate_python(dict(kept))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        what = f"request of run {run.meta.get('run')}: {where}: {first['msg']}"
        raise InputError(what, expected="what `bench run` keeps") from error
    return replace(found, timeouts=dict(found.timeouts))


class Run(results.Run):
    """All results of one run, with the tables that one looks at."""

    @classmethod
    def of(cls, run: results.Run) -> Run:
        """Return a run as one that has tables."""
        return cls(run.meta, run.results, run.beside)

    @property
    def table(self) -> pd.DataFrame:
        """Return one row a job: status, errors by block, counts, score and rank."""
        return results_frame(self)

    @property
    def modes(self) -> pd.DataFrame:
        """Return one row a measured mode of every job that is ok."""
        return modes_frame(self)

    @property
    def leaderboard(self) -> pd.DataFrame:
        """Return one row a strategy, best first."""
        return leaderboard(self)

    def skill_by(self, *axes: str) -> pd.DataFrame:
        """Return one row a cell of a study; see `femubench.results.skill_by`."""
        return skill_by(self, *axes)

    def rows(self) -> list[tuple[str, str]]:
        """Return what was run, and who leads."""
        board = self.leaderboard[["rank", "strategy", "skill"]].itertuples(index=False)
        return [
            *super().rows(),
            *((f"{r}. {name}", f"skill {skill:.3f}") for r, name, skill in board),
        ]


@dataclass(frozen=True)
class Plan:
    """What a run is asked for, with all that it stands for.

    Arguments:
        request: in words.
        cases, strategies: that they stand for.
        textbook: the cases with their textbook models by name, where those differ.
        classes: kinds of structure and truth by case.
        beside: twins of the cases, and what runs twice.
        repeatable: whether the words say it all.
    """

    request: Request
    cases: Sequence[Case]
    strategies: Sequence[Strategy]
    textbook: Mapping[str, Case]
    classes: Mapping[str, Sequence[str]]
    beside: Beside
    repeatable: bool = True

    @property
    def jobs(self) -> int:
        """Return the number of jobs."""
        models = sum(1 for _ in self.starts.of_all(self.cases))
        return models * len(self.strategies) * len(self.request.all_seeds)

    @property
    def starts(self) -> Starts:
        """Return the nominal models of the cases."""
        return Starts(self.textbook, self.request.nominal, self.classes, self.beside)

    def run(
        self,
        jobs: int | None = None,
        store: Store | None = None,
        executor: Executor | None = None,
        *,
        overwrite: Overwrite | None = None,
        resume: bool = False,
        progress: Progress | None = None,
        told: Told | None = None,
    ) -> Run:
        """Run every strategy on every case with every seed; see `rank`.

        Arguments:
            executor: what runs the jobs, from `executor_of`; None for `jobs` workers here.
        """
        if store is not None:
            make_folder(store.folder)
        asked = self.request
        return Run.of(
            run_jobs(
                self.cases,
                self.strategies,
                seeds=tuple(asked.all_seeds),
                jobs=jobs,
                timeout=asked.timeout,
                timeouts=asked.timeouts,
                memory=asked.memory,
                store=store,
                overwrite=overwrite,
                resume=resume,
                progress=progress,
                told=told,
                run_seed=asked.seed,
                request=asked.to_json() if self.repeatable else {"nominal": asked.nominal},
                starts=self.starts,
                executor=executor,
            )
        )


def rank(
    cases: CaseLike | Iterable[CaseLike] = (),
    strategies: StrategyLike | Iterable[StrategyLike] = (),
    *,
    seeds: int | None = None,
    seed: int | None = None,
    nominal: Start | None = None,
    jobs: int | None = None,
    timeout: float | None = None,
    timeouts: Mapping[str, float] | None = None,
    memory: int | None = None,
    store: Store | str | PathLike[str] | None = None,
    overwrite: Overwrite | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    scheduler: str | None = None,
    cluster: str | None = None,
    twins: Twins = 0,
    sandbox: Sandbox = "auto",
) -> Run:
    """Run strategies on cases, each job in a process of its own, and rank them.

    Arguments:
        cases: names, folders or `Case`s; the default set where there is none.
        strategies: names (``"NAME:OPTION=VALUE"`` with options), ``strategies[NAME](...)``,
            classes or instances, also of a notebook; all that are installed where there is none.
        seeds, seed: number of draws of noise, None for the data as recorded; the first seed.
        nominal: the model to start from, ``drawn``, ``textbook`` (handbook values) or ``both``.
        timeout, timeouts: seconds that a job may take, 600 by default; of single strategies.
        memory, store: bytes that a job may take; folder that keeps the results.
        overwrite: computes anew ``always`` (default), ``missing`` nothing, ``failed`` (resumed).
        resume: go on with the last run of these jobs in the store; of any without words for them.
        progress: called with (result, jobs done, jobs in all).
        jobs: number of worker processes, or of Slurm jobs; None for one a processor.
        scheduler, cluster: ``tcp://HOST:PORT`` of Dask; ``local:N`` or ``slurm:QUEUE`` to start.
        twins: number of each case whose truth was computed, or that and a seed.
        sandbox: of strategies: ``auto``, where that is possible; ``require``; ``off``.

    Raises:
        InputError: for an unknown name, an option that does not exist, or a faulty case.

    Examples:
        >>> femubench.rank(case, [nominal, scaled]).leaderboard["skill"].round(2).tolist()
        [0.0, -0.15]
    """
    kept = None if store is None else store_in(store)
    plan = plan_of(
        *(cases, strategies, usable_plugins()),
        seeds=seeds,
        seed=seed,
        nominal=nominal,
        timeout=timeout,
        timeouts=timeouts,
        memory=memory,
        resumed=kept if resume else None,
        twins=twins,
    )
    with executor_of(jobs, scheduler, cluster, sandbox) as where:
        return plan.run(None, kept, where, overwrite=overwrite, resume=resume, progress=progress)


def plan_of(
    cases: CaseLike | Iterable[CaseLike],
    strategies: StrategyLike | Iterable[StrategyLike],
    plugins: Plugins,
    *,
    seeds: int | None = None,
    seed: int | None = None,
    nominal: Start | None = None,
    timeout: float | None = None,
    timeouts: Mapping[str, float] | None = None,
    memory: int | None = None,
    resumed: Store | None = None,
    twins: Twins = 0,
) -> Plan:
    """Return what is to be run; nothing has been run when something is wrong with it.

    Arguments:
        plugins: where cases and strategies come from.
        resumed: the store whose last run is meant where neither cases nor strategies are given.
        twins: of every case whose truth was computed.
    """
    words, wanted = listed(cases), listed(strategies)
    number, twin_seed = (twins, None) if isinstance(twins, int) else twins
    if resumed is not None and not words and not wanted and resumed.runs():
        own = ("seeds", seeds), ("seed", seed), ("nominal", nominal), ("twins", number or None)
        for name, value in own:
            if value is not None:
                what = f"--resume alone goes on as before; {name} needs CASE or -s beside it"
                raise InputError(what)
        request = request_of(results.Run(resumed.begun(), ()))
        if timeout is not None or timeouts:
            request = replace(request, timeout=timeout or DEFAULT_TIMEOUT, timeouts=timeouts or {})
        request = request if memory is None else replace(request, memory=memory)
        return repeated(request, plugins)
    found = _strategies(wanted, plugins)
    read = read_cases(cases, plugins)
    plain = all(isinstance(item, (str, PathLike)) for item in words)
    return _planned(
        Request(
            cases=case_words(map(str, words), plugins) if plain else tuple(c.name for c in read),
            strategies=tuple(strategy.name for strategy in found),
            seeds=seeds,
            seed=seed or 0,
            nominal=nominal or "both",
            timeout=DEFAULT_TIMEOUT if timeout is None else timeout,
            timeouts=_known(timeouts or {}, found),
            memory=memory,
            twins=number,
            twin_seed=_twin_seed(number, twin_seed, resumed),
        ),
        read,
        found,
        classes_of(plugins),
        repeatable=plain and all(isinstance(item, str) for item in wanted),
    )


def _planned(
    request: Request,
    cases: Sequence[Case],
    strategies: Sequence[Strategy],
    classes: Mapping[str, Sequence[str]],
    *,
    repeatable: bool = True,
) -> Plan:
    """Return a plan with textbook models and twins; arguments as those of `Plan`."""
    drawn: Sequence[Twin] = ()
    others = Beside()
    if request.twins:
        drawn = drawn_twins(cases, classes, request.twins, request.twin_seed)
        others = beside(cases, drawn, request.twins, request.twin_seed)
    textbook = textbook_of([*cases, *drawn])
    return Plan(request, cases, strategies, textbook, classes, others, repeatable)


def drawn_twins(
    cases: Sequence[Case], classes: Mapping[str, Sequence[str]], number: int, seed: int
) -> list[Twin]:
    """Return twins of the cases whose truth was computed.

    Of what was measured it is not known how a similar structure would have been.

    Arguments:
        classes: kinds of structure and truth by case.
        number, seed: of twins of each case, and what they are drawn from.
    """
    computed = [case for case in cases if not is_test(classes.get(case.name))]
    return list(twins_of(computed, number, seed))


def _twin_seed(number: int, seed: int | None, resumed: Store | None) -> int:
    """Return what twins are drawn from: a seed given, that of the last run, or one by chance."""
    if not 0 <= number <= MOST_TWINS:
        raise InputError(f"{number} twins", expected=f"0 to {MOST_TWINS}")
    if not number or seed is not None:
        return seed or 0
    if resumed is not None and resumed.runs():
        kept = resumed.begun().get("request") or {}
        if kept.get("twins") == number:
            return int(kept["twin_seed"])
    return secrets.randbelow(2**31)


def repeated(request: Request, plugins: Plugins) -> Plan:
    """Return the plan of what was asked for before."""
    found = _strategies(request.strategies, plugins)
    _known(request.timeouts, found)
    return _planned(request, read_cases(request.cases, plugins), found, classes_of(plugins))


def textbook_of(cases: Sequence[Case]) -> dict[str, Case]:
    """Return the cases with their textbook models by name, without those that have none.

    They are made of this package's own effects: no plugin moves what all are measured against.
    """
    from femubench.core.effect.textbook import textbook_model
    from femubench.core.plugin.loader import registered_effects

    known = registered_effects()
    found = {}
    for case in cases:
        with suppress(NotApplicable):
            model = textbook_model(case.model, known)
            if differ(model, case.model):
                digest = hashlib.sha256(f"textbook of {case.digest}".encode()).hexdigest()
                found[case.name] = replace(case, model=model, digest=digest)
    return found


def classes_of(plugins: Plugins) -> dict[str, tuple[str, ...]]:
    """Return kinds of structure and truth by case."""
    listed = plugins.scenarios.values()
    return {case: scenario.classes for scenario in listed for case in scenario.cases}


def _strategies(given: Sequence[object], plugins: Plugins) -> list[Strategy]:
    """Return the strategies that are asked for, each once, all where none is given.

    Raises:
        InputError: for an unknown one, or where there is none at all.
        PluginError: for an object that is no strategy.
    """
    wanted = [item for i, item in enumerate(given) if item not in given[:i]]
    words = [word for word in wanted if isinstance(word, str)]
    chosen("strategy", (word.partition(":")[0] for word in words), plugins.strategies)
    found = [
        strategy_of(item, plugins.strategies) if isinstance(item, str) else named(item, plugins)
        for item in wanted or plugins.strategies
    ]
    if not found:
        raise InputError("there is no strategy to run", expected="a plugin that brings one")
    return found


def named(given: object, plugins: Plugins) -> Strategy:
    """Return a strategy under a name that tells its options where they are not the usual ones."""
    strategy = check_strategy(given.base if isinstance(given, Variant) else given)
    usual = plugins.strategies.get(strategy.name)
    variant = given if isinstance(given, Variant) else None
    if variant is None:
        variant = labelled(strategy, usual if type(usual) is type(strategy) else None)
    return strategy if variant.name == strategy.name else variant


def _known(timeouts: Mapping[str, float], strategies: Iterable[Strategy]) -> dict[str, float]:
    """Make sure that every time limit is for a strategy that runs.

    Raises:
        InputError: for another name.
    """
    chosen("strategy to limit", timeouts, [strategy.name for strategy in strategies])
    return dict(timeouts)


def store_in(folder: Store | str | PathLike[str] | None = None) -> Store:
    """Return a store: given, in a folder, in FEMUBENCH_STORE, or in the default folder here."""
    if isinstance(folder, Store):
        return folder
    return Store(Path(folder or os.environ.get("FEMUBENCH_STORE") or DEFAULT_STORE))


def read_run(
    run: results.Run | str | PathLike[str] | None = None,
    store: Store | str | PathLike[str] | None = None,
) -> Run:
    """Return a run.

    Arguments:
        run: a file that ``run --json`` wrote, a run id or its first letters; None for the last.
        store: where runs are kept.

    Raises:
        InputError: when there is no such run, or it cannot be read.

    Examples:
        >>> file = femubench.report(run, "results.json")
        >>> femubench.read_run(file).leaderboard["skill"].round(2).tolist()
        [0.47, -1.97]
    """
    if isinstance(run, results.Run):
        return Run.of(run)
    if run is not None and os.path.exists(run) and not os.path.isdir(run):
        return Run.of(serial.read_run(Path(run)))
    return Run.of(store_in(store).load(None if run is None else str(run)))
