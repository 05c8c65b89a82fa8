"""Where two parts of a model meet: nodes that both have, and what a softness between them does.

A mesh joins two parts by nodes that they share, as if they were one piece. Let one of them, A, move
there by d more than the other, with springs between them that are kappa times as stiff as A is
there, K_aa. Then (1 + kappa) K_aa d = -K_a u, which leaves the factor f = kappa / (1 + kappa) of
what A resists by the interface,

    K(f) = K - (1 - f) K_a' K_aa^-1 K_a ,

and the mass of A moves by d with it. At f = 1 the parts are one piece, at zero they touch no more.
Where the nodes of A are held, the other part is the ground, and the same holds with what the model
does not have of these nodes.

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
from femubench.core.fem.model import Edge, Model, Powers
from femubench.core.modal.eigen import cache_by_model
from femubench.core.typing import FloatArray, IntArray, SparseArray

_MOST = 1500  # rows that two parts share; wider faces are none
_LOOSE = 1e-10  # of the stiffness there: what resists no motion


@dataclass(frozen=True)
class Interfaces:
    """The places of a model from matrices where two parts share nodes: ``interface:A|B``.

    Where nodes of a part are held it is ``interface:ground|A``.

    Arguments:
        model: any model; of a frame, or without groups, there are none.
        parts: names of its groups between which, and under which, there may be some.
    """

    PREFIX: ClassVar[str] = "interface:"
    GROUND: ClassVar[str] = "interface:ground"

    model: Model
    parts: tuple[str, ...]

    @property
    def edges(self) -> dict[str, Edge]:
        """Return what the softer of two parts, or one that is held, does apart, by interface.

        In a basis, where all groups have all coordinates, there are none to be found.
        """
        return _edges(self.model, self.parts)

    @property
    def places(self) -> tuple[str, ...]:
        """Return all interfaces; where the model is in a basis, those that it was given."""
        return tuple(p for p in self.model.powers if p.startswith(self.PREFIX)) or tuple(self.edges)

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
        if place not in self.edges:
            raise ModelError(f"no two parts meet at {place!r}")
        edge = self.edges[place]
        stiff, heavy = sp.csr_array(edge.pulled), sp.csr_array(edge.carried)
        near = np.flatnonzero(np.diff(stiff.indptr) + np.diff(heavy.indptr))
        pulled, carried = (
            part[near].toarray() if onto is None else onto(part) for part in (stiff, heavy)
        )
        follow = pulled @ loose_inverse(edge.stiff.toarray())
        cross, moved = carried @ follow.T, follow @ edge.heavy @ follow.T
        found = {1: (pulled @ follow.T, cross + cross.T), 2: (0.0 * moved, moved)}
        if onto is not None:
            return found
        pick = sp.csr_array(sp.eye_array(self.model.size, format="csc")[:, near])
        return {
            power: (sp.csc_array(pick @ k @ pick.T), sp.csc_array(pick @ m @ pick.T))
            for power, (k, m) in ((p, map(sp.csr_array, pair)) for p, pair in found.items())
        }

    def forces(self, place: str) -> Callable[[float, FloatArray], tuple[FloatArray, FloatArray]]:
        """Return what K x and M x grow by, by f, how much of an interface is left, and motions x.

        Arguments:
            place: one of `edges`.
        """
        edge = self.edges[place]
        whole = loose_inverse(edge.stiff.toarray())

        def added(left: float, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
            inverse = (left - 1.0) * whole
            apart = inverse @ (edge.pulled.T @ motions)
            carried = edge.carried.T @ motions + edge.heavy @ apart
            return edge.pulled @ apart, edge.carried @ apart + edge.pulled @ (inverse @ carried)

        return added


def loose_inverse(stiffness: FloatArray) -> FloatArray:
    """Return the inverse of a stiffness, zero for motions that it does not resist, (p, p)."""
    size = np.sqrt(stiffness.diagonal())
    size = np.outer(size, size)
    return np.asarray(la.pinvh(stiffness / size, rtol=_LOOSE) / size)


@cache_by_model
def _edges(model: Model, parts: tuple[str, ...]) -> dict[str, Edge]:
    size = {name: model.groups[name].diagonal() for name in parts}
    found = {}
    for pair in combinations(parts, 2):
        rows = np.flatnonzero((size[pair[0]] > 0.0) & (size[pair[1]] > 0.0))
        least = min(np.count_nonzero(size[name]) for name in pair)
        if 0 < len(rows) <= _MOST and 2 * len(rows) < least:
            softer = min(pair, key=lambda name: float(size[name][rows].sum()))
            found[f"{Interfaces.PREFIX}{'|'.join(pair)}"] = _edge(model, softer, rows)
    held = {name: edge for name, edge in model.grounds.items() if edge.part in parts}
    return found | {f"{Interfaces.PREFIX}{name}": edge for name, edge in held.items()}


def _edge(model: Model, name: str, rows: IntArray) -> Edge:
    whole = model.groups[name]
    columns = [
        sp.csc_array(part)[:, rows] for part in (whole, model.mass_groups.get(name, 0.0 * whole))
    ]
    return Edge(name, rows, *columns, *(part[rows] for part in columns))
