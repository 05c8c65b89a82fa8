"""One measurement of the performance report, in a process that does nothing else.

    python benchmarks/scaling.py NAME SIZE

prints one line of JSON: seconds of processor and the memory that was added, of the thing itself
and of the anchor beside it. `python benchmarks/performance.py` calls it for every size.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from large_structures import lattice, planar_grid
from scipy.optimize import least_squares
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh, splu
from threadpoolctl import threadpool_limits

from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import Modes, solve_modes
from femubench.core.modal.sensitivity import eigenvalue_sensitivities
from femubench.core.typing import FloatArray

MODES = 12
_SOLVES = 40  # of Lanczos' method, for twelve modes
Row = dict[str, Any]
Measurement = Callable[[int], Row]


def processor() -> float:
    """Return seconds of processor that this process and its ended children have used."""
    return sum(
        sum(resource.getrusage(whose)[:2])
        for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )


def peak() -> float:
    """Return the largest resident memory of this process so far, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def timed(function: Callable[..., Any], *arguments: Any) -> Row:  # noqa: ANN401 - of any function
    """Return seconds and added memory of a call, and what it returned."""
    memory, start = peak(), processor()
    answer = function(*arguments)
    return {"seconds": processor() - start, "added_mb": peak() - memory, "answer": answer}


def _solved(frame: Frame) -> Row:
    """Return the twelve lowest modes as the package finds them."""
    model = Model.of(frame)
    row = timed(solve_modes, model, MODES)
    modes = row.pop("answer")
    return {
        "dofs": model.size,
        **row,
        "hz": list(modes.natural_frequencies[-3:]),
        "peak_mb": peak(),
    }


