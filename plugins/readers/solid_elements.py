"""Mass and stiffness of solid elements, with the shape functions and quadratures of scikit-fem.

With as many points as CalculiX has these are its matrices, to rounding: elements may be distorted
and their edges curved, and C3D20R has the eight points of its reduced integration in both.

Source: Gustafsson & McBain (2020), J. Open Source Softw. 5, 2369; Dhondt (2004), The Finite Element
Method for Three-Dimensional Thermomechanical Applications, section 2.1.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from femubench.fem import FloatArray, IntArray, SparseArray

# Of memory for one of a file: 100 that describe a brick of 20 nodes take 40 kB of a group and twice
# as much of sums, in a mesh that shares its nodes.
BYTES = 1200
_BATCH = 256  # elements, whose products take 200 MB at most
_BRICK = ("000", "100", "110", "010", "001", "101", "111", "011")
_TETRAHEDRON = ("000", "100", "010", "001")
_BRICK_EDGES = ((0, 1, 2, 3, 0), (4, 5, 6, 7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_TETRAHEDRON_EDGES = ((0, 1, 2, 0), (0, 3), (1, 3), (2, 3))
_WEDGE = ("000", "100", "010", "001", "101", "011")
_WEDGE_EDGES = ((0, 1, 2, 0), (3, 4, 5, 3), (0, 3), (1, 4), (2, 5))


class Kind(NamedTuple):
    """A kind of element.

    Arguments:
        functions: its class in scikit-fem; that of its triangles for a wedge.
        corners, edges: in the order of the input file; an edge has a node amid two corners.
        order: of the quadrature of both matrices, in the triangles of a wedge.
        incompatible: whether each direction of the reference element may bend by itself.
    """

    functions: str
    corners: tuple[str, ...]
    edges: tuple[tuple[int, ...], ...]
    order: int
    incompatible: bool = False

    @property
    def places(self) -> FloatArray:
        """Return where the nodes lie in the reference element, (n, 3)."""
        corners = np.array([[float(digit) for digit in corner] for corner in self.corners])
        pairs = [pair for chain in self.edges for pair in pairwise(chain)]
        return np.vstack([corners, *(corners[list(pair)].mean(axis=0) for pair in pairs)])


KINDS = {
    "C3D4": Kind("ElementTetP1", _TETRAHEDRON, (), 1),
    "C3D6": Kind("ElementTriP1", _WEDGE, (), 1),
    "C3D8": Kind("ElementHex1", _BRICK, (), 3),
    "C3D8I": Kind("ElementHex1", _BRICK, (), 3, incompatible=True),
    "C3D10": Kind("ElementTetP2", _TETRAHEDRON, _TETRAHEDRON_EDGES, 2),
    "C3D15": Kind("ElementTriP2", _WEDGE, _WEDGE_EDGES, 2),
    "C3D20": Kind("ElementHexS2", _BRICK, _BRICK_EDGES, 5),
    "C3D20R": Kind("ElementHexS2", _BRICK, _BRICK_EDGES, 3),
}


# Elements with the same corners that bend along their edges.
BETTER = {"C3D4": "C3D10", "C3D6": "C3D15", "C3D8": "C3D20", "C3D8I": "C3D20"}


@cache
def _tabulate(kind: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return values (n, q), slopes (n, 3, q) of the functions, points (3, q), weights (q,)."""
    import skfem
    from skfem.quadrature import get_quadrature

    functions, places = KINDS[kind].functions, KINDS[kind].places
    points, weights = get_quadrature(getattr(skfem, functions)().refdom, KINDS[kind].order)
    if KINDS[kind].corners is _WEDGE:
        return _tabulate_wedge(places, points, weights)
    return *evaluate(functions, places, points), points, weights


