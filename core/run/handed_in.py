"""Answers of strategies as a file, to be judged by who has the data that they were not given."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from femubench.core.case.case import Case
from femubench.core.errors import InputError, StrategyFailure
from femubench.core.files import MIB, check_regular, write_atomically
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.runner import Plan
from femubench.core.run.schedule import Answers
from femubench.core.run.starts import Starts
from femubench.core.schema.bounds import Name, Text, Whole
from femubench.core.schema.results import JobName, Nominal, RunData
from femubench.core.schema.run_options import RunOptions, StartModels

_LARGEST = 1024 * MIB  # bytes of all answers of a file
_LIST = "answers.json"
_MOST = 100_000  # answers


@dataclass(frozen=True)
class Absent:
    """Stands for a strategy that is not here: what it has not answered has failed."""

    name: Name
    citation: Text
    yardstick: Text = ""

    def update(self, model: Any, measurement: Any, rng: np.random.Generator) -> Any:  # noqa: ANN401
        """Raise StrategyFailure."""
        raise StrategyFailure("no answer was handed in")


class _Listed(Struct):
    """What a file of answers holds: the jobs, each with a member of its number."""

    strategies: Annotated[list[Absent], Meta(max_length=1_000)]
    seeds: Annotated[list[Whole], Meta(max_length=1_000, min_length=1)]
    jobs: Annotated[list[tuple[Name, Name, Whole, Nominal]], Meta(max_length=_MOST)]


def name_answers(file: Path) -> Path:
    """Return where the answers of a result file are."""
    return file.with_suffix(".answers")


def count_unanswered(run: RunData, answers: Answers) -> int:
    """Return how many models of a run are not among some answers, as of results from a store."""
    listed = chain(run.results, run.companions)
    return sum(
        (r.case, r.strategy, r.seed, r.nominal) not in answers for r in listed if r.status == "ok"
    )


def write_answers(file: Path, run: RunData, answers: Answers) -> None:
    """Write the answers of a run."""
    about = [run.meta.get(key) or {} for key in ("citations", "yardsticks")]
    strategies = [
        Absent(name, *(str(known.get(name, "")) for known in about))
        for name in run.meta["strategies"]
    ]
    listed = _Listed(strategies, list(run.meta["seeds"]), list(answers))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(_LIST, msgspec.json.encode(listed))
        for number, answer in enumerate(answers.values()):
            archive.writestr(str(number), answer)
    write_atomically(file, content.getvalue())


def read_answers(file: Path) -> tuple[_Listed, Answers]:
    """Return which jobs a file has answers of, and the answers.

    Raises:
        InputError: when it is no file of answers, or they are too large.
    """
    check_regular(file, _LARGEST)
    expected = "the file .answers that `bench submit` and `bench run --json` write"
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _LARGEST:
                raise InputError("too large", file=file, expected=f"{_LARGEST // MIB} MiB")
            listed = msgspec.json.decode(archive.read(_LIST), type=_Listed)
            numbered = enumerate(listed.jobs)
            return listed, {job: archive.read(str(number)) for number, job in numbered}
    except (zipfile.BadZipFile, zlib.error, KeyError, ValueError, OSError) as error:
        raise InputError(f"no answers: {error}", file=file, expected=expected) from None


def judge_answers(
    cases: Sequence[Case],
    files: Sequence[Path],
    textbooks: Mapping[str, Case],
    jobs: int,
    nominal: StartModels = "textbook",
) -> RunData:
    """Return the run of all strategies in files of answers, judged on cases with all their data.

    Nothing of a strategy runs, and nothing that a file says of errors counts: an answer is a model.

    Arguments:
        files: that `bench submit` wrote next to its results.
        textbooks: the cases with their textbook models, by name.

    Raises:
        InputError: for a file that has none, two files with one strategy, or other seeds.
    """
    strategies: dict[str, Absent] = {}
    answers: dict[JobName, bytes] = {}
    seeds: set[tuple[int, ...]] = set()
    for file in files:
        listed, own = read_answers(file)
        for one in listed.strategies:
            if strategies.setdefault(one.name, one) is not one:
                raise InputError(f"{one.name} is there twice", file=file, expected="once")
        answers |= own
        seeds.add(tuple(listed.seeds))
    if len(seeds) > 1:
        raise InputError("the files have other seeds than each other", expected="the same seeds")
    options = RunOptions(seeds=seeds.pop(), nominal=nominal)
    plan = Plan(cases, list(strategies.values()), options, Starts(textbooks, options.nominal))
    return plan.run(LocalProcesses(jobs, "off"), answers=answers)
