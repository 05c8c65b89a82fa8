"""A meshed frame with its matrices, rebuilt with other parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.assembly import AT_ONCE, prune
from femubench.core.fem.attachments import elastic_stiffness, oscillator_matrices
from femubench.core.fem.beam import MASS_PROPERTIES
from femubench.core.fem.derivatives import apply_values
from femubench.core.fem.frame import Frame
from femubench.core.fem.kinematics import point_block
from femubench.core.fem.mesh import SAME_STATION, locate
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.nominal import mesh_frame
from femubench.core.fem.parameters import Property
from femubench.core.fem.preload import GeometricStiffness
from femubench.core.fem.sensors import Sensors
from femubench.core.typing import FloatArray, SparseArray

_ROUNDING = 1e-14
# Elements from which on a structure keeps its plan only once parameters are set: a solution for
# its modes takes ten times as long as another plan, and needs the memory.
_PLANNED_ONCE = 100_000


@dataclass(frozen=True)
class Structure(MeshedFrame):
    """A meshed frame that gives its mass and stiffness, and reads sensors."""

    @classmethod
    def build(cls, frame: Frame) -> Structure:
        """Mesh a frame.

        Raises:
            ModelError: when the frame cannot be meshed.
        """
        found = mesh_frame(frame)
        return cls(found.frame, found.mesh, found.kinematics, found.properties, found.springs)

    def with_values(
        self, parameters: Sequence[Property], values: Sequence[float] | FloatArray
    ) -> Structure:
        """Return the structure with parameters set; factors multiply the present properties."""
        properties, springs = apply_values(self, parameters, values)
        changes = tuple(zip(parameters, (float(v) for v in values), strict=True))
        changed = replace(
            self, properties=properties, springs=springs, changes=self.changes + changes
        )
        # All that is cached follows from frame, mesh and kinematics, which stay.
        for name, member in (*vars(MeshedFrame).items(), *vars(Structure).items()):
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
    def preload(self) -> SparseArray | None:
        """Return the geometric stiffness of preloads and weight, (n, n), or None."""
        parts = [
            GeometricStiffness(self).of_preload(p.member, p.force) for p in self.frame.preloads
        ]
        if self.frame.gravity:
            parts.append(self.frame.gravity * GeometricStiffness(self).of_weight())
        return sum(parts[1:], start=parts[0]) if parts else None

    def matrices(self) -> tuple[SparseArray, SparseArray]:
        """Return mass and stiffness on the free dofs, sparse, (n, n) each.

        Raises:
            ModelError: when a preload has no redundancy to live on, or nothing bears the weight.
        """
        stiffness = elastic_stiffness(self)
        if self.frame.oscillators:
            stiffness = stiffness + oscillator_matrices(self)[1]
        if self.preload is not None:
            stiffness = stiffness + self.preload
        if len(self.properties) > AT_ONCE:
            mass = self._assembled_mass()
        else:  # a copy of the last one where nothing of it changed
            own = [getattr(self.properties, name) for name in MASS_PROPERTIES]
            mass = self.once("mass", (*own, *self.interpolation), self._assembled_mass).copy()
        if not self.changes and len(self.mesh.ends) > _PLANNED_ONCE:
            for name in ("plan", "gather"):
                self.__dict__.pop(name, None)
        return mass, prune(stiffness)

    def _assembled_mass(self) -> SparseArray:
        mass = self.plan.assemble_from(lambda rows: self.properties.take(rows).mass_matrices())
        if self.frame.masses:
            mass = mass + self.once(
                "masses",
                self.rests_on("masses"),
                lambda: self.assemble_attachments(self.frame.masses, ())[0],
            )
        if self.frame.oscillators:
            mass = mass + oscillator_matrices(self)[0]
        return prune(mass)

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from free dofs, sparse (n_sensors, n).

        Raises:
            ModelError: when a sensor lies off the structure.
        """
        rests_on = (sensors, *self.interpolation)
        # A factor on E leaves the ratio of shear to bending as it is, but for its last digit.
        return self.once("readings", rests_on, lambda: self._sensor_rows(sensors), _ROUNDING)

    def _sensor_rows(self, sensors: Sensors) -> SparseArray:
        """Return what sensors read: at nodes all at once, between nodes one by one."""
        frame, mesh, transform = self.frame, self.mesh, self.kinematics.transform
        if not len(sensors.xyz):
            return sp.csr_array((0, transform.shape[1]))
        # At a flexible connection several nodes lie at one point, of which only the joint is sure.
        joints, hung = len(frame.joints), set(mesh.oscillators.tolist())
        found = mesh.tree.query_ball_point(sensors.xyz, SAME_STATION, return_sorted=True)
        near = [[node for node in at if node not in hung] for at in found]
        # Joints are the first nodes, and of what is there the first one.
        node = np.array([at[0] if at and (len(at) == 1 or at[0] < joints) else -1 for at in near])
        axes = sensors.axes
        values = list(axes)
        columns = list(6 * np.maximum(node, 0)[:, None] + np.arange(6))
        between = np.flatnonzero(node < 0)
        places = self.once(
            "places", (sensors,), lambda: [locate(frame, xyz) for xyz in sensors.xyz[between]]
        )
        for i, place in zip(between, places, strict=True):
            block, moved = point_block(frame, mesh, self.properties, place)
            values[i], columns[i] = axes[i] @ block, moved
        bounds = np.cumsum([0, *map(len, values)])
        entries = np.concatenate(values), np.concatenate(columns), bounds
        rows = sp.csr_array(entries, shape=(len(node), transform.shape[0]))
        rows.eliminate_zeros()
        return rows @ transform
