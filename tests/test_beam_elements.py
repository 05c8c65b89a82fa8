"""The beam element against quadrature, rigid transformations, closed forms and its own limits."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from femubench import Model, solve_modes
from femubench.core.fem.beam import BeamProperties, shape_functions
from femubench.fem import FloatArray, Frame, Joint, Material, Member, Place, Section, Support

LENGTH = 0.7
VALUES = {
    "length": LENGTH, "EA": 7.4e7, "EIy": 1.7e4, "EIz": 0.9e4, "GJ": 1.1e4,
    "flex_y": 0.0, "flex_z": 0.0, "rhoA": 2.8, "rhoJp": 1.3e-3, "rhoIy": 0.0, "rhoIz": 0.0,
    "rigid_1": 0.0, "rigid_2": 0.0, "rigid_mass_1": 0.0, "rigid_mass_2": 0.0, "shear_shape": 0.0,
    "coupling": 0.0, "ecc_y": 0.0, "ecc_z": 0.0,
}  # fmt: skip
SHEAR = {"flex_y": 5e-8, "flex_z": 3e-7}
ROTARY = {"rhoIy": 0.02, "rhoIz": 0.03}


def one(**changes: float) -> BeamProperties:
    values = VALUES | changes
    assert set(values) == {f.name for f in fields(BeamProperties)}
    return BeamProperties(**{name: np.array([value]) for name, value in values.items()})


def polynomials(p: BeamProperties) -> FloatArray:
    """Return the shape functions as polynomial coefficients in x, (4, 6, 12), lowest first."""
    xi = 0.5 - 0.5 * np.cos(np.pi * np.array([0.125, 0.375, 0.625, 0.875]))
    values = np.array([shape_functions(p, 0, float(x)) for x in xi])
    powers = np.vander(xi * LENGTH, 4, increasing=True)
    return np.linalg.solve(powers, values.reshape(4, -1)).reshape(4, 6, 12)


def quadrature(left: FloatArray, weight: float) -> FloatArray:
    """Return weight times the integral of l'l over the length, l = rows of polynomials (4, 12)."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    x = 0.5 * LENGTH * (nodes + 1.0)
    rows = np.vander(x, 4, increasing=True) @ left
    return np.asarray(weight * 0.5 * LENGTH * np.einsum("g,gi,gj->ij", weights, rows, rows))


def derivative(coefficients: FloatArray) -> FloatArray:
    raised = np.zeros_like(coefficients)
    raised[:-1] = coefficients[1:] * np.arange(1, 4)[:, None]
    return raised


@pytest.mark.parametrize("shear_shape", [0.0, 1.0])
def test_mass_is_the_quadrature_of_the_shape_functions(shear_shape: float) -> None:
    p = one(**SHEAR, **ROTARY, shear_shape=shear_shape)
    N = polynomials(p)
    mass = sum(quadrature(N[:, i], VALUES["rhoA"]) for i in range(3))
    mass = mass + quadrature(N[:, 3], VALUES["rhoJp"])
    mass = mass + quadrature(N[:, 4], ROTARY["rhoIy"]) + quadrature(N[:, 5], ROTARY["rhoIz"])
    found = p.mass_matrices()[0]
    np.testing.assert_allclose(found, mass, rtol=0, atol=1e-12 * np.abs(found).max())


@pytest.mark.parametrize("shear", [{}, SHEAR])
def test_stiffness_is_the_quadrature_of_the_strains(shear: dict[str, float]) -> None:
    p = one(**shear, shear_shape=1.0)
    N = polynomials(p)
    slope = [derivative(N[:, i]) for i in range(6)]
    stiffness = quadrature(slope[0], VALUES["EA"]) + quadrature(slope[3], VALUES["GJ"])
    stiffness += quadrature(slope[4], VALUES["EIy"]) + quadrature(slope[5], VALUES["EIz"])
    if shear:
        stiffness += quadrature(slope[1] - N[:, 5], 1.0 / shear["flex_y"])
        stiffness += quadrature(slope[2] + N[:, 4], 1.0 / shear["flex_z"])
    found = p.stiffness_matrices()[0]
    np.testing.assert_allclose(found, stiffness, rtol=0, atol=1e-12 * np.abs(found).max())


