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

import numpy as np

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.errors import ModelError
from femubench.core.fem.frame import ACTIVE, Frame, Member, Place, split_half
from femubench.core.fem.group_factors import GROUP
from femubench.core.fem.joints import joint_groups
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.fem.structure import Structure
from femubench.core.typing import IntArray

ALL = "all"
_TYPE, _BRANCH, _SUPPORT = "type:", ":branch", "support:"
_SET, _SECTION, _MATERIAL = "set:", "section:", "material:"
APART, FREE = ":apart", ":free"
# Stations are written with six digits, mesh nodes have more.
_SAME = 1e-5
_FEW = 4


def bare_place(place: str) -> str:
    """Return the place itself of a word with ``:apart``, ``:free``, ``:first`` or ``:second``.

    Examples:
        >>> effect.bare_place("J5:apart")
        'J5'
    """
    return split_half(place.removesuffix(APART).removesuffix(FREE))[0]


def elements_of(structure: Structure, place: str, *, arms: bool = False) -> IntArray:
    """Return the rows of the mesh at ``all``, a member, a set of members or ``member/k``.

    Pieces of split elements are there too.

    Arguments:
        structure: a meshed frame.
        place: where.
        arms: whether the massless arms of joint springs count with their member.

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> print(effect.elements_of(structure, "rung-middle"))
        [24 25 26 27]
    """
    mesh, frame = structure.mesh, structure.frame
    plain = np.isnan(mesh.arm_factor)
    named = members_of(frame, place)
    if named:
        chosen = np.isin(mesh.member, [frame.member_index[name] for name in named])
    else:
        member, _, number = place.rpartition("/")
        if member not in frame.member_index or not number.isdecimal():
            raise ModelError(f"there is no place {place!r}")
        chosen = (mesh.member == frame.member_index[member]) & (mesh.number == int(number))
        arms = False
    rows = np.flatnonzero(chosen if arms else chosen & plain)
    if not len(rows):
        raise ModelError(f"there is no place {place!r}")
    return rows


def members_of(frame: Frame, place: str) -> tuple[str, ...]:
    """Return the names of the members of ``all``, a member, ``set:``, ``section:``, ``material:``.

    Nothing where the place is none of these.

    Examples:
        >>> effect.members_of(frame, "rung-middle")
        ('rung-middle',)
    """
    if place in frame.member_index:
        return (place,)
    if place == ALL:
        return member_labels(frame)
    listed = (*((f"{_SET}{s.name}", s) for s in frame.sets), *((f.name, f) for f in frame.families))
    return next((found.members for word, found in listed if word == place), ())


def set_places(frame: Frame, kinds: Sequence[str] = ("set", "section")) -> tuple[str, ...]:
    """Return the words of families of two members or more that are not all of the frame.

    Arguments:
        frame: any frame.
        kinds: ``set``, ``section``, ``material``; of equal families only the first is there, and
            none that is a material too where materials are not asked for.

    Examples:
        >>> effect.set_places(frame)
        ()
    """
    words = [f"{_SET}{s.name}" for s in frame.sets] + [f.name for f in frame.families]
    known: set[frozenset[str]] = {frozenset(frame.member_index)}
    if "material" not in kinds:
        materials = (f for f in frame.families if f.name.startswith(_MATERIAL))
        known |= {frozenset(family.members) for family in materials}
    found = []
    for word in words:
        members = frozenset(members_of(frame, word))
        if word.partition(":")[0] in kinds and len(members) > 1 and members not in known:
            found.append(word)
            known.add(members)
    return tuple(found)


def members_at(frame: Frame, place: str) -> tuple[Member, ...]:
    """Return the members that a place names or lies on, or that end at the joints it names.

    All members where it names none.

    Examples:
        >>> [member.name for member in effect.members_at(frame, "J5")]
        ['front-right', 'front-left', 'rung-middle']
    """
    points = members_of(frame, place) or (place,)
    if place.startswith(_SUPPORT):
        points = tuple(supports_of(frame, place))
    heads = {p.partition(":")[0].partition("@")[0].partition("/")[0] for p in points}
    joints = {joint.name for joint in frame.joints if heads & {joint.name, joint.type}}
    found = (m for m in frame.members if m.name in heads or joints & set(m.ends))
    return tuple(found) or frame.members


