"""The answer to a blind case, in the JSON of ``bench diagnose``; third parties write it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from femubench.core.diagnosis.result import Diagnosis
from femubench.core.files import MIB, read_text
from femubench.core.schema.bounds import Real
from femubench.core.schema.diagnosis import Verdict
from femubench.core.schema.records import parse_json, to_plain
from femubench.core.schema.validation import read_plain
from femubench.core.typing import Side

_AND = " + "
_ROUNDING = 1e-6

# Sums of probabilities may round to a little more than 1.
Probability = Annotated[float, Meta(ge=0.0, le=1.0 + 1e-9)]
Word = Annotated[str, Meta(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]


class AnswerParameter(Struct, frozen=True):
    """A size: `std` is None where it was not fitted; `textbook` where a handbook gives it."""

    name: Word
    value: Real
    std: Annotated[float, Meta(ge=0.0, le=1e300)] | None = None
    unit: Word = ""
    textbook: bool = False


class AnswerCause(Struct, frozen=True):
    """An effect at a place; ``a + b`` at ``p + q`` for a pair within a group.

    A fault of data or input, by its `side`, belongs to every member of a group.
    """

    effect: Word
    place: Word = ""
    parameters: Annotated[tuple[AnswerParameter, ...], Meta(max_length=20)] = ()
    probability: Probability | None = None
    side: Side = "model"
    # The name alone, where it says nothing of the place.
    place_probability: Probability | None = None

    @property
    def claim(self) -> float | None:
        """Return the probability of the effect at its place, None where it is not stated."""
        if self.probability is None:
            return None
        return self.probability * (
            1.0 if self.place_probability is None else self.place_probability
        )

    @property
    def parts(self) -> tuple[tuple[str, str], ...]:
        """Return effect and place of everything that the entry names."""
        effects, places = self.effect.split(_AND), self.place.split(_AND)
        if len(effects) != len(places):
            return ((self.effect, self.place),)
        return tuple(zip(effects, places, strict=True))


class Answer(Struct, frozen=True):
    """What somebody says of a blind case; more than is judged, as rivals or advice, is left out.

    Arguments:
        verdict: one word.
        causes: with ``named`` all that the model lacks, with ``ambiguous`` the members of one
            group of which one is right.
        nothing: probability that the model lacks nothing, if stated.
    """

    verdict: Verdict
    causes: Annotated[tuple[AnswerCause, ...], Meta(max_length=200)] = ()
    nothing: Probability | None = None

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Answer:
        """Return the answer that a diagnosis gives."""
        return read_plain(
            cls, {name: to_plain(getattr(diagnosis, name)) for name in cls.__struct_fields__}
        )

    @property
    def probability(self) -> float | None:
        """Return the probability that the answer claims for what it says; None where it does not.

        A group claims the sum over its members, or the largest of theirs where several of them
        stand together; several causes together claim the smallest of theirs; ``unknown`` and
        ``not-confirmed`` claim none.
        """
        known = [cause for cause in self.causes if cause.claim is not None]
        stated = [cause.claim or 0.0 for cause in known if cause.side == "model"]
        faults = [cause.claim or 0.0 for cause in known if cause.side != "model"]
        if self.verdict == "none":
            return None if self.nothing is None else min(self.nothing, 1.0)
        if self.verdict not in ("named", "ambiguous") or not known:
            return None
        if self.verdict == "named":
            return min(*stated, *faults, 1.0)
        named = sum(c.probability or 0.0 for c in self.causes if c.side == "model")
        whole = min(1.0, sum(stated)) if named <= 1.0 + _ROUNDING else max(stated)
        return min(whole, *faults, 1.0)


def read_answer(path: Path) -> Answer:
    """Return the answer in a JSON file.

    Raises:
        InputError: when the file cannot be read, is too large or is no answer.
    """
    expected = "the JSON of `bench diagnose --json`"
    return read_plain(
        Answer, parse_json(read_text(path, 4 * MIB), file=path, expected=expected), file=path
    )
