"""A meshed frame: element properties, free dofs, labels, and where points and springs move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat
from typing import Any, TypeVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.assembly import AssemblyPlan, narrow_indices, plan_assembly
from femubench.core.fem.beam import BeamProperties
from femubench.core.fem.frame import Frame, GroundSpring, Place, PointMass, split_half
from femubench.core.fem.kinematics import Kinematics, node_at, point_block, spring_rows
from femubench.core.fem.links import rigid_arm
from femubench.core.fem.mesh import Mesh
from femubench.core.fem.parameters import Property
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

_Kept = TypeVar("_Kept")
_HELD = 1e-9  # of a motion whose largest translation is 1


def _same(one: object, other: object, rounding: float) -> bool:
    if one is other or not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
        return one is other
    if one.shape != other.shape:
        return False
    return bool((np.abs(one - other) <= rounding * np.abs(one)).all())


def _gram(rows: SparseArray, each: FloatArray) -> SparseArray:
    """Return rows' diag(each) rows, sparse."""
    rows = sp.csr_array(rows)
    pull = rows.data * np.repeat(each, np.diff(rows.indptr))
    return sp.csc_array(rows.T @ sp.csr_array((pull, rows.indices, rows.indptr), shape=rows.shape))


def _positions(labels: Sequence[str]) -> dict[str, IntArray]:
    every = np.arange(len(labels), dtype=np.int64)
    found = {label: every[i : i + 1] for i, label in enumerate(labels)}
    if len(found) < len(labels):
        several: dict[str, list[int]] = {}
        for i, label in enumerate(labels):
            several.setdefault(label, []).append(i)
        found |= {name: np.array(at, dtype=np.int64) for name, at in several.items() if at[1:]}
    return found


