"""A large frame thinned out to what an eye can follow: one node a cell, and lines between cells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from femubench.core.case.case import Case
from femubench.core.drawing.wireframe import (
    MOST_NODES,
    Wireframe,
    node_positions,
    to_point,
    wireframe_of,
)
from femubench.core.typing import FloatArray, IntArray

_KEPT = 1000  # nodes of a frame that is thinned out
_SHIFT = 0.37  # of a cell: nodes of a regular structure do not lie between two


@dataclass(frozen=True)
class Thinned:
    """Some nodes of a frame, and where its elements lead from one to another.

    Arguments:
        nodes: by their numbers in `node_positions`, (k,).
        lines: pairs of positions in `nodes`, (l, 2).
        elements: of the frame.
        of: nodes of the frame.
    """

    nodes: IntArray
    lines: IntArray
    elements: int
    of: int

    def wireframe(self, case: Case) -> Wireframe:
        """Return what to draw of the case in place of its joints and members."""
        whole = wireframe_of(case)
        xyz = node_positions(case.model)[self.nodes]
        points = tuple(map(to_point, xyz))
        place = {int(node): k for k, node in enumerate(self.nodes)}
        return replace(
            whole,
            # Without types there are too many joints to name.
            joints=tuple(
                replace(j, node=place[j.node]) for j in whole.joints if j.type and j.node in place
            ),
            members=(),
            nodes=points,
            elements=tuple((int(i), int(j)) for i, j in self.lines),
            element_labels=tuple(f"line {k + 1}" for k in range(len(self.lines))),
            member_of=(),
        )


def thin_nodes(case: Case) -> Thinned | None:
    """Return which nodes of a frame to draw; None where all can be, or where there are no elements.

    Nodes at sensors come before others.
    """
    structure, xyz = case.model.structure, node_positions(case.model)
    if structure is None or len(xyz) <= MOST_NODES:
        return None
    mesh = structure.mesh
    stays = np.setdiff1d(np.arange(len(mesh.xyz)), mesh.oscillators)
    number = np.zeros(len(mesh.xyz), dtype=np.int64)
    number[stays] = np.arange(len(stays))
    seen = np.zeros(0, dtype=np.int64)
    if len(case.measurement.sensors):
        seen = np.unique(cKDTree(xyz).query(case.measurement.sensors.xyz)[1])
    order = np.concatenate([seen, np.setdiff1d(np.arange(len(xyz)), seen)])
    _, first, cell = np.unique(_cells(xyz)[order], return_index=True, return_inverse=True)
    of_node = np.empty(len(xyz), dtype=np.int64)
    of_node[order] = cell.ravel()
    pairs = np.sort(of_node[number[mesh.ends]], axis=1)
    lines = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    return Thinned(order[first], lines, len(mesh.ends), len(xyz))


def _cells(xyz: FloatArray) -> IntArray:
    """Return the number of the cube that each point lies in, as many cubes as may be, (n,)."""
    low, extent = xyz.min(axis=0), float(np.ptp(xyz, axis=0).max())

    def cells(parts: int) -> IntArray:
        place = np.floor((xyz - low) / extent * parts + _SHIFT).astype(np.int64)
        number = np.ravel_multi_index(tuple(place.T), tuple(place.max(axis=0) + 1))
        return np.asarray(number, dtype=np.int64)

    few, many = 1, _KEPT
    while many - few > 1:
        half = (few + many) // 2
        few, many = (half, many) if len(np.unique(cells(half))) <= _KEPT else (few, half)
    return cells(few)
