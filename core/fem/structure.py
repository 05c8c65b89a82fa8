"""A meshed frame: element properties, kinematics, matrices; rebuilt with other parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.assembly import AssemblyPlan, plan_assembly, prune
from femubench.core.fem.beam import BeamProperties, mass_matrices, stiffness_matrices
from femubench.core.fem.frame import ACTIVE, Frame, GroundSpring, PointMass
from femubench.core.fem.kinematics import (
    Kinematics,
    build_kinematics,
    point_rows,
    rigid_arm,
    spring_rows,
)
from femubench.core.fem.mesh import Mesh, build_mesh, locate
from femubench.core.fem.parameters import Parameter, apply_values
from femubench.core.measurement import DIRECTIONS, Sensors
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray


def _nominal_properties(frame: Frame, mesh: Mesh) -> BeamProperties:
    """Return the element properties that sections, materials and beam theory give."""
    shear = 1.0 if frame.beam == "timoshenko" else 0.0
    rotary = 1.0 if frame.with_rotary_inertia else 0.0
    rows = []
    for member in frame.members:
        s, m = member.section, member.material
        if shear and s.kappa is None:
            raise ModelError(
                f"member {member.name!r}: a Timoshenko beam needs the shear coefficient kappa"
            )
        ky, kz = s.kappa(m.nu) if s.kappa is not None else (1.0, 1.0)
        flex = shear / (m.G * s.A)
        inertia = rotary * m.rho
        rigidities = (m.E * s.A, m.E * s.Iy, m.E * s.Iz, m.G * s.J, flex / ky, flex / kz)
        inertias = (m.rho * s.A, m.rho * s.Jp, inertia * s.Iy, inertia * s.Iz)
        rows.append((*rigidities, *inertias))
    table = np.array(rows)[mesh.member]
    arm = np.isfinite(mesh.arm_factor)
    factor = np.where(arm, mesh.arm_factor, 1.0)[:, None]
    table[:, :4] *= factor
    table[:, 4:6] /= factor
    table[arm, 6:] = 0.0
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    shape = np.full(len(length), 1.0 if frame.bending_mass == "shear-consistent" else 0.0)
    columns = (length, *table.T, *mesh.rigid.T, *mesh.rigid_mass.T, shape)
    names = [f.name for f in fields(BeamProperties)]
    return BeamProperties(**dict(zip(names, (np.array(c) for c in columns), strict=True)))


def _positions(labels: Sequence[str]) -> dict[str, IntArray]:
    found: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        found.setdefault(label, []).append(i)
    return {label: np.array(where, dtype=np.int64) for label, where in found.items()}


@dataclass(frozen=True)
class Structure:
    """A frame with its mesh and the present values of everything that updating may change.

    Arguments:
        frame: the description.
        mesh: nodes and elements.
        kinematics: free dofs.
        properties: present element properties.
        springs: present joint spring stiffnesses, in the order of `spring_labels`.
        changes: parameter values that were set since the frame was built.
    """

    frame: Frame
    mesh: Mesh
    kinematics: Kinematics
    properties: BeamProperties
    springs: FloatArray
    changes: tuple[tuple[Parameter, float], ...] = ()

    def __post_init__(self) -> None:
        p = self.properties
        for rigid in (p.rigid_1 + p.rigid_2, p.rigid_mass_1 + p.rigid_mass_2):
            if np.any(rigid >= p.length):
                raise ModelError("a rigid end is longer than its element")

    @classmethod
    def build(cls, frame: Frame) -> Structure:
        """Mesh a frame.

        Raises:
            ModelError: when the frame cannot be meshed.
        """
        mesh = build_mesh(frame)
        springs = [k for c in mesh.connections for k in c.spring.stiffness.values()]
        kinematics = build_kinematics(frame, mesh)
        properties = _nominal_properties(frame, mesh)
        return cls(frame, mesh, kinematics, properties, np.array(springs, dtype=float))

    def with_values(
        self, parameters: Sequence[Parameter], values: Sequence[float] | FloatArray
    ) -> Structure:
        """Return the structure with parameters set; factors multiply the present properties."""
        properties, springs = apply_values(self, parameters, values)
        changes = tuple(zip(parameters, (float(v) for v in values), strict=True))
        changed = replace(
            self, properties=properties, springs=springs, changes=self.changes + changes
        )
        # All that is cached follows from frame, mesh and kinematics, which stay.
        for name, member in vars(Structure).items():
            if isinstance(member, cached_property):
                changed.__dict__[name] = getattr(self, name)
        return changed

    def rebuilt(self, frame: Frame) -> Structure:
        """Return another frame with the same parameter changes, e.g. with more attachments."""
        structure = Structure.build(frame)
        for parameter, value in self.changes:
            structure = structure.with_values([parameter], [value])
        return structure

    @cached_property
    def gather(self) -> SparseArray:
        """Return local element displacements from free dofs, sparse (12 n_elements, n)."""
        count = len(self.mesh.ends)
        nodes = (6 * self.mesh.ends[:, :, None] + np.arange(6)).reshape(count, 4, 3)
        columns = np.broadcast_to(nodes[:, :, None, :], (count, 4, 3, 3))
        axes = np.broadcast_to(self.mesh.axes[:, None], (count, 4, 3, 3))
        rows = np.broadcast_to(np.arange(12 * count).reshape(count, 4, 3, 1), (count, 4, 3, 3))
        turn = sp.csr_array(
            (axes.ravel(), (rows.ravel(), columns.ravel())),
            shape=(12 * count, 6 * len(self.mesh.xyz)),
        )
        gather = turn @ self.kinematics.transform
        gather.eliminate_zeros()
        return gather

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
                key = joint.type or joint.name
                ends = tuple(f"{member}@{joint.name}" for member in members)
                groups[key] = groups.get(key, ()) + ends
        return groups

    def attached(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        """Return the mass and stiffness that attachments add on the free dofs, (n, n) each."""
        transform = self.kinematics.transform
        n = transform.shape[1]
        mass, stiffness = sp.csc_array((n, n)), sp.csc_array((n, n))
        for item in masses:
            point = point_rows(self.frame, self.mesh, self.properties, item.at)
            # In a plane a mass acts in the directions of the plane, and in no other.
            arm = rigid_arm(np.array(item.offset))[:3][self.active_local[:3]]
            rows = sp.csr_array(arm) @ point @ transform
            mass = mass + item.mass * (rows.T @ rows)
        for spring in springs:
            rows = self._ground_row(spring)
            stiffness = stiffness + spring.stiffness * (rows.T @ rows)
        return sp.csc_array(mass), sp.csc_array(stiffness)

    def _ground_row(self, spring: GroundSpring) -> SparseArray:
        """Return the elongation of a spring to ground from free dofs, sparse (1, n)."""
        point = point_rows(self.frame, self.mesh, self.properties, spring.at)
        row = DIRECTIONS.index(spring.direction.lstrip("+-"))
        return point[row : row + 1] @ self.kinematics.transform

    def held(self, motion: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """Return what supports and springs to ground see of motions of the whole, (m, r).

        A motion is free where its column is zero. Exact on any mesh, unlike a strain energy
        from the stiffness matrix, which loses a soft suspension in its rounding errors.

        Arguments:
            motion: displacements from positions (k, 3) and axes (k, 6), as columns (k, r).
        """
        transform, xyz = self.kinematics.transform, self.mesh.xyz
        own = motion(xyz[self.kinematics.node], self.kinematics.axes)
        active = np.flatnonzero(np.tile(self.active_local[:6], len(xyz)))
        all_nodes = motion(xyz[active // 6], np.eye(6)[active % 6])
        rows = [self._ground_row(spring) for spring in self.frame.springs if spring.stiffness]
        pulled = [np.asarray(row @ own) for row in rows]
        return np.vstack([transform[active] @ own - all_nodes, *pulled])

    def matrices(self) -> tuple[SparseArray, SparseArray]:
        """Return mass and stiffness on the free dofs, sparse, (n, n) each."""
        mass = self.plan.assemble(mass_matrices(self.properties))
        stiffness = self.plan.assemble(stiffness_matrices(self.properties))
        more_mass, more_stiffness = self.attached(self.frame.masses, self.frame.springs)
        joint = self.spring_rows.T @ sp.diags_array(self.springs) @ self.spring_rows
        return prune(mass + more_mass), prune(stiffness + more_stiffness + joint)

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from free dofs, sparse (n_sensors, n).

        Raises:
            ModelError: when a sensor lies off the structure.
        """
        rows = []
        for xyz, axis in zip(sensors.xyz, sensors.axes, strict=True):
            place = locate(self.frame, xyz)
            point = point_rows(self.frame, self.mesh, self.properties, place)
            rows.append(sp.csr_array(axis[None, :]) @ point)
        if not rows:
            return sp.csr_array((0, self.kinematics.transform.shape[1]))
        return sp.csr_array(sp.vstack(rows)) @ self.kinematics.transform

    @cached_property
    def active_local(self) -> BoolArray:
        """Tell which of the twelve local dofs the plane lets move, (12,)."""
        one = [name in ACTIVE[self.frame.plane] for name in DIRECTIONS]
        return np.array(one + one)
