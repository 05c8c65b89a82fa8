"""A modal basis of the nominal model, and what every hypothesis does in it.

In the basis of its own modes the nominal stiffness is diag(lambda) and the mass the identity; a
hypothesis adds the projections of its fixed matrices. Where all modes are at hand (small models)
this is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from femubench.core.diagnosis.change import Change, ElementOperator, Operator, Term
from femubench.core.diagnosis.hypothesis import Hypothesis
from femubench.core.errors import ModelError
from femubench.core.fem.beam import mass_matrices, stiffness_matrices
from femubench.core.fem.structure import Structure
from femubench.core.measurement import Sensors
from femubench.core.modal.eigen import Modes
from femubench.core.model import Model
from femubench.core.typing import BoolArray, FloatArray
from femubench.core.update.residuals import total_mass


@dataclass(frozen=True)
class Projection:
    """A hypothesis in modal coordinates.

    Arguments:
        hypothesis: what is projected.
        terms: its fixed matrices, (t, N + extra, N + extra).
        is_mass: which of them belong to the mass, (t,).
        weights: by how much each mass term makes the structure heavier in kg, (t,).
    """

    hypothesis: Hypothesis
    terms: FloatArray
    is_mass: BoolArray
    weights: FloatArray

    @property
    def extra(self) -> int:
        """Return the number of coordinates that the hypothesis adds."""
        return self.hypothesis.change.extra


@dataclass(frozen=True)
class Space:
    """Modal coordinates with the hypotheses in them.

    Arguments:
        eigenvalues: of the coordinates, ascending, (N,).
        readings: of the coordinates at the sensors, (n_sensors, N).
        projections: the hypotheses.
        mass: of the structure in kg.
        rigid: number of coordinates that are rigid-body motions.
    """

    eigenvalues: FloatArray
    readings: FloatArray
    projections: tuple[Projection, ...]
    mass: float
    rigid: int

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

    def assembled(
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
        for part, index, columns in _placed(len(self), parts):
            factors = part.hypothesis.factors(x[None, columns])[0]
            block = np.ix_(index, index)
            stiffness[block] += _combined(part, factors, mass=False)
            mass[block] += _combined(part, factors, mass=True)
            weight += float(factors @ part.weights)
        return stiffness, mass, weight

    def slopes(
        self, parts: Sequence[Projection], x: FloatArray
    ) -> list[tuple[FloatArray, FloatArray, float]]:
        """Return the derivatives of `assembled` with respect to every coordinate."""
        size = len(self) + sum(part.extra for part in parts)
        result = []
        for part, index, columns in _placed(len(self), parts):
            block = np.ix_(index, index)
            for slope in part.hypothesis.slopes(x[columns]):
                stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
                stiffness[block] = _combined(part, slope, mass=False)
                mass[block] = _combined(part, slope, mass=True)
                result.append((stiffness, mass, float(slope @ part.weights)))
        return result

    def padded_readings(self, size: int) -> FloatArray:
        """Return the readings with zeros for added coordinates, (n_sensors, size)."""
        more = size - self.readings.shape[1]
        return np.pad(self.readings, ((0, 0), (0, more)))

    def rebased(self, parts: Sequence[Projection], x: FloatArray) -> Space:
        """Return the modal coordinates of the model with some hypotheses in it."""
        stiffness, mass, weight = self.assembled(parts, x)
        values, turn = solve_pencil(stiffness, mass)
        readings = self.padded_readings(len(stiffness)) @ turn
        projections = []
        for part in self.projections:
            extra = part.extra
            index = np.concatenate([np.arange(len(self)), len(turn) + np.arange(extra)])
            grown = np.zeros((len(turn) + extra, turn.shape[1] + extra))
            grown[: len(turn), : turn.shape[1]] = turn
            grown[len(turn) :, turn.shape[1] :] = np.eye(extra)
            rows = grown[index]
            terms = rows.T @ part.terms @ rows
            projections.append(replace(part, terms=terms))
        small = float(np.abs(values[self.rigid : self.rigid + 1]).sum()) * 1e-8
        rigid = int((np.abs(values[: self.rigid]) <= small).sum())
        return Space(values, readings, tuple(projections), weight, rigid)


def _placed(size: int, parts: Sequence[Projection]) -> list[tuple[Projection, FloatArray, slice]]:
    """Return every part with its rows in the joint matrices and its columns of x."""
    result, row, column = [], size, 0
    for part in parts:
        index = np.concatenate([np.arange(size), row + np.arange(part.extra)])
        count = len(part.hypothesis.parameters)
        result.append((part, index, slice(column, column + count)))
        row, column = row + part.extra, column + count
    return result


def _combined(part: Projection, factors: FloatArray, *, mass: bool) -> FloatArray:
    chosen = part.is_mass if mass else ~part.is_mass
    return np.asarray(np.tensordot(factors[chosen], part.terms[chosen], axes=1))


def solve_pencil(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues, ascending, and mass-normalised vectors of a small dense pencil.

    Raises:
        ModelError: when the mass is not positive definite.
    """
    try:
        values, vectors = la.eigh(stiffness, mass, driver="gvd", check_finite=False)
    except la.LinAlgError as error:
        raise ModelError("a hypothesis makes the mass indefinite") from error
    return values, vectors


