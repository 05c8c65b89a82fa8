"""Global search by an evolution strategy that learns its covariance."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import Any, ClassVar
from warnings import catch_warnings, simplefilter

import numpy as np

from femubench.fem import FloatArray
from femubench.plugins.strategies.global_search import Cost, Found, GlobalSearch


def _cma() -> Any:  # noqa: ANN401 - a module without types
    """Import `cma`, in a worker without its plots: matplotlib takes longer than most updates."""
    if "FEMUBENCH_WORKERS" not in os.environ:  # the caller may want to plot later
        import cma

        return cma
    if missing := "matplotlib" not in sys.modules:
        sys.modules["matplotlib"] = None  # type: ignore[assignment] # not to be found
    try:
        with catch_warnings():
            simplefilter("ignore")  # "Could not import matplotlib.pyplot"
            import cma
    finally:
        if missing:
            del sys.modules["matplotlib"]
    return cma


@dataclass(frozen=True)
class CmaEs(GlobalSearch):
    """Search all factors by samples of a normal distribution that follows the better half.

    Arguments:
        changes, evaluations, largest, shape_weight, basis: as of `GlobalSearch`.
        spread: standard deviation of the first generation in ln(factor).

    The author's are the method and every setting of its package but those above, which are ours.
    """

    name: ClassVar[str] = "cma-es"
    citation: ClassVar[str] = (
        "Hansen & Ostermeier (2001), Completely derandomized self-adaptation in evolution "
        "strategies, Evolutionary Computation 9, 159-195; package `cma` (Hansen, Akimoto & Baudis)"
    )

    spread: float = 0.2

    def search(
        self, cost: Cost, low: FloatArray, high: FloatArray, rng: np.random.Generator
    ) -> Found:
        """Return the best of all samples."""
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
        search = _cma().CMAEvolutionStrategy(np.clip(0.0, low, high), self.spread, options)
        history = []
        while not search.stop():
            points = search.ask()
            costs = [cost(np.asarray(x)) for x in points]
            search.tell(points, costs)
            history.append({"cost": float(min(costs)), "spread": float(search.sigma)})
        return np.asarray(search.result.xbest), float(search.result.fbest), history