def _anchor(frame: Frame) -> Row:
    """Return what no shift-invert method can do without: one factorisation and its solves."""
    model = Model.of(frame)
    vector = np.random.default_rng(0).standard_normal(model.size)

    def factorise_and_solve() -> None:
        shifted = csc_matrix(model.stiffness + _shift(model) * model.mass)
        factor = splu(
            shifted, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        x = vector
        for _ in range(_SOLVES):
            x = factor.solve(model.mass @ x)
            x /= np.linalg.norm(x)

    row = timed(factorise_and_solve)
    row.pop("answer")
    return {"dofs": model.size, **row, "peak_mb": peak()}


def _shift(model: Model) -> float:
    return 1e-6 * float(np.median(model.stiffness.diagonal() / model.mass.diagonal()))


def _plain(frame: Frame) -> Row:
    """Return what `eigsh` takes as its own documentation calls it."""
    model = Model.of(frame)
    stiffness, mass = csc_matrix(model.stiffness), csc_matrix(model.mass)
    row = timed(lambda: eigsh(stiffness, MODES, M=mass, sigma=-_shift(model)))
    row.pop("answer")
    return {"dofs": model.size, **row, "peak_mb": peak()}


def _opensees(joints: int) -> Row:
    """Return what OpenSees takes for the modes of a lattice that stands on its corners."""
    import openseespy.opensees as ops

    structure = Structure.build(lattice(joints, standing=True))
    mesh = structure.mesh
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, xyz in enumerate(mesh.xyz):
        ops.node(tag, *map(float, xyz))
    for index, axes in enumerate(np.eye(3)):
        ops.geomTransf("Linear", index, *map(float, axes))
    held = {support.at.joint for support in structure.frame.supports}
    for tag, joint in enumerate(structure.frame.joints):
        if joint.name in held:
            ops.fix(tag, 1, 1, 1, 1, 1, 1)
    first = structure.frame.members[0]
    young, shear = first.material.E, first.material.E / (2.0 * (1.0 + first.material.nu))
    section, line = first.section, first.material.rho * first.section.A
    up = np.abs(mesh.axes[:, 2]).argmax(axis=1)
    for tag, ends in enumerate(mesh.ends):
        ops.element(
            "elasticBeamColumn", tag, int(ends[0]), int(ends[1]), section.A, young, shear,
            section.J, section.Iy, section.Iz, int(up[tag]), "-mass", line, "-cMass",
        )  # fmt: skip
    row = timed(ops.eigen, MODES)
    hz = np.sqrt(np.array(row.pop("answer"))) / (2.0 * np.pi)
    dofs = structure.kinematics.transform.shape[1]
    return {"dofs": dofs, **row, "hz": list(hz[-3:]), "peak_mb": peak()}


def _elements(model: Model, count: int) -> list[Parameter]:
    labels = model.frame_structure.labels
    names = labels[: min(count, len(labels))]
    found = [Parameter(name, "EI", (name,)) for name in names]
    return found + [Parameter(name, "GJ", (name,)) for name in labels[: count - len(found)]]


def gradients(count: int) -> Row:
    """Return the derivatives of twelve eigenvalues for many parameters, 27 702 dofs."""
    model = Model.of(lattice(9))
    parameters = _elements(model, count)
    modes = solve_modes(model, MODES)
    eigenvalue_sensitivities(model, modes, parameters[:1])
    row = timed(eigenvalue_sensitivities, model, modes, parameters)
    solve = timed(solve_modes, Model.of(model.frame_structure.frame), MODES)
    assert row.pop("answer").shape == (MODES, count)
    return {"parameters": count, **row, "anchor": solve["seconds"]}


def differences(count: int) -> Row:
    """Return the same by forward differences: one parameter measured, times their number."""
    model = Model.of(lattice(9))
    parameter = _elements(model, 1)

    def moved() -> FloatArray:
        structure = model.frame_structure.with_values(parameter, [1.0 + 1e-4])
        return solve_modes(Model.of(structure), MODES).eigenvalues

    row = timed(moved)
    return {"parameters": count, "seconds": count * row["seconds"], "added_mb": row["added_mb"]}


def _fitted(joints: int, *, slopes: bool) -> Row:
    """Return a fit of all member stiffnesses of a lattice to ten frequencies by least squares."""
    model = Model.of(lattice(joints, standing=True))
    structure, count = model.frame_structure, 10
    names = [member.name for member in structure.frame.members]
    parameters = [
        Parameter(name, "EI", tuple(f"{name}/{k}" for k in range(1, 4))) for name in names
    ]
    rng = np.random.default_rng(0)

    def solved(values: FloatArray) -> tuple[Model, Modes]:
        changed = Model.of(structure.with_values(parameters, list(values)))
        return changed, solve_modes(changed, count)

    truth = solved(1.0 + 0.1 * rng.standard_normal(len(names)))[1].eigenvalues[:count]

    def residual(values: FloatArray) -> FloatArray:
        change = (solved(values)[1].eigenvalues[:count] / truth - 1.0) / 0.01
        return np.concatenate([change, (values - 1.0) / 0.1])

    def jacobian(values: FloatArray) -> FloatArray:
        changed, modes = solved(values)
        first = modes.take(np.arange(count))
        upper = eigenvalue_sensitivities(changed, first, parameters) / truth[:, None] / 0.01
        # Factors are about the present value.
        return np.vstack([upper / values, np.eye(len(names)) / 0.1])

    jac = jacobian if slopes else "2-point"
    row = timed(lambda: least_squares(residual, np.ones(len(names)), jac=jac, ftol=1e-6))
    found = row.pop("answer")
    return {"parameters": len(names), **row, "cost": found.cost, "peak_mb": peak()}


MEASUREMENTS: dict[str, Measurement] = {
    "modes of a planar grid": lambda joints: _solved(planar_grid(joints)),
    "modes of a lattice": lambda joints: _solved(lattice(joints)),
    "modes of a standing lattice": lambda joints: _solved(lattice(joints, standing=True)),
    "one factorisation, planar grid": lambda joints: _anchor(planar_grid(joints)),
    "one factorisation, lattice": lambda joints: _anchor(lattice(joints)),
    "eigsh as called, planar grid": lambda joints: _plain(planar_grid(joints)),
    "eigsh as called, lattice": lambda joints: _plain(lattice(joints)),
    "OpenSees, standing lattice": _opensees,
    "least squares with derivatives": lambda joints: _fitted(joints, slopes=True),
    "least squares with differences": lambda joints: _fitted(joints, slopes=False),
    "gradients": gradients,
    "forward differences": differences,
}


def main() -> None:
    """Measure one thing and print it."""
    name, size = sys.argv[1], int(sys.argv[2])
    with threadpool_limits(1):
        print(json.dumps(MEASUREMENTS[name](size)))


if __name__ == "__main__":
    main()
