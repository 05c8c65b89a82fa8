"""The leaderboard: one row a strategy over all structures and seeds of a run."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from femubench.core.case.drawn import DRAWN
from femubench.core.garbage import pause_collection
from femubench.core.schema.results import BLOCKS, JobResult, Nominal, RunData, origins_of
from femubench.core.score.bounded_gain import ModelErrors
from femubench.core.score.carried_answers import carried_answers
from femubench.core.score.ranking import TIE, Scale, rank_items, rank_results
from femubench.core.score.statistics import (
    FEWEST,
    METHOD,
    Differences,
    interval_of_mean,
    interval_tail,
    tell_apart,
)
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_Item = TypeVar("_Item")
TESTED = "published test"  # the class of a scenario whose data were measured
MUCH_WORSE = 1.25  # times the textbook model's error
# What is averaged over seeds, then over the cases of a structure, then over structures.
FIGURES = (
    *("gain", "error_gain", "change_gain", "error_percent", "band_percent", "shape_error"),
    "false_modes",
)
_COUNTS = ("parameter_count", "evaluations", "seconds")
COLUMNS = (
    *("rank", "strategy", "yardstick", "gain", "gain_low", "gain_high"),
    *("error_percent", "textbook_percent", "better_share", "worse_share"),
    *("error_gain", "change_gain"),
    *("gain_drawn", "gain_tests", "band_percent", "shape_error", "false_modes"),
    *(f"{block}_percent" for block in BLOCKS),
    *("responses_db", "responses_floor_db"),
    *("rigid_modes_lost", "negative_eigenvalues", "parameters", "evaluations", "seconds"),
    *("answered", "ok", "not_applicable", "total", "unphysical", "better_than", "worse_than"),
)


@dataclass(frozen=True)
class GainTable:
    """What the rows of a leaderboard are made from.

    Arguments:
        scale: what the results are measured by.
        names: strategies.
        cases: that count: those that hold data back, where one does.
        seeds: of the run.
        structures: of each case, by its place among them.
        expected: jobs of every strategy, those on cases that do not count with them.
        values: `FIGURES` by strategy, (cases, seeds, figures); what is missing counts as the model
            that was given, and on twins not at all; on twins an answer that is carried there from
            the case counts as the model that was given, where that gains less.
    """

    scale: Scale
    names: tuple[str, ...]
    cases: tuple[str, ...]
    seeds: tuple[int, ...]
    structures: tuple[str, ...]
    expected: int
    values: Mapping[str, FloatArray]

    @classmethod
    def of(
        cls,
        run: RunData,
        results: Iterable[JobResult],
        nominal: Nominal,
        origins: Mapping[str, str] | None = None,
    ) -> GainTable:
        """Return the figures of results.

        Arguments:
            run: that they belong to.
            nominal: the model that they started from.
            origins: from the twins that the results are on to their cases; those without a twin
                have no part.

        Raises:
            InputError: when the run keeps too little to be scored.
        """
        scale, listed = Scale.of(run.meta), list(results)
        named = run.meta.get("models") or {}
        cases = dict.fromkeys((*named, *(result.case for result in run.ranked)))
        if origins is not None:
            cases = dict.fromkeys(name for name in cases if name in set(origins.values()))
        for case in cases:
            scale.start(case, nominal)
        held = [case for case in cases if scale.holds_back(case)] or list(cases)
        seeds = {*run.meta.get("seeds", ()), *(result.seed for result in run.results)}
        names = tuple(dict.fromkeys(run.meta.get("strategies", ())))
        names += tuple(sorted({result.strategy for result in run.results} - set(names)))
        own = run.structures
        found: dict[tuple[str, str, int], list[FloatArray]] = defaultdict(list)
        carried = carried_answers(run, scale, listed, origins) if origins else ()
        for result in listed:
            case = result.case if origins is None else origins.get(result.case, "")
            if case in cases:
                job, errors = (result.strategy, case, result.seed), [scale.errors(result)]
                if job in carried:
                    errors.append(scale.start(result.case, nominal))
                rows = [_figures(scale, result.case, one) for one in errors]
                found[job].append(min(rows, key=lambda row: float(row[0])))
        # Who did not run on a twin has no gain there.
        given = {
            case: _figures(scale, case, scale.start(case, nominal))
            if origins is None
            else np.full(len(FIGURES), math.nan)
            for case in held
        }
        order = tuple(sorted(seeds))
        values = {
            name: np.array(
                [
                    np.mean(found.get((name, case, seed)) or [given[case]], axis=0)
                    for case in held
                    for seed in order
                ]
            ).reshape(len(held), len(order), len(FIGURES))
            for name in names
        }
        structures = tuple(own.get(case, case) for case in held)
        return cls(scale, names, tuple(held), order, structures, len(cases) * len(order), values)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Return the structures, each once."""
        return tuple(dict.fromkeys(self.structures))

    def by_structure(self, values: FloatArray, cases: Iterable[str] | None = None) -> FloatArray:
        """Return the mean over the cases of every structure, (structures, seeds, figures).

        Arguments:
            values: of one strategy, (cases, seeds, figures).
            cases: those that count; all where there are none.
        """
        chosen = frozenset(self.cases if cases is None else cases)
        owners = np.array([
            s if case in chosen else "" for case, s in zip(self.cases, self.structures, strict=True)
        ])  # fmt: skip
        units = [unit for unit in self.units if unit in owners]
        shape = (len(units), *values.shape[1:])
        return np.array([mean_known(values[owners == unit]) for unit in units]).reshape(shape)

    def gains(self, name: str) -> FloatArray:
        """Return the gain of a strategy on every structure, mean over the seeds, (structures,)."""
        return mean_known(np.moveaxis(self.by_structure(self.values[name])[:, :, 0], 1, 0))

    def means(self, values: FloatArray, cases: Iterable[str] | None = None) -> dict[str, float]:
        """Return the mean of `FIGURES` over structures and seeds; arguments as `by_structure`."""
        by_seed = np.moveaxis(self.by_structure(values, cases), 1, 0)
        return dict(zip(FIGURES, mean_known(mean_known(by_seed)).tolist(), strict=True))

    @property
    def interval(self) -> str:
        """Return what intervals are over: ``structures``, ``seeds`` or nothing."""
        return "structures" if len(self.units) >= FEWEST else "seeds" if len(self.seeds) > 1 else ""


