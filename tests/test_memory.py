"""What strategies hold in memory for a large model: never a dense matrix of it."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from femubench import Measurement, Model
from femubench.core.errors import NotApplicable
from femubench.core.plugin.loader import load_plugins
from tests.lattices import lattice
from tests.simulated import modes_at, sensors_along

# What solves equations for the entries or the elements of the matrices has limits of its own.
OTHERS = ("kabe", "nobari", "generic", "physical")
CELLS, ELEMENTS = 1, 100
QUICK = ("baruch", "berman")


@pytest.fixture(scope="module")
def tested() -> tuple[Model, Measurement]:
    """Return a lattice whose members are few and long, and modes of one with other stiffnesses.

    A dense matrix of it is large, while its factors and what is kept for each parameter are small.
    """
    model = Model.of(lattice(CELLS, ELEMENTS))
    structure, properties = model.frame_structure, model.frame_structure.properties
    factor = np.random.default_rng(1).lognormal(0.0, 0.1, len(properties))
    for name in ("EA", "EIy", "EIz", "GJ"):
        properties = properties.scale(name, factor)
    truth = Model.of(replace(structure, properties=properties))
    return model, modes_at(truth, sensors_along(structure.frame, 4), 5)


def every_strategy() -> list[object]:
    """Return all strategies, all but the quickest as part of the sweep."""
    names = [name for name in sorted(load_plugins().strategies) if not name.startswith(OTHERS)]
    return [n if n in QUICK else pytest.param(n, marks=pytest.mark.nightly) for n in names]


@pytest.mark.slow(5)
@pytest.mark.parametrize("name", every_strategy())
def test_no_strategy_makes_a_dense_matrix(
    name: str, tested: tuple[Model, Measurement], monkeypatch: pytest.MonkeyPatch
) -> None:
    # What a chain takes does not grow with the model: with few walkers it is below the bound.
    monkeypatch.setattr("femubench.core.update.posterior_sampling._FEWEST_WALKERS", 0)
    monkeypatch.setattr("femubench.core.update.posterior_sampling._SAMPLES", 4)
    model, measurement = tested
    strategy = load_plugins().strategies[name]
    tracemalloc.start()
    try:
        strategy.update(model, measurement, np.random.default_rng(0))
    except NotApplicable:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 0.25 * 8 * model.size**2