def member_labels(frame: Frame) -> tuple[str, ...]:
    """Return the names of the members.

    Examples:
        >>> effect.member_labels(frame)[:2]
        ('rung-right', 'front-right')
    """
    return tuple(member.name for member in frame.members)


def element_labels(frame: Frame) -> tuple[str, ...]:
    """Return ``member/k`` of every element.

    Examples:
        >>> effect.element_labels(frame)[:2]
        ('rung-right/1', 'rung-right/2')
    """
    return tuple(f"{m.name}/{k}" for m in frame.members for k in range(1, m.elements + 1))


def member_length(frame: Frame, member: str) -> float:
    """Return the distance of a member's two joints in m.

    Examples:
        >>> round(effect.member_length(frame, "rung-middle"), 4)
        0.2794
    """
    first, last = frame.corners[frame.member_ends[frame.member_index[member]]]
    return float(np.linalg.norm(last - first))


def joints_with_members(frame: Frame) -> tuple[str, ...]:
    """Return the joints at which two members meet at least; a free end is none.

    Examples:
        >>> effect.joints_with_members(frame)
        ('J1', 'J3', 'J5', 'J7', 'J9', 'J11')
    """
    return tuple(joint.name for joint in frame.joints if len(frame.ends_at(joint.name)) > 1)


def joint_types(frame: Frame) -> Mapping[str, tuple[str, ...]]:
    """Return from every joint type to its joints, free ends and joints without type left out.

    Examples:
        >>> dict(effect.joint_types(frame))
        {'L': ('J1', 'J3', 'J7', 'J9'), 'T': ('J5', 'J11')}
    """
    return frame.joint_types


def type_place(frame: Frame, type: str) -> str:
    """Return the place of a joint type: ``type:L`` where a joint has that name, else ``L``.

    Examples:
        >>> effect.type_place(frame, "L")
        'L'
    """
    return f"{_TYPE}{type}" if type in frame.joint_index else type


def type_places(frame: Frame) -> tuple[str, ...]:
    """Return the places of the joint types with two joints at least; else the joint says it.

    Examples:
        >>> effect.type_places(frame)
        ('L', 'T')
    """
    return tuple(type_place(frame, kind) for kind, names in joint_types(frame).items() if names[1:])


def joints_of(frame: Frame, place: str) -> tuple[str, ...]:
    """Return the joints of a joint or a joint type; nothing where the place is neither.

    Examples:
        >>> effect.joints_of(frame, "T")
        ('J5', 'J11')
    """
    if place in frame.joint_index:
        return (place,)
    return joint_types(frame).get(place.removeprefix(_TYPE), ())


def end_places(frame: Frame) -> tuple[str, ...]:
    """Return the ``member@joint`` ends at joints of three members or more.

    At a joint of two, a flexible end and a flexible joint are the same.

    Examples:
        >>> effect.end_places(frame)[:2]
        ('front-right@J5', 'front-left@J5')
    """
    return tuple(
        f"{member}@{joint}"
        for joint in joints_with_members(frame)
        for member in frame.ends_at(joint)
        if len(frame.ends_at(joint)) > 2
    )


def branch_places(frame: Frame) -> tuple[str, ...]:
    """Return ``T:branch`` for every joint type where members branch off ones that pass through.

    A member that passes is continuous; what turns is the end that is welded to its face. Types
    with one such end are left out: the end says it.

    Examples:
        >>> effect.branch_places(frame)
        ('T:branch',)
    """
    return tuple(
        type_place(frame, group.type) + _BRANCH
        for group in joint_groups(frame)
        if group.role == "branch" and len(group.ends) > 1 and group.type in joint_types(frame)
    )


