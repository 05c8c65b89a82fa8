"""How many modes of a model could be the partner of a measured one.

A model with many modes around those of the structure always has one close to what was measured,
wherever that is: which one it is, the measurement says and not the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import IntArray

# Of two modes of one shape that lie close, sensors do not always tell which is which: results on
# built-in cases have up to half as many surplus partners as there are measured modes.
_MOST = 2.0 / 3.0
_ALWAYS = 1  # an oscillator that was attached doubles a mode


@dataclass(frozen=True)
class Surplus:
    """Possible partners that a model has beyond those of the nominal one.

    Arguments:
        count: of them; 0 where there are not too many for a prediction.
        reason: what was counted then.
    """

    count: int = 0
    reason: str = ""


def surplus_partners(found: IntArray, expected: IntArray) -> Surplus:
    """Return possible partners beyond those of the nominal model, where they are too many.

    More than two for every three measured modes are, of the structure as tested and of all its
    modifications together; one is always allowed. A mode without a partner makes no room for
    another one's.

    Arguments:
        found, expected: how many modes of the model, and of the nominal one, could be the partner
            of each measured mode, (m,).
    """
    own, known = np.maximum(found, 1), np.maximum(expected, 1)
    count = int(own.sum() - known.sum())
    if count <= max(_ALWAYS, _MOST * len(own)):
        return Surplus()
    told = f"{own.sum()} modes could be partners of {len(own)} measured ones"
    return Surplus(count, f"{told}, of the nominal model {known.sum()}")
