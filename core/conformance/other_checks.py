"""What readers and scenarios must keep, one check a function."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.conformance import kit
from femubench.core.conformance.kit import Bench, Verdict, check, fail_check, pass_check
from femubench.core.errors import FemubenchError, InputError
from femubench.core.roles import Reader, Scenario
from femubench.core.run.jobs import one_line
from femubench.core.score.scoring import reference_of

_BYTES = 4096
# What no reader may take for data: name of the check, how its sentence begins, words, content.
_FILES = (
    ("empty-file", "An empty file", "an empty file", b""),
    (
        "random-file",
        "A file of random bytes",
        "a file of random bytes",
        np.random.default_rng(0).integers(0, 256, _BYTES, dtype=np.uint8).tobytes(),
    ),
    (
        "text-file",
        "A text that is not in its format",
        "a text",
        b"Dear reader,\nnothing of this is a measurement.\n-1\n 55\n1,2,x\n",
    ),
)

check("reader", "picklable", "It can be sent to a worker.")(partial(kit.picklable, what="a reader"))


def _refused(bench: Bench, what: str, content: bytes) -> Verdict:
    return bench.apart(refuses, what, content)


for _name, _subject, _what, _content in _FILES:
    _judge = partial(_refused, what=_what, content=_content)
    check("reader", _name, f"{_subject} is refused by InputError.")(_judge)


def refuses(reader: Reader, what: str, content: bytes) -> Verdict:
    """Read a file that is none as a matrix and as modes."""
    with tempfile.TemporaryDirectory() as folder:
        for suffix in reader.suffixes:
            file = Path(folder) / f"file{suffix}"
            file.write_bytes(content)
            for role in ("read_matrix", "read_modes"):
                try:
                    found = getattr(reader, role)(file)
                except InputError as error:
                    if file.name not in str(error):
                        return fail_check(
                            f"{role} of {what}: {error}, expected the name of the file"
                        )
                    continue
                except Exception as error:
                    return fail_check(f"{role} of {what}: {one_line(error)}, expected InputError")
                seen = type(found).__name__
                return fail_check(f"{role} of {what} returned {seen}, expected InputError")
    return pass_check()


@kit.check_apart("scenario", "reads", "Every case can be read.")
def reads(scenario: Scenario, *readers: Reader) -> Verdict:
    """Read every case."""
    for name in scenario.cases:
        try:
            read_case(scenario.folder(name), name, readers)
        except InputError as error:
            return fail_check(f"{name}: {error}")
    return pass_check()


def _first_fault(scenario: Scenario, fault_of: Callable[[Case], str], *readers: Reader) -> Verdict:
    """Return the first fault of the cases that can be read; `reads` is about the others."""
    count = 0
    for name in scenario.cases:
        try:
            case = read_case(scenario.folder(name), name, readers)
        except InputError:
            continue
        count += 1
        if fault := fault_of(case):
            return fail_check(f"{case.name}: {fault}")
    return pass_check() if count else kit.not_applicable("no case can be read")


def find_held_out_fault(case: Case) -> str:
    """Return what held-out modes and modifications lack."""
    if not case.held_out and not case.modifications:
        return "nothing is held out, expected modes or a modification"
    return "" if case.used else "no used mode, expected one or more"


def nominal_fault(case: Case) -> str:
    """Solve and judge the nominal model."""
    try:
        used = reference_of(case).blocks["used"]
    except FemubenchError as error:
        return f"{error}, expected a nominal model with modes"
    lost = all(mode.predicted_hz is None for mode in used.modes)
    return "no used mode has a partner in the nominal model" if lost else ""


def source_fault(case: Case) -> str:
    """Look for title and source."""
    stated = case.source.strip() and case.title.strip()
    return "" if stated else "title or source is empty, expected both"


_CASES = {
    "held-out": ("Every case holds out data by which a model can be judged.", find_held_out_fault),
    "solves": (
        "The nominal model of every case has modes that pair with used ones.",
        nominal_fault,
    ),
    "sources": ("Every case says where its numbers come from.", source_fault),
}


def _every_case(bench: Bench, fault_of: Callable[[Case], str]) -> Verdict:
    return bench.apart(_first_fault, fault_of, *bench.helpers)


for _name, (_sentence, _fault_of) in _CASES.items():
    check("scenario", _name, _sentence)(partial(_every_case, fault_of=_fault_of))
