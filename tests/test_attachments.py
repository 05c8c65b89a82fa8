"""Springs, supports, masses, arms: where they act, how they split a member, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from femubench import Model, Sensors, solve_modes
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
from femubench.fem import FloatArray, LowRank, ModelError, Property, Section, Structure

FrameBuilder = Callable[..., Frame]


def elastic(frame: Frame, count: int = 8) -> FloatArray:
    return solve_modes(Model.of(frame)).elastic.natural_frequencies[:count]


def test_supports_remove_exactly_the_named_dofs(ladder: FrameBuilder) -> None:
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


def test_an_attachment_between_nodes_splits_its_element(ladder: FrameBuilder) -> None:
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


@pytest.mark.parametrize(("beam", "s"), [("euler-bernoulli", 0.3), ("timoshenko", 0.93)])
def test_what_is_put_on_a_model_gives_the_modes_of_the_frame_that_has_it(
    ladder: FrameBuilder, beam: str, s: float
) -> None:
    """Against matrices that are assembled anew: both pieces of an element have their lengths."""
    masses = PointMass(Place(member="EF", s=s), 0.3), PointMass(Place(member="BE", s=0.61), 0.2)
    springs = (GroundSpring(Place(member="AB", s=s), "z", 1e5),)
    base = ladder(beam)
    whole = replace(base, masses=(*base.masses, *masses), springs=springs)
    after = Model.of(base).attach(masses, springs)
    assert after.size == Model.of(whole).size == Model.of(base).size + 9
    found = solve_modes(after).elastic.natural_frequencies[:8]
    np.testing.assert_allclose(found, elastic(whole), rtol=1e-9)


def test_a_mass_between_nodes_gives_the_frequencies_of_a_beam_with_a_mass() -> None:
    """A cantilever with a mass M at a: det of Euler-Bernoulli's waves in its two parts.

    Source: each part has cos, sin, cosh, sinh of beta x; shear jumps by M omega^2 w at the mass.
    """
    length, at, mass, EI, rho_a = 1.0, 0.37, 0.8, 2.1e11 * 1.2e-8, 7850.0 * 4e-4
    section = Section(A=4e-4, Iy=1.2e-8, Iz=1.2e-8, J=2e-8, Jp=2.4e-8)
    joints = Joint("A", (0.0, 0.0, 0.0)), Joint("B", (length, 0.0, 0.0))
    member = Member("AB", ("A", "B"), 20, section, Material(2.1e11, 0.3, 7850.0))
    clamped = (Support(Place(joint="A"), ("x", "z", "ry")),)
    frame = Frame("in-plane", "euler-bernoulli", joints, (member,), supports=clamped)
    after = Model.of(frame).attach([PointMass(Place(member="AB", s=at), mass)], [])
    hertz = solve_modes(after).natural_frequencies[:3]

    def determinant(f: float) -> float:
        omega = 2.0 * np.pi * f
        beta = (rho_a * omega**2 / EI) ** 0.25

        def waves(x: float) -> FloatArray:
            c, s, ch, sh = np.cos(beta * x), np.sin(beta * x), np.cosh(beta * x), np.sinh(beta * x)
            return np.array([[c, s, ch, sh], [-s, c, sh, ch], [-c, -s, ch, sh], [s, -c, sh, ch]])

        jump = np.zeros((4, 4))
        jump[3] = mass * omega**2 / (EI * beta**3) * waves(at)[0]
        matrix = np.zeros((8, 8))
        matrix[:2, :4] = waves(0.0)[:2]
        matrix[2:6, :4], matrix[2:6, 4:] = waves(at) + jump, -waves(at)
        matrix[6:, 4:] = waves(length)[2:]
        return float(np.linalg.det(matrix))

    for f in hertz:
        assert determinant(0.9999 * f) * determinant(1.0001 * f) < 0.0


@pytest.mark.parametrize("distance", [1e-8, 1e-4])
def test_an_attachment_close_to_a_node_spoils_nothing(
    ladder: FrameBuilder, distance: float
) -> None:
    # A station such as 0.3333333 makes no needle of an element, whose stiffness drowns the rest.
    def with_mass(s: float) -> FloatArray:
        masses = (PointMass(Place(member="EF", s=s), 0.3),)
        return elastic(replace(ladder(accelerometer=False), masses=masses))

    at_node, further = with_mass(0.25), with_mass(0.25 + 0.02)
    slope = (further - at_node) / 0.02
    np.testing.assert_allclose(
        with_mass(0.25 + distance), at_node + slope * distance, rtol=2e-6 + 0.2 * distance
    )


def test_a_support_close_to_a_node_holds_the_node(ladder: FrameBuilder) -> None:
    near = replace(ladder(), supports=(Support(Place(member="EF", s=0.2500001), ("z",)),))
    exact = replace(ladder(), supports=(Support(Place(member="EF", s=0.25), ("z",)),))
    np.testing.assert_array_equal(elastic(near), elastic(exact))


ARM = JointSpring("A", "AB", {"rx": 1e4, "ry": 1e4}, 0.02)


def test_a_mass_on_a_rigid_arm_is_a_mass_with_an_offset(ladder: FrameBuilder) -> None:
    base = replace(ladder(accelerometer=False), joint_springs=(ARM,))
    on_arm = replace(base, masses=(PointMass(Place(member="AB", s=0.01 / 0.2921), 0.3),))
    offset = replace(base, masses=(PointMass(Place(joint="A"), 0.3, (0.01, 0.0, 0.0)),))
    np.testing.assert_allclose(elastic(on_arm), elastic(offset), rtol=1e-10)
    at_end = replace(base, masses=(PointMass(Place(member="AB", s=0.0), 0.3),))
    at_joint = replace(base, masses=(PointMass(Place(joint="A"), 0.3),))
    np.testing.assert_array_equal(elastic(at_end), elastic(at_joint))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rigid_ends": (RigidEnd("A", "BE", 0.01),)}, "no member end"),
        ({"rigid_ends": (RigidEnd("A", "AB", 0.0, 0.09),)}, "longer than its element"),
        ({"joint_springs": (JointSpring("A", "AB", {"ry": 1.0}, 0.08),)}, "past its end element"),
        ({"masses": (PointMass(Place(member="ZZ", s=0.2), 0.1),)}, "no member"),
        (
            {"joint_springs": (ARM,), "supports": (Support(Place(member="AB", s=0.03), ("z",)),)},
            "on the arm",
        ),
    ],
)
def test_what_cannot_be_meshed_is_refused(
    ladder: FrameBuilder, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        Model.of(replace(ladder(), **change))


def test_a_rigid_length_beyond_the_element_is_refused(hframe: FrameBuilder) -> None:
    rigid = (RigidEnd("T1", "horizontal", 0.01),)
    structure = Structure.build(hframe(rigid_ends=rigid))
    parameter = Property("a", "rigid", ("horizontal@T1",))
    assert structure.with_values([parameter], [-0.05]).properties.rigid_1.min() == -0.05
    with pytest.raises(ModelError, match="longer than its element"):
        structure.with_values([parameter], [0.06])


OBLONG = Section(A=4e-4, Iy=3e-8, Iz=1.2e-8, J=1e-8, Jp=4.2e-8, kappa=Section.constant_kappa(0.45))
MATERIAL = Material(70e9, 0.3, 2700.0)


def test_attach_keeps_a_low_rank_update(ladder: FrameBuilder) -> None:
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


def test_attach_between_nodes_carries_the_update_to_the_old_dofs(ladder: FrameBuilder) -> None:
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


def test_attach_to_crossing_members_finds_the_right_dofs() -> None:
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
