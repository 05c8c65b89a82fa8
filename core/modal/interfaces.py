"""Where two parts of a model meet: nodes that both have, and what a softness between them does.

A mesh joins two parts by nodes that they share, as if they were one piece. Let one of them, A, move
there by d more than the other, with springs between them that are kappa times as stiff as A is
there, K_aa. Then (1 + kappa) K_aa d = -K_a u, which leaves the factor f = kappa / (1 + kappa) of
what A resists by the interface,

    K(f) = K - (1 - f) K_a' K_aa^-1 K_a ,

and the mass of A moves by d with it. At f = 1 the parts are one piece, at zero they touch no more.

Source: Guyan (1965), AIAA Journal 3, for motions that follow without inertia forces of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model, Powers
from femubench.core.modal.eigen import cache_by_model
from femubench.core.modal.group_prior import INTERFACE, STRUCTURE_STD, GroupPriors
from femubench.core.typing import FloatArray, IntArray, SparseArray

_MOST = 1500  # rows that two parts share; wider faces are none
_LOOSE = 1e-10  # of the stiffness there: what resists no motion


@dataclass(frozen=True)
class Interfaces:
    """The places of a model from matrices where two parts share nodes: ``interface:A|B``.

    Arguments:
        model: any model; of a frame, or without groups, there are none.
    """

    PREFIX: ClassVar[str] = INTERFACE

    model: Model

    @property
    def places(self) -> tuple[str, ...]:
        """Return the interfaces between parts that are no joints and hold nothing to ground.

        Examples:
            >>> modal.Interfaces(model).places
            ()
        """
        known = tuple(place for place in self.model.powers if place.startswith(INTERFACE))
        return known or tuple(_shared(self.model))

    def side(self, place: str) -> tuple[str, IntArray]:
        """Return the group that is softer there, and the rows that it shares, (p,).

        Raises:
            ModelError: when there is no such interface.
        """
        if place not in _shared(self.model):
            raise ModelError(f"no two parts meet at {place!r}")
        return _shared(self.model)[place]

    def powers(self, place: str, onto: Callable[[SparseArray], FloatArray] | None = None) -> Powers:
        """Return stiffness and mass that come with powers of f - 1.

        Arguments:
            place: one of `places`.
            onto: from forces (n, p) to those along coordinates, (N, p), of which the matrices then
                are; None for the rows of the model.

        Raises:
            ModelError: when there is no such interface.
        """
        if onto is None and place in self.model.powers:
            return self.model.powers[place]
        name, rows = self.side(place)
        stiff = sp.csr_array(sp.csc_array(self.model.groups[name])[:, rows])
        heavy = sp.csr_array(stiff.shape)
        if name in self.model.mass_groups:
            heavy = sp.csr_array(sp.csc_array(self.model.mass_groups[name])[:, rows])
        near = np.flatnonzero(np.diff(stiff.indptr) + np.diff(heavy.indptr))
        pulled, carried = (
            part[near].toarray() if onto is None else onto(part) for part in (stiff, heavy)
        )
        inside, inertia = stiff[rows].toarray(), heavy[rows].toarray()
        size = np.sqrt(inside.diagonal())
        inverse = la.pinvh(inside / np.outer(size, size), rtol=_LOOSE) / np.outer(size, size)
        follow = pulled @ inverse
        cross = carried @ follow.T
        found = {
            1: (pulled @ follow.T, cross + cross.T),
            2: (np.zeros(cross.shape), follow @ inertia @ follow.T),
        }
        if onto is not None:
            return found
        pick = sp.csr_array(
            (np.ones(len(near)), (near, range(len(near)))), (heavy.shape[0], len(near))
        )
        return {
            power: tuple(sp.csc_array(pick @ sp.csr_array(part) @ pick.T) for part in pair)
            for power, pair in found.items()
        }


@cache_by_model
def _shared(model: Model) -> dict[str, tuple[str, IntArray]]:
    """Return the softer of two parts and the rows that both have, by interface.

    In a basis, where all groups have all coordinates, there are none to be found.
    """
    std = GroupPriors(model).std
    sure = {n: k for n, k in model.groups.items() if std(n) < 2.0 * STRUCTURE_STD}
    size = {name: part.diagonal() for name, part in sure.items()}
    found = {}
    for pair in combinations(size, 2):
        rows = np.flatnonzero((size[pair[0]] > 0.0) & (size[pair[1]] > 0.0))
        least = min(np.count_nonzero(size[name]) for name in pair)
        if 0 < len(rows) <= _MOST and 2 * len(rows) < least:
            softer = min(pair, key=lambda name: float(size[name][rows].sum()))
            found[f"{INTERFACE}{'|'.join(pair)}"] = softer, rows
    return found
