"""Bounded least squares from many starts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, UpdateResult
from femubench.update import ModalSpace, ParametricStrategy

_START = 2  # eigenvalue solutions of a basis before its first fit


@dataclass(frozen=True)
class MultiStart(ParametricStrategy):
    """Fit frequencies and MAC by bounded least squares from the nominal and other starts.

    Unknowns are the logarithms of the factors. Every start is followed to a local optimum with
    exact derivatives; of all optima the one of least cost is taken. The search goes on in a
    reduced basis; the last fit starts from its best point, in a basis made there.

    Arguments:
        changes: as of `ParametricStrategy`.
        starts: number of starts from a Latin hypercube, apart from the nominal model.
        largest: bound of a factor; the least is its inverse.
        shape_weight: of a MAC of 0 against a frequency that is 100 % off; 0 for frequencies alone.
        basis: shapes in the reduced basis of the search.

    The authors' are the Latin hypercube (McKay, Beckman & Conover) and the trust-region
    reflective method (Branch, Coleman & Li); number of starts, bounds and weights are ours.
    """

    name: ClassVar[str] = "multi-start"
    citation: ClassVar[str] = (
        "Branch, Coleman & Li (1999), A subspace, interior, and conjugate gradient method for "
        "large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21, 1-23; "
        "McKay, Beckman & Conover (1979), Technometrics 21, 239-245 (Latin hypercube)"
    )

    scaled: ClassVar[str] = "length"  # of shapes, as of `ModalSpace`

    starts: int = 8
    largest: float = 3.0
    shape_weight: float = 0.1
    basis: int = 60

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors of the best optimum.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        # Here, since no other strategy has to wait for it; workers have it from the start.
        from scipy.stats.qmc import LatinHypercube

        parts = self.parameterise(model)
        weight, scaled = self.shape_weight, self.scaled
        of = partial(
            ModalSpace.of, parts, measurement, shape_weight=weight, scaled=scaled, size=self.basis
        )
        space = of(max_solves=self.max_solves)
        low, high = space.bounds(float(np.log(self.largest)))
        cube = LatinHypercube(len(parts), rng=rng).random(self.starts)
        starts = [
            np.zeros(len(parts)),
            *(0.5 * (low + high) + 0.5 * (high - low) * (2.0 * cube - 1.0)),
        ]
        solves, found = space.solves, [space.fit_bounded(starts[0], self.largest)]
        found += [space.fit_bounded(x, self.largest) for x in starts[1:] if solves.left]
        log, cost = min(found, key=lambda item: item[1])
        if solves.left > _START:
            log, cost = of(at=log, max_solves=solves.left).fit_bounded(log, self.largest)
        costs = np.array([item[1] for item in found])
        history = tuple({"cost": float(value)} for value in costs)
        near = float(np.mean(costs <= 1.1 * costs.min()))
        return self.result(parts, log, history, cost=cost, share_of_starts_at_best=near)
