"""Analytical sensitivities against finite differences, both in one run and to the same end."""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from femubench.core.case.case import Case
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.sensitivity import eigenvalue_sensitivities, shape_sensitivities
from femubench.core.typing import FloatArray

MODES = slice(3, 8)
STEP = 1e-4


@pytest.fixture(scope="module")
def parameters(case: Case) -> list[Property]:
    """Return the bending stiffness of every element, 28 parameters."""
    return [Property(label, "EI", (label,)) for label in case.model.frame_structure.labels]


def analytical(model: Model, parameters: list[Property]) -> FloatArray:
    """Return d lambda / d p of five modes, one eigenvalue solution included."""
    modes = solve_modes(model)
    return eigenvalue_sensitivities(model, modes.take(np.arange(len(modes))[MODES]), parameters)


def differences(model: Model, parameters: list[Property]) -> FloatArray:
    """Return the same by central differences, two eigenvalue solutions a parameter."""
    structure, columns = model.frame_structure, []
    for parameter in parameters:
        moved = [
            solve_modes(Model.of(structure.with_values([parameter], [1.0 + step]))).eigenvalues
            for step in (STEP, -STEP)
        ]
        columns.append((moved[0] - moved[1])[MODES] / (2.0 * STEP))
    return np.array(columns).T


@pytest.mark.benchmark(group="28 eigenvalue sensitivities")
def test_analytical(benchmark: BenchmarkFixture, case: Case, parameters: list[Property]) -> None:
    found = benchmark(analytical, case.model, parameters)
    np.testing.assert_allclose(found, differences(case.model, parameters), rtol=1e-4, atol=1.0)


@pytest.mark.benchmark(group="28 eigenvalue sensitivities")
def test_differences(benchmark: BenchmarkFixture, case: Case, parameters: list[Property]) -> None:
    found = benchmark.pedantic(differences, (case.model, parameters), rounds=3)
    assert found.shape == (5, 28)


@pytest.mark.benchmark(group="28 shape sensitivities of a mode")
def test_shapes(benchmark: BenchmarkFixture, case: Case, parameters: list[Property]) -> None:
    modes = solve_modes(case.model)
    found = benchmark(shape_sensitivities, case.model, modes, 4, parameters)
    assert found.shape == (case.model.size, 28)
