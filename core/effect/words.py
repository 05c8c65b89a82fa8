"""How an effect speaks for itself: the wording of its sizes, and what can be read directly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# In its unit; a relative change, also in percent with a sign; a part of a whole, also in percent.
Wording = Literal["value", "change", "share"]


@dataclass(frozen=True)
class Reading:
    """An instrument that reads a parameter of an effect without any vibration test.

    Arguments:
        parameter: name of the parameter that it reads.
        text: an imperative clause for the advice: ``"read the temperature"``.
        std: standard deviation of the reading, in the unit of the parameter.
    """

    parameter: str
    text: str
    std: float
