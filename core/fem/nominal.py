"""A frame meshed as it is described: element properties before any parameter was changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import TypeVar

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.attachments import check_attachments
from femubench.core.fem.beam import BeamProperties
from femubench.core.fem.derivatives import apply_values
from femubench.core.fem.frame import Coupling, Eccentricity, Factor, Frame, Member
from femubench.core.fem.kinematics import build_kinematics
from femubench.core.fem.mesh import Mesh, build_mesh
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.parameters import QUANTITIES, Property
from femubench.core.typing import FloatArray

# Without shear or rotary inertia a beam is still one; without stiffness or mass it is none.
MAY_VANISH = ("shear", "rotary")
_Item = TypeVar("_Item", Coupling, Eccentricity)


def mesh_frame(frame: Frame) -> MeshedFrame:
    """Return a frame with its mesh, dofs and element properties, factors included.

    Raises:
        ModelError: when the frame cannot be meshed.
    """
    check_attachments(frame)
    mesh = build_mesh(frame)
    springs = [k for c in mesh.connections for k in c.spring.stiffness.values()]
    kinematics = build_kinematics(frame, mesh)
    properties = nominal_properties(frame, mesh)
    built = MeshedFrame(frame, mesh, kinematics, properties, np.array(springs, dtype=float))
    if not frame.factors:
        return built
    parameters = [_parameter(built, item) for item in frame.factors]
    factors = [item.factor for item in frame.factors]
    return replace(built, properties=apply_values(built, parameters, factors)[0])


def nominal_properties(frame: Frame, mesh: Mesh) -> BeamProperties:
    """Return what sections, materials and beam theory give, `frame.factors` left out.

    Raises:
        ModelError: for a Timoshenko beam without kappa, or an entry at no member.
    """
    arm = np.isfinite(mesh.arm_factor)
    kinds: dict[tuple[int, int], int] = {}
    kind = [
        kinds.setdefault((id(member.section), id(member.material)), len(kinds))
        for member in frame.members
    ]
    first = np.unique(kind, return_index=True)[1]
    constants = np.array([_constants(frame, frame.members[m]) for m in first])
    table = constants[np.array(kind, dtype=np.int64)[mesh.member]]
    factor = np.where(arm, mesh.arm_factor, 1.0)[:, None]
    table[:, :4] *= factor
    table[:, 4:6] /= factor
    table[arm, 6:] = 0.0
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    shape = np.full(len(length), 1.0 if frame.bending_mass == "shear-consistent" else 0.0)
    coupling = _of_members(frame, frame.couplings, lambda item: item.coefficient)
    if np.any(np.abs(coupling) >= 1.0):
        raise ModelError("a bending-torsion coupling coefficient is not between -1 and 1")
    ecc_y = _of_members(frame, frame.eccentricities, lambda item: item.y)
    ecc_z = _of_members(frame, frame.eccentricities, lambda item: item.z)
    if frame.plane == "out-of-plane":
        ecc_z[:] = 0.0  # as with an offset mass, nothing moves along x and y there
    further = [np.where(arm, 0.0, c[mesh.member]) for c in (coupling, ecc_y, ecc_z)]
    columns = (length, *table.T, *mesh.rigid.T, *mesh.rigid_mass.T, shape, *further)
    names = [f.name for f in fields(BeamProperties)]
    return BeamProperties(**dict(zip(names, (np.array(c) for c in columns), strict=True)))


def _constants(frame: Frame, member: Member) -> tuple[float, ...]:
    """Return EA to flex_z and rhoA to rhoIz of a member."""
    s, m = member.section, member.material
    shear = 1.0 if frame.beam == "timoshenko" else 0.0
    if shear and s.kappa is None:
        raise ModelError(
            f"member {member.name!r}: a Timoshenko beam needs the shear coefficient kappa", member
        )
    if not m.G * s.A > 0.0:
        raise ModelError(f"member {member.name!r}: its stiffness is nothing to rounding", member)
    ky, kz = s.kappa(m.nu) if s.kappa is not None else (1.0, 1.0)
    flex = shear / (m.G * s.A)
    inertia = frame.rotary_share * m.rho
    rigidities = (m.E * s.A, m.E * s.Iy, m.E * s.Iz, m.G * s.J, flex / ky, flex / kz)
    return (*rigidities, m.rho * s.A, m.rho * s.Jp, inertia * s.Iy, inertia * s.Iz)


def _of_members(
    frame: Frame, items: Sequence[_Item], value: Callable[[_Item], float]
) -> FloatArray:
    """Return a number of every member; several entries at one member add up, (n_members,)."""
    column = np.zeros(len(frame.members))
    for item in items:
        if item.member not in frame.member_index:
            raise ModelError(f"there is no member {item.member!r}", item)
        column[frame.member_index[item.member]] += value(item)
    return column


def _parameter(structure: MeshedFrame, item: Factor) -> Property:
    """Return what a factor of the frame multiplies; massless arms of joints have none."""
    name = f"factor on {item.quantity}"
    if item.quantity not in QUANTITIES or not QUANTITIES[item.quantity]:
        known = ", ".join(quantity for quantity, scaled in QUANTITIES.items() if scaled)
        raise ModelError(f"there is no factor on {item.quantity!r}; there are {known}", item)
    if not (item.factor > 0.0 or (item.factor == 0.0 and item.quantity in MAY_VANISH)):
        raise ModelError(f"{name}: {item.factor:g} is not positive", item)
    places: list[str] = []
    for place in item.at:
        if place == "all":
            places += (label for label in structure.label_index if label)
        elif place in structure.frame.member_index:
            places += structure.member_labels[place]
        else:
            places.append(place)
    return Property(name, item.quantity, tuple(places))
