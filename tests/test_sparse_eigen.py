"""The sparse solver against the dense one, and its count of eigenvalues."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Joint, JointSpring, Material, Member, Place, PointMass
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.sections import Section
from femubench.core.modal.eigen import dense_matrices, solve_dense, solve_modes
from femubench.core.modal.sparse_eigen import ShiftedModel, lowest_eigenpairs
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]
SPRINGS = (
    JointSpring("J1", "m0", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J3", "m3", {"x": 1e6, "ry": 2e3}),
    JointSpring("J6", "m5", {"x": 1e7, "z": 1e7, "ry": 1e4}, 0.02, 5.0),
)


def agree(model: Model, count: int, tolerance: float = 1e-8) -> FloatArray:
    """Check the sparse eigenpairs by the dense ones and by their own residual; return them."""
    mass, stiffness = dense_matrices(model)
    expected, _ = solve_dense(mass, stiffness)
    found, shapes = lowest_eigenpairs(model, count)
    assert len(found) >= min(count, len(expected))
    # No solver knows an eigenvalue better than the rounding of phi' K phi.
    small = np.abs(shapes)
    rounding = 32 * np.finfo(float).eps * np.einsum("ij,ij->j", small, np.abs(stiffness) @ small)
    np.testing.assert_allclose(
        found, expected[: len(found)], rtol=tolerance, atol=float(rounding.max())
    )
    gram = shapes.T @ mass @ shapes
    np.testing.assert_allclose(gram, np.eye(len(found)), atol=1e-7)
    residual = np.abs(stiffness @ shapes - mass @ shapes * found)
    weight = (np.abs(stiffness) @ np.abs(shapes)).max()
    assert residual.max() < 1e-9 * weight
    return found


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_spatial_frames_with_massless_joints(portal: FrameBuilder, seed: int) -> None:
    masses = (PointMass(Place(member="m2", s=0.37), 0.5, (0.1, 0.2, -0.1)),)
    agree(Model.of(portal(seed, joint_springs=SPRINGS, masses=masses)), 16)


def test_low_rank_changes_with_negative_eigenvalues(ladder: FrameBuilder) -> None:
    model = Model.of(ladder(elements=12))
    modes = solve_modes(model)
    basis = np.asarray(model.mass @ modes.shapes[:, 3:6])
    core = np.diag([-1.5 * modes.eigenvalues[3], 3e5, -1.2 * modes.eigenvalues[5]])
    mass = LowRank(basis[:, :2], np.diag([0.03, -0.02]))
    updated = replace(model, stiffness_change=LowRank(basis, core), mass_change=mass)
    found = agree(updated, 12)
    assert (found < -1.0).sum() == 2
    assert len(found) == 14  # the negative ones come as well


def test_indefinite_sparse_stiffness(ladder: FrameBuilder) -> None:
    model = Model.of(ladder(elements=12))
    dip = np.zeros(model.size)
    dip[30:33] = -3e4
    found = agree(replace(model, stiffness=model.stiffness + sp.diags_array(dip)), 12)
    assert (found < -1.0).any()


def test_eigenvalues_far_below_zero_are_an_error_of_the_model(ladder: FrameBuilder) -> None:
    """Lanczos cannot tell them from the highest ones; ARPACK's own error was no ModelError."""
    model = Model.of(ladder(elements=12))
    dip = np.zeros(model.size)
    dip[30:33] = -1e12
    with pytest.raises(
        ModelError, match=r"^3 eigenvalues below -\S+ \(rad/s\)\^2 do not converge$"
    ):
        lowest_eigenpairs(replace(model, stiffness=model.stiffness + sp.diags_array(dip)), 12)


def test_repeated_eigenvalues_are_all_found() -> None:
    section = Section.round_tube(0.02, 0.002)
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (0.3, 0.4, 0.5)))
    member = Member("m", ("A", "B"), 40, section, Material(70e9, 0.3, 2700.0))
    model = Model.of(Frame("3d", "euler-bernoulli", joints, (member,)))
    for count in (7, 8, 11, 14):
        agree(model, count)


def test_inertia_counts_the_eigenvalues_below_a_shift(portal: FrameBuilder) -> None:
    model = Model.of(portal(1, joint_springs=SPRINGS))
    modes = solve_modes(model)
    shapes = np.asarray(model.mass @ modes.shapes[:, [7, 9]])
    change = LowRank(shapes, np.diag([-2.0 * modes.eigenvalues[7], 1e7]))
    for candidate in (model, replace(model, stiffness_change=change)):
        expected = solve_modes(candidate).eigenvalues
        for upper in (8, 10, 15, 40):
            middle = float(0.5 * (expected[upper - 1] + expected[upper]))
            count = ShiftedModel(candidate, middle).eigenvalues_below()
            assert count in (None, upper)
        assert ShiftedModel(candidate, -1e10).eigenvalues_below() == 0


def test_solve_is_the_inverse(portal: FrameBuilder) -> None:
    model = Model.of(portal(2))
    shapes = np.asarray(model.mass @ solve_modes(model).shapes[:, 6:9])
    stiffness = LowRank(shapes, np.diag([1e4, -1e3, 0.0]))
    changed = replace(model, stiffness_change=stiffness, mass_change=LowRank(shapes, np.eye(3)))
    shifted = ShiftedModel(changed, -1e3)
    mass, full = dense_matrices(changed)
    right = np.random.default_rng(0).standard_normal((model.size, 3))
    expected = np.linalg.solve(full + 1e3 * mass, right)
    np.testing.assert_allclose(
        shifted.solve(right), expected, rtol=0, atol=1e-8 * abs(expected).max()
    )
    np.testing.assert_allclose(shifted.solve(right[:, 0]), shifted.solve(right)[:, 0], rtol=1e-9)


def test_the_same_bits_twice(ladder: FrameBuilder) -> None:
    first, second = (lowest_eigenpairs(Model.of(ladder(elements=30)), 12) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


def test_a_mechanism_without_mass_is_refused(ladder: FrameBuilder) -> None:
    hinges = tuple(JointSpring("B", m, {"rx": 0.0, "ry": 0.0}) for m in ("AB", "BC", "BE"))
    model = Model.of(replace(ladder(elements=30), joint_springs=hinges))
    with pytest.raises(ModelError, match="neither mass nor stiffness"):
        lowest_eigenpairs(model, 8)
