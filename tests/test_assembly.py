"""Assembly: invariance, the whole mass, planes as parts of space, sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, GroundSpring, Joint, Material, Member, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]
OBLONG = Section(A=4e-4, Iy=3e-8, Iz=1.2e-8, J=1e-8, Jp=4.2e-8, kappa=Section.constant_kappa(0.45))
MATERIAL = Material(70e9, 0.3, 2700.0)


def elastic(frame: Frame, count: int = 8) -> FloatArray:
    return solve_modes(Model.of(frame)).elastic.natural_frequencies[:count]


def test_assembly_is_the_sum_of_rotated_elements(portal: FrameBuilder) -> None:
    structure = Structure.build(portal(3))
    size = 6 * len(structure.mesh.xyz)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    k, m = structure.properties.stiffness_matrices(), structure.properties.mass_matrices()
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


def test_local_axes_are_right_handed_and_hold_up(portal: FrameBuilder) -> None:
    frame = portal(4)
    structure = Structure.build(frame)
    for axes, index in zip(structure.mesh.axes, structure.mesh.member, strict=True):
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        up = np.array(frame.members[index].up)
        assert abs(up @ axes[1]) < 1e-12
        assert up @ axes[2] > 0.0


def test_turning_a_frame_leaves_its_frequencies(portal: FrameBuilder) -> None:
    seed = 1
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


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_translation_and_rotation_carry_the_whole_mass(portal: FrameBuilder, theory: str) -> None:
    frame = portal(1, theory, masses=(PointMass(Place(joint="J2"), 0.7, (0.1, -0.2, 0.3)),))
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


@pytest.mark.parametrize(
    ("plane", "theory"), [("in-plane", "timoshenko"), ("out-of-plane", "euler-bernoulli")]
)
def test_planar_models_are_parts_of_the_spatial_one(plane: str, theory: str) -> None:
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


def test_what_a_structure_keeps_is_what_it_would_make_anew(fitted_portal: FrameBuilder) -> None:
    """In any order of changes, and whatever is done to a matrix that was handed out."""
    frame = fitted_portal(3)
    length = np.linalg.norm(np.subtract(frame.joint("J1").xyz, frame.joint("J5").xyz))
    on_rigid_end = Place(member="m8", s=float(1.0 - 0.015 / length))
    masses = (*frame.masses, PointMass(on_rigid_end, 0.3))
    frame = replace(frame, masses=masses, springs=(GroundSpring(on_rigid_end, "z", 3e4),))
    base = Structure.build(frame)
    every, first = tuple(filter(None, base.label_index)), ("m8/1", "m8/2")
    lines = [[frame.joint(name).xyz for name in frame.members[k].ends] for k in (8, 4)]
    points = np.array([np.average(line, axis=0, weights=(0.3, 0.7)) for line in lines])
    sensors = Sensors(("a", "b"), points, ("z", "-ry"))
    changed = base
    for quantity, places, value in (
        *(("E", every, 1.3), ("EI", first, 0.8), ("density", every, 0.9), ("rhoJp", first, 1.1)),
        *(("shear", every, 1.5), ("rotary", every, 2.0), ("GJ", every, 0.7), ("E", first, 0.6)),
        *(("rigid", ("m8@J5",), 0.002), ("rhoA", first, 1.2), ("spring", ("m0@J1:rx",), 5e3)),
    ):
        parameter = Property(quantity, quantity, places)
        for start in (changed, base):
            assert Model.of(start).observe(sensors).shape == (2, len(base.kinematics.node))
            found = start.with_values([parameter], [value])
            anew = replace(found)
            assert not {"kept", "plan"} & set(vars(anew))
            model, expected = Model.of(found), Model.of(anew)
            np.testing.assert_array_equal(model.mass.toarray(), expected.mass.toarray())
            np.testing.assert_array_equal(model.stiffness.toarray(), expected.stiffness.toarray())
            readings = expected.observe(sensors).toarray()
            np.testing.assert_allclose(model.observe(sensors).toarray(), readings, atol=1e-13)
            np.testing.assert_array_equal(rigid_modes_of(model), rigid_modes_of(expected))
            model.mass.data[:], changed = 0.0, found if start is changed else changed


def test_sensors_read_points_between_nodes(ladder: FrameBuilder) -> None:
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


def test_a_sensor_reads_rigid_motions_exactly(portal: FrameBuilder) -> None:
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


def test_a_sensor_off_the_structure_is_refused(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    on = Sensors(("s",), np.array([[0.1, 5e-7, 0.0]]), ("z",))
    assert model.observe(on).shape == (1, 81)
    with pytest.raises(ModelError, match="off the structure"):
        model.observe(replace(on, xyz=np.array([[0.1, 2e-6, 0.0]])))
