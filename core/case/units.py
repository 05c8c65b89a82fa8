"""Models in other units than SI: a unit of length, and what hangs together with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from femubench.core.case.frame_keys import describe_frame
from femubench.core.case.matrix_files import matrices_of
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.schema import LengthUnit
from femubench.core.fem.frame import Frame, Material, Member, Vector
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section
from femubench.core.typing import SparseArray

METRES: dict[LengthUnit, float] = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
_POUND = 4.4482216152605  # N; models in inches and feet have it as their force
NEWTONS: dict[LengthUnit, float] = {
    unit: _POUND if unit in ("in", "ft") else 1.0 for unit in METRES
}


def in_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in SI that was read in other units.

    The force is N (or lbf with in and ft) and the time s, so that the mass is N s2 / unit: with
    mm this is the system of tonnes and MPa. With T, 1 / unit for translations and 1 for
    rotations, and the energy e = force times unit in J, K is e T K T and M e T M T.
    """
    return _converted(model, METRES[unit], NEWTONS[unit])


def from_si(model: Model, unit: LengthUnit) -> Model:
    """Return a model in the units of a file; the inverse of `in_si`.

    Raises:
        Fault: for parameters of a frame that it cannot say by itself.
    """
    return _converted(model, 1.0 / METRES[unit], 1.0 / NEWTONS[unit])


def _converted(model: Model, length: float, force: float) -> Model:
    if length == force == 1.0:
        return model
    rotation = np.array([name.startswith("r") for name in model.dofs.direction])
    scale = sp.diags_array(np.sqrt(force * length) * np.where(rotation, 1.0, 1.0 / length))

    def turned(matrix: SparseArray) -> SparseArray:
        return sp.csc_array(scale @ matrix @ scale)

    mass, stiffness = matrices_of(model)
    if model.structure is not None:
        new = Model.of(_frame(describe_frame(model.structure), length, force))
        own = model.structure.matrices()  # an update may have changed the matrices themselves
        more_mass, more_stiffness = turned(mass - own[0]), turned(stiffness - own[1])
        return replace(new, mass=new.mass + more_mass, stiffness=new.stiffness + more_stiffness)
    assert isinstance(model.geometry, MatrixGeometry)
    dofs = replace(model.dofs, xyz=length * model.dofs.xyz)
    return replace(
        model,
        mass=turned(mass),
        stiffness=turned(stiffness),
        mass_change=None,
        stiffness_change=None,
        dofs=dofs,
        geometry=replace(
            model.geometry,
            dofs=dofs,
            outlines={name: length * ends for name, ends in model.geometry.outlines.items()},
        ),
        groups={name: turned(part) for name, part in model.groups.items()},
        mass_groups={name: turned(part) for name, part in model.mass_groups.items()},
    )


def _frame(frame: Frame, length: float, force: float) -> Frame:
    """Return a frame whose numbers are in units of such a length and force instead of 1."""
    mass = force / length  # of a unit of time of 1 s

    def moved(xyz: Vector) -> Vector:
        x, y, z = (length * v for v in xyz)
        return x, y, z

    def stiff(direction: str, value: float) -> float:
        return value * force * (length if "r" in direction else 1.0 / length)

    return replace(
        frame,
        joints=tuple(replace(j, xyz=moved(j.xyz)) for j in frame.joints),
        members=tuple(
            replace(m, section=_section(m.section, length), material=_material(m, length, force))
            for m in frame.members
        ),
        masses=tuple(replace(m, mass=mass * m.mass, offset=moved(m.offset)) for m in frame.masses),
        springs=tuple(replace(s, stiffness=stiff(s.direction, s.stiffness)) for s in frame.springs),
        joint_springs=tuple(
            replace(
                s, arm=length * s.arm, stiffness={d: stiff(d, v) for d, v in s.stiffness.items()}
            )
            for s in frame.joint_springs
        ),
        rigid_ends=tuple(
            replace(
                end,
                stiffness_length=length * end.stiffness_length,
                mass_length=length * end.mass_length,
            )
            for end in frame.rigid_ends
        ),
        preloads=tuple(replace(p, force=force * p.force) for p in frame.preloads),
        eccentricities=tuple(
            replace(e, y=length * e.y, z=length * e.z) for e in frame.eccentricities
        ),
        braces=tuple(replace(b, stiffness=stiff("x", b.stiffness)) for b in frame.braces),
        oscillators=tuple(replace(o, mass=mass * o.mass) for o in frame.oscillators),
    )


def _section(section: Section, length: float) -> Section:
    powers = {"A": 2, "Iy": 4, "Iz": 4, "J": 4, "Jp": 4, "width": 1, "height": 1}
    sizes = {name: getattr(section, name) for name in powers}
    return replace(section, **{k: v and v * length ** powers[k] for k, v in sizes.items()})


def _material(member: Member, length: float, force: float) -> Material:
    E, rho = member.material.E * force / length**2, member.material.rho * force / length**4
    return replace(member.material, E=E, rho=rho)
