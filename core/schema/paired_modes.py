"""Measured modes and those of a model that were paired with them, and the text of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cache
from operator import attrgetter
from typing import Any, ClassVar, TypeAlias

from femubench.core.errors import InputError
from femubench.core.schema.bounds import (
    READING,
    Hertz,
    Mac,
    PredictedHertz,
    StdHertz,
    Text,
    Whole,
)

# The fields of a `PairedMode` in their order, as they stand in a store.
Row: TypeAlias = tuple[
    Whole, Hertz, PredictedHertz | None, Mac | None, Text | None, StdHertz | None
]
_NEEDED = 2  # of them are never None


@dataclass(frozen=True, slots=True)
class PairedMode:
    """One measured mode and the model's mode that was paired with it by shape.

    Arguments:
        number: label of the measured mode.
        measured_hz: its frequency.
        predicted_hz: the model's; None where no mode of the model matches. A negative number
            stands for an imaginary frequency.
        mac: of the two shapes, 0..1; None where nothing was paired or no shape was measured.
        modification: name of the design change; None for the structure as tested.
        predicted_std_hz: standard deviation of what a test would find about `predicted_hz`, its
            own error of measurement included; None where the strategy does not say.
    """

    __pydantic_config__: ClassVar = READING

    number: Whole
    measured_hz: Hertz
    predicted_hz: PredictedHertz | None
    mac: Mac | None
    modification: Text | None = None
    predicted_std_hz: StdHertz | None = None


_FIELDS = attrgetter(*(field.name for field in fields(PairedMode)))


def rows_of(modes: Iterable[PairedMode]) -> list[Row]:
    """Return the fields of every mode."""
    return list(map(_FIELDS, modes))


def rows_from_texts(texts: Sequence[bytes]) -> list[dict[str, list[Row]]]:
    """Return the modes of many results at once, by block.

    Arguments:
        texts: of a table of JSON each, from the name of a block to its rows.

    Raises:
        InputError: when one is something else.
    """
    from pydantic_core import from_json

    try:
        found: list[dict[str, list[Row]]] = from_json(
            b"[%b]" % b",".join(texts), allow_inf_nan=False
        )
        _check([row for blocks in found for rows in blocks.values() for row in rows])
    except (AttributeError, TypeError, ValueError) as error:
        what = f"modes of a result: {str(error).splitlines()[0]}"
        raise InputError(what, expected="what `bench run` stores") from None
    return found


def _check(rows: Sequence[Row]) -> None:
    """Check all rows by the least and the largest value of each column, six times as fast as each.

    Raises:
        TypeError: when numbers and texts are mixed.
        ValueError: when a column is missing or out of its bounds.
    """
    if not rows:
        return
    columns = [
        [value for value in column if value is not None] if place >= _NEEDED else column
        for place, column in enumerate(zip(*rows, strict=True))
    ]
    for end in (min, max):
        _reader().validate_python(tuple(end(column, default=None) for column in columns))


@cache
def _reader() -> Any:  # noqa: ANN401 - pydantic is not loaded where nothing is read
    from pydantic import TypeAdapter

    return TypeAdapter(Row)
