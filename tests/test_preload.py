"""Geometric stiffness: buckling loads, beams under tension, rigid motions, what it follows from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
from diagnosis_problems import case_of, clamped_portal, measured

from femubench import Model, diagnose, solve_modes
from femubench.core.fem.frame import (
    Brace,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    Member,
    Oscillator,
    Place,
    PointMass,
    Preload,
    RigidEnd,
    Support,
)
from femubench.core.fem.preload import (
    GeometricStiffness,
    StressState,
    geometric_matrices,
    statics_of,
)
from femubench.fem import ModelError, Property, Section, Structure
from femubench.modal import eigenvalue_sensitivities, rigid_modes_of

STEEL = Material(210e9, 0.3, 7850.0)
SECTION = Section(A=4e-4, Iy=3e-9, Iz=5e-8, J=2e-9, Jp=5.3e-8)
LENGTH = 1.3
EI = STEEL.E * SECTION.Iy
EULER = np.pi**2 * EI / LENGTH**2
PINNED = (("x", "z"), ("x", "z"))
CLAMPED = (("x", "z", "ry"), ("x", "z", "ry"))
CLAMPED_OUT = (("z", "rx", "ry"), ("z", "rx", "ry"))


def beam(
    plane: str,
    fixed: tuple[tuple[str, ...], tuple[str, ...]],
    force: float = 0.0,
    elements: int = 12,
    **parts: Any,
) -> Frame:
    joints = (Joint("A", (0.1, 0.2, 0.0)), Joint("B", (0.1 + LENGTH, 0.2, 0.0)))
    supports = tuple(Support(Place(joint=j), f) for j, f in zip("AB", fixed, strict=True) if f)
    return Frame(
        plane,  # type: ignore[arg-type]
        "euler-bernoulli",
        joints,
        (Member("m", ("A", "B"), elements, SECTION, STEEL),),
        supports=supports,
        preloads=(Preload("m", force),) if force else (),
        **parts,
    )


def in_plane_ladder(ladder: Any, **parts: Any) -> Frame:
    return replace(ladder(plane="in-plane"), **parts)  # type: ignore[no-any-return]


@pytest.mark.parametrize("share", [-0.8, 3.0])
def test_a_pinned_beam_under_tension_has_the_exact_frequencies(share: float) -> None:
    frames = [beam("in-plane", PINNED, force, elements=24) for force in (0.0, share * EULER)]
    plain, loaded = (solve_modes(Model.of(frame)).natural_frequencies[:3] for frame in frames)
    n = np.arange(1, 4)
    base = (n * np.pi / LENGTH) ** 2 * np.sqrt(EI / (STEEL.rho * SECTION.A)) / (2 * np.pi)
    assert plain == pytest.approx(base, rel=3e-5)
    assert loaded == pytest.approx(base * np.sqrt(1.0 + share / n**2), rel=3e-5)


@pytest.mark.parametrize(
    ("plane", "fixed", "multiple"),
    [("in-plane", PINNED, 1.0), ("in-plane", CLAMPED, 4.0), ("out-of-plane", CLAMPED_OUT, 4.0)],
)
def test_a_beam_buckles_at_its_euler_load(plane: str, fixed: Any, multiple: float) -> None:
    def critical(elements: int) -> float:
        structure = Structure.build(beam(plane, fixed, elements=elements))
        stiffness = structure.matrices()[1].toarray()
        tension = GeometricStiffness(structure).of_preload("m", 1.0).toarray()
        return float(1.0 / la.eigh(tension, stiffness, eigvals_only=True)[-1])

    errors = np.array([critical(n) / (multiple * EULER) - 1.0 for n in (4, 8)])
    assert abs(errors[1]) < 1e-3
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)  # h^4
    load = critical(8)
    for factor, sign in ((0.999, 1.0), (1.001, -1.0)):
        model = Model.of(beam(plane, fixed, -factor * load, elements=8))
        assert np.sign(solve_modes(model).eigenvalues[0]) == sign


def stress(structure: Structure, force: Any, moment: Any) -> StressState:
    """Return a state of stress that no lack of fit gives."""
    count = len(structure.mesh.ends)
    none = np.zeros((0, 3))
    rows = [np.broadcast_to(v, (count, 3)) for v in (force, moment)]
    return StressState(rows[0], rows[1], none, none, none, np.zeros(0))


def buckling(structure: Structure, state: StressState) -> float:
    stiffness = structure.matrices()[1].toarray()
    geometric = structure.plan.assemble(geometric_matrices(structure, state)).toarray()
    return float(1.0 / la.eigh(geometric, stiffness, eigvals_only=True)[-1])


def test_a_beam_under_a_uniform_moment_buckles_sideways() -> None:
    """Timoshenko & Gere (1961), art. 6.3: M = pi/L sqrt(EI GJ) with free warping."""
    structure = Structure.build(beam("out-of-plane", (("z", "rx"), ("z", "rx")), elements=24))
    state = stress(structure, np.zeros(3), [0.0, 0.0, 1.0])
    exact = np.pi / LENGTH * np.sqrt(EI * STEEL.G * SECTION.J)
    assert buckling(structure, state) == pytest.approx(exact, rel=1e-3)


def test_a_cantilever_under_a_tip_force_buckles_sideways() -> None:
    """Timoshenko & Gere (1961), art. 6.4: P = 4.0126 sqrt(EI GJ) / L^2 at the centroid."""
    structure = Structure.build(beam("out-of-plane", (("z", "rx", "ry"), ()), elements=40))
    along = LENGTH * structure.mesh.stations[:, 1]
    moment = np.zeros((len(along), 3))
    moment[:, 2] = LENGTH - along
    state = stress(structure, [0.0, 1.0, 0.0], moment)
    exact = 4.0126 * np.sqrt(EI * STEEL.G * SECTION.J) / LENGTH**2
    assert buckling(structure, state) == pytest.approx(exact, rel=1e-3)


def free_frames(ladder: Any, asymmetric: Any, portal: Any, fitted: Any) -> dict[str, Frame]:
    springs = (
        JointSpring("F", "EF", {"x": 1e6, "z": 2e6, "ry": 1e4}, 0.0127),
        JointSpring("A", "AD", {"x": 1e6, "ry": 1e4}, 0.0127, 5.0),
    )
    return {
        "timoshenko": ladder("timoshenko", polar=False),
        "asymmetric": asymmetric(),
        "in-plane": in_plane_ladder(
            ladder,
            joint_springs=springs,
            rigid_ends=(RigidEnd("B", "AB", 0.02, 0.01), RigidEnd("B", "BC", -0.02)),
            braces=(Brace(("A", "F"), 1e6),),
            oscillators=(Oscillator(Place(member="AB", s=0.3), "z", 0.1, 100.0),),
        ),
        "fitted": replace(fitted(5), braces=(Brace(("J0", "J2"), 1e5),)),
    }


@pytest.mark.parametrize("name", ["timoshenko", "asymmetric", "in-plane", "fitted"])
def test_rigid_motions_cost_nothing(
    name: str, ladder: Any, asymmetric_ladder: Any, portal: Any, fitted_portal: Any
) -> None:
    frame = free_frames(ladder, asymmetric_ladder, portal, fitted_portal)[name]
    structure = Structure.build(frame)
    rigid = rigid_modes_of(Model.of(structure))
    assert rigid.shape[1] == (6 if frame.plane == "3d" else 3)
    members = GeometricStiffness(structure).redundant_members()
    assert members == tuple(member.name for member in frame.members)
    for member in members:
        matrix = GeometricStiffness(structure).of_preload(member, 1.0)
        assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()
        scale = (abs(matrix) @ np.abs(rigid)).max()
        # Rounding of the stress, where the scaled stiffness has a condition of 1e6.
        assert np.abs(matrix @ rigid).max() < (5e-12 if name == "fitted" else 2e-12) * scale
        assert np.abs(rigid.T @ matrix @ rigid).max() < 1e-12 * scale * np.abs(rigid).max()


def test_the_state_is_balanced_and_its_largest_force_is_the_given_one(ladder: Any) -> None:
    structure = Structure.build(in_plane_ladder(ladder, braces=(Brace(("A", "F"), 1e7),)))
    for m, member in enumerate(structure.frame.members):
        state = statics_of(structure).state(member.name)
        assert state.largest == pytest.approx(1.0, rel=1e-12)
        assert (state.force[structure.mesh.member == m, 0] > 0.0).all()
        # The load is not part of the ends' forces: what is left balances at every joint.
        axes, ends = structure.mesh.axes, structure.mesh.ends
        pull = np.einsum("eij,ei->ej", axes, state.force)
        total = np.zeros((len(structure.mesh.xyz), 3))
        np.add.at(total, ends[:, 0], pull)
        np.add.at(total, ends[:, 1], -pull)
        joints = structure.frame.joint_index
        line = structure.frame.corners[joints["F"]] - structure.frame.corners[joints["A"]]
        thrust = state.brace_force[0] * line / np.linalg.norm(line)
        total[joints["A"]] += thrust
        total[joints["F"]] -= thrust
        assert np.abs(total).max() < 1e-10


def test_changed_parameters_leave_the_stress_alone(asymmetric_ladder: Any) -> None:
    frame = replace(asymmetric_ladder(), preloads=(Preload("BE", 2e3),))
    structure = Structure.build(frame)
    soft = Property("E", "E", ("AB/1", "EF/2"))
    changed = structure.with_values([soft], [0.5])
    direct = GeometricStiffness(changed).of_preload("BE", 2e3)
    assert abs(direct - GeometricStiffness(structure).of_preload("BE", 2e3)).max() == 0.0
    model = Model.of(structure)
    modes = solve_modes(model, 9).elastic
    slope = eigenvalue_sensitivities(model, modes, [soft])[:, 0]
    step = 1e-5
    ends = [
        solve_modes(Model.of(structure.with_values([soft], [1.0 + s]))).elastic.eigenvalues[:6]
        for s in (-step, step)
    ]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-5)


def test_a_clamp_out_of_plane_holds_the_frame_in_its_plane_and_a_ground_spring_its_own() -> None:
    assert GeometricStiffness(
        Structure.build(beam("out-of-plane", CLAMPED_OUT))
    ).redundant_members() == ("m",)
    pinned = beam("out-of-plane", (("z", "rx"), ("z", "rx")))
    assert GeometricStiffness(Structure.build(pinned)).redundant_members() == ()
    spring = (GroundSpring(Place(joint="B"), "x", 1e6),)
    sprung = beam("in-plane", (("x", "z"), ("z",)), springs=spring)
    assert GeometricStiffness(Structure.build(sprung)).redundant_members() == ("m",)
    assert (
        GeometricStiffness(Structure.build(replace(sprung, springs=()))).redundant_members() == ()
    )


def test_what_cannot_be_stressed_is_refused(hframe: Any, ladder: Any) -> None:
    structure = Structure.build(hframe())
    with pytest.raises(ModelError, match=r"'lower1'.* not redundant"):
        GeometricStiffness(structure).of_preload("lower1", 1.0)
    assert GeometricStiffness(structure).redundant_members() == ()
    with pytest.raises(ModelError, match="no member 'XY'"):
        GeometricStiffness(Structure.build(ladder())).of_preload("XY", 1.0)
    with pytest.raises(ModelError, match="not redundant"):
        Model.of(replace(hframe(), preloads=(Preload("horizontal", 1.0),)))
    flat = replace(Section.rectangular_tube(0.0254, 0.0254, 0.00238), Iz=0.0)
    members = tuple(replace(member, section=flat) for member in ladder().members)
    with pytest.raises(ModelError, match="needs Iz"):
        Model.of(replace(ladder(), members=members, preloads=(Preload("BE", 1.0),)))


def upright(plane: str, elements: int, down: float = 1.0, **parts: Any) -> Frame:
    """Return a column on a clamp that stands, or hangs where `down` is -1."""
    fixed = tuple(d for d in ("x", "y", "z", "rx", "ry", "rz") if plane == "3d" or d in "x z ry")
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (0.0, 0.0, down * LENGTH)))
    member = (Member("m", ("A", "B"), elements, SECTION, STEEL),)
    supports = parts.pop("supports", (Support(Place(joint="A"), fixed),))
    return Frame(plane, "euler-bernoulli", joints, member, supports=supports, **parts)


class TestWeight:
    @pytest.mark.parametrize("plane", ["in-plane", "3d"])
    def test_a_column_buckles_under_its_own_weight(self, plane: str) -> None:
        """Greenhill (1881): q L^3 / EI = 7.8373, the square of 1.5 times the zero of J_-1/3."""
        frame = upright(plane, 40)
        structure = Structure.build(frame)
        weight = GeometricStiffness(structure).of_weight().toarray()
        stiffness = structure.matrices()[1].toarray()
        factors = la.eigh(-weight, stiffness, eigvals_only=True)
        q = 9.80665 * STEEL.rho * SECTION.A
        least = min(SECTION.Iy, SECTION.Iz) if plane == "3d" else SECTION.Iy
        critical = q * LENGTH**3 / (STEEL.E * least * factors.max())
        assert critical == pytest.approx(7.8373, rel=5e-4)

    @pytest.mark.parametrize("plane", ["in-plane", "3d"])
    def test_a_bar_that_hangs_swings_as_a_pendulum(self, plane: str) -> None:
        """By hand: w^2 = 3 g / 2 L about a hinge, (M/2 + m) g L / (M/3 + m) L^2 with a bob."""
        hinge = ("x", "z") if plane == "in-plane" else ("x", "y", "z", "rz")
        supports = (Support(Place(joint="A"), hinge),)
        rod, bob = STEEL.rho * SECTION.A * LENGTH, 0.7
        for mass in (0.0, bob):
            masses = (PointMass(Place(joint="B"), mass),) if mass else ()
            frame = upright(plane, 8, -1.0, supports=supports, masses=masses, gravity=1.0)
            square = (rod / 2 + mass) * 9.80665 / ((rod / 3 + mass) * LENGTH)
            found = np.linalg.eigvals(
                np.linalg.solve(*(m.toarray() for m in Structure.build(frame).matrices()))
            )
            swing = np.sort(found.real)[: 1 if plane == "in-plane" else 2]
            assert swing == pytest.approx(square, rel=2e-3)

    def test_a_hung_mass_pulls_as_a_preload_does(self) -> None:
        """Far heavier than the bar, it leaves N everywhere."""
        heavy = (PointMass(Place(joint="B"), 1e5),)
        frame = upright("in-plane", 6, -1.0, masses=heavy)
        structure = Structure.build(frame)
        count = len(structure.mesh.ends)
        state = statics_of(structure).under_weight(frame)
        np.testing.assert_allclose(state.force[:, 0], np.full(count, 1e5 * 9.80665), rtol=1e-4)
        hung = (Oscillator(Place(joint="B"), "x", 1e5, 3.0),)
        other = upright("in-plane", 6, -1.0, oscillators=hung)
        again = statics_of(Structure.build(other)).under_weight(other)
        np.testing.assert_allclose(again.force, state.force, rtol=1e-9, atol=1e-3)

    def test_what_stands_inclined_bends(self) -> None:
        """By hand: a cantilever along x has M = q (L - x)^2 / 2, and no normal force."""
        frame = beam("in-plane", (("x", "z", "ry"), ()), elements=10)
        state = statics_of(Structure.build(frame)).under_weight(frame)
        q = 9.80665 * STEEL.rho * SECTION.A
        x = (np.arange(10) + 0.5) * LENGTH / 10
        np.testing.assert_allclose(state.force[:, 0], 0.0, atol=1e-9)
        np.testing.assert_allclose(np.abs(state.force[:, 2]), q * (LENGTH - x), rtol=1e-9)
        middle = state.moment + 0.5 * LENGTH / 10 * np.cross([1.0, 0.0, 0.0], state.force)
        exact = q * (LENGTH - x) ** 2 / 2
        np.testing.assert_allclose(np.abs(middle[:, 1]), exact, atol=q * (LENGTH / 10) ** 2 / 6)

    def test_what_falls_or_has_no_weight_in_its_plane_is_refused(self, ladder: Any) -> None:
        free = Structure.build(beam("in-plane", ((), ())))
        with pytest.raises(ModelError, match="nothing holds"):
            GeometricStiffness(free).of_weight()
        tipping = beam("in-plane", (("x", "z"), ()))  # a bar on one hinge, lying
        with pytest.raises(ModelError, match="nothing holds"):
            GeometricStiffness(Structure.build(tipping)).of_weight()
        with pytest.raises(ModelError, match="out of plane"):
            Structure.build(replace(ladder(), gravity=1.0)).matrices()

    def test_the_weight_of_what_slender_legs_carry_is_named(self) -> None:
        """Two lumps on a portal of thin tubes, which lower its sway by 1.6 %."""
        test_frame = slender(4)
        truth = Model.of(replace(slender(12), gravity=1.0))
        test = measured(truth, test_frame, count=5, rng=np.random.default_rng(0))
        found = diagnose(case_of(Model.of(test_frame), test, 4))
        (cause,) = found.causes
        assert (cause.effect, cause.place, found.verdict) == ("gravity-stiffness", "all", "named")
        (multiple,) = cause.parameters
        assert multiple.std is not None
        assert abs(multiple.value - 1.0) < 2.0 * multiple.std < 0.5


def slender(elements: int) -> Frame:
    """Return a portal on clamps with a mass at either corner."""
    masses = tuple(PointMass(Place(joint=j), 4.0) for j in ("el", "er"))
    return replace(
        clamped_portal(elements, Section.rectangular_tube(0.012, 0.012, 0.001), STEEL),
        masses=masses,
    )