def ends_of(frame: Frame, place: str) -> tuple[str, ...]:
    """Return the ``member@joint`` ends at a type, a type's branches, a joint, or the end itself.

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> effect.ends_of(frame, "J5")
        ('front-right@J5', 'front-left@J5', 'rung-middle@J5')
    """
    place = bare_place(place)
    if place.endswith(_BRANCH):
        kind = place.removesuffix(_BRANCH).removeprefix(_TYPE)
        for group in joint_groups(frame):
            if (group.type, group.role) == (kind, "branch"):
                return group.ends
    joints = joints_of(frame, place)
    ends = tuple(f"{member}@{joint}" for joint in joints for member in frame.ends_at(joint))
    if ends:
        return ends
    member, _, joint = place.rpartition("@")
    if member in frame.ends_at(joint):
        return (place,)
    raise ModelError(f"no member ends at {place!r}")


def support_places(frame: Frame) -> tuple[str, ...]:
    """Return ``support:A`` of what holds the frame to ground, ``support:A:z`` of each direction.

    One that holds one direction alone has the latter only; ``support:all`` are all of several.

    Examples:
        >>> spring = fem.GroundSpring(fem.Place(joint="J1"), "z", 1e4)
        >>> effect.support_places(frame.with_attachments((), (spring,)))
        ('support:J1:z',)
    """
    held = _held(frame)
    places = [_SUPPORT + ALL] if len(held) > 1 else []
    for word, directions in held.items():
        places += [_SUPPORT + word] if len(directions) > 1 else []
        places += [f"{_SUPPORT}{word}:{direction}" for direction in directions]
    return tuple(places)


def supports_of(frame: Frame, place: str) -> Mapping[str, Mapping[str, float]]:
    """Return what holds the frame to ground at a place: by point, from direction to stiffness.

    Supports are infinitely stiff, springs to ground as stiff as they are, N/m and N m/rad;
    directions that the plane does not have are left out.

    Raises:
        ModelError: when nothing is held there.

    Examples:
        >>> spring = fem.GroundSpring(fem.Place(joint="J1"), "z", 1e4)
        >>> effect.supports_of(frame.with_attachments((), (spring,)), "support:J1")
        {'J1': {'z': 10000.0}}
    """
    word, direction = split_direction(place)
    held, word = _held(frame), word.removeprefix(_SUPPORT)
    found = {
        at: {d: k for d, k in own.items() if direction in (None, d)}
        for at, own in held.items()
        if word in (ALL, at)
    }
    if not place.startswith(_SUPPORT) or not any(found.values()):
        raise ModelError(f"there is no support {place!r}")
    return found


def _held(frame: Frame) -> dict[str, dict[str, float]]:
    held: dict[str, dict[str, float]] = {}
    listed = [(s.at, s.direction, s.stiffness) for s in frame.springs if s.stiffness]
    listed += [(support.at, d, np.inf) for support in frame.supports for d in support.fixed]
    for at, name, stiffness in listed:
        direction = name.lstrip("+-")
        if direction in ACTIVE[frame.plane]:
            own = held.setdefault(str(point_of(frame, str(at))), {})
            own[direction] = own.get(direction, 0.0) + stiffness
    return {
        word: {d: own[d] for d in ACTIVE[frame.plane] if d in own} for word, own in held.items()
    }


def split_direction(place: str) -> tuple[str, str | None]:
    """Return a place without its suffix ``:z``, and the direction; None where it has none.

    Examples:
        >>> effect.split_direction("rung-middle@0.5:z")
        ('rung-middle@0.5', 'z')
    """
    head, _, tail = place.rpartition(":")
    # "type:x" is the joint type x.
    kinds = (_TYPE, _SUPPORT, _SET, _SECTION, _MATERIAL, GROUP)
    if head and f"{head}:" not in kinds and tail.lstrip("+-") in DIRECTIONS:
        return head, tail
    return place, None


