"""Array types under one name each."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
# scipy ships no type information; a sparse array is whatever answers to `@`.
SparseArray: TypeAlias = Any
# Element batches are real, or complex when a derivative is taken through them.
AnyArray: TypeAlias = NDArray[Any]
