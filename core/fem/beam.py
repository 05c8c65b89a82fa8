"""Matrices of straight prismatic beam elements, a whole batch at a time, in local axes.

The twelve local dofs are x y z rx ry rz of end 1, then of end 2; local x runs along the element and
dw/dx = -ry, dv/dx = +rz. Everything is plain arithmetic on arrays, so complex numbers go through:
that is how the derivatives are taken.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from femubench.core.typing import AnyArray, FloatArray, IntArray

AXIAL = np.array([0, 6])
TWIST = np.array([3, 9])
# (v, rz) pairs with dv/dx = rz; (w, ry) pairs need the sign of the slope turned.
BEND_XY = np.array([1, 5, 7, 11])
BEND_XZ = np.array([2, 4, 8, 10])
SLOPE_SIGN = np.array([1.0, -1.0, 1.0, -1.0])
# Next to those that decide on the interpolation, which the mass matrix shares.
MASS_PROPERTIES = (
    *("rhoA", "rhoJp", "rhoIy", "rhoIz", "rigid_mass_1", "rigid_mass_2", "ecc_y", "ecc_z"),
)
_DIGITS = 12  # in which elements of one kind agree
_REACH = 0.5 * float(np.sqrt(0.6))
# Points and weights on 0..1, exact up to the fifth degree.
GAUSS = ((0.5 - _REACH, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + _REACH, 5.0 / 18.0))


def interpolation(x: float, L: AnyArray, phi_y: AnyArray, phi_z: AnyArray) -> AnyArray:
    """Return displacement and rotation inside many elements, (n, 6, 12), local axes.

    Arguments:
        x: position as a share of the length, 0..1.
        L: flexible length in m, (n,).
        phi_y, phi_z: ratios of shear to bending flexibility; 0 for cubic functions, (n,).
    """
    rows = np.zeros((len(L), 6, 12), dtype=np.result_type(L, phi_y, phi_z))
    for i, columns in ((0, AXIAL), (3, TWIST)):
        rows[:, i, columns] = [1.0 - x, x]
    rows[:, [[1], [5]], BEND_XY] = np.moveaxis(bending_functions(x, L, phi_y), -1, 0)
    across = np.moveaxis(bending_functions(x, L, phi_z), -1, 0) * SLOPE_SIGN
    rows[:, [[2], [4]], BEND_XZ] = across * [[1.0], [-1.0]]
    return rows


def cubic_rates(x: float, L: FloatArray) -> FloatArray:
    """Return the derivatives of displacement and rotation in x, (n, 6, 12), cubic functions.

    Arguments:
        x: position as a share of the length, 0..1.
        L: flexible length in m, (n,).
    """
    rows = np.zeros((len(L), 6, 12))
    for i, columns in ((0, AXIAL), (3, TWIST)):
        rows[:, i, columns] = np.array([-1.0, 1.0]) / L[:, None]
    _, slope = bending_functions(x, L, np.zeros_like(L))
    bend = np.array([(12 * x - 6) / L**2, (6 * x - 4) / L, (6 - 12 * x) / L**2, (6 * x - 2) / L]).T
    rows[:, 1, BEND_XY], rows[:, 5, BEND_XY] = slope.T, bend
    rows[:, 2, BEND_XZ], rows[:, 4, BEND_XZ] = slope.T * SLOPE_SIGN, -bend * SLOPE_SIGN
    return rows


def bending_functions(x: float, L: AnyArray | float, phi: AnyArray | float) -> AnyArray:
    """Return deflection and slope of the section for (w, slope) at both ends, (2, 4, ...).

    Source: Friedman & Kosmatka (1993), (20)-(21); with phi = 0 Hermite's cubic functions.
    """
    c = 1.0 / (1.0 + phi)
    cubic = 2 * x**3 - 3 * x**2 - phi * x
    w = [
        c * (cubic + 1 + phi),
        c * L * (x**3 - (2 + phi / 2) * x**2 + (1 + phi / 2) * x),
        -c * cubic,
        c * L * (x**3 - (1 - phi / 2) * x**2 - phi / 2 * x),
    ]
    slope = 6 * c / L * (x**2 - x)
    theta = [
        slope,
        c * (3 * x**2 - (4 + phi) * x + 1 + phi),
        -slope,
        c * (3 * x**2 - (2 - phi) * x),
    ]
    return np.array([w, theta])


def rigid_part(x: float, L: float) -> FloatArray:
    """Return the same at a rigid end, x < 0 or x > 1, (2, 4)."""
    if x < 0.0:
        return np.array([[1.0, x * L, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    return np.array([[0.0, 0.0, 1.0, (x - 1.0) * L], [0.0, 0.0, 0.0, 1.0]])


_CURVE = np.array([4, 10])


@dataclass(frozen=True)
class BeamProperties:
    """Rigidities and inertias of a batch of elements, one entry an element.

    Arguments:
        length: distance of the two nodes in m.
        EA, EIy, EIz, GJ: axial, bending (about y, about z) and torsional rigidity.
        flex_y, flex_z: shear flexibility 1/(kappa G A) in 1/N; 0 for Euler-Bernoulli.
        rhoA: mass per length in kg/m.
        rhoJp: torsional inertia per length in kg m.
        rhoIy, rhoIz: rotary inertia per length in kg m; 0 for Euler-Bernoulli.
        rigid_1, rigid_2: rigid lengths at the ends in the stiffness matrix in m, of either sign.
        rigid_mass_1, rigid_mass_2: rigid massless lengths in the mass matrix in m.
        shear_shape: how far the mass matrix and the interpolation know of the shear: 0 keeps
            cubic Hermite functions, 1 takes those of the Timoshenko element.
        coupling: coefficient c of the bending-torsion coupling, -1 < c < 1.
        ecc_y, ecc_z: where the mass centre of the section lies in local axes in m.
    """

    length: FloatArray
    EA: FloatArray
    EIy: FloatArray
    EIz: FloatArray
    GJ: FloatArray
    flex_y: FloatArray
    flex_z: FloatArray
    rhoA: FloatArray
    rhoJp: FloatArray
    rhoIy: FloatArray
    rhoIz: FloatArray
    rigid_1: FloatArray
    rigid_2: FloatArray
    rigid_mass_1: FloatArray
    rigid_mass_2: FloatArray
    shear_shape: FloatArray
    coupling: FloatArray
    ecc_y: FloatArray
    ecc_z: FloatArray

    def __len__(self) -> int:
        return len(self.length)

    def take(self, index: IntArray) -> BeamProperties:
        """Return the entries of some elements."""
        return BeamProperties(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def scale(self, name: str, factor: FloatArray) -> BeamProperties:
        """Return a batch in which one property is multiplied, one factor an element."""
        return replace(self, **{name: getattr(self, name) * factor})

    def alike(self, *further: FloatArray | IntArray) -> tuple[IntArray, IntArray]:
        """Return one element of every kind, (c,), and the kind of each element, (n,).

        Arguments:
            further: further numbers that are equal within a kind, (n,) each.
        """
        table = np.column_stack([*(getattr(self, f.name) for f in fields(self)), *further])
        table = table / np.maximum(np.abs(table).max(axis=0, initial=0.0), 1e-300)
        _, first, kind = np.unique(
            table.round(_DIGITS), axis=0, return_index=True, return_inverse=True
        )
        return first, kind

    def stiffness_matrices(self) -> AnyArray:
        """Return the local stiffness matrices in N, N m, (n, 12, 12).

        Rigid ends follow Horton et al. (1999), equation (5): T' k(L - a) T, axial EA/(L - a).

        Examples:
            >>> twist = properties.stiffness_matrices()[:, 3, 3]
            >>> np.allclose(twist, properties.GJ / properties.length)
            True
        """
        L = _flexible(self)
        dtype = np.result_type(*(getattr(self, f.name) for f in fields(self)))
        k = np.zeros((len(self), 12, 12), dtype=dtype)
        bar = np.array([[1.0, -1.0], [-1.0, 1.0]])
        _place(k, AXIAL, bar * (self.EA / L)[:, None, None])
        _place(k, TWIST, bar * (self.GJ / L)[:, None, None])
        _place(k, BEND_XY, bending_stiffness(self.EIz, self.flex_y, L))
        _place(k, BEND_XZ, bending_stiffness(self.EIy, self.flex_z, L), SLOPE_SIGN)
        k = _add_rigid_ends(k, self.rigid_1, self.rigid_2)
        if np.any(self.coupling):
            k += self.coupling[:, None, None] * self.coupling_matrices()
        return k

    def coupling_matrices(self) -> AnyArray:
        """Return what a bending-torsion coupling of coefficient 1 adds in N, N m, (n, 12, 12).

        The strain energy is the integral of sqrt(EI GJ) d(ry)/dx d(rx)/dx; with a linear twist it
        depends on the rotations of the ends alone, so that rigid ends change the length alone.

        Examples:
            >>> properties.coupling_matrices().shape
            (28, 12, 12)
        """
        k = np.zeros(
            (len(self), 12, 12), dtype=np.result_type(self.EIy, self.GJ, self.length, self.rigid_1)
        )
        block = np.array([[1.0, -1.0], [-1.0, 1.0]])
        block = block * (np.sqrt(self.EIy * self.GJ) / _flexible(self))[:, None, None]
        k[:, TWIST[:, None], _CURVE[None, :]] = block
        k[:, _CURVE[:, None], TWIST[None, :]] = block
        return k

    def mass_matrices(self) -> AnyArray:
        """Return the consistent local mass matrices in kg, kg m, kg m2, (n, 12, 12).

        Cubic in bending, linear in axial motion and twist. With cubic functions the rotary inertia
        belongs to the slope of the axis (Rayleigh); with those of the Timoshenko element it belongs
        to the rotation of the section, as Timoshenko's theory has it.

        Examples:
            >>> axial = properties.mass_matrices()[:, 0, [0, 6]].sum(axis=1)
            >>> np.allclose(axial, properties.rhoA * properties.length / 2)
            True
        """
        L = self.length - self.rigid_mass_1 - self.rigid_mass_2
        dtype = np.result_type(*(getattr(self, f.name) for f in fields(self)))
        m = np.zeros((len(self), 12, 12), dtype=dtype)
        bar = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
        _place(m, AXIAL, bar * (self.rhoA * L)[:, None, None])
        _place(m, TWIST, bar * (self.rhoJp * L)[:, None, None])
        phi_y = self.shear_shape * 12 * self.EIz * self.flex_y / L**2
        phi_z = self.shear_shape * 12 * self.EIy * self.flex_z / L**2
        _place(m, BEND_XY, bending_mass(self.rhoA, self.rhoIz, phi_y, L))
        _place(m, BEND_XZ, bending_mass(self.rhoA, self.rhoIy, phi_z, L), SLOPE_SIGN)
        m = _add_rigid_ends(m, self.rigid_mass_1, self.rigid_mass_2)
        if np.any(self.ecc_y) or np.any(self.ecc_z):
            y, z = self.ecc_y[:, None, None], self.ecc_z[:, None, None]
            parts = self.eccentric_mass_parts()
            m += y * parts["y"] + z * parts["z"]
            m += y * y * parts["yy"] + z * z * parts["zz"] + y * z * parts["yz"]
        return m

    def eccentric_mass_parts(self) -> dict[str, AnyArray]:
        """Return what an eccentric mass centre adds to the mass matrices, each (n, 12, 12).

        The mass with its centre at (y, z) is M0 + y My + z Mz + y^2 Myy + z^2 Mzz + y z Myz, under
        the keys ``y``, ``z``, ``yy``, ``zz``, ``yz``: rho A acts on u + r x (0, y, z), and the
        inertias about the mass centre stay. `ecc_y` and `ecc_z` do not enter.

        Examples:
            >>> list(properties.eccentric_mass_parts())
            ['y', 'z', 'yy', 'zz', 'yz']
        """
        L = self.length - self.rigid_mass_1 - self.rigid_mass_2
        phi_y = self.shear_shape * 12 * self.EIz * self.flex_y / L**2
        phi_z = self.shear_shape * 12 * self.EIy * self.flex_z / L**2
        parts: dict[str, AnyArray] = dict.fromkeys(("y", "z", "yy", "zz", "yz"), np.zeros(1))
        for x, weight in GAUSS:
            rows = interpolation(x, L, phi_y, phi_z)
            by_y, by_z = np.zeros_like(rows[:, :3]), np.zeros_like(rows[:, :3])
            by_y[:, 0], by_y[:, 2] = -rows[:, 5], rows[:, 3]
            by_z[:, 0], by_z[:, 1] = rows[:, 4], -rows[:, 3]
            share = (weight * self.rhoA * L)[:, None, None]
            terms = {"y": (rows[:, :3], by_y), "z": (rows[:, :3], by_z), "yz": (by_y, by_z)}
            for name, (left, right) in terms.items():
                product = np.swapaxes(left, 1, 2) @ right
                parts[name] = parts[name] + share * (product + np.swapaxes(product, 1, 2))
            for name, one in (("yy", by_y), ("zz", by_z)):
                parts[name] = parts[name] + share * (np.swapaxes(one, 1, 2) @ one)
        return {
            k: _add_rigid_ends(m, self.rigid_mass_1, self.rigid_mass_2) for k, m in parts.items()
        }


def bending_stiffness(EI: AnyArray, flexibility: AnyArray, L: AnyArray) -> AnyArray:
    """Return (n, 4, 4) for (w, slope) at both ends (Przemieniecki 1968, (5.116)).

    Arguments:
        EI: bending rigidity in N m2, (n,).
        flexibility: 1/(kappa G A) in 1/N, (n,).
        L: flexible length in m, (n,).
    """
    phi = 12.0 * EI * flexibility / L**2
    c = EI / (L**3 * (1.0 + phi))
    a, b = 6.0 * L, 4.0 + phi
    d = 2.0 - phi
    one = np.ones_like(c)
    rows = [
        [12 * one, a, -12 * one, a],
        [a, b * L**2, -a, d * L**2],
        [-12 * one, -a, 12 * one, -a],
        [a, d * L**2, -a, b * L**2],
    ]
    return np.moveaxis(np.array(rows) * c, -1, 0)


def bending_mass(rhoA: AnyArray, rhoI: AnyArray, phi: AnyArray, L: AnyArray) -> AnyArray:
    """Return (n, 4, 4) for (w, slope) at both ends (Friedman & Kosmatka 1993, (30)-(31)).

    Arguments:
        rhoA: mass per length in kg/m, (n,).
        rhoI: rotary inertia per length in kg m, (n,).
        phi: ratio of shear to bending flexibility 12 EI / (kappa G A L^2), (n,).
        L: length that carries mass in m, (n,).
    """
    c = rhoA * L / (210.0 * (1.0 + phi) ** 2)
    t1 = 70 * phi**2 + 147 * phi + 78
    t2 = (35 * phi**2 + 77 * phi + 44) * L / 4
    t3 = 35 * phi**2 + 63 * phi + 27
    t4 = (35 * phi**2 + 63 * phi + 26) * L / 4
    t5 = (7 * phi**2 + 14 * phi + 8) * L**2 / 4
    t6 = (7 * phi**2 + 14 * phi + 6) * L**2 / 4
    translation = [[t1, t2, t3, -t4], [t2, t5, t4, -t6], [t3, t4, t1, -t2], [-t4, -t6, -t2, t5]]
    r = rhoI / (30.0 * (1.0 + phi) ** 2 * L)
    r1 = 36.0 * np.ones_like(r)
    r2 = (15 * phi - 3) * L
    r3 = (10 * phi**2 + 5 * phi + 4) * L**2
    r4 = (5 * phi**2 - 5 * phi - 1) * L**2
    rotation = [[r1, -r2, -r1, -r2], [-r2, r3, r2, r4], [-r1, r2, r1, r2], [-r2, r4, r2, r3]]
    return np.moveaxis(np.array(translation) * c + np.array(rotation) * r, -1, 0)


def _place(
    target: AnyArray, index: IntArray, block: AnyArray, sign: FloatArray | None = None
) -> None:
    if sign is not None:
        block = block * np.outer(sign, sign)
    target[:, index[:, None], index[None, :]] += block


def _flexible(p: BeamProperties) -> AnyArray:
    return p.length - p.rigid_1 - p.rigid_2


def _add_rigid_ends(matrix: AnyArray, first: AnyArray, second: AnyArray) -> AnyArray:
    """Return T' k T: the ends of the flexible part move rigidly with the nodes."""
    if not (np.any(first) or np.any(second)):
        return matrix
    transform = rigid_transform(first, second)
    return np.swapaxes(transform, 1, 2) @ matrix @ transform


