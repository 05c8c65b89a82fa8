"""How many modes of a model could be the partner of a measured one.

A model with many modes around those of the structure always has one close to what was measured,
wherever that is: which one it is, the measurement says and not the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from femubench.core.typing import IntArray

# By modification, None for the structure as tested: of every measured mode, how many modes of the
# model could be its partner, (m,).
Choices: TypeAlias = Mapping[str | None, IntArray]

# An oscillator that was attached doubles one mode, and fits that went astray doubled three of ten.
_LEAST, _SHARE = 1, 3


@dataclass(frozen=True)
class Surplus:
    """Possible partners that a model has beyond those of the nominal one.

    Arguments:
        count: of them; 0 where there are not too many for a prediction.
        reason: what was counted then.
    """

    count: int = 0
    reason: str = ""


def surplus_partners(found: Choices, expected: Choices) -> Surplus:
    """Return possible partners beyond those of the nominal model, where they are too many.

    More than one for every three measured modes are, and one is always allowed; the structure as
    tested and each modification count by themselves.

    Arguments:
        found, expected: of the model and of the nominal one.
    """
    largest = Surplus()
    for change, own in found.items():
        known = expected[change]
        count = int(np.maximum(own - known, 0).sum())
        if count > max(_LEAST, len(own) // _SHARE) and count > largest.count:
            where = "" if change is None else f" with the modification {change!r}"
            told = f"{own.sum()} modes could be partners of {len(own)} measured ones{where}"
            largest = Surplus(count, f"{told}, of the nominal model {known.sum()}")
    return largest
