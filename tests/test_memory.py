"""What strategies hold in memory for a large model: never a dense matrix of it."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.plugin.loader import load_plugins
from tests.lattices import lattice

QUICK = ("baruch", "berman")
# What solves equations for the entries or the elements of the matrices has limits of its own.
OTHERS = ("kabe", "nobari", "generic", "physical")
USED = 5


@pytest.fixture(scope="module")
def tested() -> tuple[Model, Measurement]:
    """Return a lattice of 300 members, and modes of one with other stiffnesses at 120 sensors."""
    model = Model.of(lattice(4, 5))
    structure, rng = model.frame_structure, np.random.default_rng(1)
    properties = structure.properties
    factor = rng.lognormal(0.0, 0.1, len(properties))
    for name in ("EA", "EIy", "EIz", "GJ"):
        properties = properties.scale(name, factor)
    truth = Model.of(type(structure)(structure.frame, structure.mesh, structure.kinematics,
                                     properties, structure.springs))  # fmt: skip
    modes = solve_modes(truth, 6 + USED).elastic
    chosen = rng.choice(len(structure.frame.joints), size=40, replace=False)
    xyz = np.repeat([structure.frame.joints[i].xyz for i in chosen], 3, axis=0)
    sensors = Sensors(tuple(f"s{i}" for i in range(120)), xyz, tuple("xyz") * 40)
    shapes = np.asarray(truth.observe(sensors) @ modes.shapes)
    hertz = modes.natural_frequencies
    std = np.broadcast_to(0.01 * np.abs(shapes).max(axis=0), shapes.shape)
    numbers, damping = tuple(range(1, USED + 1)), np.full(USED, np.nan)
    return model, Measurement(sensors, numbers, hertz, 1e-3 * hertz, damping, shapes, std)


def every_strategy() -> list[object]:
    """Return all strategies, those that take minutes here as part of the sweep."""
    names = [name for name in sorted(load_plugins().strategies) if not name.startswith(OTHERS)]
    return [n if n in QUICK else pytest.param(n, marks=pytest.mark.nightly) for n in names]


@pytest.mark.slow(5)
@pytest.mark.parametrize("name", every_strategy())
def test_no_strategy_makes_a_dense_matrix(name: str, tested: tuple[Model, Measurement]) -> None:
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
