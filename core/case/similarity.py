"""Similar structures: all lengths, moduli and densities times a factor each, in linear elasticity.

Frequencies go with sqrt(modulus / density) / length, shapes stay at the moved sensors, rotations go
with 1 / length. This is exact for every linear elastic structure, solid or frame, so that what was
computed for one of them is the truth of all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.case.case import Case
from femubench.core.case.matrix_files import matrices_of
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import (
    Brace,
    Eccentricity,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    PointMass,
    Preload,
    RigidEnd,
    Vector,
)
from femubench.core.fem.model import Dofs, Edge, Model
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import DIRECTIONS, Sensors
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import SparseArray

LENGTHS, MODULI = (0.7, 1.4), (0.6, 1.6)  # between which factors are drawn; densities as moduli
_LEAST_SHIFT = 1.1  # of the frequencies, up or down: who knows them must not find them again


@dataclass(frozen=True)
class Similarity:
    """Factors from a structure to a similar one.

    Arguments:
        length: of all coordinates, sizes of sections, arms and offsets.
        modulus: of Young's moduli; Poisson's ratios stay.
        density: of all densities.
    """

    length: float
    modulus: float
    density: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Similarity:
        """Return factors, log-uniform, that move the frequencies by a tenth at least."""
        while True:
            found = cls(
                *(
                    float(np.exp(rng.uniform(np.log(low), np.log(high))))
                    for low, high in (LENGTHS, MODULI, MODULI)
                )
            )
            if abs(np.log(found.frequency)) >= np.log(_LEAST_SHIFT):
                return found

    @property
    def frequency(self) -> float:
        """Return the factor of all natural frequencies."""
        return float(np.sqrt(self.modulus / self.density) / self.length)

    @property
    def mass(self) -> float:
        """Return the factor of all masses."""
        return self.density * self.length**3

    @property
    def force(self) -> float:
        """Return the factor of all forces."""
        return self.modulus * self.length**2

    def stiffness(self, direction: str) -> float:
        """Return the factor of a spring: N/m, or N m/rad for a rotation."""
        return self.modulus * self.length ** (3 if "r" in direction else 1)

    def move_points(self, xyz: Vector) -> Vector:
        """Return a point or a vector between points, m."""
        x, y, z = (self.length * value for value in xyz)
        return x, y, z


def similar_case(case: Case, by: Similarity) -> Case:
    """Return the case of a similar structure: model, modes, and changes.

    Gravity does not scale by itself: the multiple of the own weight that acts on the stiffness goes
    with modulus / (density length), so that weight / stiffness is what it was.

    Raises:
        NotApplicable: for a model that is neither a frame nor matrices with their nodes.
    """
    measured, reference, low_high = case.measurement, case.reference, case.band
    changes = tuple(
        replace(
            change,
            masses=tuple(_point_mass(mass, by) for mass in change.masses),
            springs=tuple(_ground_spring(spring, by) for spring in change.springs),
            measurement=_measurement(change.measurement, by),
        )
        for change in case.modifications
    )
    return replace(
        case,
        model=_model(case.model, by),
        measurement=_measurement(measured, by),
        modifications=changes,
        reference=None if reference is None else _measurement(reference, by),
        band=None if low_high is None else (by.frequency * low_high[0], by.frequency * low_high[1]),
        # What is drawn of a test, and said of its files, is of the structure that it was.
        notes=(),
        matches=(),
        lines=None,
    )


def _measurement(measured: Measurement, by: Similarity) -> Measurement:
    """Return the modes of the similar structure, with the same relative deviations."""
    sensors, f = measured.sensors, by.frequency
    per_rotation = np.abs(sensors.axes[:, 3:]).sum(axis=1) > 0.0
    readings = np.where(per_rotation, 1.0 / by.length, 1.0)[:, None]
    weight, modal = measured.total_mass, measured.modal_mass
    return replace(
        measured,
        sensors=Sensors(sensors.labels, by.length * sensors.xyz, sensors.directions),
        frequencies=f * measured.frequencies,
        frequency_std=f * measured.frequency_std,
        shapes=readings * measured.shapes,
        shape_std=readings * measured.shape_std,
        total_mass=None if weight is None else (by.mass * weight[0], by.mass * weight[1]),
        modal_mass=None if modal is None else by.mass * modal,
    )


def _model(model: Model, by: Similarity) -> Model:
    if model.structure is not None:
        return Model.of(similar_frame(model.structure.frame, by))
    if not isinstance(model.geometry, MatrixGeometry):
        raise NotApplicable("a model without elements and without nodes has no similar one")
    return similar_matrices(model, model.geometry, by)


def similar_matrices(model: Model, geometry: MatrixGeometry, by: Similarity) -> Model:
    """Return the model of matrices, with low-rank changes in them, of the similar structure."""
    dofs = replace(model.dofs, xyz=by.length * model.dofs.xyz)
    mass, stiffness = matrix_factors(dofs, by)
    whole = matrices_of(model)

    def parts(named: Mapping[str, SparseArray], factor: SparseArray) -> dict[str, SparseArray]:
        return {name: scale_matrix(part, factor) for name, part in named.items()}

    outlines = {name: by.length * ends for name, ends in geometry.outlines.items()}
    return replace(
        model,
        mass=scale_matrix(whole[0], mass),
        stiffness=scale_matrix(whole[1], stiffness),
        mass_change=None,
        stiffness_change=None,
        groups=parts(model.groups, stiffness),
        mass_groups=parts(model.mass_groups, mass),
        powers=model.map_powers(
            lambda part: scale_matrix(part, stiffness), lambda part: scale_matrix(part, mass)
        ),
        grounds={name: _edge(edge, mass, stiffness, by) for name, edge in model.grounds.items()},
        dofs=dofs,
        geometry=replace(geometry, dofs=dofs, outlines=outlines),
    )


def matrix_factors(dofs: Dofs, by: Similarity) -> tuple[SparseArray, SparseArray]:
    """Return diagonal matrices by which mass and stiffness go from both sides, (n, n) each.

    Arguments:
        dofs: a rotation bears one length more than a translation.
    """
    turns = np.abs(dofs.motions[:, 3:]).sum(axis=1) > 0.0
    arms = np.where(turns, by.length, 1.0)
    roots = np.sqrt(by.mass), np.sqrt(by.stiffness(DIRECTIONS[0]))
    mass, stiffness = (sp.diags_array(root * arms, format="csr") for root in roots)
    return mass, stiffness


def scale_matrix(matrix: SparseArray, factor: SparseArray) -> SparseArray:
    """Return a matrix with one of `matrix_factors` from both sides, (n, n)."""
    found: SparseArray = (factor @ matrix @ factor).asformat(matrix.format)
    return found


def _edge(edge: Edge, mass: SparseArray, stiffness: SparseArray, by: Similarity) -> Edge:
    """Return what is held by translations of the similar structure."""
    heavy, stiff = by.mass, by.stiffness(DIRECTIONS[0])
    return edge._replace(
        pulled=np.sqrt(stiff) * (stiffness @ edge.pulled),
        carried=np.sqrt(heavy) * (mass @ edge.carried),
        stiff=stiff * edge.stiff,
        heavy=heavy * edge.heavy,
    )


def similar_frame(frame: Frame, by: Similarity) -> Frame:
    """Return the frame of the similar structure; what is no length, modulus or density stays."""
    sections = {id(m.section): similar_section(m.section, by.length) for m in frame.members}
    changed: dict[str, Any] = {
        "joints": [Joint(j.name, by.move_points(j.xyz), j.type) for j in frame.joints],
        "members": [
            replace(m, section=sections[id(m.section)], material=_material(m.material, by))
            for m in frame.members
        ],
        "masses": [_point_mass(mass, by) for mass in frame.masses],
        "springs": [_ground_spring(spring, by) for spring in frame.springs],
        "joint_springs": [_joint_spring(spring, by) for spring in frame.joint_springs],
        "rigid_ends": [
            RigidEnd(e.joint, e.member, by.length * e.stiffness_length, by.length * e.mass_length)
            for e in frame.rigid_ends
        ],
        "preloads": [Preload(p.member, by.force * p.force) for p in frame.preloads],
        "eccentricities": [
            Eccentricity(e.member, by.length * e.y, by.length * e.z) for e in frame.eccentricities
        ],
        "braces": [
            Brace(b.ends, by.stiffness("x") * b.stiffness, b.direction) for b in frame.braces
        ],
        "oscillators": [
            replace(o, mass=by.mass * o.mass, frequency=by.frequency * o.frequency)
            for o in frame.oscillators
        ],
    }
    own: dict[str, Any] = {name: tuple(items) for name, items in changed.items()}
    gravity = frame.gravity * by.modulus / (by.density * by.length)
    return replace(frame, gravity=gravity, **own)


def similar_section(section: Section, length: float) -> Section:
    """Return a section of the same form with all its lengths times a factor."""
    fourth: dict[str, Any] = {
        name: length**4 * getattr(section, name) for name in ("Iy", "Iz", "J", "Jp")
    }
    sizes: dict[str, Any] = {
        name: None if size is None else length * size
        for name, size in (("width", section.width), ("height", section.height))
    }
    return replace(section, A=length**2 * section.A, **fourth, **sizes)


def _material(material: Material, by: Similarity) -> Material:
    return replace(material, E=by.modulus * material.E, rho=by.density * material.rho)


def _point_mass(mass: PointMass, by: Similarity) -> PointMass:
    return PointMass(mass.at, by.mass * mass.mass, by.move_points(mass.offset))


def _ground_spring(spring: GroundSpring, by: Similarity) -> GroundSpring:
    return replace(spring, stiffness=by.stiffness(spring.direction) * spring.stiffness)


def _joint_spring(spring: JointSpring, by: Similarity) -> JointSpring:
    stiffness = {name: by.stiffness(name) * value for name, value in spring.stiffness.items()}
    return replace(spring, stiffness=stiffness, arm=by.length * spring.arm)
