"""Numbers as they go into a page: rounded or not, and always such that JSON knows them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def clean(value: Any) -> Any:  # noqa: ANN401 - a cell of a table
    """Return a plain value; None for a number that JSON does not know."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def plain_data(data: Any, depth: int = 8) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return plain data with seven digits of every number.

    Numbers that JSON does not know, and what lies deeper, are None.
    """
    # First, since drawings have a million of them.
    if type(data) is float and math.isfinite(data):
        return int(data) if data.is_integer() else float(f"{data:.7g}")
    if isinstance(data, (list, tuple)):
        return [plain_data(value, depth - 1) for value in data] if depth else None
    if isinstance(data, Mapping):
        return {str(k): plain_data(v, depth - 1) for k, v in data.items()} if depth else None
    return clean(data)


def compact_json(data: Any) -> str:  # noqa: ANN401 - JSON data of any form
    """Return strict JSON without a space that needs not be."""
    return json.dumps(data, allow_nan=False, separators=(",", ":"))


def round_figures(value: Any, digits: int) -> Any:  # noqa: ANN401 - a number of a third party's result
    """Return a number with some significant digits; None where there is none."""
    value = clean(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    if isinstance(value, int):
        return value
    short = float(f"{value:.{digits}g}")
    return int(short) if short == int(short) and abs(short) < 2**53 else short