class Projector:
    """Projects changes on given vectors; element matrices take a short cut.

    Arguments:
        model: the nominal model.
        vectors: basis on its dofs, (n, N).
    """

    def __init__(self, model: Model, vectors: FloatArray) -> None:
        self.vectors, self.structure = vectors, model.structure
        self.local: FloatArray | None = None
        self.shift: FloatArray | None = None
        if self.structure is not None:
            self.local = (self.structure.gather @ vectors).reshape(-1, 12, vectors.shape[1])
            self.shift = _translation(self.structure)

    def __call__(self, hypothesis: Hypothesis) -> Projection:
        """Return a hypothesis in the coordinates of the basis."""
        change = hypothesis.change
        terms = [self._term(term, change.extra) for term in change.terms]
        shift = self._shifted(change)
        weights = [self._weight(term, shift) for term in change.terms]
        is_mass = np.array([term.matrix == "mass" for term in change.terms])
        return Projection(hypothesis, np.array(terms), is_mass, np.array(weights))

    def _term(self, term: Term, extra: int) -> FloatArray:
        operator = term.operator
        if isinstance(operator, ElementOperator) and self.local is not None:
            local = self.local[operator.elements]
            product = np.tensordot(local, operator.blocks @ local, axes=([0, 1], [0, 1]))
            return np.pad(product, (0, extra)) if extra else product
        return operator.project(self._grown(extra))

    def _grown(self, extra: int) -> FloatArray:
        n, m = self.vectors.shape
        if not extra:
            return self.vectors
        grown = np.zeros((n + extra, m + extra))
        grown[:n, :m] = self.vectors
        grown[n:, m:] = np.eye(extra)
        return grown

    def _weight(self, term: Term, motion: FloatArray) -> float:
        if term.matrix == "stiffness" or self.structure is None:
            return 0.0
        operator: Operator = term.operator
        if isinstance(operator, ElementOperator) and self.shift is not None:
            local = self.shift[operator.elements]
            return float(np.einsum("ei,eij,ej->", local, operator.blocks, local))
        return float(operator.project(motion[:, None])[0, 0])

    def _shifted(self, change: Change) -> FloatArray:
        """Return all dofs in a unit translation; those that a change adds follow statically."""
        if self.structure is None:
            return np.zeros(0)
        own = _unit_motion(self.structure)
        motion = np.concatenate([own, np.zeros(change.extra)])
        if change.extra:
            both = np.column_stack([motion, np.eye(len(motion))[:, len(own) :]])
            springs = [term for term in change.terms if term.matrix == "stiffness"]
            pulled = np.sum([term.operator.apply(both) for term in springs], axis=0)
            force, inner = pulled[len(own) :, 0], pulled[len(own) :, 1:]
            motion[len(own) :] = -np.linalg.solve(inner, force)
        return motion


def _direction(structure: Structure) -> int:
    """Return the axis along which the structure is moved to weigh it."""
    return 0 if structure.frame.plane == "in-plane" else 2


def _translation(structure: Structure) -> FloatArray:
    """Return the local displacements of all elements in a unit translation, (n_elements, 12)."""
    axis = structure.mesh.axes[:, :, _direction(structure)]
    motion = np.zeros((len(axis), 12))
    motion[:, 0:3] = motion[:, 6:9] = axis
    return motion


def _unit_motion(structure: Structure) -> FloatArray:
    """Return the free dofs in a unit translation, (n,)."""
    return np.asarray(structure.kinematics.axes[:, _direction(structure)])


def nominal_space(
    model: Model, modes: Modes, sensors: Sensors, hypotheses: Sequence[Hypothesis]
) -> Space:
    """Return the modal coordinates of a model with all of its hypotheses.

    Arguments:
        model: the nominal model.
        modes: all of its modes.
        sensors: where shapes are read.
        hypotheses: what may be missing.
    """
    order = np.argsort(~modes.rigid, kind="stable")
    modes = modes.take(order)
    project = Projector(model, modes.shapes)
    readings = np.asarray(model.observe(sensors) @ modes.shapes)
    mass = total_mass(model.structure) if model.structure is not None else 0.0
    eigenvalues = np.where(modes.rigid, 0.0, modes.eigenvalues)
    projections = tuple(project(hypothesis) for hypothesis in hypotheses)
    return Space(eigenvalues, readings, projections, mass, int(modes.rigid.sum()))


def scatter_terms(structure: Structure, vectors: FloatArray, eigenvalues: FloatArray) -> FloatArray:
    """Return the modal forces of a relative change of every element's stiffness, then its mass.

    Arguments:
        structure: the nominal frame.
        vectors: its modes, (n, N).
        eigenvalues: of the modes of interest, which come first among the columns, (q,).

    Returns:
        phi_k' (dK - lambda_j dM) phi_j by element and kind, mode j, coordinate k,
        (2 n_elements, q, N).
    """
    q = len(eigenvalues)
    local = (structure.gather @ vectors).reshape(-1, 12, vectors.shape[1])
    near = local[:, :, :q]
    stiff = np.swapaxes(stiffness_matrices(structure.properties) @ near, 1, 2) @ local
    heavy = np.swapaxes(mass_matrices(structure.properties) @ near, 1, 2) @ local
    return np.concatenate([stiff, -eigenvalues[:, None] * heavy])
