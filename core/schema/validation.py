"""Data of strangers against a schema: the first field that is wrong comes out as one line."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from femubench.core.errors import InputError

_R = TypeVar("_R", bound=BaseModel)


def validated(
    kind: type[_R],
    record: object,
    file: Path | str | None = None,
    line: int | None = None,
    key: str = "",
) -> _R:
    """Return plain data as a record.

    Raises:
        InputError: naming the first field that is wrong.
    """
    try:
        return kind.model_validate(record)
    except ValidationError as error:
        raise wrong_field(error, file, line, key) from error


def wrong_field(
    error: ValidationError, file: Path | str | None, line: int | None, key: str
) -> InputError:
    """Return the error that names the first field that is wrong.

    Arguments:
        file, line, key: where the data stand.
    """
    first = error.errors(include_url=False)[0]
    path = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in first["loc"])
    return InputError(first["msg"], file=file, line=line, key=(key + path).lstrip(".") or None)