@dataclass(frozen=True)
class Standings:
    """A run as a board has it: the table of each strategy that counts, and who differs.

    Arguments:
        run: what was run.
        own: on the cases.
        counted: by strategy the figures that count, on the cases or, where these are lower, on
            their twins, (cases, seeds, figures).
        apart: the differences that are shown.

    Attributes:
        TIE: gains that differ by less share a rank.
        FEWEST: structures from which on differences are tested.
        METHOD: how, in a sentence.
    """

    TIE: ClassVar[float] = TIE
    FEWEST: ClassVar[int] = FEWEST
    METHOD: ClassVar[str] = METHOD
    interval_tail = staticmethod(interval_tail)

    run: RunData
    own: GainTable
    counted: Mapping[str, FloatArray]
    apart: Differences

    @classmethod
    def of(cls, run: RunData) -> Standings:
        """Return the standings of a run.

        Raises:
            InputError: when the run keeps too little to be scored.
        """
        own = GainTable.of(run, run.ranked, run.nominals[0])
        counted = dict(own.values)
        if origins := origins_of(run.meta, "of"):
            twins = GainTable.of(run, run.companions, run.nominals[0], origins)
            rows = [own.cases.index(case) for case in twins.cases]
            for name, values in counted.items():
                other = values.copy()
                there = np.isfinite(twins.values[name][:, :, :1])
                other[rows] = np.where(there, twins.values[name], values[rows])
                counted[name] = min((values, other), key=lambda item: _mean_gain(own, item))
        gains = {n: own.by_structure(v)[:, :, 0].mean(axis=1) for n, v in counted.items()}
        return cls(run, own, counted, tell_apart(gains))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of the leaderboard, best first; the rank of a yardstick is None.

        Examples:
            >>> [round(row["gain"], 2) for row in results.Standings.of(run).rows]
            [0.6, -0.67]
        """
        return list_rows(self.run, self)

    @property
    def results(self) -> tuple[JobResult, ...]:
        """Return the results that make the ranks, with their gains and ranks.

        Examples:
            >>> [(round(one.gain, 2), one.rank) for one in results.Standings.of(run).results]
            [(-0.67, 2), (0.6, 1)]
        """
        return rank_results(self.run.ranked, self.run.meta)

    @property
    def drawings(self) -> dict[str, dict[str, tuple[dict[str, float], dict[str, float]]]]:
        """Return by further drawing and strategy the figures from the first drawing and from it.

        Over the cases of the run that have both; each against the textbook model of its own.

        Examples:
            >>> results.Standings.of(run).drawings
            {}
        """
        own, pairs = self.own, defaultdict[str, dict[str, str]](dict)
        for case in own.cases:
            first, _, drawing = case.rpartition(DRAWN)
            if first in own.cases:
                pairs[drawing][first] = case
        return {
            drawing: {
                name: (own.means(values, both), own.means(values, both.values()))
                for name, values in own.values.items()
            }
            for drawing, both in pairs.items()
        }

    def is_test(self, case: str) -> bool:
        """Tell whether a case was measured: what has no class is somebody's own structure."""
        return is_test((self.run.meta.get("classes") or {}).get(case))

    @staticmethod
    def basis_of(run: RunData) -> str:
        """Return on what the gain of a run is measured: ``unseen`` data, or the ``given`` modes.

        Examples:
            >>> results.Standings.basis_of(run)
            'unseen'
        """
        scale = Scale.of(run.meta)
        return "unseen" if any(map(scale.holds_back, scale.textbook)) else "given"

    @staticmethod
    def interval_of(run: RunData) -> str:
        """Return what the intervals of the gains are over: ``structures``, ``seeds`` or nothing.

        Examples:
            >>> results.Standings.interval_of(run)
            ''
        """
        return GainTable.of(run, (), run.nominals[0]).interval

    @staticmethod
    def ordered(
        items: Iterable[_Item], key: Callable[[_Item], tuple[tuple[float, ...], float, str]]
    ) -> list[_Item]:
        """Return items best first, those that share a rank by name.

        Arguments:
            key: tier, number and name; the tier counts first, then the number, less being better.

        Examples:
            >>> errors = {"b": 1.0, "a": 1.0, "c": 2.0}
            >>> results.Standings.ordered(errors, lambda name: ((), errors[name], name))
            ['a', 'b', 'c']
        """
        return [item for _, item in rank_items(items, key)]


