"""Meshing and assembly: invariance, mass, supports, attachments, and what a frame refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from femubench.core.errors import ModelError
from femubench.core.fem.beam import mass_matrices, stiffness_matrices
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
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.sections import Section, constant_kappa
from femubench.core.fem.structure import Structure
from femubench.core.measurement import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.model import LowRank, Model
from femubench.core.typing import FloatArray
from scipy.spatial.transform import Rotation

OBLONG = Section(A=4e-4, Iy=3e-8, Iz=1.2e-8, J=1e-8, Jp=4.2e-8, kappa=constant_kappa(0.45))
MATERIAL = Material(70e9, 0.3, 2700.0)
FLEXIBLE = {"rx": 3e3, "ry": 2e3, "rz": 1e3}


def elastic(frame: Frame, count: int = 8) -> FloatArray:
    return solve_modes(Model.of(frame)).elastic.natural_frequencies[:count]


def test_assembly_is_the_sum_of_rotated_elements(portal):
    structure = Structure.build(portal(3))
    size = 6 * len(structure.mesh.xyz)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    k, m = stiffness_matrices(structure.properties), mass_matrices(structure.properties)
    for e, ends in enumerate(structure.mesh.ends):
        T = np.kron(np.eye(4), structure.mesh.axes[e])
        index = np.concatenate([6 * node + np.arange(6) for node in ends])
        stiffness[np.ix_(index, index)] += T.T @ k[e] @ T
        mass[np.ix_(index, index)] += T.T @ m[e] @ T
    found_mass, found_stiffness = (matrix.toarray() for matrix in structure.matrices())
    np.testing.assert_allclose(found_mass, mass, rtol=0, atol=1e-13 * np.abs(mass).max())
    np.testing.assert_allclose(
        found_stiffness, stiffness, rtol=0, atol=1e-13 * np.abs(stiffness).max()
    )


def test_local_axes_are_right_handed_and_hold_up(portal):
    frame = portal(4)
    structure = Structure.build(frame)
    for axes, index in zip(structure.mesh.axes, structure.mesh.member, strict=True):
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        up = np.array(frame.members[index].up)
        assert abs(up @ axes[1]) < 1e-12
        assert up @ axes[2] > 0.0


@pytest.mark.parametrize("seed", [0, 1])
def test_turning_a_frame_leaves_its_frequencies(portal, seed):
    frame = portal(seed, masses=(PointMass(Place(member="m2", s=0.3), 0.4, (0.1, 0.05, -0.2)),))
    turn = Rotation.random(random_state=seed).as_matrix()

    def turned(vector: object) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in turn @ np.array(vector))
        return x, y, z

    other = replace(
        frame,
        joints=tuple(replace(j, xyz=turned(j.xyz)) for j in frame.joints),
        members=tuple(replace(m, up=turned(m.up)) for m in frame.members),
        masses=tuple(replace(m, offset=turned(m.offset)) for m in frame.masses),
    )
    np.testing.assert_allclose(elastic(other, 30), elastic(frame, 30), rtol=1e-8)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_translation_and_rotation_carry_the_whole_mass(portal, seed, theory):
    frame = portal(seed, theory, masses=(PointMass(Place(joint="J2"), 0.7, (0.1, -0.2, 0.3)),))
    model = Model.of(frame)
    r = model.dofs.xyz
    direction = np.array(model.dofs.direction)
    lines = [(frame.joint(m.ends[0]).xyz, frame.joint(m.ends[1]).xyz) for m in frame.members]
    per_length = frame.members[0].section.A * 2700.0
    lump = np.array(frame.joint("J2").xyz) + np.array([0.1, -0.2, 0.3])
    for axis, name in enumerate("xyz"):
        moving = (direction == name).astype(float)
        total = per_length * sum(np.linalg.norm(np.subtract(b, a)) for a, b in lines) + 0.7
        assert moving @ model.mass @ moving == pytest.approx(total, rel=1e-12)
        assert np.abs(model.stiffness @ moving).max() < 1e-12 * np.abs(model.stiffness).max()
        # First moment: the coupling of this translation with a rotation about the next axis.
        about = np.eye(3)[(axis + 1) % 3]
        turning = np.zeros(model.size)
        for k, other in enumerate("xyz"):
            turning += np.where(direction == other, np.cross(about, r)[:, k], 0.0)
            turning += np.where(direction == "r" + other, about[k], 0.0)
        centre = sum(
            per_length * np.linalg.norm(np.subtract(b, a)) * np.add(a, b) / 2 for a, b in lines
        )
        moment = np.cross(about, centre + 0.7 * lump)[axis]
        assert moving @ model.mass @ turning == pytest.approx(moment, rel=1e-10)
        assert np.abs(model.stiffness @ turning).max() < 1e-12 * np.abs(model.stiffness).max()


def planar(plane: str, theory: str) -> Frame:
    """Return a skew triangle with a spur of an oblong section, in x-y or in x-z."""
    flat = {"A": (0.0, 0.0), "B": (0.5, 0.1), "C": (0.2, 0.6), "D": (0.2, 1.1)}
    up_down = plane == "in-plane"
    joints = tuple(
        Joint(name, (a, 0.0, b) if up_down else (a, b, 0.0)) for name, (a, b) in flat.items()
    )
    members = tuple(Member(p, (p[0], p[1]), 3, OBLONG, MATERIAL) for p in ("AB", "BC", "CA", "CD"))
    offset = (0.02, 0.0, 0.03) if up_down else (0.02, 0.03, 0.0)
    masses = (PointMass(Place(joint="D"), 0.2, offset),)
    springs = (GroundSpring(Place(member="AB", s=0.4), "z", 1e4),)
    return Frame(plane, theory, joints, members, masses, springs)  # type: ignore[arg-type]


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("plane", ["in-plane", "out-of-plane"])
def test_planar_models_are_parts_of_the_spatial_one(plane, theory):
    frame = planar(plane, theory)
    model, spatial = Model.of(frame), Model.of(replace(frame, plane="3d"))
    keep = [
        i
        for i, d in enumerate(spatial.dofs.direction)
        if d in (("x", "z", "ry") if plane == "in-plane" else ("z", "rx", "ry"))
    ]
    for small, large in ((model.mass, spatial.mass), (model.stiffness, spatial.stiffness)):
        expected = large.toarray()[np.ix_(keep, keep)]
        np.testing.assert_allclose(
            small.toarray(), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
        )
    everything = solve_modes(spatial).natural_frequencies
    for frequency in solve_modes(model).elastic.natural_frequencies[:10]:
        assert np.abs(everything / frequency - 1.0).min() < 1e-7


def test_a_spring_takes_no_notice_of_its_sign(ladder):
    frames = [
        replace(ladder(), springs=(GroundSpring(Place(joint="B"), d, 1e5),))
        for d in ("z", "-z", "+z")
    ]
    first, *others = (elastic(frame) for frame in frames)
    for other in others:
        np.testing.assert_array_equal(other, first)
    assert first[0] < elastic(ladder())[0] + 200.0


def test_supports_remove_exactly_the_named_dofs(ladder):
    frame = ladder()
    free, held = Model.of(frame), Model.of(
        replace(frame, supports=(Support(Place(joint="A"), ("z", "rx")),))
    )  # fmt: skip
    assert held.size == free.size - 2
    keep = [
        i
        for i, (node, d) in enumerate(zip(free.dofs.node, free.dofs.direction, strict=True))
        if not (node == 0 and d in ("z", "rx"))
    ]
    for a, b in ((held.mass, free.mass), (held.stiffness, free.stiffness)):
        np.testing.assert_array_equal(a.toarray(), b.toarray()[np.ix_(keep, keep)])


def test_an_attachment_between_nodes_splits_its_element(ladder):
    at = Place(member="EF", s=0.4)
    spring = GroundSpring(at, "z", 1e5)
    frame = replace(ladder(), masses=(PointMass(at, 0.3),), springs=(spring,))
    model = Model.of(frame)
    assert model.size == 84
    structure = model.frame_structure
    assert structure.labels.count("EF/2") == 2
    node = int(np.argmin(np.linalg.norm(structure.mesh.xyz - [0.2921 * 1.4, 0.2794, 0.0], axis=1)))
    index = [i for i in range(84) if model.dofs.node[i] == node and model.dofs.direction[i] == "z"]
    plain = Model.of(replace(frame, masses=(PointMass(at, 0.0),), springs=()))
    change = (model.mass - plain.mass).toarray()
    assert change[index[0], index[0]] == pytest.approx(0.3)
    assert np.count_nonzero(np.abs(change) > 1e-12) == 1


def test_a_support_between_nodes_splits_its_element(ladder):
    frame = replace(ladder(), supports=(Support(Place(member="EF", s=0.4), ("z",)),))
    assert Model.of(frame).size == 83


@pytest.mark.parametrize("distance", [1e-8, 1e-6, 1e-5, 1e-4, 1e-3])
def test_an_attachment_close_to_a_node_spoils_nothing(ladder, distance):
    # A station such as 0.3333333 makes no needle of an element, whose stiffness drowns the rest.
    def with_mass(s: float) -> FloatArray:
        masses = (PointMass(Place(member="EF", s=s), 0.3),)
        return elastic(replace(ladder(accelerometer=False), masses=masses))

    at_node, further = with_mass(0.25), with_mass(0.25 + 0.02)
    slope = (further - at_node) / 0.02
    np.testing.assert_allclose(
        with_mass(0.25 + distance), at_node + slope * distance, rtol=2e-6 + 0.2 * distance
    )


def test_a_support_close_to_a_node_holds_the_node(ladder):
    near = replace(ladder(), supports=(Support(Place(member="EF", s=0.2500001), ("z",)),))
    exact = replace(ladder(), supports=(Support(Place(member="EF", s=0.25), ("z",)),))
    np.testing.assert_array_equal(elastic(near), elastic(exact))


ARM = JointSpring("A", "AB", {"rx": 1e4, "ry": 1e4}, 0.02)


def test_a_mass_on_a_rigid_arm_is_a_mass_with_an_offset(ladder):
    base = replace(ladder(accelerometer=False), joint_springs=(ARM,))
    on_arm = replace(base, masses=(PointMass(Place(member="AB", s=0.01 / 0.2921), 0.3),))
    offset = replace(base, masses=(PointMass(Place(joint="A"), 0.3, (0.01, 0.0, 0.0)),))
    np.testing.assert_allclose(elastic(on_arm), elastic(offset), rtol=1e-10)
    at_end = replace(base, masses=(PointMass(Place(member="AB", s=0.0), 0.3),))
    at_joint = replace(base, masses=(PointMass(Place(joint="A"), 0.3),))
    np.testing.assert_array_equal(elastic(at_end), elastic(at_joint))


def test_stiff_joint_springs_are_no_springs(ladder):
    stiff = JointSpring("A", "AB", {"rx": 1e9, "ry": 1e9})
    np.testing.assert_allclose(
        elastic(replace(ladder(), joint_springs=(stiff,))), elastic(ladder()), rtol=1e-4
    )


def test_soft_joint_springs_are_hinges(ladder):
    # A bending hinge at both ends of the middle rung leaves it torsion and shear alone.
    soft = tuple(JointSpring(j, "BE", {"ry": 1e-3}) for j in "BE")
    hinged = elastic(replace(ladder(), joint_springs=soft))
    harder = tuple(JointSpring(j, "BE", {"ry": 1.0}) for j in "BE")
    assert (hinged <= elastic(ladder()) + 1e-6).all()
    np.testing.assert_allclose(hinged, elastic(replace(ladder(), joint_springs=harder)), rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_springs": (JointSpring("A", "nothing", {"ry": 1.0}),)}, "no member end"),
        ({"joint_springs": (JointSpring("E", "AB", {"ry": 1.0}),)}, "no member end"),
        ({"rigid_ends": (RigidEnd("A", "BE", 0.01),)}, "no member end"),
        ({"rigid_ends": (RigidEnd("A", "AB", 0.09),)}, "longer than its element"),
        ({"rigid_ends": (RigidEnd("A", "AB", 0.0, 0.09),)}, "longer than its element"),
        ({"joint_springs": (JointSpring("A", "AB", {"ry": 1.0}, 0.08),)}, "past its end element"),
        ({"masses": (PointMass(Place(member="AB", s=1.2), 0.1),)}, "not within 0..1"),
        ({"masses": (PointMass(Place(member="ZZ", s=0.2), 0.1),)}, "no member"),
        ({"masses": (PointMass(Place(joint="ZZ"), 0.1),)}, "no joint"),
        (
            {"joint_springs": (ARM,), "supports": (Support(Place(member="AB", s=0.03), ("z",)),)},
            "on the arm",
        ),
    ],
)
def test_what_cannot_be_meshed_is_refused(ladder, change, message):
    with pytest.raises(ModelError, match=message):
        Model.of(replace(ladder(), **change))


def test_a_member_that_leaves_the_plane_is_refused(ladder):
    frame = ladder()
    joints = (*frame.joints[:-1], Joint("F", (0.5842, 0.2794, 0.01)))
    with pytest.raises(ModelError, match="leaves the plane"):
        Model.of(replace(frame, joints=joints))


def test_a_rigid_length_beyond_the_element_is_refused(hframe):
    rigid = (RigidEnd("T1", "horizontal", 0.01),)
    structure = Structure.build(hframe(rigid_ends=rigid))
    parameter = Parameter("a", "rigid", ("horizontal@T1",))
    assert structure.with_values([parameter], [-0.05]).properties.rigid_1.min() == -0.05
    with pytest.raises(ModelError, match="longer than its element"):
        structure.with_values([parameter], [0.06])


# ---- sensors --------------------------------------------------------------------------------


def test_sensors_read_points_between_nodes(ladder):
    model = Model.of(ladder("timoshenko", polar=False))
    split = Model.of(
        replace(
            ladder("timoshenko", polar=False, elements=64),
            masses=(PointMass(Place(joint="A"), 0.0266),),
        )
    )
    points = np.array([[0.1, 0.0, 0.0], [0.45, 0.2794, 0.0], [0.2921, 0.11, 0.0], [0.0, 0.0, 0.0]])
    sensors = Sensors(("a", "b", "c", "d"), points, ("z", "-z", "rx", "+ry"))
    coarse = model.observe(sensors) @ solve_modes(model).elastic.shapes[:, :3]
    fine = split.observe(sensors) @ solve_modes(split, 8).elastic.shapes[:, :3]
    sign = np.sign(np.einsum("ij,ij->j", coarse, fine))
    np.testing.assert_allclose(coarse, fine * sign, rtol=0, atol=2e-2 * np.abs(fine).max())
    minus = model.observe(replace(sensors, directions=("-z", "z", "-rx", "-ry")))
    np.testing.assert_array_equal(minus.toarray(), -model.observe(sensors).toarray())


def test_a_sensor_reads_rigid_motions_exactly(portal):
    model = Model.of(portal(5))
    frame = model.frame_structure.frame
    a, b = (np.array(frame.joint(name).xyz) for name in frame.members[3].ends)
    point = a + 0.37 * (b - a)
    sensors = Sensors(("x", "y", "z"), np.array([point] * 3), ("x", "y", "z"))
    direction = np.array(model.dofs.direction)
    for k in range(3):
        about = np.eye(3)[k]
        motion = np.zeros(model.size)
        for i, name in enumerate("xyz"):
            motion += np.where(direction == name, np.cross(about, model.dofs.xyz)[:, i], 0.0)
            motion += np.where(direction == "r" + name, about[i], 0.0)
        np.testing.assert_allclose(
            model.observe(sensors) @ motion, np.cross(about, point), atol=1e-12
        )


def test_a_sensor_off_the_structure_is_refused(ladder):
    model = Model.of(ladder())
    on = Sensors(("s",), np.array([[0.1, 5e-7, 0.0]]), ("z",))
    assert model.observe(on).shape == (1, 81)
    with pytest.raises(ModelError, match="off the structure"):
        model.observe(replace(on, xyz=np.array([[0.1, 2e-6, 0.0]])))


# ---- attaching to updated models ------------------------------------------------------------


def test_attach_keeps_a_low_rank_update(ladder):
    model = Model.of(ladder())
    shapes = solve_modes(model).shapes[:, 3:6]
    stiffness = LowRank(np.asarray(model.mass @ shapes), np.diag([-4e5, 2e5, 1e5]))
    mass = LowRank(np.asarray(model.mass @ shapes), np.diag([0.02, 0.0, 0.01]))
    updated = replace(model, stiffness_change=stiffness, mass_change=mass)
    at = Place(member="EF", s=0.5)  # an existing node: the dense algebra is simple
    after = updated.attach([PointMass(at, 0.5)], [GroundSpring(at, "z", 1e6)])
    row = model.observe(Sensors(("s",), np.array([[0.2921 * 1.5, 0.2794, 0.0]]), ("z",))).toarray()
    K = model.stiffness.toarray() + stiffness.toarray() + 1e6 * row.T @ row
    M = model.mass.toarray() + mass.toarray() + 0.5 * row.T @ row
    expected = np.linalg.eigvals(np.linalg.solve(M, K)).real
    np.testing.assert_allclose(
        solve_modes(after).eigenvalues[:12], np.sort(expected)[:12], rtol=1e-7, atol=1e-2
    )


def test_attach_between_nodes_carries_the_update_to_the_old_dofs(ladder):
    model = Model.of(ladder())
    change = sp.csc_array(sp.diags_array(np.linspace(1e2, 1e3, 81)))
    basis = np.random.default_rng(0).standard_normal((81, 2))
    updated = replace(
        model, stiffness=model.stiffness + change, stiffness_change=LowRank(basis, np.eye(2))
    )
    at = Place(member="EF", s=0.4)
    after, plain = (m.attach([PointMass(at, 0.5)], []) for m in (updated, model))
    assert after.size == 84
    difference = (after.stiffness - plain.stiffness).toarray()
    assert after.stiffness_change is not None
    new = [
        i
        for i, xyz in enumerate(after.dofs.xyz)
        if np.linalg.norm(xyz - [0.2921 * 1.4, 0.2794, 0.0]) < 1e-9
    ]
    old = np.setdiff1d(np.arange(84), new)
    assert len(new) == 3
    np.testing.assert_array_equal(after.dofs.xyz[old], model.dofs.xyz)
    np.testing.assert_allclose(difference[np.ix_(old, old)], change.toarray(), atol=1e-5)
    np.testing.assert_array_equal(after.stiffness_change.basis[old], basis)
    assert not after.stiffness_change.basis[new].any()


def test_attach_to_crossing_members_finds_the_right_dofs():
    square = {
        "A": (0.0, 0.0, 0.0),
        "B": (1.0, 1.0, 0.0),
        "C": (1.0, 0.0, 0.0),
        "D": (0.0, 1.0, 0.0),
    }
    joints = tuple(Joint(name, xyz) for name, xyz in square.items())
    # AB and CD cross in the middle without touching; only CD has a node there.
    members = [Member("AB", ("A", "B"), 3, OBLONG, MATERIAL)]
    members += [
        Member(p, (p[0], p[1]), 4, OBLONG, MATERIAL) for p in ("CD", "AC", "CB", "BD", "DA")
    ]
    model = Model.of(Frame("out-of-plane", "euler-bernoulli", joints, tuple(members)))
    shapes = solve_modes(model).shapes[:, 3:5]
    updated = replace(
        model, stiffness_change=LowRank(np.asarray(model.mass @ shapes), np.diag([-1e4, 3e4]))
    )
    attached = updated.attach([PointMass(Place(member="AB", s=0.5), 1e-9)], [])
    found = solve_modes(attached).elastic.natural_frequencies[:6]
    np.testing.assert_allclose(
        found, solve_modes(updated).elastic.natural_frequencies[:6], rtol=5e-3
    )
    assert attached.stiffness_change is not None
    middle = np.flatnonzero(np.linalg.norm(attached.dofs.xyz - [0.5, 0.5, 0.0], axis=1) < 1e-9)
    own = attached.stiffness_change.basis[middle]
    assert len(own) == 6
    assert np.count_nonzero(np.abs(own).max(axis=1) > 0.0) == 3


def test_attach_repeats_parameter_changes(asymmetric_ladder):
    structure = Structure.build(asymmetric_ladder())
    parameters = [Parameter("E", "EI", ("EF/2",)), Parameter("k", "spring", ("CF@F:ry",))]
    updated = Model.of(structure.with_values(parameters, [0.5, 4e3]))
    after = updated.attach([PointMass(Place(member="EF", s=0.4), 0.5)], [])
    changed = after.frame_structure
    ratio = changed.properties.EIy / Structure.build(changed.frame).properties.EIy
    halves = [ratio[i] for i, label in enumerate(changed.labels) if label == "EF/2"]
    assert halves == pytest.approx([0.5, 0.5])
    assert changed.springs[changed.spring_labels.index("CF@F:ry")] == 4e3
    assert ratio.sum() == pytest.approx(len(ratio) - 1.0)
