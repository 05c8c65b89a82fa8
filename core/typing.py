"""Types of arrays, and of words that results share, under one name each."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
# scipy ships no type information; a sparse array is whatever answers to `@`.
SparseArray: TypeAlias = Any
# Element batches are real, or complex when a derivative is taken through them.
AnyArray: TypeAlias = NDArray[Any]
# Of a size: in its unit; a relative change, also in percent with a sign; a part of a whole.
Wording = Literal["value", "change", "share"]
# Where something is wrong: in the structure's model, in what was measured, in what was typed in.
Side = Literal["model", "data", "input"]
