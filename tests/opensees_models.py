"""Models in the memory of OpenSees, read by femubench; writes JSON to a file.

Run as a program of its own, as `opensees_peer.py` is.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import openseespy.opensees as ops

import femubench
from femubench import fem

BEAM = (1e-3, 2e11, 8e10, 1e-6, 1e-6, 2e-6)  # A, E, G, J, Iy, Iz


def bent() -> None:
    """Build a space frame with a rigid arm, a massless node and an equal displacement."""
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 0.5), (0, 0, 2)]
    for tag, xyz in enumerate(places, 1):
        ops.node(tag, *map(float, xyz))
    ops.fix(1, 1, 1, 1, 1, 1, 1)
    ops.geomTransf("Linear", 1, 0, 0, 1)
    ops.geomTransf("Linear", 2, 1, 0, 0)
    ops.element("elasticBeamColumn", 1, 1, 2, *BEAM, 1, "-mass", 7.8, "-cMass")
    ops.element("elasticBeamColumn", 2, 2, 3, *BEAM, 1, "-mass", 7.8, "-cMass")
    ops.element("elasticBeamColumn", 3, 1, 5, *BEAM, 2, "-mass", 7.8)
    ops.rigidLink("beam", 3, 4)
    ops.mass(4, 1, 1, 1, 0, 0, 0)
    ops.equalDOF(2, 5, 1)


def loaded() -> None:
    """Build a plane portal under its load, so that its tangent is another than at first."""
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for tag, (x, y) in enumerate([(0, 0), (0, 3), (4, 3), (4, 0), (2, 3), (2, 3.5), (0, 3)], 1):
        ops.node(tag, float(x), float(y))
    ops.fix(1, 1, 1, 1)
    ops.fix(4, 1, 1, 0)
    ops.fix(7, 0, 1, 0)
    ops.geomTransf("PDelta", 1)
    for tag, (a, b) in enumerate([(1, 2), (2, 5), (5, 3), (3, 4)], 1):
        ops.element("elasticBeamColumn", tag, a, b, 1e-3, 2e11, 1e-6, 1, "-mass", 7.8)
    ops.rigidLink("beam", 5, 6)
    ops.mass(6, 5, 5, 0.1)
    ops.mass(7, 1, 1, 0.0)
    ops.equalDOF(2, 7, 1, 3)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(2, 1e3, -5e4, 0)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGen")
    ops.algorithm("Newton")
    ops.test("NormUnbalance", 1e-6, 10)
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    ops.analyze(1)


def floor() -> None:
    """Build columns under a rigid floor."""
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.geomTransf("Linear", 1, 1, 0, 0)
    for i, (x, y) in enumerate([(-2, -1), (2, -1), (2, 1), (-2, 1)], 1):
        ops.node(i, float(x), float(y), 0.0)
        ops.node(10 + i, float(x), float(y), 3.0)
        ops.fix(i, 1, 1, 1, 1, 1, 1)
        ops.element("elasticBeamColumn", i, i, 10 + i, *BEAM, 1, "-mass", 7.8)
    ops.node(20, 0.0, 0.0, 3.0)
    ops.fix(20, 0, 0, 1, 1, 1, 0)
    ops.mass(20, 500, 500, 0, 0, 0, 900)
    ops.rigidDiaphragm(3, 20, 11, 12, 13, 14)


def plate() -> None:
    """Build a free patch of solids."""
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    ops.nDMaterial("ElasticIsotropic", 1, 7e10, 0.3, 2700.0)
    ops.block3D(3, 2, 1, 1, 1, "stdBrick", 1, 1, 0, 0, 0, 2, 0.3, 0, 0, 3, 0.3, 0.2, 0, 4, 0, 0.2,
                0, 5, 0, 0, 0.1, 6, 0.3, 0, 0.1, 7, 0.3, 0.2, 0.1, 8, 0, 0.2, 0.1)  # fmt: skip


def stated(build: Callable[[], None], count: int) -> dict[str, Any]:
    ops.wipe()
    build()
    before = [ops.nodeDisp(tag) for tag in ops.getNodeTags()]
    model = fem.from_opensees()
    after = [ops.nodeDisp(tag) for tag in ops.getNodeTags()]
    own = ops.eigen("-fullGenLapack", count)
    names = [model.geometry.names[node] for node in model.dofs.node]
    return {
        "own": [value**0.5 for value in own if value > 1.0],
        "read": [value**0.5 for value in femubench.solve_modes(model).eigenvalues if value > 1.0],
        "labels": [
            f"{name}:{direction}"
            for name, direction in zip(names, model.dofs.direction, strict=True)
        ],
        "moved": float(
            max(np.abs(np.subtract(a, b)).max() for a, b in zip(before, after, strict=True))
        ),
    }


def refused(build: Callable[[], None]) -> str:
    ops.wipe()
    build()
    try:
        fem.from_opensees()
    except fem.ModelError as error:
        return str(error)
    return ""


def still() -> None:
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.fix(1, 1)


def wet() -> None:
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    ops.node(1, 0.0, 0.0)
    ops.node(2, 1.0, 0.0, "-ndf", 4)


if __name__ == "__main__":
    found: dict[str, Any] = {
        "bent": stated(bent, 6),
        "loaded": stated(loaded, 4),
        "floor": stated(floor, 3),
        "plate": stated(plate, 12),
        "refused": [refused(build) for build in (lambda: None, still, wet)],
    }
    ops.wipe()
    bent()
    fem.write_matrices(fem.from_opensees(), Path(sys.argv[1]).parent / "matrices")
    Path(sys.argv[1]).write_text(json.dumps(found))
