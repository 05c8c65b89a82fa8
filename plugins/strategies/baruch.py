"""Baruch and Bar-Itzhack: the smallest symmetric change of K that has the measured modes."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.fem import FloatArray, LowRank
from femubench.update import QuasiModes, check_used_modes, with_stiffness_step

# Of eps |K| |phi|: what the modes of the model leave of K phi - lambda M phi by rounding.
_ROUNDING = 64.0 * np.finfo(float).eps


def stiffness_change(model: Model, quasi: QuasiModes) -> LowRank:
    """Return Delta + Delta' of rank m, or 2m where the shapes are no rotated modes of the model.

    With H = Phi' K Phi and E = K Phi - M Phi H equation (18) reads
    M Phi (Lambda - H) Phi' M - M Phi E' - E Phi' M. For rotated modes H follows from their
    eigenvalues and E is zero: it is left out, not evaluated, since its rounding error would
    spoil the rigid-body modes of fine meshes.

    Arguments:
        quasi: measured modes, the shapes made from modes of the same model.

    Source: Baruch & Bar-Itzhack (1978); Ahmadian, Gladwell & Ismail (1997), equation (18).
    """
    momentum = model.mass_times(quasi.shapes)
    rotation = momentum.T @ quasi.modes.shapes[:, quasi.partners]
    energy = (rotation * quasi.modes.eigenvalues[quasi.partners]) @ rotation.T
    force = model.stiffness_times(quasi.shapes)
    # Forces and moments in one unit.
    diagonal = np.abs(model.stiffness.diagonal())
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))[:, None]
    gross = np.linalg.norm(scale * (np.abs(model.stiffness) @ np.abs(quasi.shapes)), axis=0)
    rest = np.linalg.norm(scale * (force - momentum @ energy), axis=0)
    if np.all(rest <= _ROUNDING * gross):
        return LowRank(momentum, _symmetric(np.diag(quasi.eigenvalues) - energy))
    energy = quasi.shapes.T @ force
    core, one = _symmetric(np.diag(quasi.eigenvalues) - energy), np.eye(len(energy))
    blocks = np.block([[core, -one], [-one, 0.0 * one]])
    return LowRank(np.hstack([momentum, force - momentum @ energy]), blocks)


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (matrix + matrix.T))


class Baruch(Strategy):
    """Correct the stiffness matrix by the smallest symmetric change in the norm of M."""

    name: ClassVar[str] = "baruch"
    citation: ClassVar[str] = (
        "Baruch, M. & Bar-Itzhack, I. Y. (1978). Optimal weighted orthogonalization of measured "
        "modes. AIAA Journal 16, 346-351; Ahmadian, Gladwell & Ismail (1997), equation (18)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with a low-rank change of its stiffness.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            SelfCheckFailed: when the used modes are not reproduced to 1e-8.
            NotApplicable: when there are fewer complete sensors than modes.
        """
        current, history = model, []
        while True:
            quasi = QuasiModes.of(current, measurement)
            step = stiffness_change(current, quasi)
            current = with_stiffness_step(current, quasi.modes, step)
            history.append({"largest_eigenvalue_change": float(np.abs(np.diag(step.core)).max())})
            if len(history) == QuasiModes.ITERATIONS:
                break
        found = check_used_modes(current, quasi.shapes, quasi.eigenvalues)
        change = current.stiffness_change
        rank = 0 if change is None else len(change.core)
        return UpdateResult(
            current,
            parameter_count=model.size * (model.size + 1) // 2,
            history=tuple(history),
            diagnostics={"rank": float(rank), "residual": found.forces},
        )
