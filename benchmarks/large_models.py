"""Twelve modes of large frames: processor seconds against rivals, and the memory they add.

    python benchmarks/large_models.py --rivals             # lattice of 27 702 dofs
    python benchmarks/large_models.py lattice 19           # 275 082 dofs
    python benchmarks/large_models.py grid 226 --least 1   # 1 068 528 dofs

A rival is measured in the same process, so that the ratio holds on a busy machine too. `anchor` is
one factorisation a little below the known first eigenvalue and the iteration on it, nothing else.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import psutil
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from femubench.core.fem.frame import Frame, Joint, Material, Member, Place, Support
from femubench.core.fem.model import Model
from femubench.core.fem.sections import round_tube
from femubench.core.modal import sparse_eigen
from femubench.core.modal.factorisation import LU, Cholesky, cholmod_obstacle, solver_name
from femubench.core.modal.sparse_eigen import lowest_eigenpairs

COUNT = 12
SPACING = (0.5, 0.45, 0.4)
TUBE, ALUMINIUM = round_tube(0.02, 0.002), Material(70e9, 0.3, 2700.0)
MEMORY = 1024.0  # KiB of ru_maxrss in a MiB


def lattice_frame(kind: str, side: int, *, held: bool = False) -> Frame:
    """Return bars between so many joints a side: 3 elements in space, 4 in a plane."""
    sides = (side, side, side if kind == "lattice" else 1)
    plane, elements = ("3d", 3) if kind == "lattice" else ("out-of-plane", 4)
    joints, members = [], []
    for at in np.ndindex(sides):
        joints.append(Joint(str(at), tuple(float(i * s) for i, s in zip(at, SPACING, strict=True))))
        for axis in range(3):
            other = tuple(int(i) + (axis == k) for k, i in enumerate(at))
            if other[axis] < sides[axis]:
                ends = (str(at), str(other))
                members.append(Member(f"m{len(members)}", ends, elements, TUBE, ALUMINIUM))
    fixed = ("x", "y", "z", "rx", "ry", "rz") if plane == "3d" else ("z", "rx", "ry")
    supports = (Support(Place(joint=str((0, 0, 0))), fixed),) if held else ()
    return Frame(plane, "euler-bernoulli", tuple(joints), tuple(members), supports=supports)


def seconds(work: Callable[[], object], least: int = 3) -> float:
    """Return the least processor time of several runs."""
    taken = []
    for _ in range(least):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return min(taken)


def peak() -> float:
    """Return the largest memory of this process so far in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEMORY


def one_factorisation(model: Model, first: float, rigid: int) -> None:
    """Factorise once and iterate on it, with the back end that is used here."""
    matrix = sp.csc_array(model.stiffness + 0.1 * first * model.mass)
    factor: LU | Cholesky
    if sparse_eigen.cholmod_obstacle() is None:
        factor = Cholesky(matrix, spatial=model.dofs.axes is None and "x" in model.dofs.direction)
        assert factor.factorise(matrix)
    else:
        factor = LU(matrix)
    inverse = LinearOperator(matrix.shape, matvec=factor.solve, dtype=float)
    start = factor.solve(model.mass @ np.random.default_rng(0).standard_normal(model.size))
    eigsh(model.stiffness, COUNT + 2, model.mass, -0.1 * first, OPinv=inverse, v0=start, tol=0.0)


def plain_eigsh(model: Model, first: float) -> None:
    """Ask SciPy as its users do, with the shift that is best for it."""
    eigsh(model.stiffness, COUNT, model.mass, -0.1 * first)


def opensees(model: Model) -> list[float]:
    """Return the eigenvalues that OpenSees finds on the same mesh, which must be held."""
    import openseespy.opensees as ops

    mesh = model.frame_structure.mesh
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, xyz in enumerate(mesh.xyz.tolist(), 1):
        ops.node(tag, *xyz)
    ops.fix(1, *[1] * 6)
    for tag, across in enumerate(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), 1):
        ops.geomTransf("Linear", tag, *across)
    E, G = ALUMINIUM.E, ALUMINIUM.E / (2.0 * (1.0 + ALUMINIUM.nu))
    stiffness = (TUBE.A, E, G, TUBE.J, TUBE.Iy, TUBE.Iz)
    for tag, (a, b) in enumerate(mesh.ends.tolist(), 1):
        upright = bool(abs(mesh.xyz[b, 2] - mesh.xyz[a, 2]) > 1e-6)
        mass = ("-mass", ALUMINIUM.rho * TUBE.A, "-cMass")
        ops.element("elasticBeamColumn", tag, a + 1, b + 1, *stiffness, 1 + upright, *mass)
    return list(ops.eigen(COUNT))


def measured(kind: str, side: int, least: int, rivals: bool) -> dict[str, float]:
    """Return seconds and memory by name; `_x` is how many times the anchor something takes."""
    model = Model.of(lattice_frame(kind, side))
    before = psutil.Process().memory_info().rss / MEMORY**2
    own = seconds(lambda: lowest_eigenpairs(model, COUNT), least)
    found = {"dofs": model.size, "seconds": own, "added_mib": peak() - before, "mib": peak()}
    eigenvalues, _ = lowest_eigenpairs(model, COUNT)
    rigid = int(np.sum(np.abs(eigenvalues) < 1e-6 * eigenvalues[-1]))
    first = float(eigenvalues[rigid])
    found["anchor"] = seconds(partial(one_factorisation, model, first, rigid), least)
    if rivals:
        found["eigsh"] = seconds(partial(plain_eigsh, model, first), 1)
        held = Model.of(lattice_frame(kind, side, held=True))
        found["held"] = seconds(lambda: lowest_eigenpairs(held, COUNT), least)
        rival: list[float] = []
        found["opensees"] = seconds(lambda: rival.extend(opensees(held)), 1)
        assert np.allclose(rival, lowest_eigenpairs(held, COUNT)[0], rtol=1e-5)
    return found


def main() -> None:
    """Print the figures of one structure."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("kind", nargs="?", choices=("lattice", "grid"), default="lattice")
    parser.add_argument("side", nargs="?", type=int, default=9)
    parser.add_argument("--least", type=int, default=3, help="runs, of which the least counts")
    parser.add_argument("--rivals", action="store_true", help="eigsh and OpenSees too: minutes")
    parser.add_argument("--superlu", action="store_true", help="without CHOLMOD")
    given = parser.parse_args()
    if given.superlu:
        sparse_eigen.cholmod_obstacle = lambda: "left out"
    print("SuperLU" if given.superlu else solver_name())
    with threadpool_limits(1):
        cholmod_obstacle()
        found = measured(given.kind, given.side, given.least, given.rivals)
    for name, value in found.items():
        print(f"{name:10} {value:12.3f}")
    print(f"over the anchor: {found['seconds'] / found['anchor']:.2f}")
    if given.rivals:
        print(f"eigsh: {found['eigsh'] / found['seconds']:.0f} times as long")
        print(f"OpenSees: {found['opensees'] / found['held']:.0f} times as long")


if __name__ == "__main__":
    main()
