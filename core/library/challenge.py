"""Blind cases with a hidden fault, and answers judged: ``bench challenge``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from femubench.core.challenge.folder import Scored, any_hidden, score_folder, write_blind
from femubench.core.challenge.truth import DataKind, Hidden
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_to_json


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


def challenge(
    folder: str | PathLike[str],
    seed: int,
    *,
    kind: DataKind = "A",
    structure: str = "ladder",
    hidden: Hidden | Literal["any"] = "any",
    scatter: float = 0.0,
    truth: str | PathLike[str] | None = None,
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

    Raises:
        InputError: when the folder is not empty, the truth exists, or nothing can be drawn.

    Examples:
        >>> femubench.challenge("blind", seed=3, hidden="none").folder.name
        'blind'
    """
    path, commitment = write_blind(
        Path(folder),
        seed,
        kind,
        structure=structure,
        hidden=any_hidden(seed) if hidden == "any" else hidden,
        scatter=scatter,
        sealed=None if truth is None else Path(truth),
    )
    return Challenge(Path(folder), path, commitment)


def score_challenge(
    folder: str | PathLike[str],
    answer: Diagnosis | str | PathLike[str],
    *,
    truth: str | PathLike[str] | None = None,
) -> Scored:
    """Judge an answer to a blind case.

    Arguments:
        folder: of the case.
        answer: a diagnosis, or a file as ``bench diagnose --json`` writes it.
        truth: the sealed truth; ``truth.sealed`` in the folder by default.

    Raises:
        InputError: when case, truth or answer cannot be read, or do not belong together.

    Examples:
        >>> blind = femubench.challenge("blind", seed=3, hidden="none")
        >>> femubench.score_challenge("blind", found).judgement.right  # it names a cause
        False
    """
    sealed = None if truth is None else Path(truth)
    if not isinstance(answer, Diagnosis):
        return score_folder(Path(folder), Path(answer), sealed)
    with TemporaryDirectory() as scratch:
        file = Path(scratch, "answer.json")
        file.write_text(json.dumps(diagnosis_to_json(answer), allow_nan=False), encoding="utf-8")
        return score_folder(Path(folder), file, sealed)
