"""A TOML text against a schema: whatever is wrong in it gets file, line and key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from femubench.core.case.faults import (
    BadKey,
    KeyPath,
    first_fault,
    join_key_path,
    key_lines,
    line_of,
)
from femubench.core.errors import InputError

_Spec = TypeVar("_Spec", bound=BaseModel)
# The look-behind and the possessive plus keep the search linear.
_LONG_KEY = re.compile(r"""(?<![\w"'.-])(?:["'\w-]++[ \t]*+\.[ \t]*+){50}""")
_AT_LINE = re.compile(r"\s*\(at line (\d+), column \d+\)")


def spec_of(
    text: str,
    file: Path,
    schema: type[_Spec],
    parse: Callable[[Mapping[str, Any]], _Spec] | None = None,
) -> _Spec:
    """Return the content of a TOML text as typed tables.

    Arguments:
        schema: its tables; unknown keys are errors.
        parse: turns plain tables into these; the schema's own way where left out.

    Raises:
        BadKey: at the first key that is wrong.
        InputError: when it is no TOML.
    """
    deep = InputError("nested too deeply", file=file, expected="a flat table")
    # The parser takes time with the square of the parts of a dotted key.
    if _LONG_KEY.search(text):
        raise deep
    try:
        return (parse or schema.model_validate)(tomllib.loads(text))
    except ValidationError as error:
        raise first_fault(error, schema) from None
    except RecursionError:
        raise deep from None
    except tomllib.TOMLDecodeError as error:
        found = _AT_LINE.search(str(error))
        line = int(found.group(1)) if found else None
        what = _AT_LINE.sub("", str(error))
        raise InputError(what, file=file, line=line, expected="valid TOML") from None
    except ValueError:  # Python's own, at whole numbers of more than 4300 digits
        raise InputError("a number is too long", file=file, expected="valid TOML") from None


def locate_fault(fault: BadKey, text: str, file: Path) -> InputError:
    """Return a fault with its file, line and key."""
    key = join_key_path(fault.path) or None
    line = key_line(text, fault.path)
    return InputError(fault.what, file=file, line=line, key=key, expected=fault.expected)


def key_line(text: str, path: KeyPath) -> int | None:
    """Return the line of a key of a valid TOML text, or of the nearest table above it."""
    try:
        return line_of(key_lines(text), path)
    except RecursionError:  # nearly too deep for the parser, and too deep for this one
        return None
