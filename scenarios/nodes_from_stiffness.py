"""Directions, nodes and positions of rows that nobody labelled, from motions that cost no force.

A bridge that is held lengthwise alone is free to shift across and upwards and to turn about two
axes. Which rows shift together says where they go; by how much a row moves when the whole turns
says where it lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femubench.fem import FloatArray

_Words = np.ndarray[tuple[int], np.dtype[np.object_]]
_FREE = 1e-9  # of the stiffness of a row
_SAME = 1e-4


@dataclass(frozen=True)
class Row:
    """Where a row of the matrices sits: number of its node, direction and position."""

    node: int
    direction: str
    xyz: tuple[float, float, float]


def label_rows(
    stiffness: FloatArray, turns: NDArray[np.bool_], across: Sequence[int], upright: Sequence[int]
) -> list[Row] | None:
    """Return what the rows are; None where the stiffness does not tell.

    Arguments:
        stiffness: of the structure without the springs that hold it across and upwards, (n, n).
        turns: which rows are rotations, (n,).
        across: rows that go along y.
        upright: rows that go along z; the first are at nodes that do not move lengthwise.
    """
    # Motions without force: those in which no row turns, and the others.
    scale = 1.0 / np.sqrt(stiffness.diagonal())
    values, vectors = la.eigh(scale[:, None] * stiffness * scale)
    motions = scale[:, None] * vectors[:, np.abs(values) < _FREE]
    _, size, mix = la.svd(motions[turns])
    size = np.append(size, np.zeros(len(mix) - len(size)))
    straight = size < _FREE * size.max(initial=1e-300)
    shifts, rolls = motions @ mix[straight].T, motions @ mix[~straight].T
    if shifts.shape[1] != 2 or rolls.shape[1] != 2:
        return None
    kind = _shifted(shifts, turns, across[0], upright[0])
    axes = _axes(rolls[turns])
    if axes is None:
        return None
    rolls = rolls @ la.inv(axes)
    y, x = kind == "y", kind == "x"
    # About x the rows along y move, about y those along x.
    if np.ptp(rolls[y, 0]) < np.ptp(rolls[y, 1]):
        rolls = rolls[:, ::-1]
    near = [np.abs(rolls - way).max(axis=1) < _SAME for way in ([1.0, 0.0], [0.0, 1.0])]
    kind[turns] = np.select([near[0][turns], near[1][turns]], ["rx", "ry"], "rz")
    held = {*across[:2], *upright[:2]}  # rows of nodes that do not move along x
    # The rows come one node after the other, in any order within.
    nodes: list[list[int]] = [[]]
    for row, direction in enumerate(kind):
        known = [kind[other] for other in nodes[-1]]
        if direction in known or (direction == "x" and held & set(nodes[-1])):
            nodes.append([])
        nodes[-1].append(row)
    wanted = {"y", "z", "rx", "ry", "rz"}
    if not x.any() or not all(wanted <= {kind[row] for row in rows} for rows in nodes):
        return None
    found: list[Row] = []
    for number, rows in enumerate(nodes):
        at = {kind[row]: row for row in rows}
        along, up = -rolls[at["z"], 1], -rolls[at["y"], 0]
        xyz = (float(along), float(rolls[at["z"], 0]), float(up))
        found += [Row(number, str(kind[row]), xyz) for row in rows]
    return found


def _axes(rolls: FloatArray) -> FloatArray | None:
    """Return how rows turn about either axis in two motions, (2, 2); None for more axes."""
    size = np.abs(rolls).max()
    turning = rolls[np.abs(rolls).max(axis=1) > _SAME * size]
    first = np.abs(turning - turning[0]).max(axis=1) < _SAME * size
    other = turning[~first]
    if not len(other) or np.ptp(other, axis=0).max() > _SAME * size:
        return None
    return np.array([turning[first].mean(axis=0), other.mean(axis=0)])


def _shifted(shifts: FloatArray, turns: NDArray[np.bool_], across: int, upright: int) -> _Words:
    """Return y, z, x for rows that shift with one, with another and not at all, (n,)."""
    shifts = shifts / np.abs(shifts).max()
    like = [np.abs(shifts - shifts[row]).max(axis=1) < _SAME for row in (across, upright)]
    kind: _Words = np.select(like, ["y", "z"], "x").astype(object)
    kind[turns] = "r"
    return kind
