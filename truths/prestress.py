"""Stress that a misfit leaves in a solid, and the stiffness that it adds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import skfem
from scipy import sparse

from truths.eigenmodes import System, statics
from truths.elasticity import Matrices, basis_of, interleaved
from truths.solid import Solid

Array = npt.NDArray[np.float64]


def with_misfit(
    solid: Solid, matrices: Matrices, system: System, cells: npt.NDArray[np.bool_], strain: Array
) -> tuple[Matrices, Array]:
    """Return the matrices with the stiffness of the stress that a misfit leaves, and that stress.

    Arguments:
        cells: (cells,) which would be longer by `strain` if they were free.
        strain: (3,) along x, y, z.

    Returns:
        The matrices, and the stress (3, 3, cells, points of quadrature) in Pa.

    Source: initial stress stiffness, int sigma_ab u_c,a v_c,b (Zienkiewicz & Taylor 2000, vol. 2).
    """
    basis = basis_of(solid, solid.points)
    per_point = np.ones((1, basis.X.shape[-1]))
    shear = (solid.modulus / (2 * (1 + solid.poisson)))[:, None] * per_point
    poisson = solid.poisson[:, None]
    lame = shear * 2 * poisson / (1 - 2 * poisson)
    misfit = np.where(cells, 1.0, 0.0)[:, None] * per_point
    load = np.zeros(3 * basis.N)
    for a in range(3):
        stress = (lame * strain.sum() + 2 * shear * strain[a]) * misfit

        @skfem.LinearForm
        def push(v: Any, w: Any, a: int = a) -> Any:  # noqa: ANN401
            return w["stress"] * v.grad[a]

        load[a::3] = push.assemble(basis, stress=stress)
    back = system.observe
    moved = back @ statics(system).solve(back.T @ load)
    slope = np.array([np.asarray(basis.interpolate(moved[a::3]).grad) for a in range(3)])
    strains = (slope + slope.transpose(1, 0, 2, 3)) / 2
    for a in range(3):
        strains[a, a] -= strain[a] * misfit
    found = 2 * shear * strains
    found[range(3), range(3)] += lame * np.trace(strains)

    @skfem.BilinearForm
    def stiffening(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        return sum(w[f"s{a}{b}"] * v.grad[a] * u.grad[b] for a in range(3) for b in range(3))

    fields = {f"s{a}{b}": found[a, b] for a in range(3) for b in range(3)}
    added = stiffening.assemble(basis, **fields)
    stiffness = matrices.stiffness + interleaved({(a, a): added for a in range(3)}, basis.N)
    return replace(matrices, stiffness=sparse.csc_array(stiffness)), found
