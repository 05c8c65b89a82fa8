"""The finite element columns of both papers, from the geometry that was recovered from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femubench.core.fem.frame import Frame, JointSpring, RigidEnd
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import solve_modes
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]
MESH_C = [78.908, 148.359, 306.241, 417.534, 534.288, 958.437, 1024.195, 1334.451]
MESH_C_WITH_ACCELEROMETERS = [78.51, 147.31, 298.90, 408.03, 523.31, 957.34, 1013.35, 1310.70]
INITIAL_SPRING = [79.31, 151.45, 299.05, 411.55, 539.36]
INITIAL_OFFSET = [80.08, 154.83, 299.28, 413.67, 553.71]
FRAME_FE = [255.8, 277.5, 581.3, 911.3, 1049.4]


def deviation(model: Model, expected: list[float]) -> float:
    modes = solve_modes(model)
    assert modes.rigid.sum() == 3
    found: FloatArray = modes.elastic.natural_frequencies[: len(expected)]
    return float(np.abs(found / np.array(expected) - 1.0).max())


def test_ladder_has_the_published_size_and_zero_pattern(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    assert model.size == 81
    assert sp.triu(model.stiffness).nnz == 231


def test_ladder_meets_the_published_column(ladder: FrameBuilder) -> None:
    assert deviation(Model.of(ladder()), FRAME_FE) < 1e-3


def test_corner_mass_is_needed_for_it(ladder: FrameBuilder) -> None:
    assert deviation(Model.of(ladder(accelerometer=False)), FRAME_FE) > 1e-2


def test_ladder_with_bredt_and_shear_comes_near_the_test(ladder: FrameBuilder) -> None:
    frame = ladder("timoshenko", polar=False, E=70e9, accelerometer=False)
    model = Model.of(replace(frame, bending_mass="cubic"))
    assert deviation(model, [235.3, 279.7, 556.8, 884.8, 1011.7]) < 2e-3


def test_hframe_meets_the_published_row(hframe: FrameBuilder) -> None:
    model = Model.of(hframe())
    assert model.size == 195
    assert deviation(model, MESH_C_WITH_ACCELEROMETERS) < 5e-5


def test_hframe_without_accelerometers(hframe: FrameBuilder) -> None:
    assert deviation(Model.of(hframe(accelerometers=False)), MESH_C) < 1e-4


@pytest.mark.parametrize(
    ("mesh", "row"),
    [
        ((8, 4, 8), [1, 1, 1, 1, 0.999, 0.999, 0.998, 0.994]),
        ((32, 16, 32), [1, 1, 1, 1, 0.999, 0.999, 0.998, 0.994]),
    ],
)
def test_hframe_mesh_study(
    hframe: FrameBuilder, mesh: tuple[int, int, int], row: list[float]
) -> None:
    coarse = solve_modes(Model.of(hframe(mesh=(4, 2, 4), accelerometers=False)))
    fine = solve_modes(Model.of(hframe(mesh=mesh, accelerometers=False)))
    ratio = fine.elastic.natural_frequencies[:8] / coarse.elastic.natural_frequencies[:8]
    np.testing.assert_allclose(ratio, row, atol=6e-4)


def test_hframe_spring_model_meets_its_initial_row(hframe: FrameBuilder) -> None:
    stiffness = {"x": 3.30e9, "z": 4.48e9, "ry": 3.02e6}
    springs = tuple(JointSpring(j, "horizontal", stiffness, 0.02, 5.0) for j in ("T1", "T2"))
    assert deviation(Model.of(hframe(joint_springs=springs)), INITIAL_SPRING) < 1e-4


def test_hframe_offset_model_meets_its_initial_row(hframe: FrameBuilder) -> None:
    rigid = []
    for side in "12":
        rigid.append(RigidEnd("T" + side, "horizontal", 0.02, 0.02))
        rigid += [RigidEnd("T" + side, leg + side, 3.12e-6) for leg in ("lower", "upper")]
    assert deviation(Model.of(hframe(rigid_ends=tuple(rigid))), INITIAL_OFFSET) < 1e-4
