"""What can be read directly of an effect, without any vibration test."""

from __future__ import annotations

from dataclasses import dataclass


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
