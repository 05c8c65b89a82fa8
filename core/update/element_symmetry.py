"""What an element's own symmetry leaves of its generic stiffness, derived from the operations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Plane
from femubench.core.typing import BoolArray, FloatArray

Symmetry = Literal["none", "half-turn", "mirror", "full"]

_MIRROR_AXIS = 0  # the mid-plane is normal to the element
# A planar element is turned end for end in its plane; a spatial one about both transverse axes, so
# that the class does not depend on which of them is called z.
_TURN_AXES: dict[Plane, tuple[int, ...]] = {"out-of-plane": (2,), "in-plane": (1,), "3d": (2, 1)}


def operation_on_dofs(operation: FloatArray) -> FloatArray:
    """Return what a rotation or reflection of an element does to its dofs, (12, 12).

    Displacements are vectors, rotations axial vectors; where the operation turns the element end
    for end, the ends change places.

    Arguments:
        operation: orthogonal and diagonal, in local axes (x along the element), (3, 3).
    """
    node = np.kron(np.diag([1.0, np.linalg.det(operation)]), operation)
    ends = np.eye(2) if operation[0, 0] > 0.0 else np.eye(2)[::-1]
    return np.asarray(np.kron(ends, node))


def half_turn(axis: int) -> FloatArray:
    """Return the rotation by 180 degrees about local axis 0, 1 or 2, (3, 3)."""
    signs = -np.ones(3)
    signs[axis] = 1.0
    return np.diag(signs)


def mid_plane_mirror() -> FloatArray:
    """Return the reflection that swaps the ends, (3, 3)."""
    signs = np.ones(3)
    signs[_MIRROR_AXIS] = -1.0
    return np.diag(signs)


def strain_modes() -> FloatArray:
    """Return the six strain modes of a beam of unit length, columns, (12, 6).

    Symmetric bending, antisymmetric bending (shear) in the local x-z plane, twist, extension, and
    the same two bending modes in the local x-y plane.

    Source: Ahmadian, Gladwell & Ismail (1997), section 4.3, U0.
    """
    modes = np.zeros((12, 6))
    a, b = np.sqrt(0.5), np.sqrt(0.1)
    modes[[4, 10], 0] = [-a, a]  # slope = -ry
    modes[[2, 4, 8, 10], 1] = [2 * b, -b, -2 * b, -b]
    modes[[3, 9], 2] = [a, -a]
    modes[[0, 6], 3] = [a, -a]
    modes[[5, 11], 4] = [a, -a]
    modes[[1, 5, 7, 11], 5] = [2 * b, b, -2 * b, b]
    return modes


def active_strain_modes(active: BoolArray) -> list[int]:
    """Return which strain modes a plane lets happen.

    Arguments:
        active: which of the twelve local dofs move, (12,).
    """
    still = np.abs(strain_modes()[~active]).sum(axis=0) == 0.0
    return [int(i) for i in np.flatnonzero(still)]


def strain_mode_signs(operation: FloatArray, active: BoolArray) -> FloatArray:
    """Return +1 for every active strain mode that an operation keeps, -1 for one it turns, (q,).

    Raises:
        ModelError: when the operation mixes strain modes.
    """
    modes = strain_modes()[:, active_strain_modes(active)]
    turned = operation_on_dofs(operation) @ modes
    signs = np.sign(np.einsum("iq,iq->q", modes, turned))
    if not np.allclose(turned, modes * signs):
        raise ModelError("the operation is not a symmetry of a prismatic beam")
    return np.asarray(signs)


def operations_of(symmetry: Symmetry, plane: Plane) -> list[FloatArray]:
    """Return the operations that a symmetry class promises to survive."""
    turns = [half_turn(axis) for axis in _TURN_AXES[plane]]
    return {
        "none": [],
        "half-turn": turns,
        "mirror": [mid_plane_mirror()],
        "full": [*turns, mid_plane_mirror()],
    }[symmetry]


def end_swap_signs(plane: Plane, active: BoolArray) -> FloatArray:
    """Return the signs by which equal elements differ when the other end touches the joint, (q,).

    An element turned end for end in the plane has k_ij times the product of signs i and j.
    """
    return strain_mode_signs(half_turn(_TURN_AXES[plane][0]), active)


def free_terms(operations: Sequence[FloatArray], active: BoolArray) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i <= j, of core terms that survive all the operations."""
    count = len(active_strain_modes(active))
    keep = np.ones((count, count), dtype=bool)
    for operation in operations:
        signs = strain_mode_signs(operation, active)
        keep &= np.outer(signs, signs) > 0.0
    diagonal = [(i, i) for i in range(count)]
    return diagonal + [(i, j) for i in range(count) for j in range(i + 1, count) if keep[i, j]]
