"""Blind cases with a hidden fault, and answers judged: ``bench challenge``."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from femubench.core.case.reader import read_case
from femubench.core.case.writing import write_case
from femubench.core.challenge import closed_set
from femubench.core.challenge.answer import Answer, read_answer
from femubench.core.challenge.draw import Effects, draw_case, registered_effects
from femubench.core.challenge.outcome import judge_by_truth, same_place
from femubench.core.challenge.posing import HEALTHY, pose
from femubench.core.challenge.score import Judgement, judge_answer
from femubench.core.challenge.sealed import SEALED_FILE, read_sealed, seal
from femubench.core.challenge.truth import HIDDEN, DataKind, Hidden, Truth
from femubench.core.challenge.truth_file import TRUTH_FILE, GivenTruth, read_truth
from femubench.core.challenge.visibility import delta_chi2
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.errors import InputError
from femubench.core.library.cases import scenarios_of, usable_plugins
from femubench.core.library.rank import Run, textbook_of
from femubench.core.run.executor import count_workers
from femubench.core.run.handed_in import judge_answers

_SHARES = (0.6, 0.15, 0.125, 0.125)  # of one, none, pair, outside where any may be hidden


@dataclass(frozen=True)
class Scored:
    """A judged answer with all that it was judged by.

    Arguments:
        delta_chi2: by how much each cause lowers chi-square; of a truth from outside the
            chi-square of what it changes.
        commitment: sha256 of the truth.
    """

    truth: Truth | GivenTruth
    delta_chi2: tuple[float, ...]
    judgement: Judgement
    commitment: str

    def to_json(self) -> str:
        """Return everything as JSON."""
        return json.dumps(asdict(self), indent=1)


@dataclass(frozen=True)
class Challenge:
    """A blind case.

    Arguments:
        folder: of the case.
        truth: the file of the sealed truth.
        commitment: its sha256, for who wants to show that it was not changed.
    """

    folder: Path
    truth: Path
    commitment: str

    def score(self, answer: Diagnosis | str | PathLike[str]) -> Scored:
        """Judge an answer; see `score_challenge`."""
        return score_challenge(self.folder, answer, truth=self.truth)


def any_hidden(seed: int) -> Hidden:
    """Return how much a seed hides where nobody says so."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, len(HIDDEN)]))
    return HIDDEN[int(rng.choice(len(HIDDEN), p=_SHARES))]


def challenge(
    folder: str | PathLike[str],
    seed: int,
    *,
    kind: DataKind = "A",
    structure: str = "ladder",
    hidden: Hidden | Literal["any"] = "any",
    scatter: float = 0.0,
    truth: str | PathLike[str] | None = None,
    effects: Effects | None = None,
    truths: str | PathLike[str] | None = None,
    reference: bool = False,
) -> Challenge:
    """Write a blind case with a hidden fault, and its sealed truth.

    Arguments:
        folder: new or empty.
        seed: of all that is random.
        kind: how good the data are: A precise shapes, B poor shapes, C frequencies alone.
        structure: what is measured.
        hidden: ``one`` effect, ``none``, a ``pair``, one ``outside`` the catalogue, or ``any``.
        scatter: standard deviation of each element's stiffness and mass, relative.
        truth: where the sealed truth goes; ``truth.sealed`` in the folder by default.
        effects: the catalogue by name; None for those that come with femubench.
        truths: a folder of truths from outside, one of which is posed in place of drawing one;
            kind, structure, hidden, scatter and effects then say nothing.
        reference: whether the case of such a truth brings the healthy structure.

    Raises:
        InputError: when the folder is not empty, the truth exists, or nothing can be drawn.

    Examples:
        >>> femubench.challenge("blind", seed=3, hidden="none").folder.name
        'blind'
    """
    case, path = _free(folder, truth)
    if truths is not None:
        return _given(case, path, seed, Path(truths), reference)
    if reference:
        raise InputError("a reference goes with truths", expected="a folder of truths")
    much = any_hidden(seed) if hidden == "any" else hidden
    blind = draw_case(
        seed, kind, structure=structure, hidden=much, scatter=scatter, effects=effects
    )
    return _sealed(case, path, lambda: write_case(case, blind.case), blind.truth)


