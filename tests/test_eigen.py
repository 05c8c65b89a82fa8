"""Eigenpairs: rigid-body modes, exact condensation, signs, repeated roots, determinism."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from femubench.core.errors import ModelError
from femubench.core.fem.frame import (
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    Member,
    Place,
    PointMass,
    RigidEnd,
    Support,
)
from femubench.core.fem.sections import round_tube
from femubench.core.measurement import DIRECTIONS
from femubench.core.modal.eigen import (
    condense_massless,
    counted_evaluations,
    dense_matrices,
    solve_dense,
    solve_modes,
    zero_tolerance,
)
from femubench.core.modal.rigid import rigid_body_vectors, rigid_modes_of
from femubench.core.model import Dofs, LowRank, Model
from femubench.core.typing import FloatArray

JOINTS = (
    JointSpring("J1", "m0", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J1", "m1", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J1", "m8", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J3", "m3", {"x": 1e6, "ry": 2e3}),
    JointSpring("J6", "m5", {"x": 1e7, "z": 1e7, "ry": 1e4}, 0.02, 5.0),
)
ENDS = (RigidEnd("J4", "m4", -0.03), RigidEnd("J5", "m8", 0.03, 0.02))
MASSES = (
    PointMass(Place(member="m2", s=0.37), 0.5, (0.1, 0.2, -0.1)),
    PointMass(Place(joint="J0"), 0.5, (0.1, 0.2, -0.1)),
)


def dense(model: Model) -> tuple[FloatArray, FloatArray]:
    return dense_matrices(model)


def straining(model: Model, vectors: FloatArray) -> float:
    """Return the largest nodal force of motions, relative to its own summands."""
    force = np.abs(model.stiffness @ vectors).max()
    return float(force / (np.abs(model.stiffness) @ np.abs(vectors)).max())


# ---- rigid-body modes -----------------------------------------------------------------------


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("seed", range(4))
def test_any_free_spatial_frame_has_six_rigid_modes(portal, seed, theory):
    frame = portal(seed, theory, joint_springs=JOINTS, rigid_ends=ENDS, masses=MASSES)
    model = Model.of(frame)
    modes = solve_modes(model)
    assert modes.rigid[:6].all()
    assert modes.rigid.sum() == 6
    assert np.abs(modes.eigenvalues[:6]).max() <= 1e-9 * modes.eigenvalues[6]
    raw, _ = solve_dense(*dense(model))
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


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, np.pi / 2, 2.5])
@pytest.mark.parametrize("plane", ["in-plane", "out-of-plane"])
def test_planar_frames_have_three_in_every_orientation(asymmetric_ladder, plane, angle):
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


@pytest.mark.parametrize("elements", [4, 20, 60, 150])
def test_fine_meshes_keep_their_rigid_modes(ladder, elements):
    model = Model.of(ladder(elements=elements))
    modes = solve_modes(model, 8)
    assert modes.rigid[:3].all()
    assert modes.rigid.sum() == 3
    assert np.abs(modes.eigenvalues[:3]).max() <= 1e-9 * modes.eigenvalues[3]
    assert straining(model, rigid_body_vectors(model.dofs)) < 1e-14


@pytest.mark.parametrize("elements", [4, 12, 60])
def test_a_soft_suspension_makes_rigid_modes_elastic_on_any_mesh(ladder, elements):
    springs = tuple(GroundSpring(Place(joint=j), "z", 100.0) for j in "ACDF")
    frame = replace(ladder(elements=elements, accelerometer=False), springs=springs)
    modes = solve_modes(Model.of(frame), 8)
    assert not modes.rigid.any()
    area, density = frame.members[0].section.A, 2700.0
    length = 4 * 0.2921 + 3 * 0.2794
    bounce = np.sqrt(400.0 / (area * density * length)) / (2 * np.pi)
    assert modes.natural_frequencies[0] == pytest.approx(bounce, rel=1e-3)


@pytest.mark.parametrize(
    ("fixed", "left"), [(("z",), 2), (("z", "rx"), 1), (("z", "rx", "ry"), 0), (("ry",), 2)]
)
def test_supports_take_rigid_modes_away(ladder, fixed, left):
    frame = replace(ladder(), supports=(Support(Place(joint="B"), fixed),))
    modes = solve_modes(Model.of(frame))
    assert modes.rigid.sum() == left
    assert np.sum(modes.eigenvalues <= zero_tolerance(modes)) == left


def test_one_spring_leaves_two(ladder):
    frame = replace(ladder(), springs=(GroundSpring(Place(member="EF", s=0.4), "z", 1e4),))
    modes = solve_modes(Model.of(frame))
    assert modes.rigid.sum() == 2
    no_spring = replace(frame, springs=(GroundSpring(Place(member="EF", s=0.4), "z", 0.0),))
    assert solve_modes(Model.of(no_spring)).rigid.sum() == 3


def test_matrices_without_geometry_are_judged_by_energy(ladder):
    model = Model.of(ladder())
    bare = replace(model, structure=None, dofs=replace(model.dofs, axes=None))
    assert rigid_modes_of(bare).shape == (81, 3)
    held = replace(bare, stiffness=bare.stiffness + sp.diags_array(np.eye(81)[0] * 1e5))
    assert rigid_modes_of(held).shape == (81, 2)


def test_a_lost_rigid_mode_is_not_counted_as_one(ladder):
    model = Model.of(ladder())
    rigid = rigid_modes_of(model)
    force = np.asarray(model.mass @ rigid[:, :1])
    stiff = replace(model, stiffness_change=LowRank(force, np.array([[(2 * np.pi * 90) ** 2]])))
    modes = solve_modes(stiff)
    kept = modes.rigid & (np.abs(modes.eigenvalues) <= zero_tolerance(modes))
    assert kept.sum() == 2
    assert np.abs(modes.natural_frequencies - 90.0).min() < 1e-6


# ---- condensation ---------------------------------------------------------------------------


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
@pytest.mark.parametrize("seed", range(3))
def test_condensation_is_exact(seed, aligned):
    mass, stiffness = random_pencil(seed, 20, 6, aligned)
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


@pytest.mark.parametrize("seed", range(3))
def test_a_tiny_mass_tends_to_no_mass(seed):
    mass, stiffness = random_pencil(seed, 12, 3, aligned=True)
    exact, _ = solve_dense(mass, stiffness)
    deviation = []
    for tiny in (1e-3, 1e-4, 1e-5):
        filled = mass + tiny * np.diag([1.0] * 3 + [0.0] * 9)
        values = la.eigh(stiffness, filled, eigvals_only=True)[:5]
        deviation.append(np.abs(values / exact[:5] - 1.0).max())
    assert deviation[0] / deviation[1] == pytest.approx(10.0, rel=0.2)
    assert deviation[2] < 1e-3


def massless_frames(portal) -> list[Model]:  # type: ignore[no-untyped-def]
    """Return frames with massless joints, springs along skew members, arms and offset masses."""
    return [
        Model.of(portal(seed, joint_springs=JOINTS, rigid_ends=ENDS, masses=MASSES))
        for seed in range(2)
    ]


def test_massless_joints_follow_exactly_and_satisfy_the_equations(portal):
    for model in massless_frames(portal):
        modes = solve_modes(model)
        mass, stiffness = dense(model)
        assert len(modes) == np.linalg.matrix_rank(mass, tol=1e-12, hermitian=True) < model.size
        shapes, eigenvalues = modes.elastic.shapes[:, :20], modes.elastic.eigenvalues[:20]
        residual = np.abs(stiffness @ shapes - mass @ shapes * eigenvalues)
        scale = np.abs(stiffness) @ np.abs(shapes)
        assert (residual.max(axis=0) / scale.max(axis=0)).max() < 1e-12
        gram = modes.shapes[:, :30].T @ mass @ modes.shapes[:, :30]
        np.testing.assert_allclose(gram, np.eye(30), atol=1e-9)


def test_the_mass_of_an_offset_lump_alone_is_condensed(ladder):
    # A massless frame that carries four lumps on arms: eight massless combinations of twelve dofs.
    frame = ladder(elements=1, accelerometer=False)
    weightless = replace(frame.members[0].material, rho=0.0)
    lumps = tuple(PointMass(Place(joint=j), 0.3, (0.02, 0.03, 0.0)) for j in "ACDF")
    members = tuple(replace(m, material=weightless) for m in frame.members)
    model = Model.of(replace(frame, members=members, masses=lumps))
    mass, stiffness = dense(model)
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


def test_a_massless_mechanism_is_refused(ladder):
    hinges = tuple(JointSpring("B", m, {"rx": 0.0, "ry": 0.0}) for m in ("AB", "BC", "BE"))
    with pytest.raises(ModelError, match="neither mass nor stiffness"):
        solve_modes(Model.of(replace(ladder(), joint_springs=hinges)))


# ---- signs, repeated roots, order -----------------------------------------------------------


def test_negative_eigenvalues_keep_their_sign(ladder):
    model = Model.of(ladder())
    modes = solve_modes(model)
    shapes = np.asarray(model.mass @ modes.shapes[:, 3:6])
    drop = np.diag([-1.5 * modes.eigenvalues[3], 3e5, -1.2 * modes.eigenvalues[5]])
    updated = solve_modes(replace(model, stiffness_change=LowRank(shapes, drop)))
    expected = modes.eigenvalues.copy()
    expected[3:6] += np.diag(drop)
    np.testing.assert_allclose(updated.eigenvalues, np.sort(expected), rtol=1e-7, atol=1e-3)
    assert (updated.natural_frequencies[:2] < 0.0).all()
    assert updated.natural_frequencies[0] == pytest.approx(
        -np.sqrt(0.5 * modes.eigenvalues[3]) / (2 * np.pi)
    ) or updated.natural_frequencies[1] == pytest.approx(
        -np.sqrt(0.5 * modes.eigenvalues[3]) / (2 * np.pi)
    )


@pytest.mark.parametrize("factor", [-1e-9, -1.0, -1.0 - 1e-12, -1.0 + 1e-12, -30.0, -1e4, -1e7])
def test_a_negative_eigenvalue_of_any_size_spoils_no_other(ladder, factor):
    # Whatever shift the solver takes, an eigenvalue may lie right at minus the shift.
    model = Model.of(ladder())
    mass, stiffness = dense(model)
    values, shapes = solve_dense(mass, stiffness)
    scale = float(1e-6 * np.median(np.diagonal(stiffness) / np.diagonal(mass)))
    force = mass @ shapes[:, 5]
    change = (factor * scale - values[5]) * np.outer(force, force)
    found, _ = solve_dense(mass, stiffness + change)
    expected = np.sort(np.append(np.delete(values, 5), factor * scale))
    tolerance = 1e-7 * values[3]
    np.testing.assert_allclose(found[:12], expected[:12], rtol=1e-7, atol=tolerance)


def test_indefinite_mass_is_refused(ladder):
    model = Model.of(ladder())
    shapes = np.asarray(model.mass @ solve_modes(model).shapes[:, 3:4])
    with pytest.raises(ModelError, match="mass matrix is not positive"):
        solve_modes(replace(model, mass_change=LowRank(shapes, np.array([[-2.0]]))))


def test_indefinite_mass_beside_indefinite_stiffness_is_refused(ladder):
    model = Model.of(ladder())
    modes = solve_modes(model)
    shapes = np.asarray(model.mass @ modes.shapes[:, 3:5])
    drop = LowRank(shapes, np.diag([0.0, -1e9]))
    with pytest.raises(ModelError, match="mass matrix is not positive"):
        solve_modes(
            replace(model, stiffness_change=drop, mass_change=LowRank(shapes, np.diag([-2.0, 0.0])))
        )


def test_matrices_that_are_not_finite_are_refused(ladder):
    model = Model.of(ladder())
    bad = model.stiffness.copy()
    bad.data[0] = np.nan
    with pytest.raises(ModelError, match="not finite"):
        solve_modes(replace(model, stiffness=bad))


def test_repeated_eigenvalues_give_orthonormal_shapes():
    section = round_tube(0.02, 0.002)
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (0.3, 0.4, 0.5)))
    member = Member("m", ("A", "B"), 6, section, Material(70e9, 0.3, 2700.0))
    model = Model.of(Frame("3d", "euler-bernoulli", joints, (member,)))
    modes = solve_modes(model)
    assert modes.rigid.sum() == 6
    pairs = modes.eigenvalues[6:12].reshape(3, 2)
    np.testing.assert_allclose(pairs[:, 0], pairs[:, 1], rtol=1e-9)
    gram = modes.shapes.T @ model.mass.toarray() @ modes.shapes
    np.testing.assert_allclose(gram, np.eye(len(modes)), atol=1e-8)


def test_the_same_model_gives_the_same_bits_twice(portal):
    first, second = (solve_modes(Model.of(portal(1, joint_springs=JOINTS))) for _ in range(2))
    np.testing.assert_array_equal(first.eigenvalues, second.eigenvalues)
    np.testing.assert_array_equal(first.shapes, second.shapes)


def test_count_takes_the_lowest(ladder):
    model = Model.of(ladder())
    few, all_modes = solve_modes(model, 7), solve_modes(model)
    assert len(few) == 7
    np.testing.assert_array_equal(few.eigenvalues, all_modes.eigenvalues[:7])
    assert len(all_modes) == 81


def test_a_mass_lowers_and_a_spring_raises_every_frequency(asymmetric_ladder):
    frame = asymmetric_ladder()
    plain = solve_modes(Model.of(frame)).eigenvalues
    at = Place(joint="E")
    heavier = replace(frame, masses=(*frame.masses, PointMass(at, 0.5, (0.01, 0.02, 0.0))))
    stiffer = replace(frame, springs=(GroundSpring(at, "z", 1e5),))
    slack = 1e-6 * plain[3]
    assert (solve_modes(Model.of(heavier)).eigenvalues <= plain + slack).all()
    raised = solve_modes(Model.of(stiffer)).eigenvalues
    assert (raised >= plain - slack).all()
    assert (raised[:-1] <= plain[1:] * (1 + 1e-9) + slack).all()  # Rayleigh's interlacing


def test_evaluations_are_counted_in_nested_blocks(ladder):
    model = Model.of(ladder())
    with counted_evaluations() as outer:
        with counted_evaluations() as inner:
            solve_modes(model)
        solve_modes(model)
        solve_modes(model)
    solve_modes(model)
    assert (inner.count, outer.count) == (1, 3)


def test_rigid_vectors_of_labelled_dofs():
    xyz = np.array([[1.0, 2.0, 3.0]] * 6 + [[-1.0, 0.5, 2.0]] * 6)
    dofs = Dofs(np.repeat([0, 1], 6), DIRECTIONS * 2, xyz)
    vectors = rigid_body_vectors(dofs)
    assert vectors.shape == (12, 6)
    assert np.linalg.matrix_rank(vectors) == 6
    # Every motion keeps the distance of the two points to first order.
    gap = xyz[0] - xyz[6]
    assert np.abs(gap @ (vectors[:3] - vectors[6:9])).max() < 1e-14
