"""Frequencies of a spatial frame against OpenSeesPy, an independent program."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femubench.core.fem.frame import Frame, Place, PointMass, Support
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import solve_modes

Peer = Callable[[dict[str, Any]], list[float]]


FrameBuilder = Callable[..., Frame]


def opensees_environment() -> dict[str, str]:
    """Return the environment in which OpenSees runs in a process of its own, or skip the test."""
    package = importlib.util.find_spec("openseespylinux")
    if importlib.util.find_spec("openseespy") is None or package is None or not package.origin:
        pytest.skip("openseespy is not installed on this machine")
    # The wheel carries a BLAS that its own libraries do not find without help.
    bundled = str(Path(package.origin).parent / "lib")
    environment = os.environ | {"LD_LIBRARY_PATH": bundled}
    probe = subprocess.run(
        [sys.executable, "-c", "import openseespy.opensees"],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if probe.returncode:
        pytest.skip(f"openseespy cannot be imported: {probe.stderr.strip().splitlines()[-1]}")
    return environment


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Peer:
    """Return a call to OpenSees in a process of its own."""
    environment = opensees_environment()
    script = Path(__file__).with_name("opensees_peer.py")
    output = tmp_path_factory.mktemp("peer") / "frequencies.json"

    def call(frame: dict[str, Any]) -> list[float]:
        subprocess.run(
            [sys.executable, str(script), str(output)],
            env=environment, input=json.dumps(frame), text=True, check=True, capture_output=True,
        )  # fmt: skip
        result: list[float] = json.loads(output.read_text())
        return result

    return call


def description(frame: Frame, count: int) -> dict[str, Any]:
    """Return the frame cut into elements, from the frame's own description and nothing else."""
    names = [joint.name for joint in frame.joints]
    nodes = [list(joint.xyz) for joint in frame.joints]
    elements = []
    for member in frame.members:
        a, b = (names.index(name) for name in member.ends)
        first, last = np.array(nodes[a]), np.array(nodes[b])
        chain = [a]
        for k in range(1, member.elements):
            nodes.append(list(first + k / member.elements * (last - first)))
            chain.append(len(nodes) - 1)
        chain.append(b)
        s, m = member.section, member.material
        constants = {"A": s.A, "E": m.E, "G": m.G, "J": s.J, "Iy": s.Iy, "Iz": s.Iz}
        constants |= {"rhoA": m.rho * s.A, "up": member.up}
        elements += [constants | {"ends": pair} for pair in pairwise(chain)]
    return {
        "nodes": nodes,
        "elements": elements,
        "fixed": [names.index(str(support.at.joint)) for support in frame.supports],
        "masses": [(names.index(str(mass.at.joint)), mass.mass) for mass in frame.masses],
        "count": count,
    }


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_skew_spatial_frame_agrees_with_opensees(
    peer: Peer, portal: FrameBuilder, seed: int
) -> None:
    clamp = ("x", "y", "z", "rx", "ry", "rz")
    frame = portal(
        seed,
        "euler-bernoulli",
        elements=3,
        supports=tuple(Support(Place(joint=j), clamp) for j in ("J0", "J6")),
        masses=(PointMass(Place(joint="J3"), 0.8),),
    )
    # OpenSees takes the torsion constant for the polar moment, so let them be the same.
    members = tuple(
        replace(member, section=replace(member.section, J=member.section.Jp))
        for member in frame.members
    )
    frame = replace(frame, members=members)
    found = solve_modes(Model.of(frame)).natural_frequencies[:30]
    np.testing.assert_allclose(found, peer(description(frame, 30)), rtol=1e-6)
