"""Natural frequencies of a frame by OpenSeesPy; reads JSON from stdin, writes JSON to a file.

Run as a program of its own: the library brings a BLAS of its own and prints when it ends.
"""

from __future__ import annotations

import json
import sys
from typing import Any


def frequencies(frame: dict[str, Any]) -> list[float]:
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, xyz in enumerate(frame["nodes"], 1):
        ops.node(tag, *xyz)
    for node in frame["fixed"]:
        ops.fix(node + 1, 1, 1, 1, 1, 1, 1)
    for node, mass in frame["masses"]:
        ops.mass(node + 1, mass, mass, mass, 0.0, 0.0, 0.0)
    for tag, element in enumerate(frame["elements"], 1):
        ops.geomTransf("Linear", tag, *element["up"])
        a, b = (node + 1 for node in element["ends"])
        constants = [element[key] for key in ("A", "E", "G", "J", "Iy", "Iz")]
        ops.element("elasticBeamColumn", tag, a, b, *constants, tag, "-mass", element["rhoA"],
                    "-cMass")  # fmt: skip
    return [value**0.5 / 6.283185307179586 for value in ops.eigen("-fullGenLapack", frame["count"])]


if __name__ == "__main__":
    result = frequencies(json.load(sys.stdin))
    with open(sys.argv[1], "w") as stream:
        json.dump(result, stream)
