"""Known changes of a structure that masses and springs cannot say: supports, parts, members.

The frame is changed and meshed anew, with what an update had set in its elements; what it had
changed in the matrices stays at the degrees of freedom that are still there. Of matrices from
files, degrees of freedom are held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.frame import Frame, GroundSpring, Member, Place, PointMass, Support
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.mesh import ON_MEMBER, locate, place_xyz
from femubench.core.fem.model import Geometry, Model, carry_over
from femubench.core.fem.parameters import Property
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

Removable = Member | Support | PointMass | GroundSpring
_KAPPA = 5.0 / 6.0  # of a section without one, in a model that an update gave shear


@dataclass(frozen=True)
class Exchange:
    """Another section or material of a member; None for the one that it has."""

    member: str
    section: Section | None = None
    material: Any = None


@dataclass(frozen=True)
class Alteration:
    """What changes of a structure apart from further masses and springs.

    Arguments:
        removed: parts of the structure as drawn that are taken away.
        groups: names of those of the stiffness of matrices that are taken away.
    """

    supports: tuple[Support, ...] = ()
    removed: tuple[Removable, ...] = ()
    exchanged: tuple[Exchange, ...] = ()
    groups: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.supports or self.removed or self.exchanged or self.groups)


@dataclass(frozen=True)
class _Held:
    """A geometry of which some dofs are held."""

    base: Geometry
    kept: IntArray

    def observe(self, sensors: Sensors) -> SparseArray:
        return sp.csr_array(self.base.observe(sensors))[:, self.kept]

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        mass, stiffness = self.base.assemble_attachments(masses, springs)
        return _block(mass, self.kept), _block(stiffness, self.kept)


@dataclass(frozen=True)
class _Remaining:
    """A frame that has lost members: what was drawn or measured there is at rest."""

    base: Structure

    def observe(self, sensors: Sensors) -> SparseArray:
        there = np.flatnonzero([self._has(xyz) for xyz in sensors.xyz])
        place = np.ones(len(there)), (there, np.arange(len(there)))
        own = self.base.observe(sensors.take(there))
        return sp.csr_array(place, shape=(len(sensors), len(there))) @ own

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        return self.base.assemble_attachments(masses, springs)

    def _has(self, xyz: FloatArray) -> bool:
        try:
            locate(self.base.frame, xyz)
        except ModelError:
            return False
        return True


def alter_model(model: Model, alteration: Alteration) -> Model:
    """Return a model with an alteration, and with whatever an update changed of the rest.

    Raises:
        ModelError: when a part is not there, or what is left is no frame.
        NotApplicable: where parts are to be taken of matrices.
    """
    if model.structure is None:
        if alteration.removed or alteration.exchanged:
            what = "the model came as matrices, in which nothing but supports can be added"
            raise NotApplicable(what)
        for place in (f"{Groups.PREFIX}{name}" for name in alteration.groups):
            model = Groups(model).with_factors([Property(place, "E", (place,))], [0.0])
        return _hold(model, alteration.supports) if alteration.supports else model
    old, members = model.structure, [p for p in alteration.removed if isinstance(p, Member)]
    if (members or alteration.exchanged) and not model.has_matrices(*old.matrices()):
        what = "the matrices were updated as a whole, in which no member can be taken or exchanged"
        raise NotApplicable(what)
    gone, frame = {member.name for member in members}, alter_frame(old.frame, alteration)
    kept = replace(old, changes=tuple(_changes_without(old, gone)))
    new = Model.of(kept.rebuilt(frame))
    if new.size == 0:
        raise ModelError("nothing can move any more")
    if gone or alteration.exchanged:
        return replace(new, geometry=_Remaining(new.frame_structure)) if gone else new
    return carry_over(model, new, held=True)


def _changes_without(old: Structure, gone: set[str]) -> Any:  # noqa: ANN401 - pairs
    """Yield what was set since a frame was built, without members that are taken away."""
    for parameter, value in old.changes:
        left = (p for p in parameter.places if p.partition("/")[0].partition("@")[0] not in gone)
        if places := tuple(left):
            yield replace(parameter, places=places), value


def alter_frame(frame: Frame, alteration: Alteration) -> Frame:
    """Return a frame with an alteration.

    With a member goes what sits on it, and on joints at which no other member ends.

    Raises:
        ModelError: when a part is not there, or what is left does not hang together.
    """
    for part in alteration.removed:
        if isinstance(part, Member):
            continue
        taken = find_removed(frame, part)
        left: dict[str, Any] = {
            key: tuple(own for own in getattr(frame, key) if not any(own is t for t in taken))
            for key in ("masses", "springs", "supports")
        }
        frame = replace(frame, **left)
    gone = {part.name for part in alteration.removed if isinstance(part, Member)}
    frame = _without_members(frame, gone) if gone else frame
    changed = {item.member: item for item in alteration.exchanged}
    unknown = changed.keys() - frame.member_index.keys()
    if unknown:
        raise ModelError(f"there is no member {min(unknown)!r} to exchange")
    members = tuple(
        _exchanged(frame, m, changed[m.name]) if m.name in changed else m for m in frame.members
    )
    free = frame.free and not alteration.supports
    return replace(frame, members=members, supports=frame.supports + alteration.supports, free=free)


def _exchanged(frame: Frame, member: Member, item: Exchange) -> Member:
    section = item.section or member.section
    if section.kappa is None and frame.beam == "timoshenko":
        section = replace(section, kappa=Section.constant_kappa(_KAPPA))
    return replace(member, section=section, material=item.material or member.material)


def find_removed(frame: Frame, part: Removable) -> tuple[Removable, ...]:
    """Return what a part of a frame as drawn is after an update.

    A support may sit elsewhere, or have become springs.

    Raises:
        ModelError: when nothing of it is there.
    """
    if isinstance(part, Member):
        return (part,)
    found: list[Removable] = []
    if isinstance(part, Support):
        found += [s for s in frame.supports if _same_point(frame, s.at, part.at)]
        soft = {
            d for d in part.fixed if not any(d in s.fixed for s in frame.supports if s in found)
        }
        springs = (s for s in frame.springs if s.direction.lstrip("+-") in soft)
        found += [s for s in springs if _same_point(frame, s.at, part.at)]
        if not found:
            xyz = place_xyz(frame, part.at)
            moved = [s for s in frame.supports if s.fixed == part.fixed]
            moved.sort(key=lambda s: float(np.linalg.norm(place_xyz(frame, s.at) - xyz)))
            found += moved[:1]
    else:
        parts = frame.masses if isinstance(part, PointMass) else frame.springs
        same: list[Removable] = [own for own in parts if own == part]
        found += (same or [own for own in parts if _alike(frame, own, part)])[:1]
    if not found:
        raise ModelError(f"there is nothing to take away at {part.at}")
    return tuple(found)


def _alike(frame: Frame, one: PointMass | GroundSpring, other: PointMass | GroundSpring) -> bool:
    names = (getattr(item, "direction", "").lstrip("+-") for item in (one, other))
    return len(set(names)) == 1 and _same_point(frame, one.at, other.at)


def _same_point(frame: Frame, one: Place, other: Place) -> bool:
    return float(np.linalg.norm(place_xyz(frame, one) - place_xyz(frame, other))) <= ON_MEMBER


def _without_members(frame: Frame, gone: set[str]) -> Frame:
    members = tuple(m for m in frame.members if m.name not in gone)
    linked = {name for link in frame.links for name in (link.leads, *link.follows)}
    used = {name for m in members for name in m.ends} | linked
    idle = {name for m in frame.members for name in m.ends} - used

    def stays(at: Place) -> bool:
        return at.joint not in idle and at.member not in gone

    own: dict[str, Any] = {
        key: tuple(part for part in getattr(frame, key) if stays(part.at))
        for key in ("masses", "springs", "supports", "oscillators")
    }
    own |= {
        key: tuple(part for part in getattr(frame, key) if part.member not in gone)
        for key in ("joint_springs", "rigid_ends", "preloads", "eccentricities", "couplings")
    }
    factors = (
        replace(f, at=tuple(p for p in f.at if p.partition("/")[0] not in gone))
        for f in frame.factors
    )
    sets = (
        replace(s, members=tuple(name for name in s.members if name not in gone))
        for s in frame.sets
    )
    found = replace(
        frame,
        **own,
        joints=tuple(joint for joint in frame.joints if joint.name not in idle),
        members=members,
        braces=tuple(b for b in frame.braces if not idle & set(b.ends)),
        factors=tuple(f for f in factors if f.at),
        sets=tuple(s for s in sets if s.members),
    )
    if not members:
        raise ModelError("no member is left")
    pairs = [m.ends for m in members] + [b.ends for b in found.braces]
    pairs += [(link.leads, name) for link in found.links for name in link.follows]
    ends = np.array([[found.joint_index[joint] for joint in pair] for pair in pairs])
    shape = (len(found.joints), len(found.joints))
    graph = sp.csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=shape)
    bodies = sp.csgraph.connected_components(graph, directed=False)[0]
    if bodies > 1:
        raise ModelError("without it the structure falls apart")
    return found


def _hold(model: Model, supports: Sequence[Support]) -> Model:
    """Return matrices of which some rows are held."""
    springs = [GroundSpring(s.at, direction, 1.0) for s in supports for direction in s.fixed]
    held: BoolArray = model.geometry.assemble_attachments((), springs)[1].diagonal() != 0.0
    kept = np.flatnonzero(~held)
    if not len(kept):
        raise ModelError("nothing can move any more")
    return replace(
        model,
        mass=_block(model.mass, kept),
        stiffness=_block(model.stiffness, kept),
        dofs=model.dofs.take(kept),
        geometry=_Held(model.geometry, kept),
        mass_change=model.mass_change and model.mass_change.take(kept),
        stiffness_change=model.stiffness_change and model.stiffness_change.take(kept),
        free=False,
        groups={name: _block(part, kept) for name, part in model.groups.items()},
        mass_groups={name: _block(part, kept) for name, part in model.mass_groups.items()},
        powers=model.map_powers(*[lambda part: _block(part, kept)] * 2),
        grounds={name: edge.take(kept) for name, edge in model.grounds.items()},
    )


def _block(matrix: SparseArray, kept: IntArray) -> SparseArray:
    return sp.csc_array(sp.csr_array(matrix)[kept][:, kept])
