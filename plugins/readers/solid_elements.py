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


class Kind(NamedTuple):
    """A kind of element.

    Arguments:
        functions: its class in scikit-fem.
        corners, edges: in the order of the input file; an edge has a node amid two corners.
        order: of the quadrature of both matrices.
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
    "C3D8": Kind("ElementHex1", _BRICK, (), 3),
    "C3D8I": Kind("ElementHex1", _BRICK, (), 3, incompatible=True),
    "C3D10": Kind("ElementTetP2", _TETRAHEDRON, _TETRAHEDRON_EDGES, 2),
    "C3D20": Kind("ElementHexS2", _BRICK, _BRICK_EDGES, 5),
    "C3D20R": Kind("ElementHexS2", _BRICK, _BRICK_EDGES, 3),
}


# Elements with the same corners that bend along their edges.
BETTER = {"C3D4": "C3D10", "C3D8": "C3D20", "C3D8I": "C3D20"}


@cache
def _tabulate(kind: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return values (n, q), slopes (n, 3, q) of the functions, points (3, q), weights (q,)."""
    import skfem
    from skfem.quadrature import get_quadrature

    element, places = getattr(skfem, KINDS[kind].functions)(), KINDS[kind].places
    points, weights = get_quadrature(element.refdom, KINDS[kind].order)
    far = np.linalg.norm(element.doflocs[None] - places[:, None], axis=-1)
    values, slopes = zip(*(element.lbasis(points, i) for i in far.argmin(axis=1)), strict=True)
    return np.array(values), np.array(slopes), points, weights


def integrate(
    kind: str, xyz: FloatArray, modulus: FloatArray, poisson: FloatArray, density: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return stiffness (e, 3 n, 3 n) and mass of one direction (e, n, n) of elements of a kind.

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
    size = 3 * gradient.shape[2]
    stiffness = stiffness.reshape(-1, size, size)
    if KINDS[kind].incompatible:
        own = 3 * len(values)
        coupling, bending = stiffness[:, own:, :own], stiffness[:, own:, own:]
        condensed = coupling.swapaxes(1, 2) @ np.linalg.solve(bending, coupling)
        stiffness = stiffness[:, :own, :own] - condensed
    mass = np.einsum("iq,jq,eq,e->eij", values, values, volume, density, optimize=True)
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
        for d in range(3):
            mass += _scatter(inertia, rows[:, d::3], size)
    return stiffness, mass


def _scatter(blocks: FloatArray, rows: IntArray, size: int) -> SparseArray:
    """Return the sum of dense blocks (e, m, m) at their rows (e, m)."""
    short = rows.astype(np.int32)  # half the memory of a model of 10^5 rows
    at = np.broadcast_arrays(short[:, :, None], short[:, None, :])
    entries = (blocks.ravel(), (at[0].ravel(), at[1].ravel()))
    return sp.csc_array(sp.coo_array(entries, shape=(size, size)))
