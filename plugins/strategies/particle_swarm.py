"""Global search by a swarm of particles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import InputError
from femubench.fem import FloatArray
from femubench.plugins.strategies.global_search import Cost, Found, GlobalSearch

_PULL = 4.1  # phi, of both bests together
_CONSTRICTION = 2.0 / (_PULL - 2.0 + np.sqrt(_PULL**2 - 4.0 * _PULL))  # 0.7298
_COLLAPSED = 1e-5  # range of all particles in any coordinate


@dataclass(frozen=True)
class ParticleSwarm(GlobalSearch):
    """Search all factors by particles that are drawn to their own best place and to that of all.

    Arguments:
        changes, evaluations, largest, shape_weight, basis: as of `GlobalSearch`.
        particles: how many.

    The authors' are the swarm in which all know the best place (Kennedy & Eberhart), constriction
    0.7298 with phi = 4.1 (Clerc & Kennedy), frequencies and shapes as the cost (Marwala); ours:
    one particle at the nominal model and the others anywhere between the bounds, 20 of them, a
    first step to anywhere, all move before the best place is anew, and one that would leave a
    bound stays there without velocity.

    Source: Clerc & Kennedy (2002), type 1" constriction.
    """

    name: ClassVar[str] = "particle-swarm"
    citation: ClassVar[str] = (
        "Kennedy & Eberhart (1995), Particle swarm optimization, Proc. IEEE Int. Conf. Neural "
        "Networks, 1942-1948; Clerc & Kennedy (2002), The particle swarm: explosion, stability, "
        "and convergence in a multidimensional complex space, IEEE Trans. Evolutionary Computation "
        "6, 58-73; Marwala (2010), Finite-element-model updating using computational intelligence "
        "techniques, Springer"
    )

    particles: int = 20

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.particles < 2:
            raise InputError(f"particles is {self.particles}", expected="2 at least")

    def search(
        self, cost: Cost, low: FloatArray, high: FloatArray, rng: np.random.Generator
    ) -> Found:
        """Return the best place that any particle met."""
        shape, history = (self.particles, len(low)), list[dict[str, float]]()
        x = low + (high - low) * rng.random(shape)
        x[0] = np.clip(0.0, low, high)
        velocity = low + (high - low) * rng.random(shape) - x
        best, least = x.copy(), np.array([cost(row) for row in x])
        for _ in range(self.evaluations // self.particles - 1):
            own, shared = 0.5 * _PULL * rng.random((2, *shape))
            pull = own * (best - x) + shared * (best[least.argmin()] - x)
            velocity = _CONSTRICTION * (velocity + pull)
            x, free = np.clip(x + velocity, low, high), x + velocity
            velocity[x != free] = 0.0
            costs = np.array([cost(row) for row in x])
            better = costs < least
            best[better], least[better] = x[better], costs[better]
            spread = float(np.ptp(x, axis=0).max())
            history.append({"cost": float(least.min()), "spread": spread})
            if spread < _COLLAPSED:
                break
        return best[least.argmin()], float(least.min()), history
