"""The answer to a blind case, in the JSON of ``bench diagnose``; third parties write it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator

from femubench.core.diagnosis.result import Diagnosis
from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.diagnosis import Verdict
from femubench.core.typing import Side

_AND = " + "
_ROUNDING = 1e-6

Finite = Annotated[float, Field(allow_inf_nan=False)]
# Sums of probabilities may round to a little more than 1.
Probability = Annotated[
    float,
    Field(ge=0.0, le=1.0 + 1e-9, allow_inf_nan=False),
    AfterValidator(lambda value: min(value, 1.0)),
]
Word = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]


class _AnswerPart(BaseModel):
    # An answer may say more than is judged: rivals, residuals, advice.
    model_config = ConfigDict(extra="ignore", frozen=True, from_attributes=True)


class AnswerParameter(_AnswerPart):
    """A size: `std` is None where it was not fitted; `textbook` where a handbook gives it."""

    name: Word
    value: Finite
    std: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    unit: Word = ""
    textbook: bool = False


class AnswerCause(_AnswerPart):
    """An effect at a place; ``a + b`` at ``p + q`` for a pair within a group.

    A fault of data or input, by its `side`, belongs to every member of a group.
    """

    effect: Word
    place: Word = ""
    parameters: tuple[AnswerParameter, ...] = Field((), max_length=20)
    probability: Probability | None = None
    side: Side = "model"
    # The name alone, where it says nothing of the place.
    place_probability: Probability | None = None

    @field_validator("place_probability", mode="before")
    @classmethod
    def _known(cls, value: object) -> object:
        return None if isinstance(value, float) and math.isnan(value) else value

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


class Answer(_AnswerPart):
    """What somebody says of a blind case.

    Arguments:
        verdict: one word.
        causes: with ``named`` all that the model lacks, with ``ambiguous`` the members of one
            group of which one is right.
        nothing: probability that the model lacks nothing, if stated.
    """

    verdict: Verdict
    causes: tuple[AnswerCause, ...] = Field((), max_length=200)
    nothing: Probability | None = None

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Answer:
        """Return the answer that a diagnosis gives."""
        return cls.model_validate(diagnosis)

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
            return self.nothing
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
    text = read_text(path, 4 * MIB)
    try:
        return Answer.model_validate_json(text)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(str(part) for part in fault["loc"][:6])
        what = str(fault["msg"])[:200]
        expected = "the JSON of `bench diagnose --json`"
        raise InputError(what, file=path, key=key or None, expected=expected) from None
