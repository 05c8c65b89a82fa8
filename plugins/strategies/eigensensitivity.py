"""Regularised sensitivity updating on frequencies and shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, UpdateResult
from femubench.update import (
    ParametricStrategy,
    l_curve_corner,
    modal_space,
    parameterise,
    parametric_result,
    tikhonov,
)


@dataclass(frozen=True)
class Eigensensitivity(ParametricStrategy):
    """Fit frequencies and MAC by factors that Tikhonov's term keeps near 1.

    Every iteration linearises relative frequencies and unit shapes in the logarithms x of the
    factors and takes the x that makes |S x - b|^2 + mu^2 |x|^2 least; mu is the weight at the
    corner of the L-curve of that linear problem. The squares of a unit shape's misfit sum to
    1 - MAC. Of groups of matrices each x_j is divided by the spread of its prior, so that supports
    may change more than the structure.

    Arguments:
        changes: as of `ParametricStrategy`.
        shape_weight: of a MAC of 0 against a frequency that is 100 % off; 0 for frequencies alone.

    The authors' are the sensitivities (Fox & Kapoor), the damped least squares of Natke and
    Friswell & Mottershead, and the corner as the weight; ours are logarithms, the whole change
    rather than the step in the term, the weight of shapes and steps of at most 0.5.

    Source: Friswell, Mottershead & Ahmadian (2001), Finite-element model updating using
    experimental test data: parametrization and regularization; Hansen & O'Leary (1993).
    """

    name: ClassVar[str] = "eigensensitivity"
    citation: ClassVar[str] = (
        "Friswell, Mottershead & Ahmadian (2001), Finite-element model updating using experimental "
        "test data: parametrization and regularization, Phil. Trans. R. Soc. A 359, 169-186; "
        "Hansen & O'Leary (1993), SIAM J. Sci. Comput. 14, 1487-1503 (L-curve)"
    )

    shape_weight: float = 0.1

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors of the last iteration.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        parts = parameterise(model, self.changes)
        space = modal_space(parts, measurement, shape_weight=self.shape_weight)
        log, fit, history, weight = space.fit_penalised(l_curve_corner, tikhonov, squares=True)
        return parametric_result(parts, log, history, weight=weight, paired_modes=float(fit.paired))
