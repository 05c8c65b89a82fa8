"""Mass and stiffness of a stretched solid of bricks, as sums over powers of the factors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import skfem
from scipy import sparse

from truths.elasticity import Matrices, basis_of
from truths.solid import Solid
from truths.stretch import Stretch

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Cells = npt.NDArray[np.bool_]  # which ones of all
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of directions of derivatives
Power = tuple[int, ...]  # of each factor


def _unit_integrals() -> tuple[Array, Array]:
    """Return integrals over a unit brick of derivative a of function i times b of j, and i times j.

    Returns:
        (3, 3, 20, 20) and (20, 20), in the order of scikit-fem's functions.
    """
    corners = np.array(
        [(0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 1)]
    ).T.astype(float)
    one = np.zeros(1)
    solid = Solid(corners, np.arange(8)[:, None], one.astype(int), ("brick",), one, one, one)
    basis = basis_of(solid, corners)
    order = basis.element_dofs[:, 0]

    def local(form: Any) -> Array:  # noqa: ANN401 - a form of scikit-fem
        return np.asarray(form.assemble(basis).toarray()[np.ix_(order, order)])

    def slopes(a: int, b: int) -> Array:
        @skfem.BilinearForm
        def form(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
            return v.grad[a] * u.grad[b]

        return local(form)

    @skfem.BilinearForm
    def product(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        return v * u

    return np.array([[slopes(a, b) for b in range(3)] for a in range(3)]), local(product)


def _brick_matrices() -> tuple[Array, Array, Array]:
    """Return what a brick's stiffness is the sum of by pair of directions, and its mass.

    Returns:
        By Lame's first constant and by the shear modulus, (6, 60, 60) each; by the density.
        Dof 3 i + c moves node i of the brick along c.
    """
    slope, product = _unit_integrals()
    by_lame, by_shear = np.zeros((2, len(PAIRS), 20, 3, 20, 3))
    for k, (a, b) in enumerate(PAIRS):
        if a == b:
            for c in range(3):
                by_shear[k, :, c, :, c] += slope[a, a]
            by_shear[k, :, a, :, a] += slope[a, a]
            by_lame[k, :, a, :, a] += slope[a, a]
            continue
        for c, d in ((a, b), (b, a)):
            by_lame[k, :, c, :, d] += slope[c, d]
            by_shear[k, :, c, :, d] += slope[d, c]
    mass = np.zeros((20, 3, 20, 3))
    for c in range(3):
        mass[:, c, :, c] = product
    wide = (len(PAIRS), 60, 60)
    return by_lame.reshape(wide), by_shear.reshape(wide), mass.reshape(60, 60)


@dataclass(frozen=True)
class StretchedSolid:
    """A mesh of bricks of which mass and stiffness are known at every stretch.

    Arguments:
        solid: the mesh of the drawing.
        stretch: of its axes.
    """

    solid: Solid
    stretch: Stretch

    @cached_property
    def nodes(self) -> Array:
        """Return the nodes of the straight description, (3, n), m."""
        return np.asarray(self._basis.doflocs)

    @cached_property
    def _basis(self) -> skfem.CellBasis:
        return basis_of(self.solid, self.solid.points)

    @cached_property
    def _sizes(self) -> Array:
        corners = self.solid.points[:, self.solid.cells]
        return np.asarray(corners.max(axis=1) - corners.min(axis=1))

    @cached_property
    def _classes(self) -> Integers:
        """Return which factor each brick has along each axis, (3, bricks)."""
        centres, stretch = self.solid.centres, self.stretch
        rows = [stretch.classes[a][stretch.interval(a, centres[a])] for a in range(3)]
        return np.array(rows)

    @cached_property
    def _places(self) -> tuple[Integers, Integers, Integers, Integers]:
        """Return the order of all bricks' entries, where sums begin, and row and column of each."""
        dofs = (3 * self._basis.element_dofs[:, None] + np.arange(3)[:, None]).reshape(60, -1).T
        n = 3 * self.nodes.shape[1]
        row = np.repeat(dofs, 60, axis=1).ravel()
        col = np.tile(dofs, (1, 60)).ravel()
        keys = col * n + row
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        first = np.flatnonzero(np.append(True, keys[1:] != keys[:-1]))
        return order, first, keys[first] % n, keys[first] // n

    def _matrix(self, entries: Array) -> sparse.csc_array:
        """Return the matrix of the solid from those of its bricks, (bricks, 3600)."""
        order, first, row, col = self._places
        n = 3 * self.nodes.shape[1]
        data = np.add.reduceat(entries.ravel()[order], first)
        starts = np.searchsorted(col, np.arange(n + 1))
        return sparse.csc_array((data, row, starts), shape=(n, n))

    @cached_property
    def _bricks(self) -> tuple[Array, Array]:
        by_lame, by_shear, mass = _brick_matrices()
        return np.concatenate([by_lame, by_shear]).reshape(12, -1), mass.reshape(1, -1)

    @cached_property
    def _coefficients(self) -> tuple[Array, Array]:
        """Return of each brick in the drawing what its matrices go with, (bricks, 12) and mass."""
        volume, pairs = self._sizes.prod(axis=0), np.array(PAIRS)
        share = volume[:, None] / (self._sizes[pairs[:, 0]] * self._sizes[pairs[:, 1]]).T
        shear = self.solid.modulus / (2 * (1 + self.solid.poisson))
        lame = shear * 2 * self.solid.poisson / (1 - 2 * self.solid.poisson)
        stiffness = np.hstack([lame[:, None] * share, shear[:, None] * share])
        return stiffness, (self.solid.density * volume)[:, None]

    def matrices(self, factors: Array) -> Matrices:
        """Return the matrices of the solid stretched by factors."""
        s, pairs = factors[self._classes], np.array(PAIRS)
        ratio = (s.prod(axis=0) / (s[pairs[:, 0]] * s[pairs[:, 1]])).T
        stiffness, mass = self._coefficients
        tables = self._bricks
        return Matrices(
            nodes=self.stretch.map(factors)(self.nodes),
            straight=self.nodes,
            stiffness=self._matrix((stiffness * np.tile(ratio, 2)) @ tables[0]),
            mass=self._matrix((mass * s.prod(axis=0)[:, None]) @ tables[1]),
        )

    def _powers(self) -> Iterator[tuple[bool, Power, Cells, int]]:
        """Yield mass or not, power, which bricks, and the pair, of every product of factors."""
        kinds, which = np.unique(self._classes, axis=1, return_inverse=True)
        for k in range(kinds.shape[1]):
            inside = which.ravel() == k
            volume = np.bincount(kinds[:, k], minlength=len(self.stretch.names))
            yield True, tuple(volume.tolist()), inside, 0
            for number, (a, b) in enumerate(PAIRS):
                power = volume.copy()
                power[kinds[a, k]] -= 1
                power[kinds[b, k]] -= 1
                yield False, tuple(power.tolist()), inside, number

    def masses(self) -> dict[Power, float]:
        """Return the mass of the solid in kg as a sum over powers of the factors."""
        found: dict[Power, float] = defaultdict(float)
        for is_mass, power, inside, _ in self._powers():
            if is_mass:
                found[power] += float(self._coefficients[1][inside].sum())
        return dict(found)

    def projected(self, vectors: Array) -> tuple[dict[Power, Array], dict[Power, Array]]:
        """Return stiffness and mass seen by vectors (dofs, n), by power of the factors, (n, n)."""
        chosen: dict[tuple[bool, Power], list[tuple[Cells, int]]] = defaultdict(list)
        for is_mass, power, inside, pair in self._powers():
            chosen[is_mass, power].append((inside, pair))
        found: tuple[dict[Power, Array], dict[Power, Array]] = ({}, {})
        for (is_mass, power), parts in chosen.items():
            known, table = self._coefficients[is_mass], self._bricks[is_mass]
            weights = np.zeros_like(known)
            for inside, pair in parts:
                for column in (pair,) if is_mass else (pair, pair + len(PAIRS)):
                    weights[inside, column] = known[inside, column]
            seen = self._seen(weights, table, vectors)
            found[is_mass][power] = (seen + seen.T) / 2
        return found

    def _seen(self, weights: Array, table: Array, vectors: Array) -> Array:
        """Return the product of weighted bricks with vectors from both sides."""
        inside = np.flatnonzero(weights.any(axis=1))
        dofs = (3 * self._basis.element_dofs[:, None, inside] + np.arange(3)[:, None]).reshape(
            60, -1
        )
        seen = np.zeros((vectors.shape[1],) * 2)
        for kind, which in _alike(weights[inside]):
            own = vectors[dofs[:, which]]  # (60, bricks, n)
            brick = (kind @ table).reshape(60, 60)
            pulled = np.tensordot(brick, own, axes=(1, 0))
            seen += np.tensordot(own, pulled, axes=((0, 1), (0, 1)))
        return seen


def _alike(weights: Array) -> Iterator[tuple[Array, Integers]]:
    """Yield each kind of row and which rows are of it, bricks of one size and material."""
    size = np.abs(weights).max(axis=0)
    size[size == 0] = 1.0
    _, first, which = np.unique(
        np.round(weights / size, 12), axis=0, return_index=True, return_inverse=True
    )
    for k, row in enumerate(first):
        yield weights[row], np.flatnonzero(which.ravel() == k)
