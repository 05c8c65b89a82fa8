"""Slopes of stiffness and mass by parameters that fixed matrices are multiplied by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from femubench.core.fem.derivatives import Derivatives
from femubench.core.typing import FloatArray, IntArray

Matrix: TypeAlias = Literal["mass", "stiffness"]


@dataclass(frozen=True)
class TermSlopes:
    """dK/dx and dM/dx where the matrices are sums of fixed ones with factors.

    Arguments:
        parts: what each fixed matrix is added to, and its product with vectors, (n, m).
        factors: d factor / dx of each, (n_parameters, n_parts).
    """

    parts: tuple[tuple[Matrix, Callable[[FloatArray], FloatArray]], ...]
    factors: FloatArray

    @property
    def count(self) -> int:
        """Return the number of parameters."""
        return len(self.factors)

    def take(self, chosen: IntArray) -> TermSlopes:
        """Return those of some of the parameters."""
        return TermSlopes(self.parts, self.factors[chosen])

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dx right_j and the same for dM, two arrays (m, n_parameters)."""
        found = {name: np.zeros((left.shape[1], self.count)) for name in ("stiffness", "mass")}
        for (matrix, apply), own in zip(self.parts, self.factors.T, strict=True):
            energy = np.einsum("nm,nm->m", left, apply(right))
            used = np.flatnonzero(own)
            found[matrix][:, used] += np.outer(energy, own[used])
        return found["stiffness"], found["mass"]

    def inner(self, left: FloatArray, right: FloatArray, matrix: str = "stiffness") -> FloatArray:
        """Return left' dK/dx right, or that of the mass, (n_parameters, m_left, m_right)."""
        found = np.zeros((self.count, left.shape[1], right.shape[1]))
        for (kind, apply), own in zip(self.parts, self.factors.T, strict=True):
            if kind == matrix:
                used = np.flatnonzero(own)
                form = left.T @ apply(right)
                found[used] += own[used, None, None] * form
        return found

    def combine(self, vector: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of weights[p] dK/dx @ vector, (n, k), of weights (n_parameters, k)."""
        return self.products(vector, 0.0) @ weights

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dx - eigenvalue dM/dx) @ vector for every parameter, (n, n_parameters)."""
        result = np.zeros((len(vector), self.count))
        for (matrix, apply), own in zip(self.parts, self.factors.T, strict=True):
            used = np.flatnonzero(own)
            factor = own[used] if matrix == "stiffness" else -eigenvalue * own[used]
            result[:, used] += np.outer(apply(vector[:, None])[:, 0], factor)
        return result


@dataclass(frozen=True)
class JoinedSlopes:
    """Slopes by properties and by terms, in the order of the parameters.

    Arguments:
        parts: each with the numbers of its parameters.
    """

    parts: tuple[tuple[MatrixSlopes, IntArray], ...]
    count: int

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dx right_j and the same for dM, two arrays (m, n_parameters)."""
        found = np.zeros((2, left.shape[1], self.count))
        for part, own in self.parts:
            found[:, :, own] = part.quadratic(left, right)
        return found[0], found[1]

    def inner(self, left: FloatArray, right: FloatArray, matrix: str = "stiffness") -> FloatArray:
        """Return left' dK/dx right, or that of the mass, (n_parameters, m_left, m_right)."""
        found = np.zeros((self.count, left.shape[1], right.shape[1]))
        for part, own in self.parts:
            found[own] = part.inner(left, right, matrix)
        return found

    def combine(self, vector: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of weights[p] dK/dx @ vector, (n, k), of weights (n_parameters, k)."""
        products = [part.combine(vector, weights[own]) for part, own in self.parts]
        return sum(products[1:], start=products[0])

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dx - eigenvalue dM/dx) @ vector for every parameter, (n, n_parameters)."""
        result = np.zeros((len(vector), self.count))
        for part, own in self.parts:
            result[:, own] = part.products(vector, eigenvalue)
        return result


MatrixSlopes: TypeAlias = Derivatives | TermSlopes | JoinedSlopes
