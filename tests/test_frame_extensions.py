"""Factors, eccentric mass, coupling, braces and oscillators against exact and edited frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from femubench.core.errors import ModelError
from femubench.core.fem.beam import BeamProperties, shape_functions
from femubench.core.fem.frame import (
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    Joint,
    JointSpring,
    Material,
    Member,
    Oscillator,
    Place,
    PointMass,
    Preload,
    Support,
)
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.parameters import QUANTITIES, Property
from femubench.core.fem.sections import Section
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.sensitivity import eigenvalue_sensitivities
from femubench.core.typing import FloatArray

STEEL = Material(210e9, 0.3, 7850.0)
SECTION = Section(4e-4, 3e-9, 5e-8, 2e-9, 5.3e-8, Section.constant_kappa(0.8))
LENGTH = 1.3
EI, GJ, RHO_A = STEEL.E * SECTION.Iy, STEEL.G * SECTION.J, STEEL.rho * SECTION.A
MIDDLE = Place(member="m", s=0.5)
CLAMP = (Support(Place(joint="A"), ("z", "rx", "ry")),)


def beam(plane: str, elements: int, supports: tuple[Support, ...] = (), **parts: Any) -> Frame:
    material = parts.pop("material", STEEL)
    section = parts.pop("section", SECTION)
    return Frame(
        plane,  # type: ignore[arg-type]
        "euler-bernoulli",
        (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (LENGTH, 0.0, 0.0))),
        (Member("m", ("A", "B"), elements, section, material),),
        supports=supports,
        **parts,
    )


def matrices(frame: Frame) -> tuple[FloatArray, FloatArray]:
    mass, stiffness = Structure.build(frame).matrices()
    return mass.toarray(), stiffness.toarray()


def same(first: Frame, second: Frame) -> None:
    for one, two in zip(matrices(first), matrices(second), strict=True):
        assert np.abs(one - two).max() < 1e-13 * np.abs(two).max()


def frequencies(frame: Frame, count: int | None = None) -> FloatArray:
    return np.asarray(solve_modes(Model.of(frame)).elastic.natural_frequencies[:count])


def edited(frame: Frame, *, material: Any = None, section: Any = None) -> Frame:
    """Return the frame with all materials and sections replaced by functions of them."""
    members = tuple(
        replace(
            member,
            material=member.material if material is None else material(member.material),
            section=member.section if section is None else section(member.section),
        )
        for member in frame.members
    )
    return replace(frame, members=members)


class TestFactors:
    @pytest.mark.parametrize(
        ("plane", "theory"), [("in-plane", "timoshenko"), ("3d", "euler-bernoulli")]
    )
    def test_factors_are_edited_materials_and_sections(self, plane: str, theory: Any) -> None:
        plain = replace(beam(plane, 3), beam=theory)
        stiff = replace(plain, factors=(Factor("E", ("all",), 0.7),))
        same(stiff, edited(plain, material=lambda m: replace(m, E=0.7 * m.E)))
        heavy = replace(plain, factors=(Factor("density", ("m",), 1.2),))
        same(heavy, edited(plain, material=lambda m: replace(m, rho=1.2 * m.rho)))
        wiry = replace(plain, factors=(Factor("GJ", ("m", "m/2"), 1.5),))
        same(wiry, edited(plain, section=lambda s: replace(s, J=1.5 * s.J)))
        soft = replace(plain, factors=(Factor("shear", ("all",), 4.0),))
        same(soft, edited(plain, section=lambda s: replace(s, kappa=Section.constant_kappa(0.2))))
        rigid = replace(plain, factors=(Factor("shear", ("all",), 0.0),))
        same(rigid, replace(plain, beam="euler-bernoulli", rotary_inertia=theory == "timoshenko"))

    def test_a_factor_on_an_element_is_a_parameter_there(self, fitted_portal: Any) -> None:
        plain = fitted_portal(2)
        for quantity in (name for name, scaled in QUANTITIES.items() if scaled):
            factors = (Factor(quantity, ("m2/1",), 2.0), Factor(quantity, ("m2/1", "m8"), 0.3))
            given = Structure.build(replace(plain, factors=factors))
            here, there = Property("a", quantity, ("m2/1",)), Property("b", quantity, ("m8/1",))
            rest = Property("c", quantity, ("m8/2",))
            wanted = Structure.build(plain).with_values([here, there, rest], [0.6, 0.3, 0.3])
            for one, two in zip(given.matrices(), wanted.matrices(), strict=True):
                assert abs(one - two).max() < 1e-13 * abs(two).max()

    @pytest.mark.parametrize("half", ["first", "second"])
    def test_half_an_element_gives_as_beams_do(self, half: str) -> None:
        """Castigliano: the tip moves by the integral of M^2 / EI under a unit force."""
        factors = (Factor("E", (f"m/2:{half}",), 0.25), Factor("E", ("m/2",), 0.8))
        model = Model.of(beam("out-of-plane", 4, CLAMP, factors=factors))
        tip = next(i for i, n in enumerate(model.dofs.node) if n == 1)
        force = np.eye(model.size)[tip]
        motion = float(np.linalg.solve(model.stiffness.toarray(), force)[tip])
        # From the tip: the arm of the force at the ends of what is soft.
        whole, end = (
            (LENGTH / 2, 3 * LENGTH / 4),
            3 * LENGTH / 4 if half == "first" else 5 * LENGTH / 8,
        )
        part = end - LENGTH / 8, end

        def integral(low: float, high: float) -> float:
            return (high**3 - low**3) / 3.0

        expected = integral(0.0, LENGTH) + 0.25 * integral(*whole) + 1.25 * 3.0 * integral(*part)
        assert motion == pytest.approx(expected / (STEEL.E * SECTION.Iy), rel=1e-9)

    @pytest.mark.parametrize(
        ("factor", "words"),
        [
            (Factor("G", ("all",), 2.0), "no factor on 'G'"),
            (Factor("E", ("m/5",), 2.0), "no place 'm/5'"),
            (Factor("E", ("m/5:first",), 2.0), "no place 'm/5:first'"),
            (Factor("E", ("m:first",), 2.0), "no place 'm:first'"),
            (Factor("E", ("m",), 0.0), "not positive"),
            (Factor("E", ("m",), float("nan")), "not positive"),
        ],
    )
    def test_what_is_no_factor_is_refused(self, factor: Factor, words: str) -> None:
        with pytest.raises(ModelError, match=words):
            Structure.build(beam("3d", 4, factors=(factor,)))

    @pytest.mark.parametrize("plane", ["in-plane", "3d"])
    def test_a_multiple_of_the_rotary_inertia_is_a_factor_on_it(self, plane: str) -> None:
        plain = replace(beam(plane, 3), beam="timoshenko")
        more = replace(plain, rotary_inertia=1.4)
        same(more, replace(plain, factors=(Factor("rotary", ("all",), 1.4),)))
        same(replace(plain, rotary_inertia=0.0), replace(plain, rotary_inertia=False))
        same(replace(plain, rotary_inertia=1.0), plain)
        # What stretches knows nothing of it, what bends or twists is slower.
        ratio = frequencies(more) / frequencies(plain)
        assert ratio.max() < 1.0 + 1e-9
        assert ratio.min() < 1.0 - 1e-4


def properties(**changes: float) -> BeamProperties:
    values = {
        "length": 0.7, "EA": 7.4e7, "EIy": 1.7e4, "EIz": 0.9e4, "GJ": 1.1e4,
        "flex_y": 5e-8, "flex_z": 3e-7, "rhoA": 2.8, "rhoJp": 1.3e-3, "rhoIy": 0.02, "rhoIz": 0.03,
        "rigid_1": 0.0, "rigid_2": 0.0, "rigid_mass_1": 0.0, "rigid_mass_2": 0.0,
        "shear_shape": 0.0, "coupling": 0.0, "ecc_y": 0.0, "ecc_z": 0.0,
    }  # fmt: skip
    return BeamProperties(**{k: np.array([v, v]) for k, v in (values | changes).items()})


class TestEccentricMass:
    @pytest.mark.parametrize(("shape", "rigid"), [(0.0, 0.0), (0.4, 0.06)])
    def test_it_is_the_inertia_of_the_line_of_mass_centres(
        self, shape: float, rigid: float
    ) -> None:
        y, z = 0.02, -0.03
        ends = dict.fromkeys(("rigid_1", "rigid_mass_1"), rigid)
        ends |= dict.fromkeys(("rigid_2", "rigid_mass_2"), 0.5 * rigid)
        p = properties(shear_shape=shape, **ends)
        length = 0.7 - 1.5 * rigid
        arm = np.array([[0.0, z, -y], [-z, 0.0, 0.0], [y, 0.0, 0.0]])
        expected = np.zeros((12, 12))
        for x, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
            at = rigid + length * (0.5 + 0.5 * x)
            rows = shape_functions(p, 0, at / 0.7)
            moved = rows[:3] + arm @ rows[3:]
            change = moved.T @ moved - rows[:3].T @ rows[:3]
            expected += 0.5 * weight * length * 2.8 * change
        shifted = replace(p, ecc_y=np.full(2, y), ecc_z=np.full(2, z))
        change = shifted.mass_matrices() - p.mass_matrices()
        assert change[1] == pytest.approx(expected, rel=1e-11, abs=1e-12)
        parts = p.eccentric_mass_parts()
        total = y * parts["y"] + z * parts["z"] + y * y * parts["yy"] + z * z * parts["zz"]
        assert total + y * z * parts["yz"] == pytest.approx(change, abs=1e-15)

    def test_the_mass_stays_and_the_moment_of_inertia_grows_by_steiner(self) -> None:
        frame = beam("3d", 3, eccentricities=(Eccentricity("m", 0.02, 0.01),))
        model = Model.of(frame)
        rigid = np.zeros((model.size, 2))
        rigid[[d == "y" for d in model.dofs.direction], 0] = 1.0
        rigid[[d == "rx" for d in model.dofs.direction], 1] = 1.0
        inertia = rigid.T @ model.mass @ rigid
        assert inertia[0, 0] == pytest.approx(RHO_A * LENGTH, rel=1e-12)
        steiner = STEEL.rho * SECTION.Jp + RHO_A * (0.02**2 + 0.01**2)
        assert inertia[1, 1] == pytest.approx(steiner * LENGTH, rel=1e-12)
        assert inertia[0, 1] == pytest.approx(-0.01 * RHO_A * LENGTH, rel=1e-12)


class TestCoupling:
    def tip(self, coefficient: float, elements: int) -> dict[str, float]:
        """Return the motion of the tip of a cantilever under a unit force there."""
        frame = beam("out-of-plane", elements, CLAMP, couplings=(Coupling("m", coefficient),))
        model = Model.of(frame)
        tip = {d: i for i, d in enumerate(model.dofs.direction) if model.dofs.node[i] == 1}
        force = np.eye(model.size)[tip["z"]]
        motion = np.linalg.solve(model.stiffness.toarray(), force)
        return {d: float(motion[i]) for d, i in tip.items()}

    @pytest.mark.parametrize("c", [-0.6, 0.9])
    def test_a_tip_force_twists_a_cantilever(self, c: float) -> None:
        """By hand: no torque, so that t = -c sqrt(EI/GJ) k and EI (1 - c^2) k = moment."""
        twist = c * LENGTH**2 / (2.0 * np.sqrt(EI * GJ) * (1.0 - c**2))
        deflection = LENGTH**3 / (3.0 * EI * (1.0 - c**2))
        tips = [self.tip(c, n) for n in (1, 4, 8)]
        for tip in tips:
            assert tip["rx"] == pytest.approx(twist, rel=1e-9)
        errors = [1.0 - tip["z"] / deflection for tip in tips]
        assert errors[0] == pytest.approx(c**2 / 4.0, rel=1e-9)
        assert errors[1] / errors[2] == pytest.approx(4.0, rel=1e-6)

    @pytest.mark.parametrize("c", [-0.99, 0.99])
    def test_a_free_beam_keeps_six_rigid_modes_and_a_positive_energy(self, c: float) -> None:
        modes = solve_modes(Model.of(beam("3d", 4, couplings=(Coupling("m", c),))))
        assert list(np.flatnonzero(modes.rigid)) == list(range(6))
        assert (modes.eigenvalues[6:] > 0.0).all()

    @pytest.mark.parametrize("quantity", ["EI", "GJ", "rhoA"])
    def test_sensitivities_know_of_coupling_and_eccentricity(self, quantity: str) -> None:
        extra = {
            "couplings": (Coupling("m", 0.3),),
            "eccentricities": (Eccentricity("m", 0.01),),
            "oscillators": (Oscillator(MIDDLE, "z", 0.1, 50.0),),
        }
        structure = Structure.build(beam("out-of-plane", 5, CLAMP, **extra))
        model = Model.of(structure)
        modes = solve_modes(model, 6)
        parameter = Property("p", quantity, ("m/2", "m/3"))
        slope = eigenvalue_sensitivities(model, modes, [parameter])[:, 0]
        ends = [
            solve_modes(Model.of(structure.with_values([parameter], [1.0 + s]))).eigenvalues[:6]
            for s in (-1e-5, 1e-5)
        ]
        numeric = (ends[1] - ends[0]) / 2e-5
        assert slope == pytest.approx(numeric, rel=1e-5, abs=1e-6 * np.abs(slope).max())

    def test_too_strong_a_coupling_is_refused(self) -> None:
        both = (Coupling("m", 0.6), Coupling("m", 0.4))
        for items, words in ((both, "not between -1 and 1"), ((Coupling("n", 0.1),), "member 'n'")):
            with pytest.raises(ModelError, match=words):
                Structure.build(beam("3d", 2, couplings=items))


class TestBraces:
    def test_a_bracket_is_a_truss_of_two(self) -> None:
        """By hand: the cantilever gives EA/L along and 3 EI/L^3 across, the brace k n n'."""
        high, k = 0.9, 3e6
        frame = beam("in-plane", 1, (Support(Place(joint="A"), ("x", "z", "ry")),))
        frame = replace(
            frame,
            joints=(*frame.joints, Joint("C", (0.0, 0.0, high))),
            supports=(*frame.supports, Support(Place(joint="C"), ("x", "z", "ry"))),
            braces=(Brace(("B", "C"), k),),
        )
        model = Model.of(frame)
        unit = np.array([LENGTH, -high]) / np.hypot(LENGTH, high)
        alone = np.diag([STEEL.E * SECTION.A / LENGTH, 3.0 * EI / LENGTH**3])
        expected = np.linalg.inv(alone + k * np.outer(unit, unit))
        assert model.dofs.direction == ("x", "z", "ry")
        flexibility = np.linalg.inv(model.stiffness.toarray())[:2, :2]
        assert flexibility == pytest.approx(expected, rel=1e-9)

    def test_it_sees_nothing_but_the_distance_of_its_joints(self, portal: Any) -> None:
        plain, braced = Model.of(portal(4)), Model.of(portal(4, braces=(Brace(("J0", "J6"), 2e5),)))
        rng = np.random.default_rng(1)
        motion = rng.normal(size=plain.size)
        points = {joint.name: np.array(joint.xyz) for joint in portal(4).joints}
        line = points["J6"] - points["J0"]
        ends = [motion[plain.dofs.node == node][:3] for node in (0, 6)]
        stretch = (ends[1] - ends[0]) @ line / np.linalg.norm(line)
        energy = motion @ ((braced.stiffness - plain.stiffness) @ motion)
        assert energy == pytest.approx(2e5 * stretch**2, rel=1e-6)
        assert int(solve_modes(braced).rigid.sum()) == 6

    def test_what_is_no_brace_is_refused(self) -> None:
        for plane, brace, words in (
            ("3d", Brace(("A", "A"), 1.0), "two joints"),
            ("3d", Brace(("A", "Z"), 1.0), "two joints"),
            ("out-of-plane", Brace(("A", "B"), 1.0), "out of plane"),
            ("out-of-plane", Brace(("A", "B"), 1.0, "x"), "along 'x'"),
        ):
            with pytest.raises(ModelError, match=words):
                Structure.build(beam(plane, 2, braces=(brace,)))


