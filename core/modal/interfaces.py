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
from femubench.core.typing import FloatArray, IntArray, SparseArray

_MOST = 1500  # rows that two parts share; wider faces are none
_LOOSE = 1e-10  # of the stiffness there: what resists no motion


@dataclass(frozen=True)
class Interfaces:
    """The places of a model from matrices where two parts share nodes: ``interface:A|B``.

    Arguments:
        model: any model; of a frame, or without groups, there are none.
        parts: names of its groups between which there may be some.
    """

    PREFIX: ClassVar[str] = "interface:"

    model: Model
    parts: tuple[str, ...]

    @property
    def sides(self) -> dict[str, tuple[str, IntArray]]:
        """Return the softer of two parts and the rows that both have, (p,), by interface.

        In a basis, where all groups have all coordinates, there are none to be found.
        """
        return _sides(self.model, self.parts)

    @property
    def places(self) -> tuple[str, ...]:
        """Return all interfaces; where the model is in a basis, those that it was given."""
        return tuple(p for p in self.model.powers if p.startswith(self.PREFIX)) or tuple(self.sides)

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
        if place not in self.sides:
            raise ModelError(f"no two parts meet at {place!r}")
        name, rows = self.sides[place]
        whole = self.model.groups[name]
        stiff, heavy = (
            sp.csr_array(sp.csc_array(part)[:, rows])
            for part in (whole, self.model.mass_groups.get(name, 0.0 * whole))
        )
        near = np.flatnonzero(np.diff(stiff.indptr) + np.diff(heavy.indptr))
        pulled, carried = (
            part[near].toarray() if onto is None else onto(part) for part in (stiff, heavy)
        )
        follow = pulled @ loose_inverse(stiff[rows].toarray())
        cross, moved = carried @ follow.T, follow @ heavy[rows].toarray() @ follow.T
        found = {1: (pulled @ follow.T, cross + cross.T), 2: (0.0 * moved, moved)}
        if onto is not None:
            return found
        pick = sp.csr_array(sp.eye_array(len(whole.indptr) - 1, format="csc")[:, near])
        return {
            power: (sp.csc_array(pick @ k @ pick.T), sp.csc_array(pick @ m @ pick.T))
            for power, (k, m) in ((p, map(sp.csr_array, pair)) for p, pair in found.items())
        }

    def forces(self, place: str) -> Callable[[float, FloatArray], tuple[FloatArray, FloatArray]]:
        """Return what K x and M x grow by, by f, how much of an interface is left, and motions x.

        Arguments:
            place: one of `sides`.
        """
        name, rows = self.sides[place]
        part = self.model.groups[name]
        heavy, pulled = self.model.mass_groups.get(name, 0.0 * part), sp.csc_array(part)[:, rows]
        whole = loose_inverse(pulled[rows].toarray())

        def added(left: float, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
            inverse, apart = (left - 1.0) * whole, np.zeros_like(motions)
            apart[rows] = inverse @ (pulled.T @ motions)
            carried = heavy @ (motions + apart)
            return part @ apart, heavy @ apart + pulled @ (inverse @ carried[rows])

        return added


def loose_inverse(stiffness: FloatArray) -> FloatArray:
    """Return the inverse of a stiffness, zero for motions that it does not resist, (p, p)."""
    size = np.sqrt(stiffness.diagonal())
    size = np.outer(size, size)
    return np.asarray(la.pinvh(stiffness / size, rtol=_LOOSE) / size)


@cache_by_model
def _sides(model: Model, parts: tuple[str, ...]) -> dict[str, tuple[str, IntArray]]:
    size = {name: model.groups[name].diagonal() for name in parts}
    found = {}
    for pair in combinations(parts, 2):
        rows = np.flatnonzero((size[pair[0]] > 0.0) & (size[pair[1]] > 0.0))
        least = min(np.count_nonzero(size[name]) for name in pair)
        if 0 < len(rows) <= _MOST and 2 * len(rows) < least:
            softer = min(pair, key=lambda name: float(size[name][rows].sum()))
            found[f"{Interfaces.PREFIX}{'|'.join(pair)}"] = softer, rows
    return found
