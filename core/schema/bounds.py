"""The bounds of what is read of results; within them all figures of a run can be computed."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from msgspec import Meta

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
