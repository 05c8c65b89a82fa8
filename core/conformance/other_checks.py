"""What readers and scenarios must keep, one check a function."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.conformance.kit import Bench, Verdict, check, failed, not_applicable, passed
from femubench.core.errors import FemubenchError, InputError
from femubench.core.roles import Reader, Scenario
from femubench.core.run.jobs import one_line
from femubench.core.score.scoring import reference_of

_UNSENT = "not looked at: it cannot be sent to a worker"
_BYTES = 4096


@check("reader", "picklable", "It can be sent to a worker.")
def reader_picklable(bench: Bench) -> Verdict:
    """Pickle the reader."""
    if isinstance(bench.code, str):
        return failed(f"{bench.code}, expected a reader that pickle can send")
    return passed()


@check("reader", "empty-file", "An empty file is refused by InputError.")
def empty_file(bench: Bench) -> Verdict:
    """Read an empty file as a matrix and as modes."""
    return not_applicable(_UNSENT) if isinstance(bench.code, str) else bench.apart(
        _refuses, (bench.subject, "an empty file", b"")
    )  # fmt: skip


@check("reader", "random-file", "A file of random bytes is refused by InputError.")
def random_file(bench: Bench) -> Verdict:
    """Read random bytes as a matrix and as modes."""
    noise = np.random.default_rng(0).integers(0, 256, _BYTES, dtype=np.uint8).tobytes()
    return not_applicable(_UNSENT) if isinstance(bench.code, str) else bench.apart(
        _refuses, (bench.subject, "a file of random bytes", noise)
    )  # fmt: skip


@check("reader", "text-file", "A text that is not in its format is refused by InputError.")
def text_file(bench: Bench) -> Verdict:
    """Read a text as a matrix and as modes."""
    text = b"Dear reader,\nnothing of this is a measurement.\n-1\n 55\n1,2,x\n"
    return not_applicable(_UNSENT) if isinstance(bench.code, str) else bench.apart(
        _refuses, (bench.subject, "a text", text)
    )  # fmt: skip


def _refuses(task: tuple[Reader, str, bytes]) -> Verdict:
    reader, what, content = task
    with tempfile.TemporaryDirectory() as folder:
        for suffix in reader.suffixes:
            file = Path(folder) / f"file{suffix}"
            file.write_bytes(content)
            for role in ("read_matrix", "read_modes"):
                try:
                    found = getattr(reader, role)(file)
                except InputError as error:
                    if file.name not in str(error):
                        return failed(f"{role} of {what}: {error}, expected the name of the file")
                    continue
                except Exception as error:
                    return failed(f"{role} of {what}: {one_line(error)}, expected InputError")
                seen = type(found).__name__
                return failed(f"{role} of {what} returned {seen}, expected InputError")
    return passed()


@check("scenario", "reads", "Every case can be read.")
def reads(bench: Bench) -> Verdict:
    """Read every case."""
    return bench.apart(_reads, (bench.subject, bench.helpers or ()))


@check("scenario", "held-out", "Every case holds out data by which a model can be judged.")
def held_out(bench: Bench) -> Verdict:
    """Look for held-out modes and modifications."""
    return bench.apart(_held_out, (bench.subject, bench.helpers or ()))


@check("scenario", "solves", "The nominal model of every case has modes that pair with used ones.")
def solves(bench: Bench) -> Verdict:
    """Solve and judge every nominal model."""
    return bench.apart(_solves, (bench.subject, bench.helpers or ()))


@check("scenario", "sources", "Every case says where its numbers come from.")
def sources(bench: Bench) -> Verdict:
    """Look for title and source."""
    return bench.apart(_sources, (bench.subject, bench.helpers or ()))


def _reads(task: tuple[Scenario, Sequence[Reader]]) -> Verdict:
    scenario, readers = task
    for name, folder in scenario.cases.items():
        try:
            read_case(folder, name, readers)
        except InputError as error:
            return failed(f"{name}: {error}")
    return passed()


def _cases(task: tuple[Scenario, Sequence[Reader]]) -> list[Case]:
    scenario, readers = task
    found = []
    for name, folder in scenario.cases.items():
        try:
            found.append(read_case(folder, name, readers))
        except InputError:
            continue  # which is what `reads` is about
    return found


def _held_out(task: tuple[Scenario, Sequence[Reader]]) -> Verdict:
    cases = _cases(task)
    for case in cases:
        if not case.held_out and not case.modifications:
            return failed(f"{case.name}: nothing is held out, expected modes or a modification")
        if not case.used:
            return failed(f"{case.name}: no used mode, expected one or more")
    return passed() if cases else not_applicable("no case can be read")


def _solves(task: tuple[Scenario, Sequence[Reader]]) -> Verdict:
    cases = _cases(task)
    for case in cases:
        try:
            used = reference_of(case).blocks["used"]
        except FemubenchError as error:
            return failed(f"{case.name}: {error}, expected a nominal model with modes")
        if all(mode.predicted_hz is None for mode in used.modes):
            return failed(f"{case.name}: no used mode has a partner in the nominal model")
    return passed() if cases else not_applicable("no case can be read")


def _sources(task: tuple[Scenario, Sequence[Reader]]) -> Verdict:
    cases = _cases(task)
    for case in cases:
        if not case.source.strip() or not case.title.strip():
            return failed(f"{case.name}: title or source is empty, expected both")
    return passed() if cases else not_applicable("no case can be read")