@dataclass(frozen=True)
class MeshedFrame:
    """A frame with its mesh and the present values of everything that updating may change.

    Arguments:
        springs: present joint spring stiffnesses, in the order of `spring_labels`.
        changes: parameter values that were set since the frame was built.
    """

    frame: Frame
    mesh: Mesh
    kinematics: Kinematics
    properties: BeamProperties
    springs: FloatArray
    changes: tuple[tuple[Property, float], ...] = ()

    def __post_init__(self) -> None:
        p = self.properties
        for rigid in (p.rigid_1 + p.rigid_2, p.rigid_mass_1 + p.rigid_mass_2):
            if np.any(rigid >= p.length):
                member = self.frame.members[self.mesh.member[int(np.argmax(rigid - p.length))]].name
                own = [end for end in self.frame.rigid_ends if end.member == member]
                raise ModelError(
                    f"a rigid end of member {member!r} is longer than its element",
                    max(own, key=lambda end: end.stiffness_length + end.mass_length, default=None),
                )

    def __getstate__(self) -> dict[str, Any]:
        # Kept factorisations cannot be pickled; they are made again where they are wanted.
        return {name: value for name, value in vars(self).items() if name != "kept"}

    @cached_property
    def gather(self) -> SparseArray:
        """Return local element displacements from free dofs, sparse (12 n_elements, n)."""
        mesh, count = self.mesh, len(self.mesh.ends)
        # Two ends, of each translations and rotations, and the axes that turn what may move there.
        turns = (mesh.axes[:, None] != 0.0) & self.kinematics.active.reshape(2, 1, 3)
        turns = np.broadcast_to(turns[:, None], (count, 2, 2, 3, 3))
        element, entry = np.divmod(np.flatnonzero(turns), 36)
        node = mesh.ends[element, entry // 18]
        columns = 6 * node + 3 * (entry // 9 % 2) + entry % 3
        bounds = np.concatenate([[0], np.cumsum(np.count_nonzero(turns, axis=-1))])
        turn = sp.csr_array(
            (mesh.axes.reshape(-1)[9 * element + entry % 9], columns, bounds),
            shape=(12 * count, 6 * len(mesh.xyz)),
        )
        gather = narrow_indices(turn) @ self.kinematics.transform
        gather.eliminate_zeros()
        return narrow_indices(gather)

    @cached_property
    def plan(self) -> AssemblyPlan:
        """Return where the entries of the element matrices go."""
        return plan_assembly(self.gather, 12)

    @cached_property
    def spring_rows(self) -> SparseArray:
        """Return relative displacements of the joint springs, sparse (n_springs, n)."""
        blocks = [spring_rows(self.mesh, connection) for connection in self.mesh.connections]
        if not blocks:
            return sp.csr_array((0, self.kinematics.transform.shape[1]))
        return sp.csr_array(sp.vstack(blocks)) @ self.kinematics.transform

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Return ``member/k`` of every element; empty for the massless arm of a joint."""
        names = [member.name for member in self.frame.members]
        arms = np.isfinite(self.mesh.arm_factor)
        pairs = zip(self.mesh.member, self.mesh.number, arms, strict=True)
        return tuple("" if arm else f"{names[m]}/{k}" for m, k, arm in pairs)

    @property
    def elements(self) -> tuple[str, ...]:
        """Return the label of every element that is no arm of a joint."""
        return tuple(dict.fromkeys(label for label in self.labels if label))

    @cached_property
    def spring_labels(self) -> tuple[str, ...]:
        """Return ``member@joint:direction`` of every joint spring."""
        return tuple(
            f"{c.spring.member}@{c.spring.joint}:{direction}"
            for c in self.mesh.connections
            for direction in c.spring.stiffness
        )

    @cached_property
    def label_index(self) -> dict[str, IntArray]:
        """Return the elements of every ``member/k``; a split element has several."""
        return _positions(self.labels)

    @cached_property
    def place_index(self) -> dict[str, IntArray]:
        """Return the elements of every ``member/k``, and of halves that a factor is on."""
        found = dict(self.label_index)
        for place in (place for factor in self.frame.factors for place in factor.at):
            element, half = split_half(place)
            if half and element in self.label_index:
                rows = self.label_index[element]
                bounds = self.mesh.stations[rows]
                middle = 0.5 * (bounds[0, 0] + bounds[-1, 1])
                found[place] = rows[(bounds.mean(axis=1) > middle) == (half == 2)]
        return found

    @cached_property
    def member_labels(self) -> dict[str, tuple[str, ...]]:
        """Return the labels of the elements of every member."""
        return {
            member.name: tuple(f"{member.name}/{k + 1}" for k in range(member.elements))
            for member in self.frame.members
        }

    @cached_property
    def kept(self) -> dict[str, Any]:
        """Return a store of what follows from the frame alone, whatever the parameters are."""
        return {}

    def once(
        self,
        name: str,
        rests_on: tuple[object, ...],
        make: Callable[[], _Kept],
        rounding: float = 0.0,
    ) -> _Kept:
        """Return what was made last under a name, made anew where what it rests on has changed.

        Arguments:
            rests_on: arrays, which are compared by their numbers, and other things by identity;
                what follows from frame and mesh need not be among them.
            rounding: relative difference of numbers that counts as none.
        """
        entry = self.kept.get(name)
        if entry is None or not all(map(_same, entry[0], rests_on, repeat(rounding))):
            entry = self.kept[name] = (rests_on, make())
        found: _Kept = entry[1]
        return found

    @property
    def interpolation(self) -> tuple[FloatArray, ...]:
        """Return the properties that decide how a point between two nodes moves."""
        p = self.properties
        if not p.shear_shape.any():
            return p.rigid_1, p.rigid_2
        shear = (p.shear_shape * 12 * p.EIz * p.flex_y, p.shear_shape * 12 * p.EIy * p.flex_z)
        return p.rigid_1, p.rigid_2, *shear

    def rests_on(self, attachments: str) -> tuple[FloatArray, ...]:
        """Return the properties that decide how attachments move, of which nodes need none.

        Arguments:
            attachments: ``masses`` or ``springs``.
        """
        items = getattr(self.frame, attachments)

        def between() -> bool:
            return any(node_at(self.frame, self.mesh, item.at) is None for item in items)

        return self.interpolation if self.once(f"{attachments} between", (), between) else ()

    @cached_property
    def spring_index(self) -> dict[str, IntArray]:
        """Return the position of every label of `spring_labels`."""
        return _positions(self.spring_labels)

    @cached_property
    def element_ends(self) -> dict[str, tuple[int, int]]:
        """Return from ``member@joint`` to (element, end) for every member end."""
        ends: dict[str, tuple[int, int]] = {}
        plain = np.flatnonzero(np.isnan(self.mesh.arm_factor))
        member = self.mesh.member[plain]
        first = np.unique(member, return_index=True)[1]
        last = np.concatenate([first[1:], [len(plain)]]) - 1
        for m, spec in enumerate(self.frame.members):
            ends[f"{spec.name}@{spec.ends[0]}"] = (int(plain[first[m]]), 0)
            ends[f"{spec.name}@{spec.ends[1]}"] = (int(plain[last[m]]), 1)
        return ends

    @cached_property
    def joint_ends(self) -> dict[str, tuple[str, ...]]:
        """Return from joint type to the ``member@joint`` ends that meet at joints of that type.

        A joint without a type is a type of its own; a free end is no joint.
        """
        groups: dict[str, tuple[str, ...]] = {}
        for joint in self.frame.joints:
            members = self.frame.ends_at(joint.name)
            if len(members) > 1:
                ends = tuple(f"{member}@{joint.name}" for member in members)
                groups[joint.family] = groups.get(joint.family, ()) + ends
        return groups

    @property
    def total_mass(self) -> float:
        """Return the mass of members, attached masses and oscillators in kg, supports or not."""
        p = self.properties
        members = p.rhoA @ (p.length - p.rigid_mass_1 - p.rigid_mass_2)
        lumps = sum(item.mass for item in self.frame.masses)
        return float(members + lumps + sum(item.mass for item in self.frame.oscillators))

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        """Return the mass and stiffness that attachments add on the free dofs, (n, n) each."""
        n = self.kinematics.transform.shape[1]
        mass, stiffness = sp.csc_array((n, n)), sp.csc_array((n, n))
        if masses:
            # In a plane a mass acts in the directions of the plane, and in no other.
            moves = self.active_local[:3]
            arms = [rigid_arm(np.array(item.offset))[:3][moves] for item in masses]
            rows = self._rows_at([item.at for item in masses], arms)
            mass = _gram(rows, np.repeat([m.mass for m in masses], np.count_nonzero(moves)))
        if springs:
            each = np.array([spring.stiffness for spring in springs], dtype=float)
            stiffness = _gram(self._ground_rows(springs), each)
        return mass, stiffness

    def _ground_rows(self, springs: Sequence[GroundSpring]) -> SparseArray:
        """Return the elongation of springs to ground from free dofs, sparse (n_springs, n)."""
        each = [DIRECTIONS.index(spring.direction.lstrip("+-")) for spring in springs]
        return self._rows_at([spring.at for spring in springs], np.eye(6)[each][:, None])

    def _rows_at(
        self, places: Sequence[Place], taken: Sequence[FloatArray] | FloatArray
    ) -> SparseArray:
        """Return motions of points from free dofs, sparse (n, n_dofs).

        Arguments:
            taken: of each, what is taken of its displacement and rotation, (p, 6).
        """
        values, columns, counts = [], [], []
        for at, own in zip(places, taken, strict=True):
            block, moved = point_block(self.frame, self.mesh, self.properties, at)
            values.append((own @ block).ravel())
            columns.append(np.tile(moved, len(own)))
            counts += [len(moved)] * len(own)
        entries = np.concatenate(values), np.concatenate(columns), np.cumsum([0, *counts])
        rows = sp.csr_array(entries, shape=(len(counts), self.kinematics.transform.shape[0]))
        rows.eliminate_zeros()
        return rows @ self.kinematics.transform

    def loose(self, motion: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """Return the combinations of motions that no support or spring to ground sees, (n, f).

        Exact on any mesh, unlike a strain energy from the stiffness matrix, which loses a soft
        suspension in its rounding errors.

        Arguments:
            motion: displacements from positions (k, 3) and axes (k, 6), as columns (k, r), each
                with a largest translation of 1 or none.
        """
        transform, xyz = self.kinematics.transform, self.mesh.xyz
        own = motion(xyz[self.kinematics.node], self.kinematics.motions())
        free = np.tile(self.active_local[:6], (len(xyz), 1))
        free[self.mesh.oscillators] = False  # they have dofs of their own and hold nothing
        active = np.setdiff1d(np.flatnonzero(free), self.kinematics.unused)
        all_nodes = motion(xyz[active // 6], np.eye(6)[active % 6])
        springs = [spring for spring in self.frame.springs if spring.stiffness]
        pulled = [np.asarray(self._ground_rows(springs) @ own)] if springs else []
        seen = np.vstack([transform[active] @ own - all_nodes, *pulled])
        moving = np.abs(own).max(axis=0, initial=0.0) > _HELD
        _, singular, turn = la.svd(np.linalg.qr(seen[:, moving], mode="r"))
        rank = int(np.sum(singular > _HELD))
        return np.asarray(own[:, moving] @ turn[rank:].T)

    @cached_property
    def active_local(self) -> BoolArray:
        """Tell which of the twelve local dofs the plane lets move, (12,)."""
        return np.tile(self.kinematics.active, 2)
