"""Blind cases as folders: written with a sealed truth, and answers to them judged."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from femubench.core.case.reader import read_case
from femubench.core.case.writing import write_case
from femubench.core.challenge.answer import read_answer
from femubench.core.challenge.draw import Effects, draw_case, registered_effects
from femubench.core.challenge.score import Judgement, judge_answer
from femubench.core.challenge.sealed import SEALED_FILE, read_sealed, seal
from femubench.core.challenge.truth import HIDDEN, DataKind, Hidden, Truth
from femubench.core.challenge.visibility import delta_chi2
from femubench.core.errors import InputError

_SHARES = (0.6, 0.15, 0.125, 0.125)  # of one, none, pair, outside where any may be hidden


def any_hidden(seed: int) -> Hidden:
    """Return how much a seed hides where nobody says so."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, len(HIDDEN)]))
    return HIDDEN[int(rng.choice(len(HIDDEN), p=_SHARES))]


def write_blind(
    folder: Path,
    seed: int,
    kind: DataKind,
    *,
    structure: str = "ladder",
    hidden: Hidden = "one",
    scatter: float = 0.0,
    sealed: Path | None = None,
    effects: Effects | None = None,
) -> tuple[Path, str]:
    """Write a blind case and its sealed truth; return the path of the truth and its commitment.

    Arguments:
        folder: new or empty.
        seed, kind, structure, hidden, scatter, effects: see `draw_case`.
        sealed: where the truth goes; None for ``truth.sealed`` in the folder.

    Raises:
        InputError: when the folder is not empty, the truth exists, or nothing can be drawn.
    """
    path = folder / SEALED_FILE if sealed is None else sealed
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError("is not empty", file=folder, expected="a new or an empty folder")
    if path.exists():
        raise InputError("exists", file=path, expected="a new file for the sealed truth")
    blind = draw_case(
        seed, kind, structure=structure, hidden=hidden, scatter=scatter, effects=effects
    )
    new = not folder.exists()
    try:
        write_case(folder, blind.case)
        truth = replace(blind.truth, digest=read_case(folder).digest)
        text, commitment = seal(truth)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        if new:
            shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f"cannot be written: {error.strerror}", file=path) from None
    return path, commitment


@dataclass(frozen=True)
class Scored:
    """A judged answer with all that it was judged by."""

    truth: Truth
    delta_chi2: tuple[float, ...]
    judgement: Judgement
    commitment: str

    def to_json(self) -> str:
        """Return everything as JSON."""
        return json.dumps(asdict(self), indent=1)


def score_folder(
    folder: Path, answer: Path, sealed: Path | None = None, effects: Effects | None = None
) -> Scored:
    """Judge an answer to a blind case.

    Arguments:
        folder: of the case.
        answer: JSON file.
        sealed: the truth; None for ``truth.sealed`` in the folder.
        effects: the catalogue by name; None for those of all plugins.

    Raises:
        InputError: when case, truth or answer cannot be read, or do not belong together.
    """
    given = read_answer(answer)
    truth, commitment = read_sealed(folder / SEALED_FILE if sealed is None else sealed)
    case = read_case(folder)
    if case.digest != truth.digest:
        raise InputError("the case was changed since its truth was sealed", file=folder)
    known = registered_effects() if effects is None else effects
    missing = [cause.effect for cause in truth.causes if cause.effect not in known]
    if missing:
        what = f"the hidden effect {missing[0]!r} is not installed"
        raise InputError(what, file=folder, expected="the plugins that the case was drawn with")
    falls = delta_chi2(case, truth, known)
    return Scored(truth, falls, judge_answer(truth, given, falls), commitment)
