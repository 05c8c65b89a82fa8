"""Building, assembling and solving models of several sizes."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from femubench.core.fem.frame import Frame, GroundSpring, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.modal import eigen
from femubench.core.modal.eigen import solve_modes

Refined = Callable[[int], Frame]


@pytest.mark.benchmark(group="mesh a frame")
@pytest.mark.parametrize("elements", [4, 100])
def test_mesh(benchmark: BenchmarkFixture, refined: Refined, elements: int) -> None:
    frame = refined(elements)
    structure = benchmark(Structure.build, frame)
    assert len(structure.mesh.ends) == 7 * elements


@pytest.mark.benchmark(group="assemble mass and stiffness")
@pytest.mark.parametrize("elements", [4, 100, 1000])
def test_assembly(benchmark: BenchmarkFixture, refined: Refined, elements: int) -> None:
    structure = Structure.build(refined(elements))
    mass, stiffness = benchmark(structure.matrices)
    assert mass.shape == stiffness.shape


@pytest.mark.benchmark(group="all modes, dense")
@pytest.mark.parametrize("elements", [4, 20])
def test_dense_modes(benchmark: BenchmarkFixture, refined: Refined, elements: int) -> None:
    model = Model.of(refined(elements))
    assert model.size <= eigen.DENSE_LIMIT
    assert len(benchmark(solve_modes, model)) == model.size


@pytest.mark.benchmark(group="twelve modes, sparse")
@pytest.mark.parametrize("elements", [30, 300, 1500])
def test_sparse_modes(benchmark: BenchmarkFixture, refined: Refined, elements: int) -> None:
    model = Model.of(refined(elements))
    assert model.size > eigen.DENSE_LIMIT
    modes = benchmark.pedantic(solve_modes, (model, 12), rounds=3, warmup_rounds=1)
    assert modes.rigid.sum() == 3


@pytest.mark.benchmark(group="attach a mass and a spring")
def test_attach(benchmark: BenchmarkFixture, refined: Refined) -> None:
    model = Model.of(refined(4))
    at = Place(member=model.frame_structure.frame.members[0].name, s=0.4)
    after = benchmark(model.attach, [PointMass(at, 0.5)], [GroundSpring(at, "z", 1e6)])
    assert after.size == model.size + 3
