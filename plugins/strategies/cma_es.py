"""Global search by an evolution strategy that learns its covariance."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from threading import get_ident
from typing import Any, ClassVar
from warnings import catch_warnings, simplefilter

import numpy as np

from femubench import Measurement, Model, UpdateResult
from femubench.update import ModalSpace, ParametricStrategy


class _Hidden(MetaPathFinder):
    """Makes a package as if it were not installed, for imports by one thread."""

    def __init__(self, package: str) -> None:
        self.package, self.thread = package, get_ident()

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Find nothing, and let nobody else find the package."""
        if get_ident() == self.thread and name.partition(".")[0] == self.package:
            raise ModuleNotFoundError(f"{name} is left out here", name=name)


def _cma() -> Any:  # noqa: ANN401 - a module without types
    """Import `cma`, in a worker without its plots: matplotlib takes longer than most updates."""
    if "FEMUBENCH_WORKERS" not in os.environ:  # the caller may want to plot later
        import cma

        return cma
    hidden = _Hidden("matplotlib")
    sys.meta_path.insert(0, hidden)
    try:
        with catch_warnings():
            simplefilter("ignore")  # "Could not import matplotlib.pyplot"
            import cma
    finally:
        sys.meta_path.remove(hidden)
    return cma


@dataclass(frozen=True)
class CmaEs(ParametricStrategy):
    """Search all factors within bounds for the least misfit of frequencies and MAC.

    Unknowns are the logarithms of the factors, the cost the sum of squares of relative frequency
    errors and weighted 1 - MAC. Nothing but costs is used, no derivative. Modes are those of a
    reduced basis of the nominal model.

    Arguments:
        changes: as of `ParametricStrategy`.
        evaluations: at most.
        largest: bound of a factor; the least is its inverse.
        spread: standard deviation of the first generation in ln(factor).
        shape_weight: of a MAC of 0 against a frequency that is 100 % off; 0 for frequencies alone.
        basis: shapes in the reduced basis.

    The author's are the method and every setting of its package but those above, which are ours.
    """

    name: ClassVar[str] = "cma-es"
    citation: ClassVar[str] = (
        "Hansen & Ostermeier (2001), Completely derandomized self-adaptation in evolution "
        "strategies, Evolutionary Computation 9, 159-195; package `cma` (Hansen, Akimoto & Baudis)"
    )

    evaluations: int = 1000
    largest: float = 3.0
    spread: float = 0.2
    shape_weight: float = 0.1
    basis: int = 40

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the best factors that were met.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        cma = _cma()
        parts = self.parameterise(model)
        space = ModalSpace.of(parts, measurement, shape_weight=self.shape_weight, size=self.basis)
        low, high = space.bounds(float(np.log(self.largest)))
        options = {
            "bounds": [low, high],
            "maxfevals": self.evaluations,
            # Its own seed would be that of the whole process.
            "seed": np.nan,
            "randn": lambda *shape: rng.standard_normal(shape),
            "tolfun": 1e-9,
            "verbose": -9,
            "verb_log": 0,
        }
        search = cma.CMAEvolutionStrategy(np.clip(0.0, low, high), self.spread, options)
        history = []
        while not search.stop():
            points = search.ask()
            costs = [space.fit(np.asarray(x), slopes=False).cost for x in points]
            search.tell(points, costs)
            history.append({"cost": float(min(costs)), "spread": float(search.sigma)})
        log = np.asarray(search.result.xbest)
        return self.result(
            parts,
            log,
            history,
            cost=float(search.result.fbest),
        )
