"""Words for the places of a frame at which an effect may sit, and what they stand for.

``all``; a joint type (``type:L`` where it equals a joint's name); a joint; a member; ``member/k``,
element k from 1; ``member@joint``, an end; ``member@0.25``, a point; ``A-E``, a pair of joints; a
suffix ``:z`` names a direction; ``support:A``, what holds a point to ground; ``set:wing``,
``section:tube``, ``material:steel``, families of members. ``:apart`` and ``:free`` are no other
places: there an effect has more values, one a direction, or leaves other directions alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.frame import ACTIVE, Frame, Member, Place, halves_of, split_half
from femubench.core.fem.group_factors import GROUP, MATERIAL, SET
from femubench.core.fem.joints import joint_groups
from femubench.core.fem.mesh import member_axes
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.typing import FloatArray

ALL = "all"
_TYPE, _BRANCH, _SUPPORT = "type:", ":branch", "support:"
_SECTION = "section:"
APART, FREE = ":apart", ":free"
# Stations are written with six digits, mesh nodes have more.
_SAME = 1e-5


def bare_place(place: str) -> str:
    """Return the place itself of a word with ``:apart``, ``:free``, ``:first`` or ``:second``."""
    return split_half(place.removesuffix(APART).removesuffix(FREE))[0]


def split_direction(place: str) -> tuple[str, str | None]:
    """Return a place without its suffix ``:z``, and the direction; None where it has none."""
    head, _, tail = place.rpartition(":")
    # "type:x" is the joint type x.
    kinds = (_TYPE, _SUPPORT, SET, _SECTION, MATERIAL, GROUP)
    if head and f"{head}:" not in kinds and tail.lstrip("+-") in DIRECTIONS:
        return head, tail
    return place, None


@dataclass(frozen=True)
class Places:
    """The places of a frame: which there are, and what their words stand for."""

    APART: ClassVar[str] = APART
    FREE: ClassVar[str] = FREE

    frame: Frame

    def members(self, place: str) -> tuple[str, ...]:
        """Return the members of ``all``, a member, ``set:``, ``section:``, ``material:``.

        Nothing where the place is none of these.

        Examples:
            >>> effect.Places(frame).members("rung-middle")
            ('rung-middle',)
        """
        if place in self.frame.member_index:
            return (place,)
        if place == ALL:
            return tuple(self.frame.member_index)
        sets = ((f"{SET}{s.name}", s) for s in self.frame.sets)
        listed = (*sets, *((f.name, f) for f in self.frame.families))
        return next((found.members for word, found in listed if word == place), ())

    def sets(self, kinds: Sequence[str] = ("set", "section")) -> tuple[str, ...]:
        """Return the words of families of two members or more that are not all of the frame.

        Arguments:
            kinds: ``set``, ``section``, ``material``; of equal families only the first is there,
                and none that is a material too where materials are not asked for.

        Examples:
            >>> effect.Places(frame).sets()
            ()
        """
        words = [f"{SET}{s.name}" for s in self.frame.sets] + [f.name for f in self.frame.families]
        known: set[frozenset[str]] = {frozenset(self.frame.member_index)}
        if "material" not in kinds:
            materials = (f for f in self.frame.families if f.name.startswith(MATERIAL))
            known |= {frozenset(family.members) for family in materials}
        found = []
        for word in words:
            members = frozenset(self.members(word))
            if word.partition(":")[0] in kinds and len(members) > 1 and members not in known:
                found.append(word)
                known.add(members)
        return tuple(found)

    def members_at(self, place: str) -> tuple[Member, ...]:
        """Return the members that a place names or lies on, or that end at the joints it names.

        All members where it names none.

        Examples:
            >>> [member.name for member in effect.Places(frame).members_at("J5")]
            ['front-right', 'front-left', 'rung-middle']
        """
        points = self.members(place) or (place,)
        if place.startswith(_SUPPORT):
            points = tuple(self.supports_of(place))
        heads = {p.partition(":")[0].partition("@")[0].partition("/")[0] for p in points}
        joints = {joint.name for joint in self.frame.joints if heads & {joint.name, joint.type}}
        found = (m for m in self.frame.members if m.name in heads or joints & set(m.ends))
        return tuple(found) or self.frame.members

    def elements(self) -> tuple[str, ...]:
        """Return ``member/k`` of every element.

        Examples:
            >>> effect.Places(frame).elements()[:2]
            ('rung-right/1', 'rung-right/2')
        """
        return tuple(f"{m.name}/{k}" for m in self.frame.members for k in range(1, m.elements + 1))

    @staticmethod
    def halves(place: str) -> tuple[str, ...]:
        """Return the words of both halves of an element; nothing for what is half of one.

        Examples:
            >>> effect.Places.halves("rung-middle/1")
            ('rung-middle/1:first', 'rung-middle/1:second')
        """
        return halves_of(place)

    def types(self) -> tuple[str, ...]:
        """Return the places of the joint types with two joints at least; else the joint says it.

        Examples:
            >>> effect.Places(frame).types()
            ('L', 'T')
        """
        return tuple(
            self._type(kind) for kind, names in self.frame.joint_types.items() if names[1:]
        )

    def joints(self) -> tuple[str, ...]:
        """Return the joints at which two members meet at least; a free end is none.

        Examples:
            >>> effect.Places(frame).joints()
            ('J1', 'J3', 'J5', 'J7', 'J9', 'J11')
        """
        return tuple(name for name in self.frame.joint_index if len(self.frame.ends_at(name)) > 1)

    def joints_of(self, place: str) -> tuple[str, ...]:
        """Return the joints of a joint or a joint type; nothing where the place is neither.

        Examples:
            >>> effect.Places(frame).joints_of("T")
            ('J5', 'J11')
        """
        if place in self.frame.joint_index:
            return (place,)
        return self.frame.joint_types.get(place.removeprefix(_TYPE), ())

    def ends(self) -> tuple[str, ...]:
        """Return the ``member@joint`` ends at joints of three members or more.

        At a joint of two, a flexible end and a flexible joint are the same.

        Examples:
            >>> effect.Places(frame).ends()[:2]
            ('front-right@J5', 'front-left@J5')
        """
        return tuple(
            f"{member}@{joint}"
            for joint in self.joints()
            for member in self.frame.ends_at(joint)
            if len(self.frame.ends_at(joint)) > 2
        )

    def branches(self) -> tuple[str, ...]:
        """Return ``T:branch`` for every joint type where members branch off others that pass.

        A member that passes is continuous; what turns is the end that is welded to its face. Types
        with one such end are left out: the end says it.

        Examples:
            >>> effect.Places(frame).branches()
            ('T:branch',)
        """
        types = self.frame.joint_types
        return tuple(
            self._type(group.type) + _BRANCH
            for group in joint_groups(self.frame)
            if group.role == "branch" and len(group.ends) > 1 and group.type in types
        )

    def ends_of(self, place: str) -> tuple[str, ...]:
        """Return the ``member@joint`` ends at a type, its branches, a joint, or the end itself.

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> effect.Places(frame).ends_of("J5")
            ('front-right@J5', 'front-left@J5', 'rung-middle@J5')
        """
        place = bare_place(place)
        if place.endswith(_BRANCH):
            kind = place.removesuffix(_BRANCH).removeprefix(_TYPE)
            for group in joint_groups(self.frame):
                if (group.type, group.role) == (kind, "branch"):
                    return group.ends
        joints = self.joints_of(place)
        ends = tuple(
            f"{member}@{joint}" for joint in joints for member in self.frame.ends_at(joint)
        )
        if ends:
            return ends
        member, _, joint = place.rpartition("@")
        if member in self.frame.ends_at(joint):
            return (place,)
        raise ModelError(f"no member ends at {place!r}")

    def supports(self) -> tuple[str, ...]:
        """Return ``support:A`` of what holds the frame, ``support:A:z`` of each direction.

        One that holds one direction alone has the latter only; ``support:all`` are all of several.

        Examples:
            >>> spring = fem.GroundSpring(fem.Place(joint="J1"), "z", 1e4)
            >>> effect.Places(frame.with_attachments((), (spring,))).supports()
            ('support:J1:z',)
        """
        held = self._held()
        places = [_SUPPORT + ALL] if len(held) > 1 else []
        for word, directions in held.items():
            places += [_SUPPORT + word] if len(directions) > 1 else []
            places += [f"{_SUPPORT}{word}:{direction}" for direction in directions]
        return tuple(places)

    def supports_of(self, place: str) -> Mapping[str, Mapping[str, float]]:
        """Return what holds the frame at a place: by point, from direction to stiffness.

        Supports are infinitely stiff, springs to ground as stiff as they are, N/m and N m/rad;
        directions that the plane does not have are left out.

        Raises:
            ModelError: when nothing is held there.

        Examples:
            >>> spring = fem.GroundSpring(fem.Place(joint="J1"), "z", 1e4)
            >>> effect.Places(frame.with_attachments((), (spring,))).supports_of("support:J1")
            {'J1': {'z': 10000.0}}
        """
        word, direction = split_direction(place)
        held, word = self._held(), word.removeprefix(_SUPPORT)
        found = {
            at: {d: k for d, k in own.items() if direction in (None, d)}
            for at, own in held.items()
            if word in (ALL, at)
        }
        if not place.startswith(_SUPPORT) or not any(found.values()):
            raise ModelError(f"there is no support {place!r}")
        return found

    def point(self, place: str) -> Place:
        """Return the point of a joint or of ``member@0.25``; a direction is left out.

        Raises:
            ModelError: when there is no such point.

        Examples:
            >>> effect.Places(frame).point("rung-middle@0.25").s
            0.25
        """
        place, _ = split_direction(place)
        if place in self.frame.joint_index:
            return Place(joint=place)
        member, _, station = place.rpartition("@")
        if member in self.frame.ends_at(station):
            return Place(joint=station)
        try:
            spec, s = self.frame.members[self.frame.member_index[member]], float(station)
        except (KeyError, ValueError):
            raise ModelError(f"there is no point {place!r}") from None
        if not 0.0 <= s <= 1.0:
            raise ModelError(f"station {s:g} of member {member!r} is not within 0..1")
        nearest = round(s * spec.elements) / spec.elements
        s = nearest if abs(nearest - s) < _SAME else s
        return Place(joint=spec.ends[int(s)]) if s in (0.0, 1.0) else Place(member=member, s=s)

    def pair(self, place: str) -> tuple[str, str]:
        """Return the two joints of ``A-E``; names with a dash of their own are understood.

        Raises:
            ModelError: when there is no such pair.

        Examples:
            >>> effect.Places(frame).pair("J1-J7")
            ('J1', 'J7')
        """
        words = place.split("-")
        for cut in range(1, len(words)):
            pair = "-".join(words[:cut]), "-".join(words[cut:])
            if pair[0] in self.frame.joint_index and pair[1] in self.frame.joint_index:
                return pair
        raise ModelError(f"there is no pair of joints {place!r}")

    def axes(self, member: Member) -> FloatArray:
        """Return the local axes of a member as rows, the first along it, (3, 3).

        Examples:
            >>> print(np.abs(effect.Places(frame).axes(frame.members[0])[2]))
            [0. 0. 1.]
        """
        return member_axes(self.frame, member)[0]

    def directed_point(self, place: str) -> tuple[Place, str]:
        """Return the point and the direction that a place with a direction stands for.

        Out of plane there is one translation, which goes unsaid.

        Raises:
            ModelError: when there is no such point, or the direction is missing.

        Examples:
            >>> effect.Places(frame).directed_point("J1")[1]
            'z'
        """
        head, direction = split_direction(bare_place(place))
        if direction is None and self.frame.plane == "out-of-plane":
            direction = "z"
        if direction is None:
            raise ModelError(f"place {place!r} names no direction")
        return self.point(head), direction

    def match(self, place_a: str, place_b: str) -> bool:
        """Tell whether two words stand for the same place.

        At a joint of two members an end is the joint; a type with one joint is that joint; the
        member of a frame with one member is ``all``; the ends of a member are joints; pairs have no
        order, directions no sign; a place is the same ``:apart`` and ``:free``.
        """
        return self._canonical(place_a) == self._canonical(place_b)

    def _type(self, type: str) -> str:
        """Return the place of a joint type: ``type:L`` where a joint has that name, else ``L``."""
        return f"{_TYPE}{type}" if type in self.frame.joint_index else type

    def _held(self) -> dict[str, dict[str, float]]:
        frame = self.frame
        held: dict[str, dict[str, float]] = {}
        listed = [(s.at, s.direction, s.stiffness) for s in frame.springs if s.stiffness]
        listed += [(support.at, d, np.inf) for support in frame.supports for d in support.fixed]
        for at, name, stiffness in listed:
            direction = name.lstrip("+-")
            if direction in ACTIVE[frame.plane]:
                own = held.setdefault(str(self.point(str(at))), {})
                own[direction] = own.get(direction, 0.0) + stiffness
        return {
            word: {d: own[d] for d in ACTIVE[frame.plane] if d in own} for word, own in held.items()
        }

    def _canonical(self, place: str) -> tuple[str, ...]:
        """Return one form for all words that stand for the same place."""
        place = bare_place(place)
        if place.startswith(_SUPPORT):
            with suppress(ModelError):
                return tuple(
                    f"{word}:{d}" for word, own in self.supports_of(place).items() for d in own
                )
        place, direction = split_direction(place)
        suffix = () if direction is None else (direction.lstrip("+-"),)
        joints = self.joints_of(place)
        if joints:
            word = joints[0] if len(joints) == 1 else _TYPE + place.removeprefix(_TYPE)
            return (word, *suffix)
        if len(self.members(place)) == len(self.frame.members):
            return (ALL, *suffix)
        if named := self.members(place):
            return (*sorted(named), *suffix)
        member, _, end = place.rpartition("@")
        if member in self.frame.ends_at(end):
            return (end if len(self.frame.ends_at(end)) <= 2 else place, *suffix)
        for read in (lambda: (str(self.point(place)),), lambda: sorted(self.pair(place))):
            try:
                return (*read(), *suffix)
            except ModelError:
                continue
        return (place, *suffix)