def rigid_transform(first: AnyArray, second: AnyArray) -> AnyArray:
    """Return the motion of the ends of the flexible part from that of the nodes, (n, 12, 12)."""
    transform = np.zeros((len(first), 12, 12), dtype=np.result_type(first, second))
    transform[:, range(12), range(12)] = 1.0
    transform[:, 1, 5], transform[:, 2, 4] = first, -first
    transform[:, 7, 11], transform[:, 8, 10] = -second, second
    return transform


def shape_functions(p: BeamProperties, element: int, xi: float) -> FloatArray:
    """Return displacement and rotation inside an element, (6, 12), local axes.

    Arguments:
        element: index in the batch.
        xi: position along the element, 0..1 from node to node.

    Source: cubic Hermite functions; Friedman & Kosmatka (1993), (20)-(21), where `shear_shape`
    is 1.
    """
    length, first, second = (float(v[element]) for v in (p.length, p.rigid_1, p.rigid_2))
    L = length - first - second
    x = (xi * length - first) / L
    rows = np.zeros((6, 12))
    clear = min(max(x, 0.0), 1.0)
    rows[0, AXIAL] = rows[3, TWIST] = [1.0 - clear, clear]
    shape = p.shear_shape[element] * 12
    phi_y = shape * p.EIz[element] * p.flex_y[element] / L**2
    phi_z = shape * p.EIy[element] * p.flex_z[element] / L**2
    inside = 0.0 <= x <= 1.0
    across = bending_functions(x, L, phi_y) if inside else rigid_part(x, L)
    rows[1, BEND_XY], rows[5, BEND_XY] = across
    deflection, slope = bending_functions(x, L, phi_z) if inside else rigid_part(x, L)
    rows[2, BEND_XZ], rows[4, BEND_XZ] = deflection * SLOPE_SIGN, -slope * SLOPE_SIGN
    return np.asarray(rows @ rigid_transform(np.array([first]), np.array([second]))[0])
