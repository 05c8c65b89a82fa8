"""A modal basis of the nominal model, and what every hypothesis does in it.

In the basis of its own modes the nominal stiffness is diag(lambda) and the mass the identity; a
hypothesis adds the projections of its fixed matrices. Where all modes are at hand (small models)
this is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.fit.projection import Projection, Projector
from femubench.core.modal.eigen import Modes
from femubench.core.typing import BoolArray, FloatArray, IntArray

_HIGH = 4.0  # of the highest eigenvalue that is asked for, from where on modes only follow
_AT = (0.07, 0.5, 0.93)  # of it, where the higher modes follow exactly: Chebyshev's points
_WORTH = 0.7  # of all coordinates, above which fewer are no gain
_LIES_IN = 1e-9  # relative length below which a motion lies in the span of the others


@dataclass(frozen=True)
class Space:
    """Modal coordinates with the hypotheses in them.

    Arguments:
        eigenvalues: of the coordinates, ascending, (N,).
        readings: of the coordinates at the sensors, (n_sensors, N).
        mass: of the structure in kg.
        rigid: number of coordinates that are rigid-body motions.
        condensed: what `condense` has found.
    """

    eigenvalues: FloatArray
    readings: FloatArray
    projections: tuple[Projection, ...]
    mass: float
    rigid: int
    condensed: dict[tuple[int, ...], Condensed] = field(
        default_factory=dict, compare=False, repr=False
    )

    def __len__(self) -> int:
        return len(self.eigenvalues)

    @property
    def zero(self) -> float:
        """Return the frequency in Hz up to which a mode counts as one of zero frequency."""
        first = self.eigenvalues[self.rigid :][:1].sum()
        return float(1e-3 * np.sqrt(max(first, 0.0)) / (2.0 * np.pi))

    def still(self, eigenvalues: FloatArray) -> BoolArray:
        """Tell which eigenvalues count as zero."""
        return np.asarray(np.abs(eigenvalues) <= np.square(2.0 * np.pi * self.zero))

    def assemble(
        self, parts: Sequence[Projection], x: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return stiffness, mass and total mass with some hypotheses at their coordinates.

        Arguments:
            parts: what takes part; their added coordinates follow those of the space in order.
            x: coordinates of all of their parameters, (k,).
        """
        size = len(self) + sum(part.extra for part in parts)
        stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
        own = np.arange(len(self))
        stiffness[own, own], mass[own, own] = self.eigenvalues, 1.0
        weight = self.mass
        for part, index, columns in place_parts(len(self), parts):
            factors = part.hypothesis.factors(x[None, columns])[0]
            weight += float(factors @ part.weights)
            # A view, which is added to at once, where the part has no coordinates of its own.
            block = np.ix_(index, index) if part.extra else (slice(len(self)),) * 2
            for matrix, kind in ((stiffness, False), (mass, True)):
                change = part.matrix(factors, mass=kind)
                if change is not None:
                    matrix[block] += change
        return stiffness, mass, weight

    def slopes(
        self, parts: Sequence[Projection], x: FloatArray
    ) -> list[tuple[FloatArray, FloatArray, float]]:
        """Return the derivatives of `assembled` with respect to every coordinate."""
        size = len(self) + sum(part.extra for part in parts)
        result = []
        for part, index, columns in place_parts(len(self), parts):
            for slope in part.hypothesis.slopes(x[columns]):
                pair = np.zeros((2, size, size))
                for matrix, kind in zip(pair, (False, True), strict=True):
                    change = part.matrix(slope, mass=kind)
                    if change is not None:
                        matrix[np.ix_(index, index)] = change
                result.append((pair[0], pair[1], float(slope @ part.weights)))
        return result

    def forces(
        self, parts: Sequence[Projection], x: FloatArray, near: FloatArray, values: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return (dK - lambda_j dM) v_j and the derivative of the mass by every coordinate.

        Arguments:
            parts, x: as in `assembled`.
            near: vectors, (N + extra, m).
            values: an eigenvalue for each of them, (m,).

        Returns:
            forces (N + extra, m, p) and masses in kg (p,).
        """
        forces, masses = np.zeros((len(x), *near.shape)), np.zeros(len(x))
        for part, index, columns in place_parts(len(self), parts):
            slopes = part.hypothesis.slopes(x[columns])
            masses[columns] = slopes @ part.weights
            seen = part.rows @ near[index]
            for kind, scale in ((False, np.ones(len(values))), (True, -values)):
                core = part.core(slopes, mass=kind)
                if core is not None:
                    forces[columns, index] += part.rows.T @ (core @ (seen * scale))
        return np.moveaxis(forces, 0, 2), masses

    def pad_readings(self, size: int) -> FloatArray:
        """Return the readings with zeros for added coordinates, (n_sensors, size)."""
        more = size - self.readings.shape[1]
        return np.pad(self.readings, ((0, 0), (0, more))) if more else self.readings

    def condense(self, parts: Sequence[Projection], count: int) -> Condensed:
        """Return fewer coordinates in which the lowest modes with some hypotheses are as here.

        In a mode of eigenvalue lambda the high coordinates are (lambda - Lambda)^-1 rows' g,
        whatever the size of the hypotheses, so that this at three lambdas spans what they do.

        Source: Grimme (1997), rational Krylov methods, for the span.
        """
        key = count, *map(id, parts)
        if key not in self.condensed:
            self.condensed[key] = self._condensed(tuple(parts), count)
        return self.condensed[key]

    def _condensed(self, parts: tuple[Projection, ...], count: int) -> Condensed:
        n, values = len(self), self.eigenvalues
        everything = Condensed(parts, self, parts, None)
        if count >= n or not values[count - 1] > 0.0:
            return everything
        top = float(values[count - 1])
        low = int(np.searchsorted(values, _HIGH * top))
        local = [part.rows[:, low:n] for part in parts if not part.whole]
        # What acts on each coordinate by itself, such as all of Young's modulus, moves no other.
        if not all(part.apart for part in parts if part.whole) or not local:
            return everything
        pulls, high = _range(np.concatenate(local).T), values[low:, None]
        if low + len(_AT) * pulls.shape[1] > _WORTH * n:
            return everything
        left = _range(np.hstack([pulls / (high - share * top) for share in _AT]))
        inner, turn = la.eigh(left.T @ (high * left), check_finite=False)
        left = left @ turn
        readings = np.hstack([self.readings[:, :low], self.readings[:, low:] @ left])
        space = Space(np.append(values[:low], inner), readings, (), self.mass, self.rigid)
        return Condensed(parts, space, tuple(p.follow(low, left) for p in parts), left)

    def rebase(self, parts: Sequence[Projection], x: FloatArray) -> Space:
        """Return the modal coordinates of the model with some hypotheses in it."""
        if not parts:
            return self
        stiffness, mass, weight = self.assemble(parts, x)
        values, turn = solve_pencil(stiffness, mass)
        readings = self.pad_readings(len(stiffness)) @ turn
        # All rows at once: one product of large matrices is faster than hundreds of small ones.
        known = [part.rows for part in self.projections]
        n = len(self)
        together = np.concatenate([rows[:, :n] for rows in known] or [np.zeros((0, n))]) @ turn[:n]
        projections, last = [], 0
        for part in self.projections:
            first, last = last, last + len(part.rows)
            rows = together[first:last]
            rows = np.hstack([rows, part.rows[:, n:]]) if part.extra else rows
            projections.append(replace(part, rows=rows, whole=False))
        small = float(np.abs(values[self.rigid : self.rigid + 1]).sum()) * 1e-8
        rigid = int((np.abs(values[: self.rigid]) <= small).sum())
        return Space(values, readings, tuple(projections), weight, rigid)


@dataclass(frozen=True)
class Condensed:
    """Coordinates in which some hypotheses do to the lowest modes what they do in all.

    Arguments:
        given: the hypotheses in all coordinates.
        parts: the hypotheses in them.
        follow: the high ones of all coordinates from the last ones of these, (h, r); None where
            these are all coordinates.
    """

    given: tuple[Projection, ...]
    space: Space
    parts: tuple[Projection, ...]
    follow: FloatArray | None

    def expand(self, vectors: FloatArray) -> FloatArray:
        """Return vectors in all coordinates, those that hypotheses add behind them."""
        if self.follow is None:
            return vectors
        n, r = len(self.space), self.follow.shape[1]
        parts = vectors[: n - r], self.follow @ vectors[n - r : n], vectors[n:]
        return np.concatenate(parts)


def _range(columns: FloatArray) -> FloatArray:
    """Return orthonormal vectors that span some, whatever their lengths, (n, r)."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0.0] / size[size > 0.0]
    left, size, _ = la.svd(kept, full_matrices=False, check_finite=False)
    return np.asarray(left[:, size > _LIES_IN * size.max(initial=0.0)])


def place_parts(size: int, parts: Sequence[Projection]) -> list[tuple[Projection, IntArray, slice]]:
    """Return every part with its rows in the joint matrices and its columns of x."""
    result, row, column = [], size, 0
    for part in parts:
        index = np.concatenate([np.arange(size), row + np.arange(part.extra)])
        count = len(part.hypothesis.parameters)
        result.append((part, index, slice(column, column + count)))
        row, column = row + part.extra, column + count
    return result


def solve_pencil(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues, ascending, and mass-normalised vectors of a small dense pencil.

    Raises:
        ModelError: when the mass is not positive definite.
    """
    try:
        if np.array_equal(mass, np.eye(len(mass))):  # half the work, and most causes add no mass
            values, vectors = la.eigh(stiffness, driver="evd", check_finite=False)
        else:
            values, vectors = la.eigh(stiffness, mass, driver="gvd", check_finite=False)
    except la.LinAlgError as error:
        raise ModelError("a hypothesis makes the mass indefinite") from error
    return values, vectors


def rigid_first(modes: Modes) -> Modes:
    """Return modes, rigid-body motions first; the same ones, not a copy, where they are."""
    order = np.argsort(~modes.rigid, kind="stable")
    return modes if np.array_equal(order, np.arange(len(order))) else modes.take(order)


def nominal_space(
    model: Model, modes: Modes, sensors: Sensors, hypotheses: Sequence[Hypothesis]
) -> Space:
    """Return the modal coordinates of a model with all of its hypotheses."""
    modes = rigid_first(modes)
    project = Projector(model, modes.shapes)
    readings = np.asarray(model.observe(sensors) @ modes.shapes)
    eigenvalues = np.where(modes.rigid, 0.0, modes.eigenvalues)
    projections = tuple(project(hypothesis) for hypothesis in hypotheses)
    return Space(eigenvalues, readings, projections, model.total_mass, int(modes.rigid.sum()))


def scatter_terms(
    structure: Structure, vectors: FloatArray, eigenvalues: FloatArray, elements: IntArray
) -> FloatArray:
    """Return the modal forces of a relative change of elements' stiffness, then of their mass.

    Arguments:
        vectors: its modes, (n, N).
        eigenvalues: of the modes of interest, which come first among the columns, (q,).
        elements: which ones, (k,).

    Returns:
        phi_k' (dK - lambda_j dM) phi_j by element and kind, mode j, coordinate k, (2 k, q, N).
    """
    q, properties = len(eigenvalues), structure.properties.take(elements)
    rows = (12 * elements[:, None] + np.arange(12)).ravel()
    local = (structure.gather[rows] @ vectors).reshape(-1, 12, vectors.shape[1])
    near = local[:, :, :q]
    stiff = np.swapaxes(properties.stiffness_matrices() @ near, 1, 2) @ local
    heavy = np.swapaxes(properties.mass_matrices() @ near, 1, 2) @ local
    return np.concatenate([stiff, -eigenvalues[:, None] * heavy])
