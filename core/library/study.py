"""Studies: strategies under conditions that vary, one run: what ``bench study`` does."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any, Unpack

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.library.cases import case_names, read_cases, usable_plugins
from femubench.core.library.rank import Run, classes_of, store_in, textbook_of
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.validation import choose_names, unknown
from femubench.core.plugin.variants import Variant
from femubench.core.roles import StrategyRole
from femubench.core.run.executor import open_executor
from femubench.core.run.recording import Progress
from femubench.core.run.runner import Plan, Receivers
from femubench.core.run.starts import Starts
from femubench.core.run.store import Store
from femubench.core.schema.records import MOST_RESULTS
from femubench.core.schema.results import DONE, NOMINALS
from femubench.core.schema.run_options import StudyKeywords, check_keywords, split_keywords
from femubench.core.score.scoring import reference_of
from femubench.core.study.axes import CaseConditions, OptionSet, StudyAxes
from femubench.core.study.conditions import vary_case
from femubench.core.study.estimate import Forecast, forecast
from femubench.core.study.study_file import StudyFile, grid, read_study


@dataclass(frozen=True, kw_only=True)
class StudyPlan(Plan):
    """A study with all that its words stand for: cases under every condition, all strategies."""

    axes: StudyAxes

    @property
    def cells(self) -> int:
        """Return the number of rows of `gain_by`, which takes cases and seeds together."""
        conditions = len(self.axes.values("noise")) * len(self.axes.values("sensors_left_out"))
        return conditions * len(self.axes.nominals) * len(self.strategies)

    def forecast(self, store: Store) -> Forecast:
        """Return how many jobs are left and what they take; runs none of them.

        Arguments:
            store: whose results are done, and say how long such jobs take.
        """
        known = store.by_key()
        left = [
            (slot.case.name, slot.strategy)
            for slot in self.slots
            if slot.key not in known or known[slot.key].status not in DONE
        ]
        judging = {}
        for case in self.cases:
            origin = self.axes.cases[case.name].case
            if origin not in judging:
                start = time.process_time()
                reference_of(self.starts.yardstick(case))
                judging[origin] = time.process_time() - start
        return forecast(self.jobs, left, self.axes, known.values(), judging)

    def limited(self, given: Mapping[str, Any]) -> StudyPlan:
        """Return the plan with limits and what the store has of it, as `split_keywords` gives them.

        Raises:
            InputError: for a limit of a strategy that does not run.
        """
        bases = {name: choice.strategy for name, choice in self.axes.strategies.items()}
        limits = given.get("timeouts", {})
        choose_names("strategy to limit", limits, [*bases, *bases.values()])
        own = {name: limits.get(name, limits.get(base)) for name, base in bases.items()}
        timeouts = {name: limit for name, limit in own.items() if limit is not None}
        return replace(self, options=replace(self.options, **{**given, "timeouts": timeouts}))


def study(
    file: str | PathLike[str],
    *,
    store: Store | str | PathLike[str] | None = None,
    progress: Progress | None = None,
    **keywords: Unpack[StudyKeywords],
) -> Run:
    """Run a study: strategies with grids of options under conditions that vary.

    Its `gain_by` gives the gain by axes as a table, and `femubench.plot.heat_map` draws it.

    Arguments:
        file: a study file; see docs/studies.md.
        store: folder that keeps the results; a study goes on where it stopped. None for none.
        progress: called with (result, jobs done, jobs in all).
        keywords: ``jobs``, ``cluster``, ``sandbox``, ``timeout``, ``timeouts``,
            ``memory`` and ``overwrite`` (``failed`` by default), as in `femubench.rank`; a timeout
            may be that of a strategy with or without options.

    Raises:
        InputError: for a wrong key, an unknown name or a faulty case, before anything is run.

    Examples:
        >>> from pathlib import Path
        >>> file = Path("study.toml")
        >>> axes = f'axes = {{cases = ["{case.name}"], noise = [1, 2], seeds = 1}}'
        >>> _ = file.write_text(f'{axes}\\n[[strategies]]\\nname = "{nominal.name}"')
        >>> femubench.study(file).gain_by("noise")["jobs"].tolist()
        [1, 1]
    """
    check_keywords(keywords, StudyKeywords)
    given, place = split_keywords(keywords)
    plan = study_plan(read_study(file), usable_plugins()).limited(given)
    with open_executor(place) as executor:
        kept = None if store is None else store_in(store)
        return Run.of(plan.run(executor, Receivers(kept, progress)))


def study_plan(read: StudyFile, plugins: Plugins) -> StudyPlan:
    """Return what a study file stands for; nothing has been run when something is wrong with it.

    Raises:
        InputError: with file, line and key.
    """
    strategies, choices = _strategies(read, plugins)
    axes = read.tables.axes
    originals = _cases(read, plugins)
    textbook = textbook_of(originals)
    cases: list[Case] = []
    known, settings = dict[str, Case](), dict[str, CaseConditions]()
    for original in originals:
        for noise, left_out in product(axes.noise, axes.sensors_left_out):
            case = vary_case(original, noise, left_out)
            settings[case.name] = CaseConditions(original.name, noise, left_out)
            first = not cases or settings[cases[-1].name].case != original.name
            cases.append(case if first else replace(case, notes=()))
            if original.name in textbook:
                known[case.name] = vary_case(textbook[original.name], noise, left_out)
    options = read.options
    shown = read.tables.heat_map
    found = StudyAxes(
        settings,
        choices,
        read.title,
        None if shown is None else (shown.x, shown.y),
        tuple(reversed(NOMINALS)) if options.nominal == "both" else axes.nominal,
    )
    _check_heat_map(read, found)
    kinds = classes_of(plugins)
    classes = {name: kinds[s.case] for name, s in settings.items() if s.case in kinds}
    starts = Starts(known, options.nominal, classes)
    kept = {"study": found.to_json()}
    plan = StudyPlan(cases, strategies, options, starts, kept, axes=found)
    if plan.jobs > MOST_RESULTS:
        raise InputError(f"{plan.jobs} jobs", file=read.file, expected=f"at most {MOST_RESULTS}")
    return plan


def _strategies(
    read: StudyFile, plugins: Plugins
) -> tuple[list[StrategyRole], dict[str, OptionSet]]:
    """Return every strategy with every combination of its options, and which one it is."""
    found: list[StrategyRole] = []
    choices: dict[str, OptionSet] = {}
    for number, asked in enumerate(read.tables.strategies):
        with read.at("strategies", number, "name"):
            choose_names("strategy", [asked.name], plugins.strategies)
        base = plugins.strategies[asked.name]
        for options in grid(asked.options):
            with read.at("strategies", number, "options"):
                variant = Variant(base, asked.name)(**options)
                if variant.name in choices:
                    raise InputError(f"{variant.name} stands twice", expected="every one once")
            # With the options that it has anyway it is the strategy that `bench run` runs.
            found.append(base if variant.name == base.name else variant)
            choices[variant.name] = OptionSet(asked.name, options)
    return found, choices


def _cases(read: StudyFile, plugins: Plugins) -> list[Case]:
    """Return the cases, each once; folders are those next to the study file."""
    known = case_names(plugins.scenarios)
    found: dict[str, Case] = {}
    for number, word in enumerate(read.tables.axes.cases):
        with read.at("axes", "cases", number):
            for case in read_cases(word if word in known else _folder(read, word, known), plugins):
                same = found.setdefault(case.name, case)
                if same.folder != case.folder:
                    what = f"the name {case.name!r} is also that of {same.folder}"
                    raise InputError(what, expected="a name of its own")
    for number, left_out in enumerate(read.tables.axes.sensors_left_out):
        for case in found.values():
            have = len(case.measurement.sensors)
            if left_out and left_out >= have:
                with read.at("axes", "sensors_left_out", number):
                    what = f"{left_out} sensors left out of {case.name}, which has {have}"
                    raise InputError(what, expected="fewer than it has")
    return list(found.values())


def _folder(read: StudyFile, word: str, known: Sequence[str]) -> Path:
    folder = read.file.parent / word
    if folder.exists():
        return folder
    if "/" in word:
        expected = "a name, or a folder that is found from that of the study file"
        raise InputError(f"there is no case {word!r}", expected=expected)
    raise unknown("case", word, known)


def _check_heat_map(read: StudyFile, axes: StudyAxes) -> None:
    shown = read.tables.heat_map
    if shown is None:
        return
    for key, axis in (("x", shown.x), ("y", shown.y)):
        with read.at("heat_map", key):
            axes.values(axis)
    if shown.x == shown.y:
        with read.at("heat_map", "y"):
            raise InputError(f"{shown.y!r} is x already", expected="another axis")