def test_cubic_shape_functions_have_the_slope_as_rotation() -> None:
    N = polynomials(one(**SHEAR))
    np.testing.assert_allclose(N[:, 4], -derivative(N[:, 2]), atol=1e-11)
    np.testing.assert_allclose(N[:, 5], derivative(N[:, 1]), atol=1e-11)


def arm(first: float, second: float) -> FloatArray:
    """Return node motion -> motion of the flexible part's ends, written out by hand."""
    T = np.eye(12)
    T[1, 5], T[2, 4] = first, -first
    T[7, 11], T[8, 10] = -second, second
    return T


@pytest.mark.parametrize(
    ("first", "second", "shear"), [(0.05, 0.2, SHEAR), (0.0, -1.0, {}), (-0.2, 0.1, SHEAR)]
)
def test_partly_rigid_element_is_the_transformed_shorter_one(
    first: float, second: float, shear: dict[str, float]
) -> None:
    short = one(**shear, length=LENGTH - first - second)
    T = arm(first, second)
    expected = T.T @ short.stiffness_matrices()[0] @ T
    found = one(**shear, rigid_1=first, rigid_2=second).stiffness_matrices()[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    expected = T.T @ short.mass_matrices()[0] @ T
    found = one(**shear, rigid_mass_1=first, rigid_mass_2=second).mass_matrices()[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("a", [0.3, -0.0283])
def test_partly_rigid_element_is_the_printed_equation(a: float) -> None:
    # Horton et al. (1999), equation (5); its dofs are w and dw/dx, ours w and ry = -dw/dx.
    L, EI = LENGTH, VALUES["EIy"]
    printed = EI * np.array(
        [
            [12 / (-a + L)**3, -6 * (L + a) / (a - L)**3, 12 / (a - L)**3, 6 / (a - L)**2],
            [-6 * (L + a) / (a - L)**3, -4 * (a**2 + a * L + L**2) / (a - L)**3,
             6 * (a + L) / (a - L)**3, 2 * (2 * a + L) / (a - L)**2],
            [12 / (a - L)**3, 6 * (a + L) / (a - L)**3, 12 / (-a + L)**3, -6 / (a - L)**2],
            [6 / (a - L)**2, 2 * (2 * a + L) / (a - L)**2, -6 / (a - L)**2, 4 / (-a + L)],
        ]
    )  # fmt: skip
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    index = np.ix_([2, 4, 8, 10], [2, 4, 8, 10])
    found = one(rigid_1=a).stiffness_matrices()[0]
    tolerance = 1e-12 * np.abs(printed).max()
    np.testing.assert_allclose(found[index], printed * np.outer(sign, sign), atol=tolerance, rtol=0)
    assert found[0, 0] == pytest.approx(VALUES["EA"] / (L - a), rel=1e-14)
    # The other end is the mirror image: swap the nodes, turn the slopes.
    mirrored = one(rigid_2=a).stiffness_matrices()[0][index]
    swap = np.array([2, 3, 0, 1])
    expected = printed[np.ix_(swap, swap)]
    np.testing.assert_allclose(mirrored, expected, atol=tolerance, rtol=0)


def test_rigid_motion_costs_no_energy_and_carries_the_whole_mass() -> None:
    p = one(**SHEAR, **ROTARY, rigid_1=-0.1, rigid_2=0.05, shear_shape=1.0)
    x = np.array([0.0, LENGTH])
    motions = np.zeros((12, 6))
    for end in (0, 1):
        block = np.eye(6)
        block[1, 5], block[2, 4] = x[end], -x[end]
        motions[6 * end : 6 * end + 6] = block
    k, m = p.stiffness_matrices()[0], p.mass_matrices()[0]
    assert np.abs(k @ motions).max() < 1e-12 * np.abs(k).max()
    inertia = motions.T @ m @ motions
    total = VALUES["rhoA"] * LENGTH
    expected = [total, total, total, VALUES["rhoJp"] * LENGTH]
    expected += [total * LENGTH**2 / 3 + ROTARY[name] * LENGTH for name in ("rhoIy", "rhoIz")]
    np.testing.assert_allclose(np.diag(inertia), expected, rtol=1e-12)


# ---- beams against the roots of their frequency equations ----------------------------------

SECTION = Section(A=4e-4, Iy=2e-8, Iz=2e-8, J=3e-8, Jp=4e-8, kappa=Section.constant_kappa(0.45))
MATERIAL = Material(70e9, 0.3, 2700.0)
SPAN = 0.5


def beam(elements: int, fixed: dict[str, tuple[str, ...]], **options: object) -> Model:
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (SPAN * 0.6, 0.0, SPAN * 0.8)))
    member = Member("m", ("A", "B"), elements, SECTION, MATERIAL)
    supports = tuple(Support(Place(joint=j), dofs) for j, dofs in fixed.items())
    base = Frame("in-plane", "euler-bernoulli", joints, (member,), supports=supports)
    return Model.of(replace(base, **options))  # type: ignore[arg-type]


