"""Geometric stiffness of the self-equilibrated stress that a lack of fit of one member leaves.

The second variation of a geometrically exact beam under the internal forces n = (N, Vy, Vz) and
moments m = (T, My, Mz) is the integral of

    -2 n . (r x u') + n . (r x (r x e1)) - m . (r x r') + N (Jp/A) (rx')^2

with the displacement u and the rotation r. Out of plane it is N w'^2 + V phi w' +
M (phi w'' - phi' w') + N (Jp/A) phi'^2, in plane N w'^2. A rigid motion of a frame in equilibrium
costs nothing then, which N w'^2 alone does not give out of plane once members meet askew.

Source: strains and rotations of Simo & Vu-Quoc (1986).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.assembly import plan_assembly
from femubench.core.fem.attachments import brace_lines, brace_motion
from femubench.core.fem.beam import rigid_transform
from femubench.core.fem.interpolation import GAUSS, cubic_rates, interpolation
from femubench.core.fem.statics import StressState, statics_of
from femubench.core.typing import FloatArray, SparseArray

if TYPE_CHECKING:
    from femubench.core.fem.structure import Structure

_AT_ONCE = 20000  # elements whose matrices are held, all states together


def preload_stiffness(structure: Structure, member: str, force: float) -> SparseArray:
    """Return the geometric stiffness of one preload on the free dofs, sparse (n, n), N/m, N, N m.

    It is linear in the force. The state of stress is that of the frame as it is described:
    parameters set by `Structure.with_values` leave it alone.

    Arguments:
        structure: a meshed frame.
        member: the member with the lack of fit.
        force: the normal force of largest magnitude anywhere in the frame in N, with the sign
            of the force in `member`, tension positive.

    Raises:
        ModelError: when the member is unknown or the frame is not redundant there.
    """
    return force * preload_stiffnesses(structure, [member])[0]


def preload_stiffnesses(structure: Structure, members: Sequence[str]) -> tuple[SparseArray, ...]:
    """Return the geometric stiffness of a preload of 1 N in each of some members.

    Arguments:
        structure: a meshed frame.
        members: as for `preload_stiffness`; all at once take little more time than one.

    Raises:
        ModelError: when a member is unknown or the frame is not redundant there.
    """
    states = [statics_of(structure).state(member) for member in members]
    count = len(structure.mesh.ends)
    together = max(_AT_ONCE // count, 1)
    found = []
    for i, state in enumerate(states):
        if i % together == 0:
            several = _geometric(structure, states[i : i + together])
        blocks = several[i % together]
        total = structure.plan.assemble(blocks.reshape(count, 12, 12))
        for given, part in (
            (structure.mesh.connections, _connections),
            (structure.frame.braces, _braces),
        ):
            if given:
                rows, forms = part(structure, state)
                total = total + plan_assembly(rows, forms.shape[1]).assemble(forms)
        found.append(total)
    return tuple(found)


def _geometric(structure: Structure, states: Sequence[StressState]) -> FloatArray:
    """Return the geometric matrices of all elements in all states, (n_states, n, 12, 12)."""
    if not states:
        return np.zeros((0, len(structure.mesh.ends), 12, 12))
    force, moment = (np.concatenate([getattr(s, n) for s in states]) for n in ("force", "moment"))
    together = replace(states[0], force=force, moment=moment)
    return geometric_matrices(structure, together).reshape(len(states), -1, 12, 12)


def redundant_members(structure: Structure) -> tuple[str, ...]:
    """Return the members whose lack of fit the rest of the frame resists, in the frame's order."""
    try:
        resisting = statics_of(structure).resisting()
    except ModelError:
        return ()
    members = structure.frame.members
    return tuple(m.name for m, found in zip(members, resisting, strict=True) if found)


def _skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices of the products vector x ..., (n, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0)


def _symmetric(matrices: FloatArray) -> FloatArray:
    return 0.5 * (matrices + np.swapaxes(matrices, 1, 2))