def _mean_gain(table: GainTable, values: FloatArray) -> float:
    return float(table.by_structure(values)[:, :, 0].mean())


def _figures(scale: Scale, case: str, errors: ModelErrors) -> FloatArray:
    return np.array(list(scale.figures(case, errors).values()))


def mean_known(values: FloatArray) -> FloatArray:
    """Return the mean along the first axis of what is known; nan where nothing is."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), math.nan))


@pause_collection()
def leaderboard(run: RunData) -> pd.DataFrame:
    """Return one row a strategy, by gain; yardsticks stand in their place and have no rank.

    Strategies of one gain share a rank.

    `gain` is what a model gains over the textbook one, -1 to 1, mean over structures of the means
    of `error_gain`, of the frequencies out of the given band, and `change_gain`, of their changes
    by modifications; a job without a possible model counts as the model that was given. On twins
    it is theirs where that is lower. `gain_low` and `gain_high` are its 95 % bootstrap interval:
    over structures where there are enough of them, else over the seeds of those there are.
    `error_percent` is the error out of band, `better_share` and `worse_share` the shares of the
    structures where it is below the textbook model's, and above that by more than a quarter.
    `band_percent` is the error of modified modes in the given band, `shape_error` the mean
    1 - MAC, `false_modes` how many modes a test would see and did not. `gain_drawn` is the gain
    with which the strategy starts from the models as drawn, `gain_tests` that on tests alone,
    without computed truths; nan where there is no such difference. `used_percent` and the like are
    rms errors, medians over cases of the medians over seeds, of jobs that are ok; so are
    `parameters`, `evaluations` and `seconds`. Rigid-body modes lost and negative eigenvalues are
    sums. `better_than` and `worse_than` are the strategies of which a difference is shown.

    Arguments:
        run: with `rule`, `models`, `seeds` and `strategies` in its meta.

    Raises:
        InputError: when the run keeps too little to be scored.
    """
    import pandas as pd

    return pd.DataFrame(list_rows(run), columns=list(COLUMNS)).astype({"rank": float})


def list_rows(run: RunData, standings: Standings | None = None) -> list[dict[str, Any]]:
    """Return the rows of `leaderboard`, best first; the rank of a yardstick is None.

    Arguments:
        run: as for `leaderboard`.
        standings: of the run, where they are known already.

    Raises:
        InputError: when the run keeps too little to be scored.
    """
    standings = standings or Standings.of(run)
    if not standings.own.cases:
        return []
    by_name: dict[str, list[JobResult]] = {name: [] for name in standings.own.names}
    for result in run.ranked:
        by_name[result.strategy].append(result)
    rows = [_row(run, name, results, standings) for name, results in by_name.items()]
    if len(run.nominals) > 1:
        drawn = GainTable.of(run, run.started_from("drawn"), "drawn")
        for row in rows:
            row["gain_drawn"] = _mean_gain(drawn, drawn.values[row["strategy"]])

    def order(row: Mapping[str, Any]) -> tuple[tuple[float, ...], float, str]:
        return (), -row["gain"], row["strategy"]

    ranked = rank_items((row for row in rows if not row["yardstick"]), order)
    ranks = {row["strategy"]: rank for rank, row in ranked}
    rows = [row for _, row in rank_items(rows, order)]
    return [{**row, "rank": ranks.get(row["strategy"])} for row in rows]


def row_of(run: RunData, strategy: str) -> dict[str, Any]:
    """Return the row of one strategy on a leaderboard, without its rank.

    Arguments:
        run: as for `leaderboard`.
        strategy: its name.
    """
    found = [result for result in run.ranked if result.strategy == strategy]
    return _row(run, strategy, found, Standings.of(run))


def is_test(classes: Sequence[str] | None) -> bool:
    """Tell whether a case was measured: what has no class is somebody's own structure.

    Arguments:
        classes: of its scenario.
    """
    return not classes or TESTED in classes


def _row(
    run: RunData, strategy: str, results: Sequence[JobResult], standings: Standings
) -> dict[str, Any]:
    table, values = standings.own, standings.counted[strategy]
    by_structure = table.by_structure(values)
    gains = by_structure[:, :, 0]
    over = {"structures": gains.mean(axis=1), "seeds": gains.mean(axis=0), "": gains[:1, 0]}
    low, high = interval_of_mean(over[table.interval]) if table.interval else (math.nan, math.nan)
    error = by_structure[:, :, FIGURES.index("error_percent")].mean(axis=1)
    known = [100.0 * table.scale.textbook[case].error for case in table.cases]
    textbook = table.by_structure(np.array(known)[:, None, None])[:, 0, 0]
    classes = run.meta.get("classes") or {}
    tests = [case for case in table.cases if is_test(classes.get(case))]
    fine = [result for result in results if result.status == "ok"]
    medians: dict[str, dict[str, list[float]]] = {
        name: defaultdict(list) for name in (*BLOCKS, *_COUNTS, "rms_db", "floor_db")
    }
    for result in fine:
        for name, block in result.blocks.items():
            medians[name][result.case].append(block.rms_percent)
        if (seen := result.responses) is not None:
            medians["rms_db"][result.case].append(seen.rms_db)
            medians["floor_db"][result.case].append(seen.floor_db)
        for name, value in zip(_COUNTS, attrgetter(*_COUNTS)(result), strict=True):
            if value is not None:
                medians[name][result.case].append(value)
    return {
        "strategy": strategy,
        "yardstick": (run.meta.get("yardsticks") or {}).get(strategy, ""),
        **table.means(values),
        "gain_low": low,
        "gain_high": high,
        "textbook_percent": float(mean_known(textbook)),
        "better_share": _share(error < textbook * (1.0 - TIE), textbook),
        "worse_share": _share(error > MUCH_WORSE * textbook, textbook),
        "gain_drawn": math.nan,
        "gain_tests": float(table.by_structure(values, tests)[:, :, 0].mean())
        if 0 < len(tests) < len(table.cases)
        else math.nan,
        **{f"{block}_percent": _median(medians[block]) for block in BLOCKS},
        "responses_db": _median(medians["rms_db"]),
        "responses_floor_db": _median(medians["floor_db"]),
        "rigid_modes_lost": sum(result.rigid_modes_lost for result in fine),
        "negative_eigenvalues": sum(result.negative_eigenvalues or 0 for result in fine),
        "parameters": _median(medians["parameter_count"]),
        "evaluations": _median(medians["evaluations"]),
        "seconds": _median(medians["seconds"]),
        "answered": sum(result.answered for result in results),
        "ok": len(fine),
        "not_applicable": sum(result.status == "not-applicable" for result in results),
        "total": table.expected,
        "unphysical": any(result.unphysical for result in fine),
        "better_than": standings.apart.better_than(strategy),
        "worse_than": standings.apart.worse_than(strategy),
    }


def _share(which: FloatArray, known: FloatArray) -> float:
    """Return the share of the structures that have an error."""
    there = np.isfinite(known)
    return float(which[there].mean()) if there.any() else math.nan


def _median(by_case: Mapping[str, Sequence[float]]) -> float:
    """Return the median over cases of the median over seeds; nan where nothing has the value."""
    medians = [np.median(np.array(numbers, dtype=float)) for numbers in by_case.values()]
    return float(np.median(medians)) if medians else float("nan")
