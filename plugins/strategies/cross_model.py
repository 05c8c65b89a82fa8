"""Cross-model cross-mode: a linear system from every pair of a model's and a measured mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.optimize import lsq_linear

from femubench import InputError, Measurement, Model, Modes, UpdateResult, solve_modes
from femubench.fem import FloatArray
from femubench.update import ParametricModel, ParametricStrategy, QuasiModes, expand_measured_shapes

_RIDGE = 1e-3  # decides what no equation sees
# Of factors with rotated shapes, which are so far from the measured ones that an equation errs as
# much as a factor changes.
_ROTATED = 1.0
_LEAST, _LARGEST = 0.2, 5.0


@dataclass(frozen=True)
class CrossModel(ParametricStrategy):
    """Solve for all factors at once from products of model modes and measured modes.

    For model mode i and measured mode j, phi_i' K* phi*_j = lambda*_j phi_i' M phi*_j with
    K* = K + sum_n a_n K_n gives sum_n a_n phi_i' K_n phi*_j = (lambda*_j - lambda_i) phi_i' M
    phi*_j, linear in a_n, of which least squares over all pairs decide.

    Arguments:
        changes: as of `ParametricStrategy`.
        modes: model modes taken for every measured one with `force`, the lowest.
        expansion: of measured shapes to all dofs: `rotation` of the model's own, which have no
            equations but those of the partners, or `force`, the least force residual with the
            readings met, which is exact for complete shapes.

    The authors' is the system, without iteration; the mass is not changed here. Ours are the
    expansion, the weight of changes with `rotation`, equations relative to omega_i omega*_j instead
    of lambda_i, which may be divided by next to nothing, and factors between 1/5 and 5.
    """

    name: ClassVar[str] = "cross-model"
    citation: ClassVar[str] = (
        "Hu, Li & Wang (2007), Cross-model cross-mode method for model updating, Mechanical "
        "Systems and Signal Processing 21, 1690-1703"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})

    modes: int = 3
    expansion: str = "rotation"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.expansion not in ("rotation", "force"):
            raise InputError(f"the expansion is rotation or force, not {self.expansion!r}")

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors that meet the equations best.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when a measured mode has no partner in the model.
        """
        parts = self.parameterise(model)
        model = parts.start
        if self.expansion == "force":
            own = solve_modes(model).elastic
            own = own.take(np.arange(min(len(own), self.modes * len(measurement))))
            shapes = model.mass_normalised(expand_measured_shapes(model, measurement))
        else:
            quasi = QuasiModes.of(model, measurement)
            own, shapes = quasi.modes.take(quasi.partners), quasi.shapes
        matrix, right = cross_equations(parts, own, shapes, measurement.eigenvalues)
        count, factor = len(parts), parts.is_property
        ridge = np.where(factor & (self.expansion == "rotation"), _ROTATED, _RIDGE)
        found = lsq_linear(
            np.vstack([matrix, np.diag(ridge)]),
            np.append(right, np.zeros(count)),
            bounds=(
                np.where(factor, _LEAST - 1.0, parts.lower),
                np.where(factor, _LARGEST - 1.0, parts.upper),
            ),
        )
        rest = float(np.linalg.norm(matrix @ found.x - right) / np.linalg.norm(right))
        x = np.where(factor, np.log1p(np.where(factor, found.x, 0.0)), found.x)
        return self.result(parts, x, equations=float(len(right)), residual=rest)


def cross_equations(
    parts: ParametricModel, own: Modes, shapes: FloatArray, eigenvalues: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the equations of all pairs of modes, (n_i m, p) and (n_i m,).

    Arguments:
        shapes: measured ones at all dofs, with unit generalised mass, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).
    """
    energies = parts.energies(own.shapes, shapes)
    inertias = parts.inertias(own.shapes, shapes)
    if inertias is not None:
        energies = energies - eigenvalues * inertias
    momentum = own.shapes.T @ parts.start.mass_times(shapes)
    right = (eigenvalues[None, :] - own.eigenvalues[:, None]) * momentum
    scale = 1.0 / np.sqrt(np.outer(own.eigenvalues, eigenvalues))
    return (energies * scale).reshape(len(parts), -1).T, (right * scale).ravel()
