"""Rigid-body modes: as many as supports and springs leave, on any mesh, in any orientation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femubench.core.fem.frame import Frame, Place, Support
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import dense_matrices, solve_dense, solve_modes, zero_tolerance
from femubench.core.modal.rigid import rigid_body_vectors, rigid_modes_of
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]


def straining(model: Model, vectors: FloatArray) -> float:
    """Return the largest nodal force of motions, relative to its own summands."""
    force = np.abs(model.stiffness @ vectors).max()
    return float(force / (np.abs(model.stiffness) @ np.abs(vectors)).max())


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("seed", range(2))
def test_any_free_spatial_frame_has_six_rigid_modes(
    fitted_portal: FrameBuilder, seed: int, theory: str
) -> None:
    frame = fitted_portal(seed, theory)
    model = Model.of(frame)
    modes = solve_modes(model)
    assert modes.rigid[:6].all()
    assert modes.rigid.sum() == 6
    assert np.abs(modes.eigenvalues[:6]).max() <= 1e-9 * modes.eigenvalues[6]
    raw, _ = solve_dense(*dense_matrices(model))
    assert np.abs(raw[:6]).max() <= 2e-9 * raw[6]  # before rounding is taken for what it is
    assert straining(model, rigid_body_vectors(model.dofs)) < 1e-14


def turned_ladder(frame: Frame, plane: str, angle: float) -> Frame:
    c, s = np.cos(angle), np.sin(angle)
    joints = []
    for joint in frame.joints:
        a, b = c * joint.xyz[0] - s * joint.xyz[1] + 3.0, s * joint.xyz[0] + c * joint.xyz[1] - 2.0
        xyz = (a, b, 0.7) if plane == "out-of-plane" else (a, 0.7, b)
        joints.append(replace(joint, xyz=xyz))
    return replace(frame, joints=tuple(joints), plane=plane)  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [0.3, np.pi / 2])
@pytest.mark.parametrize("plane", ["in-plane", "out-of-plane"])
def test_planar_frames_have_three_in_every_orientation(
    asymmetric_ladder: FrameBuilder, plane: str, angle: float
) -> None:
    frame = asymmetric_ladder(accelerometer=False)
    model = Model.of(turned_ladder(frame, plane, angle))
    modes = solve_modes(model)
    assert modes.rigid.sum() == 3
    assert modes.rigid[:3].all()
    assert np.abs(modes.eigenvalues[:3]).max() <= 1e-9 * modes.eigenvalues[3]
    straight = Model.of(turned_ladder(frame, plane, 0.0))
    np.testing.assert_allclose(
        modes.natural_frequencies[3:12], solve_modes(straight).natural_frequencies[3:12], rtol=1e-8
    )


@pytest.mark.parametrize("elements", [4, 150])
def test_fine_meshes_keep_their_rigid_modes(ladder: FrameBuilder, elements: int) -> None:
    model = Model.of(ladder(elements=elements))
    modes = solve_modes(model, 8)
    assert modes.rigid[:3].all()
    assert modes.rigid.sum() == 3
    assert np.abs(modes.eigenvalues[:3]).max() <= 1e-9 * modes.eigenvalues[3]
    assert straining(model, rigid_body_vectors(model.dofs)) < 1e-14


@pytest.mark.parametrize(
    ("fixed", "left"), [(("z",), 2), (("z", "rx"), 1), (("z", "rx", "ry"), 0), (("ry",), 2)]
)
def test_supports_take_rigid_modes_away(
    ladder: FrameBuilder, fixed: tuple[str, ...], left: int
) -> None:
    frame = replace(ladder(), supports=(Support(Place(joint="B"), fixed),))
    modes = solve_modes(Model.of(frame))
    assert modes.rigid.sum() == left
    assert np.sum(modes.eigenvalues <= zero_tolerance(modes)) == left


def test_matrices_without_geometry_are_judged_by_energy(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    bare = replace(model, structure=None, dofs=replace(model.dofs, axes=None))
    assert rigid_modes_of(bare).shape == (81, 3)
    held = replace(bare, stiffness=bare.stiffness + sp.diags_array(np.eye(81)[0] * 1e5))
    assert rigid_modes_of(held).shape == (81, 2)


@pytest.mark.parametrize("height", [0.0, 0.7])
def test_a_plane_off_the_origin_has_no_further_rigid_modes(
    hframe: FrameBuilder, height: float
) -> None:
    base = hframe()
    joints = tuple(replace(j, xyz=(j.xyz[0], height, j.xyz[2])) for j in base.joints)
    raised = replace(base, joints=joints)
    assert rigid_modes_of(Model.of(raised)).shape[1] == 3
    clamped = replace(raised, supports=(Support(Place(joint="T1"), ("x", "z", "ry")),))
    assert rigid_modes_of(Model.of(clamped)).shape[1] == 0
    assert rigid_body_vectors(Model.of(raised).dofs).shape[1] == 3
