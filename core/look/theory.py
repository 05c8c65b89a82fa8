"""Whether the members are beams at all, and whether materials and sections make sense."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.frame import Member
from femubench.core.fem.joints import whole_members
from femubench.core.fem.sections import Section
from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import FloatArray


def look_at_slenderness(seen: Seen) -> list[LookWarning]:
    """Return one warning about all members that are short for their height.

    Members are whole ones, from one real joint to the next, and their height is their size in
    the direction in which the modes bend them.
    """
    frame = seen.model.frame_structure.frame
    corners = frame.corners[frame.member_ends]
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    share = _bending(seen)
    short, least = [], np.inf
    whole = whole_members(frame)
    for pieces in whole:
        rows = [frame.member_index[name] for name in pieces]
        bends = share[rows].sum(axis=0).max(axis=1) > settings.quiet_share
        height = _sizes(frame.members[rows[0]].section)[bends].max(initial=0.0)
        if length[rows].sum() < settings.stubby * height:
            least = min(least, length[rows].sum() / height)
            short.append(pieces)
    if not short:
        return []
    what = (
        f"{len(short)} of {len(whole)} members are shorter than {settings.stubby:g} times their "
        f"height, down to {least:.2g}: beams describe them roughly, and what happens "
        "in their joints counts."
    )
    names = [name for pieces in short for name in pieces]
    where = "all" if len(names) == len(frame.members) else ", ".join(names)
    return [LookWarning(what, where, "")]


def _bending(seen: Seen) -> FloatArray:
    """Return the share of every mode's energy in the bending of members, (n_members, 2, count).

    Along local z first, then along local y.
    """
    structure = seen.model.frame_structure
    modes = seen.modes.take(np.arange(seen.count))
    local = (structure.gather @ modes.shapes).reshape(-1, 12, len(modes))
    stiffness, member = structure.properties.stiffness_matrices(), structure.mesh.member
    share = np.zeros((len(structure.frame.members), 2, len(modes)))
    across = [2, 4, 8, 10], [1, 5, 7, 11]  # local dofs of bending along z and along y
    for k, slots in enumerate(across):
        own = local[:, slots]
        energy = np.einsum("eim,eim->em", own, stiffness[:, slots][:, :, slots] @ own)
        np.add.at(share[:, k], member, energy / modes.eigenvalues)
    return share


def _sizes(section: Section) -> FloatArray:
    """Return the sizes of a section along local z and y, sqrt(12 I / A) without a shape, (2,)."""
    if section.height is None or section.width is None:
        return np.sqrt(12.0 * np.array([section.Iy, section.Iz]) / section.A)
    return np.array([section.height, section.width])


def look_at_materials(seen: Seen) -> list[LookWarning]:
    """Return materials and shear coefficients outside of what exists."""
    frame = seen.model.frame_structure.frame
    found: list[LookWarning] = []
    for material in dict.fromkeys(m.material for m in frame.members):
        names = [m.name for m in frame.members if m.material == material]
        where = "all" if len(names) == len(frame.members) else ", ".join(names)
        ratio = material.E / material.rho
        low, high = settings.stiffness_per_mass
        if not low <= ratio <= high:
            what = (
                f"E / rho = {ratio:.3g} m2/s2 is that of no structural material (metals have "
                "about 2.5e7): a wrong unit of E or of the density?"
            )
            found.append(LookWarning(what, where, ""))
        if not 0.0 <= material.nu < 0.5:
            what = f"Poisson's ratio {material.nu:g} is not between 0 and 0.5."
            found.append(LookWarning(what, where, ""))
    for member in frame.members:
        values, (low, high) = _kappa(member), settings.shear_coefficient
        if values and not all(low <= k <= high for k in values):
            said = " and ".join(f"{k:.3g}" for k in dict.fromkeys(values))
            what = f"The shear coefficient {said} is not between {low:g} and {high:g}."
            found.append(LookWarning(what, member.name, ""))
    return found


def _kappa(member: Member) -> tuple[float, ...]:
    kappa = member.section.kappa
    return () if kappa is None else kappa(member.material.nu)
