"""The bounds of what is read of results; within them all figures of a run can be computed."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from msgspec import Meta

from femubench.core.errors import InputError

LONGEST_TEXT = 100_000  # characters of a reason or a traceback
Name = Annotated[str, Meta(max_length=1_000)]
Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]
Whole = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Hertz = Annotated[float, Meta(ge=1e-45, le=1e30)]
# Bounded so that the square of a relative error is a number.
PredictedHertz = Annotated[float, Meta(ge=-1e100, le=1e100)]
StdHertz = Annotated[float, Meta(ge=0, le=1e100)]
Percent = Annotated[float, Meta(ge=0, le=1e150)]
Mac = Annotated[float, Meta(ge=-1e-6, le=1 + 1e-6)]
Weight = Annotated[float, Meta(ge=0, le=1e100)]
Decibels = Annotated[float, Meta(ge=0, le=1e100)]
Degrees = Annotated[float, Meta(ge=0, le=180)]
Seconds = Annotated[float, Meta(ge=0, le=sys.float_info.max)]
GainFigure = Annotated[float, Meta(ge=-1, le=1)]
Rank = Annotated[int, Meta(ge=1, le=2**63 - 1)]
Real = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
if TYPE_CHECKING:
    Number: TypeAlias = float
    Figure: TypeAlias = Any
    Note: TypeAlias = Any
else:
    # JSON has null for what is no finite number.
    Number = Real | None
    Figure = Text | Number  # of a parameter: its name, unit or value
    Note = Text | int | float | None  # on how a result came about

LEAST_KEPT_MAC = 0.3  # of candidates in a run, so that rules with other limits can be tried on it
# Of the rule of the boards: beyond these a run keeps no candidates, or a share is none.
_RULE = {
    **{"window": (0.0, 0.6932), "mac": (LEAST_KEPT_MAC, 1.0), "above": (0.0, 10.0)},
    **{"cap": (1e-6, 10.0), "same_mac": (LEAST_KEPT_MAC, 1.0), "change_cap": (1e-6, 10.0)},
    **{"floor": (1e-6, 1.0), "change_share": (0.0, 1.0), "visible": (0.0, 10.0)},
}


def read_rule_number(name: str, value: str | float, **where: Any) -> float:  # noqa: ANN401
    """Return a number of the rule of the boards.

    Arguments:
        name, value: as they stand in the meta data of a run, or on a command line.
        where: file, line and key, for the message.

    Raises:
        InputError: for another name, or a number that is out of its bounds.
    """
    if name not in _RULE:
        expected = f"one of {', '.join(_RULE)}"
        raise InputError(f"the rule has no {name!r}", **where, expected=expected)
    least, most = _RULE[name]
    try:
        number = float(value)
    except (ValueError, OverflowError):
        number = math.nan
    if not least <= number <= most:
        what, expected = f"{name} of the rule is {value!r}", f"a number from {least:g} to {most:g}"
        raise InputError(what, **where, expected=expected)
    return number
