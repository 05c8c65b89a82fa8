"""The model that OpenSees has in memory, as matrices with labels."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from femubench.core.case.nodes import matrix_model
from femubench.core.errors import ModelError, require
from femubench.core.fem.model import Model
from femubench.core.typing import FloatArray

# Dimensions of space and degrees of freedom a node -> their directions.
_MOTIONS: dict[tuple[int, int], tuple[str, ...]] = {
    (1, 1): ("x",),
    (2, 2): ("x", "y"),
    (2, 3): ("x", "y", "rz"),
    (3, 3): ("x", "y", "z"),
    (3, 6): ("x", "y", "z", "rx", "ry", "rz"),
}
_MOST = 3_000  # rows of a matrix that OpenSees prints whole, as Python numbers
_ASYMMETRY = 1e-8  # of the largest entry


def from_opensees() -> Model:
    """Return the model that `openseespy.opensees` has in memory, in the units of its script.

    Mass and the tangent stiffness of the present state, on the degrees of freedom that are left
    once `fix`, `equalDOF`, `rigidLink` and `rigidDiaphragm` have taken theirs: a node that follows
    another has no rows. Rows bear the tags of the nodes. The state stays as it is; commands of an
    analysis must be given anew afterwards. No script of a case folder is ever run: build the model
    in Python, call this, and keep it with `fem.write_matrices`.

    Raises:
        InputError: when OpenSeesPy is not installed.
        ModelError: when there is no model, nothing in it can move, or its nodes have degrees of
            freedom that are no displacements and rotations.

    Examples:
        >>> fem.from_opensees()  # doctest: +SKIP
        Model: 12 degrees of freedom, matrices from files
    """
    require("openseespy", "opensees", "from_opensees")
    ops: Any = import_module("openseespy.opensees")
    tags = [int(tag) for tag in ops.getNodeTags() or ()]
    if not tags:
        raise ModelError("OpenSees has no model in memory")
    if sum(int(ops.getNDF(tag)[0]) for tag in tags) > _MOST:
        what = f"the model of {len(tags)} nodes in OpenSees is too large"
        raise ModelError(f"{what}: its matrices are printed whole, at most {_MOST} rows")
    held = {int(tag): set(ops.getFixedDOFs(int(tag))) for tag in ops.getFixedNodes() or ()}
    led = {
        int(tag): set(ops.getConstrainedDOFs(int(tag))) for tag in ops.getConstrainedNodes() or ()
    }
    none: set[int] = set()
    if not any(
        len(held.get(tag, none) | led.get(tag, none)) < int(ops.getNDF(tag)[0]) for tag in tags
    ):  # to solve for nothing ends the whole process
        raise ModelError("nothing can move in the model of OpenSees")
    ops.wipeAnalysis()
    try:
        mass, stiffness = _matrices(ops)
        return matrix_model(mass, stiffness, *_labels(ops, tags, len(mass)))
    finally:
        ops.wipeAnalysis()


def _labels(
    ops: Any,  # noqa: ANN401 - a module
    tags: Sequence[int],
    size: int,
) -> tuple[list[str], list[str], FloatArray]:
    """Return node, direction and place of every equation."""
    nodes, directions, places = [""] * size, [""] * size, np.full((size, 3), np.nan)
    led = {int(tag) for tag in ops.getConstrainedNodes() or ()}
    for tag in tags:
        space, count = int(ops.getNDM(tag)[0]), int(ops.getNDF(tag)[0])
        motions = _MOTIONS.get((space, count))
        if motions is None:
            what = f"node {tag} has {count} degrees of freedom in {space} dimensions"
            raise ModelError(f"{what}; known are displacements and rotations")
        follow = {int(dof) for dof in ops.getConstrainedDOFs(tag)} if tag in led else set()
        own = [name for i, name in enumerate(motions, 1) if i not in follow]
        # Behind those of its own stand the equations of the node that it follows.
        equations = [int(row) for row in ops.nodeDOFs(tag)[: len(own)]]
        coordinates = ops.nodeCoord(tag)
        for direction, row in zip(own, equations, strict=True):
            if row >= 0:
                nodes[row], directions[row] = str(tag), direction
                places[row] = [*coordinates, *[0.0] * (3 - len(coordinates))]
    if "" in directions:
        raise ModelError("OpenSees has equations that belong to no node")
    return nodes, directions, places


def _matrices(ops: Any) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401 - a module
    """Return mass and tangent stiffness, dense (n, n) each; equations are numbered afterwards."""
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormUnbalance", 1e-6, 1)
    ops.algorithm("Linear")
    # Mass plus stiffness can be solved where one of them cannot. Such a step of no time numbers
    # the equations and moves nothing.
    ops.integrator("GimmeMCK", 1.0, 0.0, 1.0, 0.0)
    ops.analysis("Transient", "-noWarnings")
    ops.analyze(1, 0.0)
    size = int(ops.systemSize())
    found = []
    for factors in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):  # mass, damping, stiffness
        ops.integrator("GimmeMCK", *factors, 0.0)
        matrix = np.array(ops.printA("-ret"), dtype=float).reshape(size, size)
        if np.abs(matrix - matrix.T).max() > _ASYMMETRY * np.abs(matrix).max():
            raise ModelError("a matrix of OpenSees is not symmetric")
        found.append(0.5 * (matrix + matrix.T))
    return found[0], found[1]