def evaluate(
    functions: str, places: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values (n, q) and slopes (n, d, q) of functions of scikit-fem at points (d, q).

    Arguments:
        places: of its nodes in the order that is wanted, (n, d).
    """
    import skfem

    element = getattr(skfem, functions)()
    far = np.linalg.norm(element.doflocs[None] - places[:, None], axis=-1)
    values, slopes = zip(*(element.lbasis(points, i) for i in far.argmin(axis=1)), strict=True)
    return np.array(values), np.array(slopes)


def _tabulate_wedge(
    places: FloatArray, flat: FloatArray, areas: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what `_tabulate` does, from the points (2, t) and weights (t,) of a triangle.

    The functions are the polynomials of the triangle times 1 and z; with nodes amid the edges
    also z^2 times those of first order.
    """
    amid = len(places) > len(_WEDGE)
    if not amid:  # one point, where scikit-fem has three at least
        flat, areas = np.full((2, 1), 1.0 / 3.0), np.array([0.5])
    height, lengths = np.polynomial.legendre.leggauss(3 if amid else 2)
    points = np.vstack(
        [np.repeat(flat, len(height), axis=1), np.tile(0.5 * (1.0 + height), len(areas))]
    )
    weights = np.asarray(np.kron(areas, 0.5 * lengths), dtype=float)
    first = [(0, 0), (1, 0), (0, 1)]
    plane = [*first, *([(1, 1), (2, 0), (0, 2)] if amid else [])]
    powers = [(*p, k) for k in (0, 1) for p in plane] + [(*p, 2) for p in first if amid]

    def monomials(at: FloatArray, along: int | None = None) -> FloatArray:
        factors = np.array(powers)[:, :, None]
        lower = np.zeros_like(factors)
        if along is not None:
            lower[:, along] = 1
        scale = np.where(lower == 1, factors, 1)
        return np.asarray((scale * at ** np.maximum(factors - lower, 0)).prod(axis=1))

    functions = np.linalg.inv(monomials(places.T))  # each a row of coefficients
    values = functions @ monomials(points)
    slopes = np.stack([functions @ monomials(points, along) for along in range(3)], axis=1)
    return values, slopes, points, weights


def integrate(
    kind: str, xyz: FloatArray, modulus: FloatArray, poisson: FloatArray, density: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return stiffness (e, 3 n, 3 n) and mass of elements of a kind, of one direction (e, n, n).

    Modes inside an element follow its nodes without inertia forces (Guyan, 1965): CalculiX keeps
    those of C3D8I, whose inertia moves frequencies of bending by percents where a mesh is coarse.
    They couple the directions: the mass of such elements is (e, 3 n, 3 n).

    Arguments:
        kind: of `KINDS`, with n nodes.
        xyz: places of the nodes, (e, n, 3).
        modulus, poisson, density: of each element, isotropic, (e,).

    Raises:
        ValueError: with the place of an element that is turned inside out.
    """
    values, slopes, points, weights = _tabulate(kind)
    jacobian = np.einsum("ena,nkq->eqak", xyz, slopes)
    volume = np.linalg.det(jacobian) * weights
    if (volume <= 0.0).any():
        raise ValueError(int(np.flatnonzero((volume <= 0.0).any(axis=1))[0]))
    gradient = np.einsum("eqka,nkq->eqna", np.linalg.inv(jacobian), slopes)
    if KINDS[kind].incompatible:
        # 1 - xi^2 in each direction, by the Jacobian of the middle; Taylor, Beresford & Wilson
        # (1976) weigh it by the volumes of middle and point, CalculiX does not.
        middle = np.linalg.inv(jacobian.mean(axis=1))
        bent = np.einsum("eka,kq->eqka", middle, 1.0 - 2.0 * points)
        gradient = np.concatenate([gradient, bent], axis=2)
    products = np.einsum("eqia,eqjb,eq->eiajb", gradient, gradient, volume, optimize=True)
    shear = modulus / (2.0 * (1.0 + poisson))
    lame = 2.0 * shear * poisson / (1.0 - 2.0 * poisson)
    # a(u, v) = lambda div u div v + 2 mu eps(u) : eps(v)
    stiffness = lame[:, None, None, None, None] * products
    products *= shear[:, None, None, None, None]
    stiffness += products.swapaxes(2, 4)
    for a in range(3):
        stiffness[:, :, a, :, a] += np.einsum("eicjc->eij", products)
    size, own = 3 * gradient.shape[2], 3 * len(values)
    stiffness = stiffness.reshape(-1, size, size)
    if KINDS[kind].incompatible:
        values = np.concatenate([values, points * (1.0 - points)])
    mass = np.einsum("iq,jq,eq,e->eij", values, values, volume, density, optimize=True)
    if KINDS[kind].incompatible:
        mass = np.einsum("eij,ab->eiajb", mass, np.eye(3)).reshape(stiffness.shape)
        follow = -np.linalg.solve(stiffness[:, own:, own:], stiffness[:, own:, :own])
        motion = np.concatenate([np.tile(np.eye(own), (len(follow), 1, 1)), follow], axis=1)
        stiffness, mass = (motion.swapaxes(1, 2) @ part @ motion for part in (stiffness, mass))
    return stiffness, mass


def assemble(
    kind: str, nodes: IntArray, xyz: FloatArray, material: FloatArray
) -> tuple[SparseArray, SparseArray]:
    """Return stiffness and mass of elements of a kind, (3 N, 3 N) each; node i has rows 3 i + d.

    Arguments:
        kind: of `KINDS`, with n nodes.
        nodes: of the elements, (e, n).
        xyz: of all nodes, (N, 3).
        material: modulus, Poisson's ratio and density of every element, (e, 3).

    Raises:
        ValueError: with the place of an element that is turned inside out.
    """
    size = 3 * len(xyz)
    stiffness, mass = sp.csc_array((size, size)), sp.csc_array((size, size))
    for start in range(0, len(nodes), _BATCH):
        part = nodes[start : start + _BATCH]
        try:
            own, inertia = integrate(kind, xyz[part], *material[start : start + _BATCH].T)
        except ValueError as error:
            raise ValueError(start + error.args[0]) from None
        rows = (3 * part[:, :, None] + np.arange(3)).reshape(len(part), -1)
        stiffness += _scatter(own, rows, size)
        for at in [rows] if KINDS[kind].incompatible else [rows[:, d::3] for d in range(3)]:
            mass += _scatter(inertia, at, size)
    return stiffness, mass


def _scatter(blocks: FloatArray, rows: IntArray, size: int) -> SparseArray:
    """Return the sum of dense blocks (e, m, m) at their rows (e, m)."""
    short = rows.astype(np.int32)  # half the memory of a model of 10^5 rows
    at = np.broadcast_arrays(short[:, :, None], short[:, None, :])
    entries = (blocks.ravel(), (at[0].ravel(), at[1].ravel()))
    return sp.csc_array(sp.coo_array(entries, shape=(size, size)))
