"""What a result has to say besides its figures, decoded when somebody asks for it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from femubench.core.errors import InputError

# A result has these under the same names; of a hundred thousand they would fill the memory.
DETAILS = ("parameters", "history", "diagnostics", "traceback", "provenance")


@dataclass(frozen=True)
class _Details:
    parameters: list[dict[str, str | float | None]] = field(default_factory=list)
    history: list[dict[str, float | None]] = field(default_factory=list)
    diagnostics: dict[str, float | None] = field(default_factory=dict)
    traceback: str = ""
    provenance: dict[str, str | int | float | None] = field(default_factory=dict)


@cache
def _reader() -> Any:  # noqa: ANN401 - pydantic is not loaded where nothing is read
    from pydantic import TypeAdapter

    return TypeAdapter(_Details)


def decoded(text: bytes) -> dict[str, Any]:
    """Return the details of a result as it has them.

    Arguments:
        text: of a table of JSON, as it stands in a store.

    Raises:
        InputError: when it is something else.
    """
    try:
        found = _reader().validate_json(text)
    except ValueError as error:
        what = f"details of a result: {str(error).splitlines()[0]}"
        raise InputError(what, expected="what `bench run` stores") from None
    return {**vars(found), **with_nan(vars(found))}


def with_nan(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters, history and diagnostics, nan again where JSON had no word for it."""
    return {
        "parameters": tuple(
            {**item, **_numbers(item, ("before", "after"))} for item in details["parameters"]
        ),
        "history": tuple(_numbers(item, item) for item in details["history"]),
        "diagnostics": _numbers(details["diagnostics"], details["diagnostics"]),
    }


def _numbers(item: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    return {name: math.nan if item.get(name) is None else item[name] for name in names}
