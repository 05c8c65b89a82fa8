"""Massless motions follow exactly, aligned with dofs or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from femubench import Model
from femubench.core.modal.eigen import condense_massless, dense_matrices, solve_dense, solve_modes
from femubench.fem import FloatArray, Frame, JointSpring, ModelError, Place, PointMass

FrameBuilder = Callable[..., Frame]


def random_pencil(seed: int, n: int, massless: int, aligned: bool) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    half = rng.standard_normal((n, n))
    stiffness = half @ half.T + 0.1 * np.eye(n)
    factor = rng.standard_normal((n, n - massless))
    mass = factor @ factor.T
    if aligned:
        mass = np.zeros((n, n))
        block = rng.standard_normal((n - massless, n - massless))
        mass[massless:, massless:] = block @ block.T + 0.1 * np.eye(n - massless)
    return mass, stiffness


def static_condensation(mass: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Return the eigenvalues by a Schur complement on the exact null space of the mass."""
    null = la.null_space(mass, rcond=1e-10)
    carrying = la.orth(mass, rcond=1e-10)
    inner, across = null.T @ stiffness @ null, null.T @ stiffness @ carrying
    schur = carrying.T @ stiffness @ carrying - across.T @ np.linalg.solve(inner, across)
    return np.asarray(la.eigh(schur, carrying.T @ mass @ carrying, eigvals_only=True))


@pytest.mark.parametrize("aligned", [True, False])
def test_condensation_is_exact(aligned: bool) -> None:
    mass, stiffness = random_pencil(0, 20, 6, aligned)
    expected = static_condensation(mass, stiffness)
    K, M, expand = condense_massless(mass, stiffness)
    assert K.shape == (14, 14)
    eigenvalues, shapes = la.eigh(K, M)
    np.testing.assert_allclose(eigenvalues, expected, rtol=1e-10)
    solved, full = solve_dense(mass, stiffness)
    np.testing.assert_allclose(solved, expected, rtol=1e-10)
    for vectors in (expand @ shapes, full):
        residual = stiffness @ vectors - mass @ vectors * expected
        assert np.abs(residual).max() < 1e-9 * np.abs(stiffness @ np.abs(vectors)).max()
        np.testing.assert_allclose(vectors.T @ mass @ vectors, np.eye(14), atol=1e-9)


def massless_frames(fitted_portal: FrameBuilder) -> list[Model]:
    """Return frames with massless joints, springs along skew members, arms and offset masses."""
    return [Model.of(fitted_portal(seed)) for seed in range(2)]


def test_massless_joints_follow_exactly_and_satisfy_the_equations(
    fitted_portal: FrameBuilder,
) -> None:
    for model in massless_frames(fitted_portal):
        modes = solve_modes(model)
        mass, stiffness = dense_matrices(model)
        assert len(modes) == np.linalg.matrix_rank(mass, tol=1e-12, hermitian=True) < model.size
        shapes, eigenvalues = modes.elastic.shapes[:, :20], modes.elastic.eigenvalues[:20]
        residual = np.abs(stiffness @ shapes - mass @ shapes * eigenvalues)
        scale = np.abs(stiffness) @ np.abs(shapes)
        assert (residual.max(axis=0) / scale.max(axis=0)).max() < 1e-12
        gram = modes.shapes[:, :30].T @ mass @ modes.shapes[:, :30]
        np.testing.assert_allclose(gram, np.eye(30), atol=1e-9)


def test_the_mass_of_an_offset_lump_alone_is_condensed(ladder: FrameBuilder) -> None:
    # A massless frame that carries four lumps on arms: eight massless combinations of twelve dofs.
    frame = ladder(elements=1, accelerometer=False)
    weightless = replace(frame.members[0].material, rho=0.0)
    lumps = tuple(PointMass(Place(joint=j), 0.3, (0.02, 0.03, 0.0)) for j in "ACDF")
    members = tuple(replace(m, material=weightless) for m in frame.members)
    model = Model.of(replace(frame, members=members, masses=lumps))
    mass, stiffness = dense_matrices(model)
    modes = solve_modes(model)
    assert len(modes) == 4
    flexibility = np.linalg.pinv(stiffness, rcond=1e-10)
    assert modes.rigid.sum() == 3
    one = modes.elastic
    np.testing.assert_allclose(
        stiffness @ one.shapes, mass @ one.shapes * one.eigenvalues, atol=1e-7 * stiffness.max()
    )
    # With rigid modes projected out the lone elastic eigenvalue is 1 / trace(F M).
    R = modes.shapes[:, :3]
    P = np.eye(18) - mass @ R @ R.T
    assert one.eigenvalues[0] == pytest.approx(
        1.0 / np.trace(P.T @ flexibility @ P @ mass), rel=1e-8
    )


def test_a_massless_mechanism_is_refused(ladder: FrameBuilder) -> None:
    hinges = tuple(JointSpring("B", m, {"rx": 0.0, "ry": 0.0}) for m in ("AB", "BC", "BE"))
    with pytest.raises(ModelError, match="neither mass nor stiffness"):
        solve_modes(Model.of(replace(ladder(), joint_springs=hinges)))
