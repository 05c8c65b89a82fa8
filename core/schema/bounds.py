"""The bounds of what is read of results; within them all figures of a run can be computed."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt, MaxLen

LONGEST_TEXT = 100_000  # characters of a reason or a traceback
Name = Annotated[str, MaxLen(1_000)]
Text = Annotated[str, MaxLen(LONGEST_TEXT)]
Whole = Annotated[int, Ge(0), Lt(2**63)]
Hertz = Annotated[float, Ge(1e-45), Le(1e30)]
# Bounded so that the square of a relative error is a number.
PredictedHertz = Annotated[float, Ge(-1e100), Le(1e100)]
StdHertz = Annotated[float, Ge(0), Le(1e100)]
Percent = Annotated[float, Ge(0), Le(1e150)]
Mac = Annotated[float, Ge(-1e-6), Le(1 + 1e-6)]
Seconds = Annotated[float, Ge(0)]
Score = Annotated[float, Gt(0), Le(1e150)]
Rank = Annotated[int, Ge(1), Lt(2**63)]
READING = {"extra": "ignore", "allow_inf_nan": False}
