"""One measurement of the performance report, in a process that does nothing else.

    python benchmarks/scaling.py NAME SIZE

prints one line of JSON: seconds of processor and the memory that was added, of the thing itself
and of the anchor next to it. `python benchmarks/performance.py` calls it for every size.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from diagnosis_cost import MODES as DIAGNOSED_MODES, SOLVES, case_of, lattice as uneven_lattice
from large_structures import brick_ladder, lattice, planar_grid
from processor_time import least, peak, timed
from scipy.optimize import least_squares
from scipy.sparse import csc_array, csc_matrix
from scipy.sparse.linalg import LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.case.writing import write_case
from femubench.core.change.hypothesis import by_themselves, hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.fem.frame import Frame, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import Modes, solve_modes
from femubench.core.modal.factorisation import LU, Cholesky, cholmod_obstacle
from femubench.core.modal.many_changes import Change, modes_of_changes
from femubench.core.modal.measurement import Measurement as Measured
from femubench.core.modal.sensitivity import eigenvalue_sensitivities
from femubench.core.plugin.loader import list_effects
from femubench.core.typing import FloatArray

MODES = 12
Row = dict[str, Any]
Measurement = Callable[[int], Row]


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
    """Return what no shift-invert method can do without: one factorisation and the iteration.

    With the back end that is used here, at a tenth of the first elastic eigenvalue below zero.
    """
    model = Model.of(frame)
    first = float(solve_modes(model, MODES).elastic.eigenvalues[0])
    shift, start = -0.1 * first, np.random.default_rng(0).standard_normal(model.size)

    def factorise_and_iterate() -> None:
        matrix = csc_array(model.stiffness - shift * model.mass)
        factor: LU | Cholesky
        if cholmod_obstacle() is None:
            factor = Cholesky(matrix, spatial=frame.plane == "3d")
            assert factor.factorise(matrix)
        else:
            factor = LU(matrix)
        inverse = LinearOperator(matrix.shape, matvec=factor.solve, dtype=float)
        v0 = factor.solve(model.mass @ start)
        eigsh(model.stiffness, MODES + 2, model.mass, shift, OPinv=inverse, v0=v0, tol=0.0)

    row = timed(factorise_and_iterate)
    row.pop("answer")
    return {"dofs": model.size, **row}


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


def _elements(model: Model, count: int) -> list[Property]:
    labels = model.frame_structure.labels
    names = labels[: min(count, len(labels))]
    found = [Property(name, "EI", (name,)) for name in names]
    return found + [Property(name, "GJ", (name,)) for name in labels[: count - len(found)]]


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
    parameters = [Property(name, "EI", tuple(f"{name}/{k}" for k in range(1, 4))) for name in names]
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


def _masses(model: Model, count: int, *, inside: bool) -> list[Change]:
    """Return masses of half a percent of the whole, each a change of its own."""
    rng, frame = np.random.default_rng(0), model.frame_structure.frame
    members, joints = (rng.choice(len(part), count) for part in (frame.members, frame.joints))
    places = (
        [Place(member=frame.members[i].name, s=0.41) for i in members]
        if inside
        else [Place(joint=frame.joints[i].name) for i in joints]
    )
    return [([PointMass(place, 0.005 * model.total_mass)], []) for place in places]


def _changed(count: int, *, inside: bool) -> Row:
    """Return twelve modes after each of many changes, 27 702 dofs, next to one solution."""
    model = Model.of(lattice(9))
    solution = least(lambda: solve_modes(model, MODES))
    row = timed(modes_of_changes, model, _masses(model, count, inside=inside), MODES)
    assert len(row.pop("answer")) == count
    return {"changes": count, **row, "anchor": solution}


def _one_by_one(count: int) -> Row:
    """Return the same solved change by change: one measured, times their number."""
    model = Model.of(lattice(9))
    ((masses, springs),) = _masses(model, 1, inside=False)
    row = timed(lambda: solve_modes(model.attach(masses, springs), MODES))
    return {"changes": count, "seconds": count * row["seconds"], "added_mb": row["added_mb"]}


def _meshed(joints: int) -> Row:
    """Return the matrices of a grid from its joints and members."""
    frame = planar_grid(joints)
    row = timed(Model.of, frame)
    return {"dofs": row.pop("answer").size, **row}


def _null_jobs(count: int) -> Row:
    """Return what so many jobs cost that do nothing, all processes together."""
    from run_cost import null_job, start_server

    start_server()
    cost = null_job(count)
    return {"jobs": cost.jobs, "seconds": cost.whole, "anchor": 1e-3 * cost.jobs}


def _stored(count: int, what: str) -> Row:
    """Return what it takes to load and rank, or to resume, a run of so many results."""
    import pandas as pd  # noqa: F401 - what is imported is not measured
    import scipy.stats  # noqa: F401
    from store import MEASURED, make

    with tempfile.TemporaryDirectory() as folder:
        store = make(Path(folder), count)
        row = timed(MEASURED[what], store)
    return {"results": row.pop("answer"), **row}


def _diagnosed(joints: int) -> Row:
    """Return a diagnosis of a lattice with a softer member, next to one solution for its modes."""
    case = case_of(uneven_lattice((joints - 1,) * 3, 3), "xyz", 16)
    solution = least(lambda: solve_modes(case.model, DIAGNOSED_MODES))
    row = timed(diagnose, case)
    row.pop("answer")
    known = len(hypotheses_of(case.model, by_themselves(list_effects())))
    beyond = 1e3 * (row["seconds"] - SOLVES * solution) / known
    return {"hypotheses": known, **row, "anchor": solution, "ms": beyond, "peak_mb": peak()}


def _write_ladder(bay: int, folder: Path) -> None:
    """Write a ladder of bricks as a case, with the modes that it has with a weld 200 times softer.

    Ten used modes and two held out, at a corner of each fourth of the rails, three directions each.
    """
    model = brick_ladder(bay)
    stiffness = model.stiffness - 0.995 * model.groups["weld 6a"]
    modes = solve_modes(replace(model, stiffness=stiffness), 12 + 6).elastic
    x, y, z = model.dofs.xyz.T
    at = [np.argmin(abs(x - s * x.max()) + abs(y - side) + z)
          for side in (0.0, y.max()) for s in np.linspace(0.0, 1.0, 5)]  # fmt: skip
    rows = np.concatenate([np.arange(3) + 3 * (row // 3) for row in at])
    sensors = Sensors(tuple(f"S{row}" for row in rows), model.dofs.xyz[rows],
                      tuple(model.dofs.direction[row] for row in rows))  # fmt: skip
    hz, shapes = modes.natural_frequencies[:12], modes.shapes[rows, :12]
    numbers = tuple(range(1, 13))
    std = np.full(shapes.shape, 0.01 * np.abs(shapes).max(axis=0))
    data = Measured(sensors, numbers, hz, 1e-3 * hz, np.full(12, np.nan), shapes, std, None)
    named = "ladder of bricks", "", "computed", folder
    write_case(folder, Case(*named, model, data, numbers[:10], numbers[10:]))


def _read_and_diagnosed(bay: int) -> Row:
    """Return what it takes to read and reduce a ladder of bricks, and what its diagnosis takes."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "ladder"
        # In a process of its own, whose memory is not that of reading.
        writer = multiprocessing.get_context("spawn").Process(
            target=_write_ladder, args=(bay, made)
        )
        writer.start()
        writer.join()
        row = timed(read_case, made)
    case, row["peak_mb"] = row.pop("answer"), peak()
    found = timed(diagnose, case)
    names = [cause.place for cause in found["answer"].causes]
    return {"dofs": case.whole.size, **row, "coordinates": case.model.size,
            "diagnosis": found["seconds"], "named": names, "notes": case.notes}  # fmt: skip


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
    "masses at joints": lambda count: _changed(count, inside=False),
    "masses inside elements": lambda count: _changed(count, inside=True),
    "each change solved by itself": _one_by_one,
    "mesh and matrices of a planar grid": _meshed,
    "jobs that do nothing": _null_jobs,
    "load and leaderboard": lambda count: _stored(count, "load"),
    "resume": lambda count: _stored(count, "resume"),
    "diagnosis of a lattice": _diagnosed,
    "bricks in groups, read and reduced": _read_and_diagnosed,
}


def main() -> None:
    """Measure one thing and print it."""
    name, size = sys.argv[1], int(sys.argv[2])
    with threadpool_limits(1):
        print(json.dumps(MEASUREMENTS[name](size)))


if __name__ == "__main__":
    main()