PINS = tuple(Support(Place(joint=j), ("x", "z")) for j in "AB")


def tuned(mass: float, frequency: float) -> FloatArray:
    """Return the natural frequencies of a pinned beam with an oscillator in its middle below 4 f1.

    With q = b L / 2 the receptance in the middle is (tan q - tanh q) / (4 EI b^3), and the
    oscillator pulls with m w^2 / (1 - (w/w0)^2) times the deflection.
    """

    def gap(f: float) -> float:
        omega = 2.0 * np.pi * f
        b = (RHO_A * omega**2 / EI) ** 0.25
        receptance = (np.tan(b * LENGTH / 2) - np.tanh(b * LENGTH / 2)) / (4.0 * EI * b**3)
        return float(receptance * mass * omega**2 - 1.0 + (f / frequency) ** 2)

    first = np.pi / (2.0 * LENGTH**2) * np.sqrt(EI / RHO_A)  # Hz, where the receptance has a pole
    low = brentq(gap, 1e-3 * first, first * (1.0 - 1e-9))
    high = brentq(gap, first * (1.0 + 1e-9), 8.9 * first)
    return np.array([low, high])


class TestOscillators:
    @pytest.mark.parametrize(
        ("share", "tuning", "elements"), [(0.05, 1.0, 20), (0.3, 0.6, 19), (0.02, 2.2, 20)]
    )
    def test_a_tuned_mass_has_the_exact_frequencies(
        self, share: float, tuning: float, elements: int
    ) -> None:
        first = np.pi / (2.0 * LENGTH**2) * np.sqrt(EI / RHO_A)
        mass, frequency = share * RHO_A * LENGTH, tuning * first
        hung = (Oscillator(MIDDLE, "-z", mass, frequency),)
        found = frequencies(beam("in-plane", elements, PINS, oscillators=hung), 3)
        even = 4.0 * first  # the second mode has its node there
        expected = np.sort([*tuned(mass, frequency), even])
        assert found == pytest.approx(expected, rel=4e-5)

    def test_attachments_find_the_dofs_again(self, ladder: Any) -> None:
        hung = (Oscillator(Place(member="AB", s=0.4), "z", 0.1, 90.0),)
        soft, tight = (JointSpring("F", "CF", {"ry": 3e3}),), (Preload("BE", 500.0),)
        frame = replace(ladder(), oscillators=hung, preloads=tight, joint_springs=soft)
        weighed = Structure.build(frame).total_mass - Structure.build(ladder()).total_mass
        assert weighed == pytest.approx(0.1, rel=1e-9)
        more = (PointMass(Place(member="BE", s=0.6), 0.2),)
        given = [Property("E", "E", ("AB/1", "CF/2")), Property("k", "spring", ("CF@F:ry",))]
        model = Model.of(Structure.build(frame).with_values(given, [0.8, 4e3]))
        attached = model.attach(more, ())
        anew = Structure.build(frame.with_attachments(more, ()))
        wanted = anew.with_values(given, [0.8, 4e3])
        for one, two in zip((attached.mass, attached.stiffness), wanted.matrices(), strict=True):
            assert abs(one - two).max() < 1e-9 * abs(two).max()
        spring = np.zeros((model.size, 1))
        spring[-1] = 1.0  # the last dof is the oscillator's
        changed = replace(model, stiffness_change=LowRank(spring, np.array([[1e5]])))
        change = changed.attach(more, ()).stiffness_change
        assert change is not None
        assert list(np.flatnonzero(change.basis)) == [attached.size - 1]
        assert attached.dofs.direction[-1] == "z"

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"direction": "rx"}, "one of z"),
            ({"mass": 0.0}, "above 0"),
            ({"frequency": 0.0}, "above 0"),
            ({"at": Place(joint="Z")}, "no joint 'Z'"),
            ({"at": Place(member="n", s=0.5)}, "no member 'n'"),
        ],
    )
    def test_what_is_no_oscillator_is_refused(self, change: dict[str, Any], words: str) -> None:
        item = replace(Oscillator(MIDDLE, "z", 0.1, 10.0), **change)
        with pytest.raises(ModelError, match=words):
            Structure.build(beam("out-of-plane", 2, oscillators=(item,)))