def _given(case: Path, path: Path, seed: int, truths: Path, reference: bool) -> Challenge:
    """Pose one of the truths in a folder, at any depth.

    Their structures are folders in ``structures`` there or next to the truth, or built-in cases.

    Raises:
        InputError: when there is no truth, one is faulty, or something cannot be written.
    """
    rooms = [file.parent for file in sorted(truths.rglob(TRUTH_FILE))]
    rooms = [room for room in rooms if not reference or (room / HEALTHY).is_file()]
    if not rooms:
        what = f"no folder with {TRUTH_FILE}" + (f" and {HEALTHY}" if reference else "")
        raise InputError(what, file=truths, expected="a folder of truths")
    room = rooms[int(np.random.default_rng(seed).integers(len(rooms)))]
    stated = read_truth(room)
    near = (folder / "structures" / stated.structure for folder in (room.parent, truths))
    structure = next((folder for folder in near if folder.is_dir()), None)
    if structure is None:
        owners = scenarios_of(usable_plugins().scenarios)
        named = [name for name in owners if name.rpartition("/")[2] == stated.structure]
        if not named:
            what = f"no structure {stated.structure!r}"
            expected = "a folder in `structures`, or a built-in case"
            raise InputError(what, file=room / TRUTH_FILE, key="structure", expected=expected)
        structure = owners[named[0]].folder(named[0])
    hidden = GivenTruth(stated, seed, reference, digest="")
    return _sealed(case, path, lambda: pose(room, structure, case, reference), hidden)


def _free(folder: str | PathLike[str], truth: str | PathLike[str] | None) -> tuple[Path, Path]:
    """Return where case and sealed truth go; raises InputError when something is there."""
    case, path = Path(folder), Path(folder, SEALED_FILE) if truth is None else Path(truth)
    if case.exists() and (not case.is_dir() or any(case.iterdir())):
        raise InputError("is not empty", file=case, expected="a new or an empty folder")
    if path.exists():
        raise InputError("exists", file=path, expected="a new file for the sealed truth")
    return case, path


def _sealed(
    case: Path, path: Path, write: Callable[[], object], hidden: Truth | GivenTruth
) -> Challenge:
    """Write a case and seal its truth; what was begun is removed where that fails."""
    new = not case.exists()
    try:
        write()
        text, commitment = seal(replace(hidden, digest=read_case(case).digest))
        path.write_text(text, encoding="utf-8")
    except (OSError, InputError) as error:
        if new:
            shutil.rmtree(case, ignore_errors=True)
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be written: {error.strerror}", file=path) from None
    return Challenge(case, path, commitment)


def score_challenge(
    folder: str | PathLike[str],
    answer: Diagnosis | str | PathLike[str],
    *,
    truth: str | PathLike[str] | None = None,
    effects: Effects | None = None,
) -> Scored:
    """Judge an answer to a blind case.

    Arguments:
        folder: of the case.
        answer: a diagnosis, or a file as ``bench diagnose --json`` writes it.
        truth: the sealed truth; ``truth.sealed`` in the folder by default.
        effects: the catalogue by name; None for those that come with femubench.

    Raises:
        InputError: when case, truth or answer cannot be read, or do not belong together.

    Examples:
        >>> blind = femubench.challenge("blind", seed=3, hidden="none")
        >>> femubench.score_challenge("blind", found).judgement.right  # it names a cause
        False
    """
    given = Answer.of(answer) if isinstance(answer, Diagnosis) else read_answer(Path(answer))
    hidden, commitment = read_sealed(Path(folder, SEALED_FILE) if truth is None else Path(truth))
    folder = Path(folder)
    case = read_case(folder)
    if case.digest != hidden.digest:
        raise InputError("the case was changed since its truth was sealed", file=folder)
    if isinstance(hidden, GivenTruth):
        structure = case.model.structure
        same = same_place(None if structure is None else structure.frame)
        chi2 = () if hidden.truth.chi2 is None else (hidden.truth.chi2,)
        return Scored(hidden, chi2, judge_by_truth(hidden.truth, given, same), commitment)
    named = [cause.effect for cause in hidden.causes]
    known = registered_effects(*named) if effects is None else effects
    missing = [cause.effect for cause in hidden.causes if cause.effect not in known]
    if missing:
        what = f"the hidden effect {missing[0]!r} is not installed"
        raise InputError(what, file=folder, expected="the plugins that the case was drawn with")
    falls = delta_chi2(case, hidden, known)
    return Scored(hidden, falls, judge_answer(hidden, given, falls), commitment)


def close_cases(
    cases: Iterable[str | PathLike[str]], target: str | PathLike[str]
) -> dict[Path, str]:
    """Write cases whose unseen data are encrypted; see `core.challenge.closed_set`."""
    return closed_set.close_cases([Path(case) for case in cases], Path(target))


def judge_closed(
    folder: str | PathLike[str], answers: Iterable[str | PathLike[str]], jobs: int | None = None
) -> Run:
    """Return the run of strategies that answered on the open halves of a closed set.

    Arguments:
        folder: of the set, whose key is in the environment.
        answers: files that `submit` wrote.
        jobs: judges at a time; one a processor by default.

    Raises:
        InputError: for a set that does not open, or a file without answers.
    """
    with closed_set.opened_cases(Path(folder)) as cases:
        files = [Path(file) for file in answers]
        return Run.of(judge_answers(cases, files, textbook_of(cases), count_workers(jobs)))
