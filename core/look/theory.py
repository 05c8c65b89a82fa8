"""Whether slender-beam theory will do, and whether materials and sections make sense."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.fem.beam import stiffness_matrices
from femubench.core.fem.frame import Frame, Material, Member
from femubench.core.fem.nominal import nominal_properties
from femubench.core.fem.sections import Section, constant_kappa
from femubench.core.look.modes import Seen, percent
from femubench.core.modal.frequency_changes import SOLVED_LIMIT
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import FloatArray

_KAPPA = 5.0 / 6.0  # of a solid rectangle, for sections without one
_NOTABLE = 0.005
_NOTABLE_DEVIATIONS = 2.0
_STUBBY = 8.0  # length over height
# E / rho in m2/s2: metals 2.3e7 to 2.8e7, magnesium to beryllium alloys 2e7 to 2e8, plastics 2e6.
_STIFF_PER_MASS = (1e6, 4e8)
_POISSON = (0.0, 0.5)
_SHEAR_COEFFICIENT = (0.2, 1.0)


def look_at_theory(seen: Seen) -> list[LookWarning]:
    """Return what shear and rotary inertia change, and members that are hardly beams."""
    frame = seen.model.frame_structure.frame
    found = []
    if frame.beam == "euler-bernoulli":
        unknown = any(m.section.kappa is None for m in frame.members)
        remark = " (kappa = 5/6 assumed where none is given)" if unknown else ""
        what = f"The members are stubby enough for shear to matter{remark}"
        found += _mended(seen, what, "shear-deformation", _by_shear(seen, with_shear(frame)))
    if frame.rotary_share == 0.0:
        what = "The rotary inertia of the cross sections matters"
        changes = seen.changes(replace(frame, rotary_inertia=True))
        found += _mended(seen, what, "rotary-inertia", changes)
    return found + _stubby(frame)


def with_shear(frame: Frame) -> Frame:
    """Return the frame of Timoshenko beams, with the rotary inertia that it had."""
    members = tuple(
        m
        if m.section.kappa is not None
        else replace(m, section=replace(m.section, kappa=constant_kappa(_KAPPA)))
        for m in frame.members
    )
    return replace(frame, beam="timoshenko", rotary_inertia=frame.rotary_share, members=members)


def _by_shear(seen: Seen, frame: Frame) -> FloatArray | None:
    """Return the changes by shear; beyond 5000 dofs by adding the flexibilities, (count,).

    1/lambda grows by W / lambda^2, W the sum of L (Vy^2 / (kappa_y G A) + Vz^2 / (kappa_z G A))
    over the elements with the shear forces V of the mode (Dunkerley's sum). The matrix at full
    flexibility would not do: on a fine mesh shear takes over within an element, and the old nodal
    displacements are far from the new ones.
    """
    if seen.model.size <= SOLVED_LIMIT:
        return seen.changes(frame)
    structure = seen.model.frame_structure
    whole = nominal_properties(frame, structure.mesh)
    modes = seen.modes.take(np.arange(seen.count))
    local = np.asarray(structure.gather @ modes.shapes).reshape(len(whole), 12, -1)
    force = stiffness_matrices(structure.properties)[:, 1:3] @ local
    flexibility = np.column_stack([whole.flex_y, whole.flex_z])
    length = whole.length - whole.rigid_1 - whole.rigid_2
    work = np.einsum("e,ed,edm->m", length, flexibility, np.square(force))
    return np.asarray(1.0 / np.sqrt(1.0 + work / modes.eigenvalues) - 1.0)


def _mended(seen: Seen, what: str, effect: str, changes: FloatArray | None) -> list[LookWarning]:
    if changes is None or not seen.exceeds(changes, _NOTABLE, _NOTABLE_DEVIATIONS):
        return []
    return [LookWarning(f"{what}: {_largest(changes)}.", "all", effect, percent(changes))]


def _largest(changes: FloatArray) -> str:
    worst = int(np.abs(changes).argmax())
    return f"it changes mode {worst + 1} by {100.0 * changes[worst]:+.2g} %"


def _stubby(frame: Frame) -> list[LookWarning]:
    """Return one warning about all members that are short for their height."""
    corners = frame.corners[frame.member_ends]
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    height = np.array([_height(frame, m.section) for m in frame.members])
    ratio = length / np.where(height > 0.0, height, 1e-300)
    short = np.flatnonzero(ratio < _STUBBY)
    if len(short) == 0:
        return []
    names = [frame.members[k].name for k in short]
    what = (
        f"{len(short)} of {len(frame.members)} members are shorter than {_STUBBY:g} times their "
        f"height, down to {ratio[short].min():.2g}: beams describe them roughly, and what happens "
        "in their joints counts."
    )
    where = "all" if len(names) == len(frame.members) else ", ".join(names)
    return [LookWarning(what, where, "")]


def _height(frame: Frame, section: Section) -> float:
    """Return the size of a section in its plane of bending, sqrt(12 I / A) without a shape."""
    by_numbers = float(np.sqrt(12.0 * max(section.Iy, section.Iz) / section.A))
    if section.height is None or section.width is None:
        return by_numbers
    return max(section.height, section.width) if frame.plane == "3d" else section.height


def look_at_materials(seen: Seen) -> list[LookWarning]:
    """Return materials and shear coefficients outside of what exists."""
    frame = seen.model.frame_structure.frame
    found: list[LookWarning] = []
    for material in dict.fromkeys(m.material for m in frame.members):
        where = _members_of(frame, material)
        ratio = material.E / material.rho
        if not _STIFF_PER_MASS[0] <= ratio <= _STIFF_PER_MASS[1]:
            what = (
                f"E / rho = {ratio:.3g} m2/s2 is that of no structural material (metals have "
                "about 2.5e7): a wrong unit of E or of the density?"
            )
            found.append(LookWarning(what, where, ""))
        if not _POISSON[0] <= material.nu < _POISSON[1]:
            what = f"Poisson's ratio {material.nu:g} is not between 0 and 0.5."
            found.append(LookWarning(what, where, ""))
    return found + _shear_coefficients(frame)


def _shear_coefficients(frame: Frame) -> list[LookWarning]:
    found = []
    for member in frame.members:
        values = _kappa(member)
        if values and not all(_SHEAR_COEFFICIENT[0] <= k <= _SHEAR_COEFFICIENT[1] for k in values):
            said = " and ".join(f"{k:.3g}" for k in dict.fromkeys(values))
            what = f"The shear coefficient {said} is not between 0.2 and 1."
            found.append(LookWarning(what, member.name, ""))
    return found


def _kappa(member: Member) -> tuple[float, ...]:
    kappa = member.section.kappa
    return () if kappa is None else kappa(member.material.nu)


def _members_of(frame: Frame, material: Material) -> str:
    names = [m.name for m in frame.members if m.material == material]
    return "all" if len(names) == len(frame.members) else ", ".join(names)
