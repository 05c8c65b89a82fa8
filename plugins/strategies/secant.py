"""Secant-method adjustment: the measured modes as secant equations of the stiffness."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.fem import FloatArray, LowRank
from femubench.modal import rigid_modes_of
from femubench.plugins.strategies.berman import balance_forces, expand_without_momentum
from femubench.update import check_used_modes


class Secant(Strategy):
    """Change the stiffness so that K Phi = M Phi Lambda, and keep it positive.

    The modes are secant equations K S = Y with S = Phi and Y = M Phi Lambda. The update of
    Broyden, Fletcher, Goldfarb and Shanno for several of them at once,
    K - K Phi (Phi' K Phi)^-1 Phi' K + M Phi Lambda Phi' M, leaves a positive semidefinite stiffness
    so, and its rigid-body modes where they are; it fills the matrix. The mass stays.

    The authors' is the adjustment by secant equations; they also give one that keeps the zeros of
    K instead of its sign. Ours are the choice of the one that keeps the sign, the expansion (least
    force residual, readings met, no momentum) and the nearest mass-orthonormal shapes to it.
    """

    name: ClassVar[str] = "secant"
    citation: ClassVar[str] = (
        "Smith, S. W. & Beattie, C. A. (1991). Secant-method adjustment for structural models. "
        "AIAA Journal 29, 119-126; Schnabel, R. B. (1983). Quasi-Newton methods using multiple "
        "secant equations, University of Colorado CU-CS-247-83"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})
    promises: ClassVar[frozenset[str]] = frozenset(
        {"used-modes", "rigid-body-modes", "no-negative-eigenvalue"}
    )

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with a low-rank change of its stiffness.

        Raises:
            StrategyFailure: when expanded shapes depend on each other.
            SelfCheckFailed: when the used modes are not reproduced to 1e-8.
        """
        rigid = rigid_modes_of(model)
        shapes, mass = expand_without_momentum(model, measurement, rigid)
        # The nearest mass-orthonormal ones: Baruch & Bar-Itzhack (1978), Phi (Phi' M Phi)^-1/2.
        values, turn = la.eigh(mass)
        shapes = np.asarray(shapes @ (turn / np.sqrt(values)) @ turn.T)
        change = stiffness_change(model, shapes, measurement.eigenvalues, rigid)
        updated = replace(model, stiffness_change=LowRank.total([model.stiffness_change, change]))
        found = check_used_modes(updated, shapes, measurement.eigenvalues)
        return UpdateResult(
            updated,
            parameter_count=model.size * (model.size + 1) // 2,
            diagnostics={"residual": found.forces},
        )


def stiffness_change(
    model: Model, shapes: FloatArray, eigenvalues: FloatArray, rigid: FloatArray
) -> LowRank:
    """Return M Phi Lambda Phi' M - K Phi (Phi' K Phi)^-1 Phi' K, of rank 2m.

    Arguments:
        shapes: orthonormal with its mass, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).
        rigid: free rigid-body modes, (n, r).
    """
    momentum, force = model.mass_times(shapes), balance_forces(model, shapes, rigid)
    energy = shapes.T @ force
    core = la.block_diag(np.diag(eigenvalues), -la.inv(0.5 * (energy + energy.T)))
    return LowRank(np.hstack([momentum, force]), np.asarray(core))
