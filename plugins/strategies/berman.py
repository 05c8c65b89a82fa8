"""Berman and Nagy: the mass matrix first, then the stiffness matrix with the corrected mass."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from femubench import Measurement, Model, Strategy, StrategyFailure, UpdateResult
from femubench.fem import FloatArray, LowRank
from femubench.modal import rigid_modes_of
from femubench.update import check_used_modes, expand_measured_shapes

# Below this share of independent motion two expanded shapes are one.
_DEPENDENT = 1e-6


def expand_without_momentum(
    model: Model, measurement: Measurement, rigid: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return shapes of unit generalised mass, (n, m), and their generalised mass matrix, (m, m).

    They come by dynamic expansion, meet the readings and have no momentum.
    A free structure vibrates without moving its centre of mass, so its elastic shapes are
    orthogonal to its rigid-body modes; were expanded ones not, the update would give the
    rigid-body modes stiffness. Both are conditions of the expansion.

    Arguments:
        rigid: free rigid-body modes, (n, r).

    Raises:
        StrategyFailure: when expanded shapes depend on each other.
    """
    shapes = expand_measured_shapes(model, measurement, rigid)
    shapes = shapes - rigid @ (rigid.T @ model.mass_times(shapes))  # what rounding left
    shapes = model.mass_normalised(shapes)
    mass = shapes.T @ model.mass_times(shapes)
    smallest = float(la.eigvalsh(mass)[0])
    if not smallest > _DEPENDENT:
        raise StrategyFailure(
            f"expanded shapes depend on each other: the generalised mass matrix has the "
            f"smallest eigenvalue {smallest:.3g}"
        )
    return shapes, 0.5 * (mass + mass.T)


def mass_change(model: Model, shapes: FloatArray, generalised_mass: FloatArray) -> LowRank:
    """Return M0 Phi m_A^-1 (I - m_A) m_A^-1 Phi' M0, after which Phi' M Phi = I.

    The corrected mass is positive wherever M0 is: it is M0 less its part in Phi, plus a square.

    Source: Berman & Nagy (1983), mass matrix improvement.
    """
    inverse = la.inv(generalised_mass)
    core = inverse @ (np.eye(len(inverse)) - generalised_mass) @ inverse
    return LowRank(model.mass_times(shapes), 0.5 * (core + core.T))


def stiffness_change(
    model: Model, shapes: FloatArray, eigenvalues: FloatArray, rigid: FloatArray
) -> LowRank:
    """Return Delta + Delta' of rank 2m, after which K Phi = M Phi Lambda.

    Delta = M Phi (Phi' K Phi + Lambda) Phi' M / 2 - K Phi Phi' M, so that K becomes
    (I - M Phi Phi') K (I - Phi Phi' M) + M Phi Lambda Phi' M: as many zero and no negative
    eigenvalues, where K has none.

    Arguments:
        model: with the corrected mass and the stiffness to be corrected.
        shapes: orthonormal with the corrected mass, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).
        rigid: free rigid-body modes, (n, r).

    Source: Berman & Nagy (1983), stiffness matrix improvement.
    """
    momentum, force = model.mass_times(shapes), balance_forces(model, shapes, rigid)
    energy = shapes.T @ force
    m = len(eigenvalues)
    core = 0.5 * (energy + energy.T) + np.diag(eigenvalues)
    blocks = np.block([[core, -np.eye(m)], [-np.eye(m), np.zeros((m, m))]])
    return LowRank(np.hstack([momentum, force]), blocks)


def balance_forces(model: Model, shapes: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return K phi in equilibrium, where elastic forces on fine meshes are up to rounding."""
    force = model.stiffness_times(shapes)
    return np.asarray(force - model.mass_times(rigid) @ (rigid.T @ force))


class Berman(Strategy):
    """Correct mass and stiffness so that measured modes are modes, by the smallest changes."""

    name: ClassVar[str] = "berman"
    citation: ClassVar[str] = (
        "Berman, A. & Nagy, E. J. (1983). Improvement of a large analytical model using test "
        "data. AIAA Journal 21, 1168-1173"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with low-rank changes of mass and stiffness.

        Raises:
            StrategyFailure: when expanded shapes depend on each other.
            SelfCheckFailed: when the used modes are not reproduced to 1e-8.
            ModelError: when a measured frequency is one of the model's own to rounding.
        """
        rigid = rigid_modes_of(model)
        shapes, generalised_mass = expand_without_momentum(model, measurement, rigid)
        change = mass_change(model, shapes, generalised_mass)
        heavier = replace(model, mass_change=LowRank.total([model.mass_change, change]))
        step = stiffness_change(heavier, shapes, measurement.eigenvalues, rigid)
        updated = replace(heavier, stiffness_change=LowRank.total([model.stiffness_change, step]))
        found = check_used_modes(updated, shapes, measurement.eigenvalues)
        worst = float(np.abs(generalised_mass - np.eye(len(measurement))).max())
        return UpdateResult(
            updated,
            parameter_count=model.size * (model.size + 1),
            diagnostics={
                "residual": found.forces,
                "largest_off_diagonal_mass": worst,
                "smallest_generalised_mass": float(la.eigvalsh(generalised_mass)[0]),
            },
        )