def point_of(frame: Frame, place: str) -> Place:
    """Return the point of a joint or of ``member@0.25``; a direction is left out.

    Raises:
        ModelError: when there is no such point.

    Examples:
        >>> effect.point_of(frame, "rung-middle@0.25").s
        0.25
    """
    place, _ = split_direction(place)
    if place in frame.joint_index:
        return Place(joint=place)
    member, _, station = place.rpartition("@")
    if member in frame.ends_at(station):
        return Place(joint=station)
    try:
        spec, s = frame.members[frame.member_index[member]], float(station)
    except (KeyError, ValueError):
        raise ModelError(f"there is no point {place!r}") from None
    if not 0.0 <= s <= 1.0:
        raise ModelError(f"station {s:g} of member {member!r} is not within 0..1")
    nearest = round(s * spec.elements) / spec.elements
    s = nearest if abs(nearest - s) < _SAME else s
    return Place(joint=spec.ends[int(s)]) if s in (0.0, 1.0) else Place(member=member, s=s)


def point_places(model: Model) -> tuple[str, ...]:
    """Return where something may be attached: every joint, free ends too, and along the members.

    A member of up to four elements offers its mesh nodes, a longer one those nearest to its
    quarter points; a model that came as matrices offers its nodes.

    Examples:
        >>> effect.point_places(model)[-3:]
        ('rung-middle@0.25', 'rung-middle@0.5', 'rung-middle@0.75')
    """
    if model.structure is None:
        return model.geometry.placed if isinstance(model.geometry, MatrixGeometry) else ()
    frame = model.structure.frame
    points = [joint.name for joint in frame.joints]
    for member in frame.members:
        count = member.elements
        nodes = range(1, count) if count <= _FEW else [round(q * count / 4) for q in (1, 2, 3)]
        points += [f"{member.name}@{k / count:g}" for k in nodes]
    return tuple(points)


def pair_of(frame: Frame, place: str) -> tuple[str, str]:
    """Return the two joints of ``A-E``; names with a dash of their own are understood.

    Raises:
        ModelError: when there is no such pair.

    Examples:
        >>> effect.pair_of(frame, "J1-J7")
        ('J1', 'J7')
    """
    words = place.split("-")
    for cut in range(1, len(words)):
        pair = "-".join(words[:cut]), "-".join(words[cut:])
        if pair[0] in frame.joint_index and pair[1] in frame.joint_index:
            return pair
    raise ModelError(f"there is no pair of joints {place!r}")


def _canonical(frame: Frame, place: str) -> tuple[str, ...]:
    """Return one form for all words that stand for the same place."""
    place = bare_place(place)
    if place.startswith(_SUPPORT):
        with suppress(ModelError):
            return tuple(
                f"{word}:{d}" for word, own in supports_of(frame, place).items() for d in own
            )
    place, direction = split_direction(place)
    suffix = () if direction is None else (direction.lstrip("+-"),)
    joints = joints_of(frame, place)
    if joints:
        word = joints[0] if len(joints) == 1 else _TYPE + place.removeprefix(_TYPE)
        return (word, *suffix)
    if len(members_of(frame, place)) == len(frame.members):
        return (ALL, *suffix)
    if named := members_of(frame, place):
        return (*sorted(named), *suffix)
    member, _, end = place.rpartition("@")
    if member in frame.ends_at(end):
        return (end if len(frame.ends_at(end)) <= 2 else place, *suffix)
    for read in (lambda: (str(point_of(frame, place)),), lambda: sorted(pair_of(frame, place))):
        try:
            return (*read(), *suffix)
        except ModelError:
            continue
    return (place, *suffix)


def match(frame: Frame, place_a: str, place_b: str) -> bool:
    """Tell whether two words stand for the same place.

    At a joint of two members an end is the joint; a type with one joint is that joint; the member
    of a frame with one member is ``all``; the ends of a member are joints; pairs have no order,
    directions no sign; a place is the same ``:apart`` and ``:free``.
    """
    return _canonical(frame, place_a) == _canonical(frame, place_b)
