"""Mass and stiffness of a solid by scikit-fem: quadratic bricks (20 nodes) or tetrahedra (10)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import skfem
from scipy import sparse

from truths.solid import Solid

Array = npt.NDArray[np.float64]
ORDER = 4  # of the quadrature: exact for the products of a straight element's functions


@dataclass(frozen=True)
class Matrices:
    """Hold the matrices of a solid; dof 3 i + d moves node i along x, y, z for d = 0, 1, 2.

    Arguments:
        nodes: (3, n) in the real shape, m.
        straight: (3, n) in the straight description, m.
        stiffness, mass: (3 n, 3 n).
    """

    nodes: Array
    straight: Array
    stiffness: sparse.csc_array
    mass: sparse.csc_array

    @property
    def total_mass(self) -> float:
        """Return the mass in kg."""
        along_x = np.zeros(self.mass.shape[0])
        along_x[::3] = 1.0
        return float(along_x @ (self.mass @ along_x))


def basis_of(solid: Solid, points: Array) -> skfem.CellBasis:
    """Return scikit-fem's basis of a scalar field on a solid with corners `points` (3, n)."""
    bricks = solid.cells.shape[0] == 8
    mesh = (skfem.MeshHex if bricks else skfem.MeshTet)(points, solid.cells, validate=False)
    element = skfem.ElementHexS2() if bricks else skfem.ElementTetP2()
    return skfem.CellBasis(mesh, element, intorder=ORDER)


def interleaved(blocks: dict[tuple[int, int], Any], size: int) -> sparse.csc_array:
    """Return the matrix of a vector field from the blocks of its components."""
    parts = [block.tocoo() for block in blocks.values()]
    row = [3 * p.row.astype(np.int64) + a for (a, _), p in zip(blocks, parts, strict=True)]
    col = [3 * p.col.astype(np.int64) + b for (_, b), p in zip(blocks, parts, strict=True)]
    data = np.concatenate([p.data for p in parts])
    shape = (3 * size, 3 * size)
    return sparse.csc_array((data, (np.concatenate(row), np.concatenate(col))), shape=shape)


def assemble(solid: Solid, real: Array) -> Matrices:
    """Assemble a solid whose corners really lie at `real` (3, n), m.

    Source: linear isotropic elasticity, a(u, v) = lambda div u div v + 2 mu eps(u) : eps(v).
    """
    basis = basis_of(solid, real)
    per_point = np.ones((1, basis.X.shape[-1]))
    shear = solid.modulus / (2 * (1 + solid.poisson))
    lame = shear * 2 * solid.poisson / (1 - 2 * solid.poisson)
    fields = {
        "lam": lame[:, None] * per_point,
        "mu": shear[:, None] * per_point,
    }

    def component(a: int, b: int) -> Any:  # noqa: ANN401 - a sparse matrix of scikit-fem
        @skfem.BilinearForm
        def form(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
            value = w["lam"] * v.grad[a] * u.grad[b] + w["mu"] * v.grad[b] * u.grad[a]
            if a == b:
                value = value + w["mu"] * sum(v.grad[c] * u.grad[c] for c in range(3))
            return value

        return form.assemble(basis, **fields)

    stiff = {(a, b): component(a, b) for a in range(3) for b in range(a, 3)}
    stiff |= {(b, a): stiff[a, b].T for a in range(3) for b in range(a + 1, 3)}
    straight = basis_of(solid, solid.points).doflocs if real is not solid.points else basis.doflocs
    return Matrices(
        nodes=basis.doflocs,
        straight=straight,
        stiffness=interleaved(stiff, basis.N),
        mass=_mass(solid, basis),
    )


def reweighed(matrices: Matrices, solid: Solid, real: Array) -> Matrices:
    """Return the matrices of a solid of other densities, corners at `real` (3, n), m."""
    return replace(matrices, mass=_mass(solid, basis_of(solid, real)))


def _mass(solid: Solid, basis: skfem.CellBasis) -> sparse.csc_array:
    @skfem.BilinearForm
    def inertia(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        return w["rho"] * u * v

    density = solid.density[:, None] * np.ones((1, basis.X.shape[-1]))
    mass = inertia.assemble(basis, rho=density)
    return interleaved({(a, a): mass for a in range(3)}, basis.N)
