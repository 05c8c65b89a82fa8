"""Factors that leave the smallest dynamic residual of measured modes, unmeasured motions free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.optimize import lsq_linear
from scipy.sparse.linalg import splu

from femubench import InputError, Measurement, Model, NotApplicable, StrategyFailure, UpdateResult
from femubench.fem import FloatArray
from femubench.update import ParametricModel, ParametricStrategy, expand_measured_shapes

_DEPENDENT = 1e-10  # of the largest answer to a force at a sensor: below it they are one
_LONGEST = 0.3  # step of a coordinate
_HALVINGS = 10


@dataclass(frozen=True)
class DynamicResidual(ParametricStrategy):
    """Minimise the forces S (K(x) - lambda_j M(x)) phi_j over factors and the shapes phi_j.

    Of a shape the readings are known, with their standard deviations, and all else is free. For
    given factors the best shapes follow from one factorisation a mode, and what they leave lies in
    the span of as many forces as there are sensors (variable projection): Gauss-Newton steps in
    the factors alone go on from there.

    Arguments:
        changes: as of `ParametricStrategy`.
        readings: `weighted` by their deviations; `exact` meets them, which takes the forces of
            their noise for those of too stiff a model: all factors fall.
        error: standard deviation of the forces of a mode, of its inertia forces.
        max_iterations: steps at most.
        tolerance: the iteration ends when no coordinate moves by more.

    The authors' are the residual, the free motions, and readings met exactly (Farhat & Hemez; Li,
    Dong & Wang) or with their covariance (Alvin); ours: S, the roots of the nominal diagonal
    stiffness, which brings forces and moments to one unit, `error`, the prior of the factors, and
    variable projection in place of steps in turn or a joint search.

    Source: Li, Dong & Wang (2018), the modal dynamic residual; Alvin (1997), readings with noise;
    Golub & Pereyra (1973), variable projection.
    """

    name: ClassVar[str] = "dynamic-residual"
    citation: ClassVar[str] = (
        "Alvin (1997), Finite element model update via Bayesian estimation and minimization of "
        "dynamic residuals, AIAA Journal 35, 879-886; Farhat & Hemez (1993), AIAA Journal 31, "
        "1702-1711; Li, Dong & Wang (2018), Model updating using sum of squares (SOS) optimization "
        "to minimize modal dynamic residuals, Struct. Control Health Monit. 25, e2263"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})

    readings: str = "weighted"
    error: float = 0.02
    max_iterations: int = 50
    tolerance: float = 1e-5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.readings not in ("weighted", "exact"):
            raise InputError(f"the readings are weighted or exact, not {self.readings!r}")
        if not self.error > 0.0:
            raise InputError(f"error is {self.error:g}", expected="a number > 0")

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors that leave the smallest residual.

        Raises:
            NotApplicable: when the model has no such parameters, or a mode no shape.
            StrategyFailure: when a measured frequency is one of the model's own.
        """
        parts = self.parameterise(model)
        nominal = parts.start
        scale = 1.0 / np.sqrt(nominal.stiffness.diagonal())
        whole = nominal.mass_times(expand_measured_shapes(nominal, measurement))
        inertia = measurement.eigenvalues * np.linalg.norm(scale[:, None] * whole, axis=0)
        weights = 1.0 / (self.error * inertia)

        def linearised(x: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            residual, jacobian = self.linearise(parts, measurement, x, scale, weights)
            residual = np.append(residual, np.sqrt(parts.precision) * x)
            jacobian = np.vstack([jacobian, np.diag(np.sqrt(parts.precision))])
            return float(residual @ residual), residual, jacobian

        x, moved, history = np.zeros(len(parts)), np.inf, list[dict[str, float]]()
        found = linearised(x)
        while moved > self.tolerance and len(history) < self.max_iterations:
            history.append({"iteration": float(len(history)), "cost": found[0]})
            low, high = (
                np.maximum(parts.lower - x, -_LONGEST),
                np.minimum(parts.upper - x, _LONGEST),
            )
            step = lsq_linear(found[2], -found[1], bounds=(low, high)).x
            for halving in range(_HALVINGS):
                trial = linearised(x + step / 2**halving)
                if trial[0] <= found[0]:
                    x, found = x + step / 2**halving, trial
                    moved = float(np.abs(step).max()) / 2**halving
                    break
            else:
                break
        converged = float(moved <= self.tolerance)
        return self.result(parts, x, history, cost=found[0], converged=converged)

    def linearise(
        self,
        parts: ParametricModel,
        measurement: Measurement,
        x: FloatArray,
        scale: FloatArray,
        weights: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the best shapes leave, and its slopes: (rows,) and (rows, p).

        Arguments:
            parts: the nominal model and its changes.
            measurement: modes with shapes.
            x: coordinates, (p,).
            scale: of forces at dofs, (n,).
            weights: of the forces of every mode, (m,).

        Raises:
            NotApplicable: when no reading of a mode has a standard deviation.
            StrategyFailure: when a measured frequency is one of the model's own.
        """
        model = parts.at(x)
        slopes, steps = parts.slopes(x, model), parts.steps(x)
        observer, rows = model.observe(measurement.sensors), []
        for j, eigenvalue in enumerate(measurement.eigenvalues):
            known = np.isfinite(measurement.shapes[:, j]) & (measurement.shape_std[:, j] > 0.0)
            if not known.any():
                what = f"no reading of mode {measurement.numbers[j]} has a standard deviation"
                raise NotApplicable(what)
            size = np.abs(measurement.shapes[known, j]).max()
            reading = measurement.shapes[known, j] / size
            std = measurement.shape_std[known, j] / size
            try:
                factor = splu(sp.csc_matrix(model.stiffness - eigenvalue * model.mass))
            except RuntimeError as error:
                what = f"the frequency of mode {measurement.numbers[j]} is one of the model's own"
                raise StrategyFailure(what) from error
            # The forces S (K - lambda M) z of motions z that no sensor reads are orthogonal to
            # these, of which `read` are the readings.
            answer = factor.solve(observer[known].T.toarray()) / scale[:, None]
            forces, values, turn = la.svd(answer, full_matrices=False)
            kept = values > _DEPENDENT * values[0]
            forces, read = forces[:, kept], turn[kept].T * values[kept]
            own = weights[j] * np.eye(len(forces.T))
            if self.readings == "exact":
                components, left = (turn[kept] @ reading) / values[kept], own
                missed = weights[j] * components
            else:
                both, said = np.vstack([own, read / std[:, None]]), reading / std
                orthogonal, triangle = la.qr(both)
                known_parts = orthogonal.T @ np.append(np.zeros(len(own)), said)
                components = la.solve_triangular(triangle[: len(own)], known_parts[: len(own)])
                missed = -known_parts[len(own) :]
                left = orthogonal[: len(own), len(own) :].T @ own
            shape = factor.solve((forces @ components) / scale)
            change = slopes.products(shape, float(eigenvalue)) * steps
            rows.append((missed, left @ (forces.T @ (scale[:, None] * change))))
        return np.concatenate([row[0] for row in rows]), np.vstack([row[1] for row in rows])
