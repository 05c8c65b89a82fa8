"""Runs of several machines as one static site: ``bench publish``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, suppress
from functools import partial
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from femubench.core.case.case import Case
from femubench.core.case.drawn import DRAWN
from femubench.core.errors import InputError
from femubench.core.files import check_can_make, resolve_path
from femubench.core.library.cases import as_list, read_cases, scenarios_of, usable_plugins, way_of
from femubench.core.library.rank import classes_of, draw_twins_of, textbook_of
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.variants import strategy_of
from femubench.core.publish.publishing import Published, publish as merge
from femubench.core.publish.rerun import Sample
from femubench.core.publish.submissions import read_submission
from femubench.core.publish.verification import verify
from femubench.core.roles import StrategyRole
from femubench.core.schema.records import run_to_json
from femubench.core.schema.results import RunData
from femubench.core.twin.twins import Twin


def publish(
    folder: str | PathLike[str],
    runs: RunData | str | PathLike[str] | Iterable[RunData | str | PathLike[str]],
    *,
    unverified: bool = False,
    address: str | None = None,
    rerun: int = 3,
    tell: Callable[[str], None] = lambda line: None,
) -> Published:
    """Merge runs into a static site, all of them or none.

    Arguments:
        folder: new, empty, or made by this function: then the runs are added to it.
        runs: files that ``bench submit`` or ``bench run --json`` wrote, here or on another machine,
            or runs; where the answers of a file are next to it, its errors are computed again.
        unverified: whether to take, marked as such, what cannot be verified: runs without sandbox
            or twins, of cases that are not installed here, or with figures that do not agree.
        address: where the site will be found, ``https://...``, for the links of its feeds; None for
            what it was given before.
        rerun: jobs of each run whose errors were computed again that are run again, drawn by
            chance, where the strategy is installed in the same version.
        tell: is given a line on these.

    Raises:
        InputError: for a file that is not sound, or cannot be verified, a folder with something
            else in it, or an address that is none.

    Examples:
        >>> run = femubench.rank(case, [nominal, scaled])
        >>> len(femubench.publish("site", run, unverified=True).added)
        1
    """
    check_can_make(resolve_path(Path(folder)).parent)
    installed = InstalledCases(usable_plugins())
    sample = Sample(rerun, installed.strategy, tell) if rerun else None
    check = partial(verify, installed=installed, sample=sample)
    with TemporaryDirectory() as scratch:
        files = []
        for number, run in enumerate(as_list(runs)):
            file = Path(scratch, f"{number}.json") if isinstance(run, RunData) else Path(str(run))
            if isinstance(run, RunData):
                file.write_text(json.dumps(run_to_json(run), allow_nan=False), encoding="utf-8")
            files.append(file)
        return merge(
            *(Path(folder), files, way_of("html", "render_site"), check),
            unverified=unverified,
            address=address,
        )


def refusal_of(file: Path) -> str:
    """Return why a site would take a result file as unverified alone; nothing where not."""
    try:
        installed = InstalledCases(usable_plugins())
        read_submission(file, partial(verify, installed=installed, sample=None))
    except InputError as fault:
        return str(fault)
    return ""


class InstalledCases:
    """The cases of the scenarios that are installed, each read once, and the strategies."""

    def __init__(self, plugins: Plugins) -> None:
        self._plugins = plugins
        self._owners = scenarios_of(plugins.scenarios)
        self._classes = classes_of(plugins)
        self._found: dict[str, Case] = {}

    def case(self, name: str) -> Case | None:
        """Return a case by its name; None where there is none."""
        if self._owner(name) in self._owners and name not in self._found:
            with suppress(InputError) if name not in self._owners else nullcontext():
                (self._found[name],) = read_cases([name], self._plugins)
        return self._found.get(name)

    def _owner(self, name: str) -> str:
        """Return the case of which a name may be that of a drawing."""
        return name if name in self._owners else name.rpartition(DRAWN)[0]

    def strategy(self, name: str) -> StrategyRole | None:
        """Return a strategy by its name with its options; None where there is none."""
        known = self._plugins.strategies
        with suppress(InputError):
            return strategy_of(name, known) if name.partition(":")[0] in known else None
        return None

    def classes(self, name: str) -> Sequence[str]:
        """Return the kinds of structure and of truth of a case."""
        return self._classes.get(self._owner(name), ())

    def twins(self, cases: Sequence[Case], number: int, seed: int) -> Sequence[Twin]:
        """Return the twins that a run of these cases draws from a seed."""
        return draw_twins_of(cases, self._classes, number, seed)

    def yardstick(self, case: Case) -> Case:
        """Return a case with the model that all errors are measured against."""
        return textbook_of([case]).get(case.name, case)
