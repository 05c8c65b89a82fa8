"""Whether the members are beams at all, and whether materials and sections make sense."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.frame import Frame, Material, Member
from femubench.core.fem.sections import Section
from femubench.core.look.modes import Seen
from femubench.core.schema.diagnosis import LookWarning

_STUBBY = 8.0  # length over height
# E / rho in m2/s2: metals 2.3e7 to 2.8e7, magnesium to beryllium alloys 2e7 to 2e8, plastics 2e6.
_STIFF_PER_MASS = (1e6, 4e8)
_POISSON = (0.0, 0.5)
_SHEAR_COEFFICIENT = (0.2, 1.0)


def look_at_slenderness(seen: Seen) -> list[LookWarning]:
    """Return one warning about all members that are short for their height."""
    frame = seen.model.frame_structure.frame
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
