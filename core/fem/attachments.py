"""Braces, oscillators, and the stiffness of a meshed frame with all of its springs."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.frame import ACTIVE, Frame
from femubench.core.fem.kinematics import point_rows
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.typing import FloatArray, IntArray, SparseArray


def check_attachments(frame: Frame) -> None:
    """Check braces, oscillators and the motions of links.

    Raises:
        ModelError: for a motion of a link that the plane does not have, a brace out of plane or
            without two joints, or an oscillator without mass or frequency or in a direction that
            is no translation of the plane.
    """
    for link in frame.links:
        if not set(link.motions) <= set(ACTIVE[frame.plane]):
            what = f"a link has the motions {', '.join(ACTIVE[frame.plane])} in this plane"
            raise ModelError(what, link)
    for brace in frame.braces:
        if frame.plane == "out-of-plane" and not brace.direction:
            raise ModelError("a brace does nothing out of plane", brace)
        if brace.direction and brace.direction not in set(ACTIVE[frame.plane]) & set(
            DIRECTIONS[:3]
        ):
            raise ModelError(f"nothing moves along {brace.direction!r} in this plane", brace)
        if brace.ends[0] == brace.ends[1] or not set(brace.ends) <= set(frame.joint_index):
            raise ModelError(f"a brace needs two joints, not {' and '.join(brace.ends)}", brace)
    allowed = [name for name in ACTIVE[frame.plane] if len(name) == 1]
    for item in frame.oscillators:
        if item.direction.lstrip("+-") not in allowed:
            expected = ", ".join(allowed)
            what = f"an oscillator moves in one of {expected}, not {item.direction!r}"
            raise ModelError(what, item)
        if not (item.mass > 0.0 and item.frequency > 0.0):
            what = f"the oscillator at {item.at} needs a mass and a frequency above 0"
            raise ModelError(what, item)


def brace_ends(frame: Frame) -> IntArray:
    """Return the joint numbers of the ends of every brace, (n_braces, 2)."""
    index = frame.joint_index
    ends = [[index[name] for name in brace.ends] for brace in frame.braces]
    return np.array(ends, dtype=np.int64).reshape(-1, 2)


def brace_lines(frame: Frame) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (n_braces, 3) and lengths in m (n_braces,) of the braces.

    One in a global direction does not turn with its ends: its length is infinite.
    """
    ends = brace_ends(frame)
    along = frame.corners[ends[:, 1]] - frame.corners[ends[:, 0]]
    length = np.linalg.norm(along, axis=1)
    for i, brace in enumerate(frame.braces):
        if brace.direction:
            along[i], length[i] = np.eye(3)[DIRECTIONS.index(brace.direction)], 1.0
    fixed = np.array([bool(brace.direction) for brace in frame.braces], dtype=bool)
    return along / length[:, None], np.where(fixed, np.inf, length)


def brace_motion(structure: MeshedFrame) -> SparseArray:
    """Return the motion of the second end of every brace less the first, (3 n_braces, n)."""
    ends = brace_ends(structure.frame)
    first, second = ((6 * ends[:, [k]] + np.arange(3)).ravel() for k in (0, 1))
    transform = structure.kinematics.transform
    return transform[second] - transform[first]


def brace_rows(structure: MeshedFrame) -> SparseArray:
    """Return the elongation of every brace from free dofs, (n_braces, n)."""
    unit, _ = brace_lines(structure.frame)
    count = len(unit)
    place = (np.repeat(np.arange(count), 3), np.arange(3 * count))
    return sp.csr_array((unit.ravel(), place), shape=(count, 3 * count)) @ brace_motion(structure)


def elastic_stiffness(structure: MeshedFrame) -> SparseArray:
    """Return the stiffness of elements, joint springs, springs to ground and braces, (n, n)."""
    properties = structure.properties
    stiffness = structure.plan.assemble_from(lambda e: properties.take(e).stiffness_matrices())
    if len(structure.springs):
        rows = structure.spring_rows
        each = rows.data * np.repeat(structure.springs, np.diff(rows.indptr))
        pull = sp.csr_array((each, rows.indices, rows.indptr), shape=rows.shape)
        stiffness = stiffness + pull.T @ rows
    if structure.frame.springs:
        stiffness = stiffness + structure.once(
            "springs",
            structure.rests_on("springs"),
            lambda: structure.assemble_attachments((), structure.frame.springs)[1],
        )
    if structure.frame.braces:
        rows = brace_rows(structure)
        each = np.array([brace.stiffness for brace in structure.frame.braces], dtype=float)
        stiffness = stiffness + rows.T @ sp.diags_array(each) @ rows
    return stiffness


def oscillator_matrices(structure: MeshedFrame) -> tuple[SparseArray, SparseArray]:
    """Return mass and stiffness of the oscillators, (n, n) each."""
    moving, stretch, masses, stiffness = [], [], [], []
    for node, item in zip(structure.mesh.oscillators, structure.frame.oscillators, strict=True):
        at = int(node)
        transform = structure.kinematics.transform
        point = point_rows(structure.frame, structure.mesh, structure.properties, item.at)
        place = point[:3] @ transform
        direction = DIRECTIONS.index(item.direction.lstrip("+-"))
        own = transform[6 * at + direction : 6 * at + direction + 1]
        active = np.flatnonzero(structure.active_local[:3])
        others = place[active[active != direction] if item.crosswise else active[:0]]
        motion, spring = sp.vstack([own, others]), own - place[direction : direction + 1]
        moving.append(motion)
        stretch.append(spring)
        masses += [item.mass] * motion.shape[0]
        stiffness.append(item.mass * (2.0 * np.pi * item.frequency) ** 2)
    rows, springs = sp.csr_array(sp.vstack(moving)), sp.csr_array(sp.vstack(stretch))
    mass = rows.T @ sp.diags_array(np.array(masses)) @ rows
    return mass, springs.T @ sp.diags_array(np.array(stiffness)) @ springs
