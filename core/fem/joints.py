"""Joints of any frame: roles, springs and rigid ends as for the H-frame; zones that may give."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import ACTIVE, Factor, Frame, JointSpring, Member, RigidEnd, halves_of
from femubench.core.fem.mesh import member_axes
from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray, IntArray

_COLLINEAR = np.cos(np.radians(175.0))
# An arm takes this much of the element behind it at most; a rigid length likewise.
_LARGEST_SHARE = 0.9
_ROUNDING = 1e-9


@dataclass(frozen=True)
class JointGroup:
    """Member ends that are alike: the same joint type, the same role.

    Arguments:
        type: the joint type; the joint's name where it has none; ``all`` for every joint.
        role: ``through`` for two collinear ends that pass a third one, ``branch`` for what meets
            them there, ``end`` where no member passes (L joints, splices, corners).
        ends: ``member@joint``.
    """

    type: str
    role: str
    ends: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return e.g. ``T branch``; ``L`` where there is one role only."""
        return self.type if self.role == "end" else f"{self.type} {self.role}"


def _outward(frame: Frame, member: Member, joint: str) -> FloatArray:
    first, last = frame.corners[frame.member_ends[frame.member_index[member.name]]]
    axis = (last - first) / np.linalg.norm(last - first)
    return np.asarray(axis if member.ends[0] == joint else -axis)


def _members_at(frame: Frame, joint: str) -> list[Member]:
    return [frame.members[frame.member_index[name]] for name in frame.ends_at(joint)]


def _roles(frame: Frame, joint: str) -> dict[str, str]:
    """Return the role of every member at a joint.

    The first collinear pair in the frame's order passes through; what else meets there branches
    off.
    """
    members = _members_at(frame, joint)
    if len(members) > 2:
        for first, second in combinations(members, 2):
            if _outward(frame, first, joint) @ _outward(frame, second, joint) < _COLLINEAR:
                through = (first.name, second.name)
                return {m.name: "through" if m.name in through else "branch" for m in members}
    return {member.name: "end" for member in members}


def whole_members(frame: Frame) -> tuple[tuple[str, ...], ...]:
    """Return the members between real joints, each as the pieces that it is described by.

    A joint is none where two collinear members of one section and material meet, and nothing
    but masses is attached.
    """
    real = {name for link in frame.links for name in (link.leads, *link.follows)}
    real |= {item.at.joint for item in frame.supports if item.at.joint is not None}
    real |= {spring.joint for spring in frame.joint_springs}
    real |= {name for brace in frame.braces for name in brace.ends}
    whole = {member.name: [member.name] for member in frame.members}
    for joint in frame.joints:
        pair = _members_at(frame, joint.name)
        if len(pair) != 2 or joint.name in real:
            continue
        one, other = pair
        alike = one.section == other.section and one.material == other.material
        straight = _outward(frame, one, joint.name) @ _outward(frame, other, joint.name)
        if alike and straight < _COLLINEAR and whole[one.name] is not whole[other.name]:
            whole[one.name] += whole[other.name]
            for name in whole[other.name]:
                whole[name] = whole[one.name]
    return tuple(tuple(pieces) for name, pieces in whole.items() if pieces[0] == name)


