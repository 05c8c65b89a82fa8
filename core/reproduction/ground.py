"""What an agreement of two figures rests on, and the verdicts that follow from that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from femubench.core.errors import InputError

# From what says most for a paper to what says least. Of several grounds the last one counts.
Verdict = Literal[
    "independent",
    "under-convention",
    "searched",
    "fitted",
    "input",
    "cannot-be-checked",
    "misprint",
    "does-not-follow",
]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
FAULTS: tuple[Verdict, ...] = ("misprint", "does-not-follow")


@dataclass(frozen=True)
class Ground:
    """Why a figure of ours may agree with a printed one, or why it does not.

    Arguments:
        verdict: what an agreement on this ground alone is worth, or one of `FAULTS`.
        words: the reason, as a reader sees it.
        tried: number of readings that were tried before this one; of ``searched`` alone.

    Raises:
        InputError: for an empty reason, or a search that does not say how many it tried.
    """

    VERDICTS: ClassVar[tuple[Verdict, ...]] = VERDICTS

    verdict: Verdict
    words: str
    tried: int | None = None

    def __post_init__(self) -> None:
        """Check what a reader sees."""
        if not self.words.strip():
            raise InputError(f"ground {self.verdict!r}: no words (expected the reason)")
        known = self.tried is not None and self.tried > 0
        if known != (self.verdict == "searched"):
            raise InputError(
                f"ground {self.verdict!r}: {self.tried} readings tried (expected a positive "
                "number for 'searched', and none for any other)"
            )


def weakest(grounds: Sequence[Ground]) -> Ground:
    """Return the ground that decides: something fitted makes nothing else independent.

    Arguments:
        grounds: all that an agreement rests on, at least one.
    """
    return max(grounds, key=lambda ground: VERDICTS.index(ground.verdict))