def euler_frequencies(roots: FloatArray) -> FloatArray:
    EI, rhoA = MATERIAL.E * SECTION.Iy, MATERIAL.rho * SECTION.A
    return np.asarray((roots / SPAN) ** 2 * np.sqrt(EI / rhoA) / (2 * np.pi))


def roots_of(sign: float, count: int) -> FloatArray:
    """Return the roots of cosh b cos b = sign (1: free-free, -1: cantilever)."""
    first = 1 if sign > 0 else 0

    def equation(b: float) -> float:
        return float(np.cos(b) - sign / np.cosh(b))

    brackets = [(np.pi * (i + first), np.pi * (i + first + 1)) for i in range(count)]
    return np.array([brentq(equation, lo + 0.01, hi - 1e-9, xtol=1e-13) for lo, hi in brackets])


def rates(errors: list[FloatArray]) -> FloatArray:
    return np.array([np.log2(a / b) for a, b in pairwise(errors)])


def errors_of(exact: FloatArray, meshes: tuple[int, ...], **case: object) -> list[FloatArray]:
    found = []
    for n in meshes:
        elastic = solve_modes(beam(n, **case)).elastic.natural_frequencies  # type: ignore[arg-type]
        # Bending differs from axial motion by its frequency: the rod's first lies far above.
        found.append(np.abs(elastic[: len(exact)] / exact - 1.0))
    return found


@pytest.mark.parametrize(
    ("sign", "fixed", "meshes"),
    [(-1.0, {"A": ("x", "z", "ry")}, (8, 16, 32)), (1.0, {}, (16, 32, 64))],
    ids=["cantilever", "free-free"],
)
def test_frequencies_converge_with_the_fourth_power(
    sign: float, fixed: dict[str, tuple[str, ...]], meshes: tuple[int, ...]
) -> None:
    exact = euler_frequencies(roots_of(sign, 3))
    errors = errors_of(exact, meshes, fixed=fixed)
    np.testing.assert_allclose(rates(errors), 4.0, atol=0.1)
    assert errors[-1].max() < 1e-5


def horizontal(elements: int, **options: object) -> Model:
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (SPAN, 0.0, 0.0)))
    member = Member("m", ("A", "B"), elements, SECTION, MATERIAL)
    supports = (Support(Place(joint="A"), ("x", "z")), Support(Place(joint="B"), ("z",)))
    base = Frame("in-plane", "timoshenko", joints, (member,), supports=supports)
    return Model.of(replace(base, **options))  # type: ignore[arg-type]