def joint_groups(frame: Frame, *, merged: bool = False) -> tuple[JointGroup, ...]:
    """Return the member ends at joints, by joint type and role.

    Arguments:
        frame: any frame; an end without a second member is no joint.
        merged: take all joints for one type.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for joint in frame.joints:
        roles = _roles(frame, joint.name)
        if len(roles) > 1:
            kind = "all" if merged else joint.family
            for member, role in roles.items():
                found.setdefault((kind, role), []).append(f"{member}@{joint.name}")
    return tuple(JointGroup(kind, role, tuple(ends)) for (kind, role), ends in found.items())


def place_words(structure: Structure | None, places: Sequence[str]) -> str:
    """Return places as one text, ``; `` between them: whole members and the whole frame as such.

    Arguments:
        structure: the frame; None for a model that came as matrices.
        places: elements as ``member/k``, or any other places.
    """
    wanted = dict.fromkeys(places)
    if structure is not None and len(wanted) > 1:
        every = structure.elements
        if wanted.keys() >= set(every):
            return "all"
        members: dict[str, list[str]] = {}
        for label in every:
            members.setdefault(label.rpartition("/")[0], []).append(label)
        for name, labels in members.items():
            if len(labels) > 1 and wanted.keys() >= set(labels):
                wanted = dict.fromkeys(name if word in labels else word for word in wanted)
    return "; ".join(wanted)


def elements_at(structure: Structure, group: JointGroup) -> tuple[str, ...]:
    """Return the labels of the elements that touch joints at the ends of a group."""
    return tuple(
        dict.fromkeys(structure.labels[structure.element_ends[end][0]] for end in group.ends)
    )


def _bends(frame: Frame, member: str) -> bool:
    """Tell whether a member resists bending; a rod of a truss does not."""
    section = frame.members[frame.member_index[member]].section
    return max(section.Iy, section.Iz) > 0.0


def half_depth(frame: Frame, end: str) -> float:
    """Return half the depth of the member that crosses a member end, along that member, in m.

    Of several, the one that stands squarest on it counts; a member that only continues it has no
    depth to offer, nor has one whose section was given as numbers.
    """
    name, _, joint = end.rpartition("@")
    members = _members_at(frame, joint)
    own = next(member for member in members if member.name == name)
    direction = _outward(frame, own, joint)
    others = [member for member in members if member.name != name]
    crossing = min(others, key=lambda m: abs(float(_outward(frame, m, joint) @ direction)))
    axes = member_axes(frame, crossing)[0]
    across = np.abs(axes @ direction)
    if across[0] > -_COLLINEAR:
        return 0.0
    section = crossing.section
    depth = section.width if across[1] > across[2] else section.height
    return 0.5 * (depth or 0.0)


def length_drawn_twice(frame: Frame, end: str) -> float:
    """Return the length in m that a branch has between its joint and the face of what passes there.

    That is along its own axis, so that it grows with the skew. It is 0 where nothing passes, for
    what one member lacks beyond the joint another has; where a section was given as numbers; at a
    branch that is deeper than what passes and has no face to end at; and where two tubes cross,
    for no centre line tells which of them is cut.
    """
    name, _, joint = end.rpartition("@")
    members, roles = {m.name: m for m in _members_at(frame, joint)}, _roles(frame, joint)
    own, direction = members[name], _outward(frame, members[name], joint)
    arms = {(spring.member, spring.joint) for spring in frame.joint_springs}
    arms |= {(rigid.member, rigid.joint) for rigid in frame.rigid_ends}
    if roles[name] != "branch" or (name, joint) in arms:
        return 0.0
    crosses = any(_outward(frame, m, joint) @ direction < _COLLINEAR for m in members.values())
    found = []
    for other in (members[name] for name, role in roles.items() if role == "through"):
        shapes = {own.section.shape, other.section.shape}
        across = np.cross(_outward(frame, other, joint), direction)
        deeper = _size(frame, own, across) > _size(frame, other, across) * (1.0 + _ROUNDING)
        if "" in shapes or deeper or (crosses and shapes != {"solid-rectangle"}):
            return 0.0
        parts = np.abs(member_axes(frame, other)[0][1:] @ direction) / _sizes(other)
        round_ = other.section.shape == "round-tube"
        found.append(0.5 / float(np.linalg.norm(parts) if round_ else parts.max()))
    return float(np.mean(found))


def _sizes(member: Member) -> FloatArray:
    return np.array([member.section.width or 0.0, member.section.height or 0.0])


def _size(frame: Frame, member: Member, across: FloatArray) -> float:
    return float(np.abs(member_axes(frame, member)[0][1:] @ across) @ _sizes(member))


@dataclass(frozen=True)
class Joints:
    """The joints of a meshed frame and the ends of members there, ``member@joint``."""

    structure: Structure

    def groups(self, *, merged: bool = False) -> tuple[JointGroup, ...]:
        """Return the member ends at joints, by joint type and role, as `joint_groups`.

        Examples:
            >>> [group.name for group in update.Joints(structure).groups()]
            ['L', 'T through', 'T branch']
        """
        return joint_groups(self.structure.frame, merged=merged)

    def groups_within(self, count: int, *, passing: bool = True) -> tuple[JointGroup, ...]:
        """Return the joint groups, at most so many: all joints as one type where need be.

        Arguments:
            count: how many groups there may be.
            passing: whether the groups of passing ends count.

        Raises:
            NotApplicable: when the frame has no joint.

        Examples:
            >>> [group.name for group in update.Joints(structure).groups_within(3)]
            ['L', 'T through', 'T branch']
        """
        for merged in (False, True):
            groups = self.groups(merged=merged)
            if not groups:
                raise NotApplicable("no two members meet in a joint")
            if sum(passing or group.role != "through" for group in groups) <= count:
                return groups
        return (JointGroup("all", "end", tuple(end for group in groups for end in group.ends)),)

    def flexible_ends(self, group: JointGroup) -> tuple[str, ...]:
        """Return the ends of a group that take a spring: all but one a joint where none passes.

        At a joint of two members, a spring at one end or at the other is the same; with more, the
        first member stays tied to the joint so that the joint keeps its inertia.

        Examples:
            >>> update.Joints(structure).flexible_ends(joints[0])
            ('back-right@J1', 'front-right@J3', 'rung-left@J7', 'back-left@J9')
        """
        frame = self.structure.frame
        taken = {f"{spring.member}@{spring.joint}" for spring in frame.joint_springs}
        ends = tuple(end for end in group.ends if _bends(frame, end.rpartition("@")[0]))
        if group.role == "through":
            return ()
        if group.role == "end":
            first: set[str] = set()
            for joint in {end.rpartition("@")[2] for end in ends}:
                bent = (m.name for m in _members_at(frame, joint) if _bends(frame, m.name))
                first.add(f"{next(bent)}@{joint}")
            ends = tuple(end for end in ends if end not in first)
        return tuple(end for end in ends if end not in taken)

    def half_depth(self, end: str) -> float:
        """Return half the depth of the member that crosses a ``member@joint`` end, as `half_depth`.

        Examples:
            >>> round(update.Joints(structure).half_depth("rung-middle@J5"), 4)
            0.0127
        """
        return half_depth(self.structure.frame, end)

    def available_length(self, end: str) -> float:
        """Return the longest arm or rigid length that the element at a member end can take in m.

        Examples:
            >>> round(update.Joints(structure).available_length("rung-middle@J5"), 4)
            0.0629
        """
        structure = self.structure
        element, name = structure.element_ends[end][0], end.rpartition("@")[0]
        joints = structure.frame.members[structure.frame.member_index[name]].ends
        both = sum(structure.element_ends[f"{name}@{joint}"][0] == element for joint in joints)
        return _LARGEST_SHARE * float(structure.properties.length[element]) / both

    def spring_estimates(self, ends: tuple[str, ...]) -> dict[str, float]:
        """Return initial joint stiffnesses in local directions, N/m and N m/rad.

        Twice EA/L, 12 EI/L^3, 4 EI/L and GJ/L of the element behind the spring, averaged over the
        ends.

        Source: Horton et al. (1999), section 7; GJ/L by analogy.

        Examples:
            >>> list(update.Joints(structure).spring_estimates(("rung-middle@J5",)))
            ['z', 'rx', 'ry']
        """
        frame, rows = self.structure.frame, []
        for end in ends:
            member = frame.members[frame.member_index[end.rpartition("@")[0]]]
            s, m = member.section, member.material
            length = member_axes(frame, member)[1] / member.elements
            rows.append(
                {
                    "x": 2.0 * m.E * s.A / length,
                    "y": 24.0 * m.E * s.Iz / length**3,
                    "z": 24.0 * m.E * s.Iy / length**3,
                    "rx": 2.0 * m.G * s.J / length,
                    "ry": 8.0 * m.E * s.Iy / length,
                    "rz": 8.0 * m.E * s.Iz / length,
                }
            )
        return {name: float(np.mean([row[name] for row in rows])) for name in ACTIVE[frame.plane]}

    def spring_ends(
        self,
        stiffness: Mapping[str, Mapping[str, float]],
        arms: Mapping[str, float],
        arm_factor: float | None = None,
    ) -> Frame:
        """Return the frame with springs at member ends, in series with those that are there.

        Arguments:
            stiffness: from ``member@joint`` to local directions to N/m or N m/rad; infinite ones
                are rigid and leave the arm.
            arms: length in m of the massless arm before a new spring, by end.
            arm_factor: the arm's rigidities in those of the member; None for a rigid arm.

        Examples:
            >>> softer = update.Joints(structure).spring_ends(
            ...     {"rung-middle@J5": {"ry": 1e4}}, {"rung-middle@J5": 0.01}
            ... )
            >>> dict(softer.joint_springs[0].stiffness)
            {'ry': 10000.0}
        """
        frame = self.structure.frame
        springs = {f"{s.member}@{s.joint}": s for s in frame.joint_springs}
        for end, own in stiffness.items():
            member, _, joint = end.rpartition("@")
            fresh = JointSpring(
                joint, member, {}, arms[end], arm_factor if arms[end] > 0.0 else None
            )
            spring = springs.get(end, fresh)
            joined = dict(spring.stiffness)
            for direction, value in own.items():
                if np.isfinite(value):
                    there = joined.get(direction)
                    joined[direction] = value if there is None else value * there / (value + there)
            springs[end] = replace(spring, stiffness=joined)
        return replace(frame, joint_springs=tuple(springs.values()))

    def with_springs(
        self,
        stiffness: Mapping[str, Mapping[str, float]],
        *,
        arm: float | None = None,
        arm_factor: float | None = 5.0,
    ) -> Structure:
        """Return the frame with a flexible connection at member ends, figure 1 of the source.

        Arguments:
            stiffness: from ``member@joint`` to local directions to N/m or N m/rad.
            arm: length of the massless arm in m; None for half the depth of the crossing member,
                shortened where the end element is too short for it.
            arm_factor: the arm's rigidities in those of the member; None for a rigid arm.

        Source: Horton et al. (1999), section 3.1.

        Examples:
            >>> springs = {"rung-middle@J5": {"rx": 1e4, "ry": 1e4}}
            >>> len(update.Joints(structure).with_springs(springs).frame.joint_springs)
            1
        """
        arms = {
            end: min(self.half_depth(end), self.available_length(end)) if arm is None else arm
            for end in stiffness
        }
        return self.structure.rebuilt(self.spring_ends(stiffness, arms, arm_factor))

    def with_rigid_ends(self, lengths: Mapping[str, tuple[float, float]]) -> Structure:
        """Return the frame with partly rigid elements at member ends, figure 2 of the source.

        Arguments:
            lengths: from ``member@joint`` to the rigid lengths a in the stiffness and a0 in the
                mass matrix, in m.

        Source: Horton et al. (1999), section 3.2, equation (5).

        Examples:
            >>> rigid = update.Joints(structure).with_rigid_ends({"rung-middle@J5": (0.01, 0.0)})
            >>> len(rigid.frame.rigid_ends)
            1
        """
        rigid = []
        for end, (a, a0) in lengths.items():
            member, _, joint = end.rpartition("@")
            rigid.append(RigidEnd(joint, member, a, a0))
        frame = self.structure.frame
        return self.structure.rebuilt(replace(frame, rigid_ends=frame.rigid_ends + tuple(rigid)))


def without_overlaps(structure: Structure, group: JointGroup) -> Structure:
    """Return the frame without the mass that branches have inside the member that passes them."""
    joints = Joints(structure)
    twice = {end: length_drawn_twice(structure.frame, end) for end in group.ends}
    lengths = {
        end: (0.0, min(length, joints.available_length(end)))
        for end, length in twice.items()
        if length
    }
    return joints.with_rigid_ends(lengths) if lengths else structure


@dataclass(frozen=True)
class JointZones:
    """The ends of a frame's members that may give at joints, at most a `part` of each member."""

    structure: Structure
    part: float

    @cached_property
    def ends(self) -> dict[tuple[str, str], list[str]]:
        """Return ``member@joint`` by joint type and role; a foot is an end that is held alone.

        Where a member only goes on there is no joint.
        """
        found, frame = dict[tuple[str, str], list[str]](), self.structure.frame
        within = {name: pieces for pieces in whole_members(frame) for name in pieces}
        for group in joint_groups(frame):
            for end in group.ends:
                ends = frame.ends_at(end.rpartition("@")[2])
                if len(ends) > 2 or len({within[name] for name in ends}) > 1:
                    found.setdefault((group.type, group.role), []).append(end)
        held = {str(s.at) for s in frame.supports} | {str(s.at) for s in frame.springs}
        for joint in frame.joints:
            ends = frame.ends_at(joint.name)
            if joint.name in held and len(ends) == 1:
                found.setdefault((joint.family, "foot"), []).append(f"{ends[0]}@{joint.name}")
        return found

    @cached_property
    def labels(self) -> dict[int, str]:
        """Return by element what the factors of a frame call it."""
        return {row: at for at, own in self.structure.place_index.items() for row in own.tolist()}

    def zone(self, end: str) -> tuple[IntArray, float]:
        """Return the elements of a zone, one at least, (k,), and its length in m.

        It reaches half the depth of what crosses, and once the own depth, from the joint's centre.

        Arguments:
            end: ``member@joint``.
        """
        structure, (name, _, joint) = self.structure, end.rpartition("@")
        frame, mesh = structure.frame, structure.mesh
        number = frame.member_index[name]
        own = np.flatnonzero(mesh.member == number)
        own = own[np.argsort(mesh.stations[own, 0])]
        own = own[[bool(structure.labels[row]) for row in own]]
        if structure.element_ends[end][1] == 1:
            own = own[::-1]
        section, length = frame.members[number].section, structure.properties.length[own]
        crossing = half_depth(frame, end) if len(frame.ends_at(joint)) > 1 else 0.0
        reach = crossing + max(section.height or 0.0, section.width or 0.0)
        reach = min(reach, self.part * float(length.sum()))
        inside = np.cumsum(length) - 0.5 * length < reach
        inside[0] = True
        return np.asarray(own[inside]), reach

    def halve(self) -> Structure:
        """Return the frame with halves of elements at joints where a zone is no longer.

        A zone as long as a coarse element would act on modes that hardly bend the joint.
        """
        structure, halves = self.structure, dict[str, None]()
        for end in (end for ends in self.ends.values() for end in ends):
            (first, *_), reach = self.zone(end)
            # The middle of the other half lies behind the zone.
            if 0.75 * structure.properties.length[first] > reach:
                halves[halves_of(structure.labels[first])[structure.element_ends[end][1]]] = None
        return self._with_softer({1.0: halves}, structure.frame) if halves else structure

    def stiffen(self, ends: Iterable[str]) -> Structure:
        """Return the frame with members rigid up to the faces of what they meet, soft behind.

        Under a constant moment a zone turns as drawn, so that what no data see stays as drawn; but
        what gives does so at a face, where moments are others than at the crossing of centre lines.

        Arguments:
            ends: ``member@joint`` of each.
        """
        structure, joints = self.structure, Joints(self.structure)
        rigid = {f"{one.member}@{one.joint}": one for one in structure.frame.rigid_ends}
        soft = defaultdict[float, dict[str, None]](dict)
        for end in ends:
            member, _, joint = end.rpartition("@")
            there = rigid.get(end, RigidEnd(joint, member, 0.0))  # its overlap may be out
            arm = min(joints.half_depth(end), joints.available_length(end))
            if arm > 0.0 == there.stiffness_length:
                rows, _ = self.zone(end)
                share = round(1.0 - arm / float(structure.properties.length[rows].sum()), 6)
                rigid[end] = replace(there, stiffness_length=arm)
                soft[share] |= dict.fromkeys(self.labels[row] for row in rows.tolist())
        frame = replace(structure.frame, rigid_ends=tuple(rigid.values()))
        return self._with_softer(soft, frame) if soft else structure

    def _with_softer(self, soft: Mapping[float, Iterable[str]], frame: Frame) -> Structure:
        factors = (Factor("E", tuple(labels), share) for share, labels in soft.items())
        return self.structure.rebuilt(replace(frame, factors=(*frame.factors, *factors)))
