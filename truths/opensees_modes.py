"""Modes of a frame of beams by OpenSees: reads JSON from stdin, writes JSON to a file.

A program of its own: the library brings a BLAS of its own and prints when it ends.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any


def _fixed(frame: dict[str, Any]) -> list[list[int]]:
    """Return the fixed directions of all nodes: those that are tied to fixed ones too."""
    fixed = [list(flags) for flags in frame["fixed"]]
    for a, b, springs in frame["hinges"]:
        for d in range(1, 7):
            if str(d) not in springs and fixed[a][d - 1]:
                fixed[b][d - 1] = 1
    return fixed


def solved(frame: dict[str, Any]) -> dict[str, Any]:
    """Return eigenvalues in rad^2/s^2, (m,), and the motion of all nodes, (m, nodes, 6)."""
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, (xyz, fixed) in enumerate(zip(frame["nodes"], _fixed(frame), strict=True), 1):
        ops.node(tag, *xyz)
        ops.fix(tag, *fixed)
    for node, mass in frame["masses"]:
        ops.mass(node + 1, mass, mass, mass, 0.0, 0.0, 0.0)
    count = 0
    for count, bar in enumerate(frame["elements"], 1):
        ops.geomTransf("Linear", count, *bar["up"])
        constants = [bar[key] for key in ("A", "E", "G", "J", "I", "I")]
        ends = [node + 1 for node in bar["ends"]]
        rho = ("-mass", bar["rhoA"], "-cMass")
        ops.element("elasticBeamColumn", count, *ends, *constants, count, *rho)
    hinges = list(frame["hinges"])
    for node, springs in frame["grounds"]:
        hinges.append((len(frame["nodes"]) + len(hinges), node, springs))
        ops.node(hinges[-1][0] + 1, *frame["nodes"][node])
        ops.fix(hinges[-1][0] + 1, *[1] * 6)
    for a, b, springs in hinges:
        tied = [d for d in range(1, 7) if str(d) not in springs]
        # What no spring joins is rigid; what is fixed is fixed on either side.
        if a < len(frame["nodes"]) and (free := [d for d in tied if not frame["fixed"][a][d - 1]]):
            ops.equalDOF(a + 1, b + 1, *free)
        materials = []
        for stiffness in springs.values():
            count += 1
            ops.uniaxialMaterial("Elastic", count, stiffness)
            materials.append(count)
        count += 1
        directions = map(int, springs)
        ops.element(*("zeroLength", count, a + 1, b + 1), "-mat", *materials, "-dir", *directions)
    for a, b, stiffness, length in frame["struts"]:
        count += 1
        ops.uniaxialMaterial("Elastic", count, stiffness * length)
        ops.element("truss", count, a + 1, b + 1, 1.0, count)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.integrator("LoadControl", 1.0)
    ops.algorithm("Linear")
    ops.analysis("Static", "-noWarnings")
    values = ops.eigen("-fullGenLapack", frame["count"])
    nodes = range(1, len(frame["nodes"]) + 1)
    motion = [[ops.nodeEigenvector(n, m + 1) for n in nodes] for m in range(len(values))]
    return {"eigenvalues": values, "motion": motion}


def environment() -> dict[str, str] | None:
    """Return the environment in which OpenSees can be imported; None where it is not installed."""
    package = importlib.util.find_spec("openseespylinux")
    if importlib.util.find_spec("openseespy") is None or package is None or not package.origin:
        return None
    # The wheel carries a BLAS that its own libraries do not find without help.
    return os.environ | {"LD_LIBRARY_PATH": str(Path(package.origin).parent / "lib")}


def modes(frame: dict[str, Any]) -> dict[str, Any]:
    """Return `solved` from a process of its own.

    Raises:
        ModuleNotFoundError: when OpenSees is not installed.
    """
    around = environment()
    if around is None:
        raise ModuleNotFoundError("openseespy is not installed", name="openseespy")
    with tempfile.TemporaryDirectory() as scratch:
        output = Path(scratch, "modes.json")
        command = [sys.executable, __file__, str(output)]
        text = json.dumps(frame)
        subprocess.run(command, env=around, input=text, text=True, check=True, capture_output=True)
        found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8"))
        return found


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(solved(json.load(sys.stdin))), encoding="utf-8")
