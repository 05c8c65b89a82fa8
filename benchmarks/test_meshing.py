"""Meshing a large frame, next to a plain loop over its members."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from femubench.core.fem.frame import Frame
from femubench.core.fem.mesh import build_mesh, member_axes
from femubench.core.typing import FloatArray, IntArray

sys.path.insert(0, str(Path(__file__).parent))
from large_structures import planar_grid


def looped(frame: Frame) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return nodes (n, 3), ends (e, 2) and axes (e, 3, 3) of the elements, member by member."""
    nodes = [np.array(joint.xyz) for joint in frame.joints]
    ends: list[tuple[int, int]] = []
    axes = []
    for member in frame.members:
        first, last = (frame.joint_index[name] for name in member.ends)
        inner = range(len(nodes), len(nodes) + member.elements - 1)
        way = nodes[last] - nodes[first]
        nodes += [nodes[first] + k / member.elements * way for k in range(1, member.elements)]
        ends += pairwise((first, *inner, last))
        axes += [member_axes(frame, member)[0]] * member.elements
    return np.array(nodes), np.array(ends), np.array(axes)


@pytest.fixture(scope="module")
def grid() -> Frame:
    """Return a grid of 12 324 members of three elements."""
    return planar_grid(79, 3)


@pytest.mark.benchmark(group="mesh 12 324 members")
def test_arrays(benchmark: BenchmarkFixture, grid: Frame) -> None:
    mesh = benchmark(build_mesh, grid)
    nodes, ends, axes = looped(grid)
    np.testing.assert_allclose(mesh.xyz[mesh.ends], nodes[ends], atol=1e-9)
    np.testing.assert_allclose(mesh.axes, axes, atol=1e-12)


@pytest.mark.benchmark(group="mesh 12 324 members")
def test_loop(benchmark: BenchmarkFixture, grid: Frame) -> None:
    nodes, _, _ = benchmark.pedantic(looped, (grid,), rounds=3)
    assert len(nodes) == len(build_mesh(grid).xyz)
