"""Strategies ranked on cases: what ``bench run`` does."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from pydantic import TypeAdapter, ValidationError

from femubench.core.case.case import Case
from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.model import differ
from femubench.core.library.cases import CaseLike, as_list, case_words, read_cases, usable_plugins
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.validation import check_strategy, choose_names
from femubench.core.plugin.variants import Variant, label_variant, strategy_of
from femubench.core.roles import StrategyRole, list_declared
from femubench.core.run.companions import Companions, choose_companions
from femubench.core.run.executor import open_executor
from femubench.core.run.frames import modes_frame, results_frame
from femubench.core.run.recording import Progress
from femubench.core.run.runner import Plan, Receivers
from femubench.core.run.starts import Starts
from femubench.core.run.store import Store
from femubench.core.schema import records as serial, results
from femubench.core.schema.run_options import (
    DEFAULT_TIMEOUT,
    MOST_TWINS,
    RunKeywords,
    RunOptions,
    check_keywords,
    split_keywords,
)
from femubench.core.score.bounded_gain import Rule
from femubench.core.score.leaderboard import is_test, leaderboard
from femubench.core.score.ranking import rank_results
from femubench.core.study.gain import gain_by
from femubench.core.twin.twins import Twin, twins_of

if TYPE_CHECKING:
    import pandas as pd

StrategyLike = str | StrategyRole | type[StrategyRole]
DEFAULT_STORE = "femubench-results"


@dataclass(frozen=True, kw_only=True)
class Request(RunOptions):
    """What decides on the results of a run, in words that can be kept with it and asked for again.

    Arguments:
        cases: names of scenarios or of their cases, and absolute folders.
        strategies: names, with options.
    """

    cases: tuple[str, ...]
    strategies: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        how = {"resume", "overwrite"}
        plain: dict[str, Any] = TypeAdapter(Request).dump_python(self, mode="json", exclude=how)
        return plain


def request_of(run: results.RunData) -> Request:
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


class Run(results.RunData):
    """All results of one run, with the tables that one looks at."""

    @classmethod
    def of(cls, run: results.RunData) -> Run:
        """Return a run as one that has tables."""
        return cls(run.meta, run.results, run.companions)

    @property
    def table(self) -> pd.DataFrame:
        """Return one row a job: status, errors by block, counts, gain and rank.

        Columns: case strategy seed nominal status reason seconds; ``used_percent``, ``used_mac``
        and the same for ``higher`` and ``modified`` (nan where the case has no such block);
        ``responses_db``, ``responses_floor_db`` and ``responses_deg`` of held-out responses;
        rigid_body_modes rigid_body_modes_expected negative_eigenvalues unphysical
        parameter_count evaluations gain rank. Of a study also the values of its axes:
        ``plain_case`` and ``plain_strategy``, noise, sensors_left_out, and every option as
        ``STRATEGY.OPTION``.

        Examples:
            >>> list(femubench.Run.of(run).table.columns[:3])
            ['case', 'strategy', 'seed']
        """
        return results_frame(self)

    @property
    def modes(self) -> pd.DataFrame:
        """Return one row a measured mode of every job that is ok.

        Columns: case strategy seed nominal block modification mode measured_hz predicted_hz
        error_percent counted_percent mac predicted_std_hz. The error is signed, (f_p / f_m - 1),
        and nan for a mode without partner or with an imaginary one; `counted_percent` is what the
        rms takes, 100 for such a mode.

        Examples:
            >>> list(femubench.Run.of(run).modes.columns[:3])
            ['case', 'strategy', 'seed']
        """
        return modes_frame(self)

    @property
    def leaderboard(self) -> pd.DataFrame:
        """Return one row a strategy, best first."""
        return leaderboard(self)

    def scored_by(self, words: Iterable[str]) -> Run:
        """Return the run scored by a rule with other numbers.

        Arguments:
            words: ``KEY=VALUE`` each, fields of `results.Rule`; none for the rule that it has.

        Raises:
            InputError: for a field that there is none of, a value out of its bounds, or a run that
                keeps too little to be scored again.

        Examples:
            >>> femubench.Run.of(run).scored_by(["cap=0.2"]).meta["rule"]["version"]
            '1 cap'
        """
        if not (listed := list(words)):
            return self
        meta = {**self.meta, "rule": Rule.of(self.meta).changed(listed).to_json()}
        return Run(meta, rank_results(self.results, meta), self.companions)

    def gain_by(self, *axes: str) -> pd.DataFrame:
        """Return one row a cell: the values of the axes, gain, and how many of its jobs failed.

        The gain of a cell is that of the leaderboard with nothing else on it: cases are taken
        together with every structure counted once, and so are the values of the axes left out; with
        several seeds it is the mean over them. `gain_low` and `gain_high` are its 95 % interval,
        over structures where there are six or more, else over seeds. A job that failed or is
        missing counts as the model that was given. Of an axis of options there are the cells of its
        strategy alone, unless ``strategy`` is an axis too: then the others have none there.

        Arguments:
            axes: ``noise``, ``sensors_left_out``, ``strategy``, ``STRATEGY.OPTION``, ``case``,
                ``nominal``; without any, those with more than one value, cases taken together.

        Raises:
            InputError: for an axis that the run does not have.

        Examples:
            >>> femubench.Run.of(run).gain_by("strategy")["gain"].round(2).tolist()
            [-0.67, 0.6]
        """
        return gain_by(self, *axes)

    def rows(self) -> list[tuple[str, str]]:
        """Return what was run, and who leads."""
        board = self.leaderboard[["rank", "strategy", "gain"]].to_dict("records")
        return [
            *super().rows(),
            *(
                (f"{row['rank']:.0f}. {row['strategy']}", f"gain {row['gain']:.3f}")
                for row in board
                if row["rank"] == row["rank"]
            ),
        ]


def rank(
    cases: CaseLike | Iterable[CaseLike] = (),
    strategies: StrategyLike | Iterable[StrategyLike] = (),
    *,
    store: Store | str | PathLike[str] | None = None,
    progress: Progress | None = None,
    **keywords: Unpack[RunKeywords],
) -> Run:
    """Run strategies on cases, each job in a process of its own, and rank them.

    Arguments:
        cases: names, folders or `Case`s; the default set where there is none.
        strategies: names (``"NAME:OPTION=VALUE"`` with options), ``strategies[NAME](...)``,
            classes or instances, also of a notebook; all that are installed where there is none.
        store: folder that keeps the results.
        progress: called with (result, jobs done, jobs in all).
        keywords: what is computed, and where: ``seeds``, ``seed``, ``nominal``, ``drawing``,
            ``twins`` (a number, or that and a seed), ``resume``, ``overwrite``, ``timeout``,
            ``timeouts``, ``memory``; ``jobs``, ``cluster``, ``sandbox``.

    Raises:
        InputError: for an unknown name, an option that does not exist, or a faulty case.

    Examples:
        >>> femubench.rank(case, [nominal, scaled]).leaderboard["gain"].round(2).tolist()
        [0.0, -0.14]
        >>> len(femubench.rank(case, nominal, nominal="drawn", timeout=60.0, jobs=1).results)
        1
    """
    check_keywords(keywords, RunKeywords)
    given, place = split_keywords(keywords)
    kept = None if store is None else store_in(store)
    plan = plan_run(cases, strategies, usable_plugins(), given, kept)
    with open_executor(place) as executor:
        return Run.of(plan.run(executor, Receivers(kept, progress)))


def plan_run(
    cases: CaseLike | Iterable[CaseLike],
    strategies: StrategyLike | Iterable[StrategyLike],
    plugins: Plugins,
    given: Mapping[str, Any],
    store: Store | None = None,
) -> Plan:
    """Return what is to be run; nothing has been run when something is wrong with it.

    Arguments:
        given: options by field of `RunOptions`, as `split_keywords` has them.
        store: whose last run is meant where the run resumes, and has neither cases nor strategies.
    """
    words, wanted = as_list(cases), as_list(strategies)
    resumed = store if store is not None and given.get("resume") and store.runs() else None
    if resumed is not None and not words and not wanted:
        return plan_again(
            _changed(request_of(results.RunData(resumed.read_start(), ())), given), plugins
        )
    found = _strategies(wanted, plugins)
    read = read_cases(cases, plugins, given.get("drawing", ""))
    if not wanted:  # without responses, those that need them would be a line of refusals each
        missing = {"responses"} if all(case.split is None for case in read) else set()
        found = [s for s in found if not missing & set(list_declared(s, "needs"))]
        found = [s for s in found if not getattr(s, "on_request", False)]
    plain = all(isinstance(item, (str, PathLike)) for item in words)
    request = Request(
        cases=case_words(map(str, words), plugins) if plain else tuple(c.name for c in read),
        strategies=tuple(strategy.name for strategy in found),
        **given,
    )
    request = replace(request, twin_seed=_twin_seed(request, resumed))
    names_only = plain and all(isinstance(item, str) for item in wanted)
    return _plan(request, read, found, plugins, repeatable=names_only)


def _changed(request: Request, given: Mapping[str, Any]) -> Request:
    """Return the request of a run that goes on, under other limits where some are given.

    Raises:
        InputError: for an option that would make it another run.
    """
    for name in ("seeds", "seed", "nominal", "drawing", "twins"):
        if name in given and (name, given[name]) != ("twins", 0):
            raise InputError(
                f"--resume alone goes on as before; {name} needs CASE or -s next to it"
            )
    if {"timeout", "timeouts"} & given.keys():
        request = replace(request, timeout=DEFAULT_TIMEOUT, timeouts={})
    how = ("timeout", "timeouts", "memory", "resume", "overwrite")
    return replace(request, **{name: given[name] for name in how if name in given})


def plan_again(request: Request, plugins: Plugins) -> Plan:
    """Return the plan of what was asked for before."""
    cases = read_cases(request.cases, plugins, request.drawing)
    strategies = _strategies(request.strategies, plugins)
    return _plan(request, cases, strategies, plugins)


def _plan(
    request: Request,
    cases: Sequence[Case],
    strategies: Sequence[StrategyRole],
    plugins: Plugins,
    *,
    repeatable: bool = True,
) -> Plan:
    """Return a plan with textbook models and twins.

    Arguments:
        repeatable: whether the words of the request say it all.

    Raises:
        InputError: for a time limit of a strategy that does not run.
    """
    choose_names("strategy to limit", request.timeouts, [strategy.name for strategy in strategies])
    classes = classes_of(plugins)
    classes |= {case.name: classes.get(case.structure, ()) for case in cases if case.drawing}
    drawn: Sequence[Twin] = ()
    others = Companions()
    if request.twins:
        drawn = draw_twins_of(cases, classes, request.twins, request.twin_seed or 0)
        others = choose_companions(cases, drawn, request.twins, request.twin_seed or 0)
    starts = Starts(textbook_of([*cases, *drawn]), request.nominal, classes, others)
    kept = request.to_json() if repeatable else {"nominal": request.nominal}
    return Plan(cases, strategies, request, starts, kept)


def draw_twins_of(
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


def _twin_seed(request: Request, resumed: Store | None) -> int:
    """Return what twins are drawn from: a seed given, that of the last run, or one by chance."""
    number, seed = request.twins, request.twin_seed
    if not 0 <= number <= MOST_TWINS:
        raise InputError(f"{number} twins", expected=f"0 to {MOST_TWINS}")
    if not number or seed is not None:
        return seed or 0
    if resumed is not None:
        kept = resumed.read_start().get("request") or {}
        if kept.get("twins") == number:
            return int(kept["twin_seed"])
    return secrets.randbelow(2**31)


def textbook_of(cases: Sequence[Case]) -> dict[str, Case]:
    """Return the cases with their textbook models by name, without those that have none.

    They are made of this package's own effects: no plugin moves what all are measured against.
    """
    from femubench.core.effect.textbook import textbook_model
    from femubench.core.plugin.loader import list_effects

    known = list_effects()
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


def _strategies(given: Sequence[object], plugins: Plugins) -> list[StrategyRole]:
    """Return the strategies that are asked for, each once, all where none is given.

    Raises:
        InputError: for an unknown one, or where there is none at all.
        PluginError: for an object that is no strategy.
    """
    wanted = [item for i, item in enumerate(given) if item not in given[:i]]
    words = [word for word in wanted if isinstance(word, str)]
    choose_names("strategy", (word.partition(":")[0] for word in words), plugins.strategies)
    found = [
        strategy_of(item, plugins.strategies)
        if isinstance(item, str)
        else name_strategy(item, plugins)
        for item in wanted or plugins.strategies
    ]
    if not found:
        raise InputError("there is no strategy to run", expected="a plugin that brings one")
    return found


def name_strategy(given: object, plugins: Plugins) -> StrategyRole:
    """Return a strategy under a name that tells its options where they are not the usual ones."""
    strategy = check_strategy(given.base if isinstance(given, Variant) else given)
    usual = plugins.strategies.get(strategy.name)
    variant = given if isinstance(given, Variant) else None
    if variant is None:
        variant = label_variant(strategy, usual if type(usual) is type(strategy) else None)
    return strategy if variant.name == strategy.name else variant


def store_in(folder: Store | str | PathLike[str] | None = None) -> Store:
    """Return a store: given, in a folder, in FEMUBENCH_STORE, or in the default folder here."""
    if isinstance(folder, Store):
        return folder
    return Store(Path(folder or os.environ.get("FEMUBENCH_STORE") or DEFAULT_STORE))


def read_run(
    run: results.RunData | str | PathLike[str] | None = None,
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
        >>> femubench.read_run(file).leaderboard["gain"].round(2).tolist()
        [0.6, -0.67]
    """
    if isinstance(run, results.RunData):
        return Run.of(run)
    if run is not None and os.path.exists(run) and not os.path.isdir(run):
        return Run.of(serial.read_run(Path(run)))
    return Run.of(store_in(store).load(None if run is None else str(run)))
