"""Damping of a whole model, in proportion to its matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Damping:
    """Proportional and structural damping: C = alpha M + beta K, and a stiffness K (1 + i eta).

    Arguments:
        alpha: of the mass, in 1/s.
        beta: of the stiffness, in s.
        eta: loss factor.

    Examples:
        >>> print(fem.Damping(eta=0.02).ratios((2 * np.pi * np.array([50.0])) ** 2))
        [0.01]
    """

    alpha: float = 0.0
    beta: float = 0.0
    eta: float = 0.0

    def ratios(self, eigenvalues: FloatArray) -> FloatArray:
        """Return the viscous ratio of every mode that it damps as much at resonance, (m,).

        Arguments:
            eigenvalues: in rad^2/s^2, (m,); a motion of the body, at 0, has no ratio: 0.

        Source: Ewins (2000), Modal Testing, 2.4: proportional damping, viscous and hysteretic.
        """
        root = np.sqrt(np.maximum(eigenvalues, 0.0))
        of_mass = np.divide(self.alpha, root, out=np.zeros_like(root), where=root > 0.0)
        return np.asarray(0.5 * (of_mass + self.beta * root + self.eta * (root > 0.0)))
