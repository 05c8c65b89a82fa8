"""Many gradients, many design changes and a matrix update of one large model, in eigen-solutions.

Every figure is processor time next to that of one solution for 12 modes of the same model in the
same process; `figures` gives them all.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.processor_time import least
from femubench.core.fem.derivatives import derivatives
from femubench.core.fem.frame import Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import Modes, solve_modes
from femubench.core.modal.many_changes import Change, modes_of_changes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.sensitivity import eigenvalue_sensitivities
from femubench.core.plugin.loader import load_plugins
from tests.lattices import lattice

COUNT = 12
USED = 5


def element_factors(model: Model) -> list[Property]:
    """Return factors on E and on the density of every element."""
    labels = list(dict.fromkeys(model.frame_structure.labels))
    return [Property(f"{q} {at}", q, (at,)) for q in ("E", "density") for at in labels]


def gradient_share(model: Model, modes: Modes, solution: float) -> tuple[float, float]:
    """Return what the gradients of 12 eigenvalues cost, the first time and again."""
    parameters = element_factors(model)

    def first() -> object:
        model.frame_structure.kept.clear()
        return eigenvalue_sensitivities(model, modes, parameters)

    again = least(lambda: eigenvalue_sensitivities(model, modes, parameters))
    return least(first) / solution, again / solution


def masses(model: Model, count: int, *, inside: bool) -> list[Change]:
    """Return masses of half a percent of the whole at joints, or each inside an element."""
    rng, frame = np.random.default_rng(0), model.frame_structure.frame
    kilograms = 0.005 * model.total_mass
    for_members = rng.choice(len(frame.members), size=count)
    for_joints = rng.choice(len(frame.joints), size=count)
    places = (
        [Place(member=frame.members[i].name, s=0.41) for i in for_members]
        if inside
        else [Place(joint=frame.joints[i].name) for i in for_joints]
    )
    return [([PointMass(place, kilograms)], []) for place in places]


def full_solutions(model: Model, changes: list[Change]) -> list[Modes]:
    """Return the modes after each change, each solved by itself."""
    return [solve_modes(model.attach(*change), COUNT) for change in changes]


def exact_measurement(model: Model) -> Measurement:
    """Return modes of the model with other stiffnesses, at three directions of 40 joints."""
    rng, structure = np.random.default_rng(1), model.frame_structure
    members = [Property(name, "E", at) for name, at in structure.member_labels.items()]
    truth = Model.of(structure.with_values(members, rng.lognormal(0.0, 0.1, len(members))))
    modes = solve_modes(truth, 6 + USED).elastic
    chosen = rng.choice(len(structure.frame.joints), size=40, replace=False)
    xyz = np.repeat(structure.frame.corners[chosen], 3, axis=0)
    sensors = Sensors(tuple(f"s{i}" for i in range(120)), xyz, tuple("xyz") * 40)
    shapes = np.asarray(truth.observe(sensors) @ modes.shapes)
    hertz, std = modes.natural_frequencies, 0.01 * np.abs(shapes)
    numbers, damping = tuple(range(1, USED + 1)), np.full(USED, np.nan)
    return Measurement(sensors, numbers, hertz, 1e-3 * hertz, damping, shapes, std)


def update_and_predict(name: str, model: Model, measurement: Measurement) -> Modes:
    """Return 12 modes of the model that a strategy gives."""
    strategy = load_plugins().strategies[name]
    # Another object of the same content: nothing that was kept of the model helps.
    result = strategy.update(replace(model), measurement, np.random.default_rng(0))
    return solve_modes(result.model, COUNT)


def figures(cells: int = 8, elements: int = 3, changes: int = 100) -> dict[str, float]:
    """Return all ratios to one solution, by what they are; 27 702 dofs as they stand."""
    model = Model.of(lattice(cells, elements))
    solution = least(lambda: solve_modes(model, COUNT))
    first, again = gradient_share(model, solve_modes(model, COUNT), solution)
    found = {"dofs": float(model.size), "gradients, first": first, "gradients, again": again}
    for inside, where in ((False, "joints"), (True, "elements")):
        listed = masses(model, changes, inside=inside)
        taken = least(lambda listed=listed: modes_of_changes(model, listed, COUNT), 1)
        found[f"{changes} masses at {where}"] = taken / solution
    measurement = exact_measurement(model)
    for name in ("baruch", "berman"):
        taken = least(lambda name=name: update_and_predict(name, model, measurement))
        found[f"{name} and {COUNT} modes"] = taken / solution
    return found


@pytest.fixture(scope="module")
def model() -> Model:
    """Return a lattice of 10 125 dofs."""
    return Model.of(lattice(5, 4))


@pytest.mark.benchmark(group="gradients of 12 eigenvalues")
def test_gradients(benchmark: BenchmarkFixture, model: Model) -> None:
    modes, parameters = solve_modes(model, COUNT), element_factors(model)
    found = benchmark(eigenvalue_sensitivities, model, modes, parameters)
    assert found.shape == (COUNT, len(parameters))


@pytest.mark.benchmark(group="gradients of 12 eigenvalues")
def test_gradients_matrix_by_matrix(benchmark: BenchmarkFixture, model: Model) -> None:
    modes, parameters = solve_modes(model, COUNT), element_factors(model)[:20]

    def one_by_one() -> object:
        return [derivatives(model.frame_structure, [p]).quadratic(modes.shapes, modes.shapes)
                for p in parameters]  # fmt: skip

    benchmark.pedantic(one_by_one, rounds=1)


@pytest.mark.benchmark(group="ten masses")
@pytest.mark.parametrize("inside", [False, True])
def test_changes(benchmark: BenchmarkFixture, model: Model, inside: bool) -> None:
    changes = masses(model, 10, inside=inside)
    found = benchmark.pedantic(modes_of_changes, (model, changes, COUNT), rounds=1)
    for modes, expected in zip(islice(found, 2), full_solutions(model, changes[:2]), strict=True):
        np.testing.assert_allclose(
            modes.elastic.natural_frequencies, expected.elastic.natural_frequencies, rtol=1e-5
        )


@pytest.mark.benchmark(group="ten masses")
def test_changes_by_full_solutions(benchmark: BenchmarkFixture, model: Model) -> None:
    changes = masses(model, 10, inside=False)
    benchmark.pedantic(full_solutions, (model, changes), rounds=1)


@pytest.mark.benchmark(group="twelve modes of an updated model")
@pytest.mark.parametrize("name", ["baruch", "berman"])
def test_update(benchmark: BenchmarkFixture, model: Model, name: str) -> None:
    measurement = exact_measurement(model)
    found = benchmark.pedantic(update_and_predict, (name, model, measurement), rounds=1)
    assert len(found) == COUNT