def wave_frequency(mode: int, cubic: bool) -> float:
    """Return the frequency of w = a sin kx, psi = b cos kx in Hz (Han, Benaroya & Wei 1999).

    With cubic mass functions the rotary inertia belongs to a slope that has the right mean w' in
    each element but the nodal psi at its ends: on a fine mesh its square is
    w'^2 + (w' - psi)^2 / 5.
    """
    assert SECTION.kappa is not None
    k, GA = mode * np.pi / SPAN, SECTION.kappa(0.3)[1] * MATERIAL.G * SECTION.A
    rhoA, rhoI = MATERIAL.rho * SECTION.A, MATERIAL.rho * SECTION.Iy
    stiffness = np.array([[GA * k**2, -GA * k], [-GA * k, GA + MATERIAL.E * SECTION.Iy * k**2]])
    mass = np.diag([rhoA, rhoI])
    if cubic:
        mass = rhoI * np.array([[1.2 * k**2, -0.2 * k], [-0.2 * k, 0.2]])
        mass[0, 0] += rhoA
    low = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.min()
    return float(np.sqrt(low) / (2 * np.pi))


def bending_only(model: Model, count: int) -> FloatArray:
    modes = solve_modes(model)
    sideways = np.array([d == "x" for d in model.dofs.direction])
    bending = np.abs(modes.shapes[sideways]).max(axis=0) < 1e-6 * np.abs(modes.shapes).max(axis=0)
    return np.asarray(modes.natural_frequencies[bending][:count])


@pytest.mark.parametrize("bending_mass", ["cubic", "shear-consistent"])
def test_timoshenko_beam_meets_its_frequency_equation(bending_mass: str) -> None:
    exact = np.array([wave_frequency(mode, bending_mass == "cubic") for mode in (1, 2, 3)])
    found = [bending_only(horizontal(n, bending_mass=bending_mass), 3) for n in (32, 64, 128)]
    # Two nodes know the shear of a distributed load to first order only: the rate is 2, not 4.
    np.testing.assert_allclose(rates([np.abs(f / exact - 1.0) for f in found]), 2.0, atol=0.03)
    extrapolated = (4.0 * found[2] - found[1]) / 3.0
    np.testing.assert_allclose(extrapolated, exact, rtol=2e-7)


def test_thin_timoshenko_beam_is_an_euler_bernoulli_beam() -> None:
    thin = replace(SECTION, Iy=SECTION.Iy * 1e-6, kappa=Section.constant_kappa(0.45))
    material = Material(70e9, 0.3, 2700.0)
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (SPAN, 0.0, 0.0)))
    found = []
    for theory in ("euler-bernoulli", "timoshenko"):
        member = Member("m", ("A", "B"), 12, thin, material)
        model = Model.of(Frame("out-of-plane", theory, joints, (member,)))  # type: ignore[arg-type]
        found.append(solve_modes(model).elastic.natural_frequencies[:3])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)
    assert (found[1] < found[0]).all()


@pytest.mark.parametrize("direction", ["y", "z"])
def test_shear_along_each_axis_has_its_own_coefficient(direction: str) -> None:
    """Deflection of a cantilever: bending, and P L / (kappa G A) with the kappa along it."""
    section = Section(4e-4, 2e-8, 5e-8, 3e-8, 7e-8, kappa=lambda nu: (0.2, 0.7))
    joints = Joint("A", (0.0, 0.0, 0.0), "E"), Joint("B", (0.05, 0.0, 0.0), "E")
    member = Member("beam", ("A", "B"), 2, section, MATERIAL, up=(0.0, 0.0, 1.0))
    held = Support(Place(joint="A"), ("x", "y", "z", "rx", "ry", "rz"))
    model = Model.of(Frame("3d", "timoshenko", joints, (member,), supports=(held,)))
    tip = (model.dofs.xyz[:, 0] > 0.049) & (np.array(model.dofs.direction) == direction)
    deflection = np.linalg.solve(model.stiffness.toarray(), tip.astype(float))[tip]
    inertia, kappa = (section.Iz, 0.2) if direction == "y" else (section.Iy, 0.7)
    bending = 0.05**3 / (3.0 * MATERIAL.E * inertia)
    shear = 0.05 / (kappa * MATERIAL.G * section.A)
    assert shear > 0.1 * bending
    assert deflection == pytest.approx([bending + shear], rel=1e-9)