def _turned(force: FloatArray, line: FloatArray) -> FloatArray:
    """Return the form force . (r x (r x line)) of a rotation r, (n, 3, 3)."""
    work = np.einsum("ni,ni->n", force, line)[:, None, None]
    return np.asarray(_symmetric(force[:, :, None] * line[:, None, :]) - work * np.eye(3))


def geometric_matrices(structure: Structure, state: StressState) -> FloatArray:
    """Return the local geometric stiffness matrices of the elements, (s n, 12, 12).

    Arguments:
        structure: a meshed frame of n elements.
        state: its internal forces; of s states, those of one after the other.
    """
    mesh, force = structure.mesh, state.force
    states = len(force) // len(mesh.ends)
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    length = np.tile(length, states)
    first, second = np.tile(mesh.rigid, (states, 1)).T
    L = length - first - second
    sections = [member.section for member in structure.frame.members]
    radius = np.array([section.Jp / section.A for section in sections])[mesh.member]
    radius = np.tile(radius, states)
    axis = np.broadcast_to([1.0, 0.0, 0.0], force.shape)
    turned = _turned(force, axis)
    total = np.zeros((len(L), 12, 12))
    for x, weight in GAUSS:
        moment = state.moment + (length - first - x * L)[:, None] * np.cross(axis, force)
        total += (weight * L)[:, None, None] * _density(x, L, force, moment, turned, radius)
    transform = rigid_transform(first, second)
    total = np.swapaxes(transform, 1, 2) @ total @ transform
    for rotation, rigid in ((slice(3, 6), first), (slice(9, 12), second)):
        total[:, rotation, rotation] -= rigid[:, None, None] * turned
    return total


def _density(
    x: float,
    L: FloatArray,
    force: FloatArray,
    moment: FloatArray,
    turned: FloatArray,
    radius: FloatArray,
) -> FloatArray:
    """Return the second variation per length at a share of the length, (n, 12, 12)."""
    zero = np.zeros_like(L)
    rotation = interpolation(x, L, zero, zero)[:, 3:]
    rates = cubic_rates(x, L)
    slope, bend = rates[:, :3], rates[:, 3:]
    back = np.swapaxes(rotation, 1, 2)
    mixed = -2.0 * np.swapaxes(slope, 1, 2) @ _skew(force) @ rotation
    mixed -= np.swapaxes(bend, 1, 2) @ _skew(moment) @ rotation
    twist = bend[:, :1]
    wagner = (force[:, 0] * radius)[:, None, None] * np.swapaxes(twist, 1, 2) @ twist
    return _symmetric(mixed) + back @ turned @ rotation + wagner


def _connections(structure: Structure, state: StressState) -> tuple[SparseArray, FloatArray]:
    """Return motions of base and hanging node of the joint springs, and their forms.

    A spring behind a rigid arm is the same as a beam of one point: u' dx is the relative
    displacement, r' dx the relative rotation, e1 dx the arm.
    """
    connections = structure.mesh.connections
    pairs = np.array([(c.base, c.node) for c in connections], dtype=np.int64).reshape(-1, 2)
    arm = np.array([c.arm for c in connections]).reshape(-1, 3)
    rows = (6 * pairs[:, :, None] + np.arange(6)).ravel()
    force, moment = _skew(state.spring_force), _skew(state.spring_moment)
    blocks = np.zeros((len(pairs), 12, 12))
    blocks[:, 3:6, 3:6] = _turned(state.spring_force, arm)
    blocks[:, 6:9, 3:6], blocks[:, 0:3, 3:6] = -2.0 * force, 2.0 * force
    blocks[:, 9:12, 3:6] = -moment
    return structure.kinematics.transform[rows], _symmetric(blocks)


def _braces(structure: Structure, state: StressState) -> tuple[SparseArray, FloatArray]:
    """Return relative motions of the ends of the braces, and their forms."""
    unit, length = brace_lines(structure.frame)
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    return brace_motion(structure), (state.brace_force / length)[:, None, None] * across
