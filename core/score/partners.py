"""How many modes of a model could be the partner of a measured one.

A model with many modes around those of the structure always has one close to what was measured,
wherever that is: which one it is, the measurement says and not the model.
"""

from __future__ import annotations

import numpy as np

from femubench.core.typing import IntArray

# Of two modes of one shape that lie close, sensors do not always tell which is which: results on
# built-in cases have up to half as many surplus partners as there are measured modes.
_MOST = 2.0 / 3.0
_ALWAYS = 1  # an oscillator that was attached doubles a mode


def surplus_partners(found: IntArray, expected: IntArray) -> tuple[int, str]:
    """Return the number of partners beyond the nominal model's, and what was counted, if too many.

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
        return 0, ""
    possible = f"{own.sum()} modes could be partners of {len(own)} measured ones"
    return count, f"{possible}, of the nominal model {known.sum()}"
