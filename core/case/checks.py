"""What the keys of a frame must be to each other."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from femubench.core.case.faults import BadKey, KeyPath
from femubench.core.case.schema import MOST_ELEMENTS, FrameSpec, JointSpringSpec, RigidEndSpec
from femubench.core.fem.frame import ACTIVE, Plane, split_half
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.nominal import MAY_VANISH
from femubench.core.typing import FloatArray

FREE_YET_HELD = "the structure hangs free, yet supports hold it"
NOT_HELD = "free = false, or no supports"
# A planar frame moves its masses in its own directions, so that an offset along it does nothing.
_NORMAL: dict[Plane, str] = {"in-plane": "y", "out-of-plane": "z"}


def _check_element(place: str, members: dict[str, int], i: int) -> None:
    path, expected = ("factors", i, "at"), '"all", the name of a member or "member/k"'
    member, found, number = split_half(place)[0].rpartition("/")
    if not found or member not in members:
        raise BadKey(path, f"there is no member {member if found else place!r}", expected)
    count = members[member]
    # Only the plain way to write a number: "m/02" would be no label of an element.
    if number not in map(str, range(1, count + 1)):
        what = f"member {member!r} has no element {number[:20]!r}"
        raise BadKey(path, what, f"a number from 1 to {count}")


def _check_braces(model: FrameSpec) -> None:
    joints = {joint.name for joint in model.joints}
    for i, item in enumerate(model.braces):
        if model.plane == "out-of-plane" and not item.direction:
            what = "a brace does nothing in plane 'out-of-plane'"
            raise BadKey(("braces", i), what, "plane 'in-plane' or '3d', or a direction")
        moving = [name for name in ACTIVE[model.plane] if len(name) == 1]
        if item.direction and item.direction not in moving:
            what = f"nothing moves along {item.direction} in plane {model.plane!r}"
            raise BadKey(("braces", i, "direction"), what, ", ".join(moving))
        for j, end in enumerate(item.ends):
            _check_known("joint", end, joints, ("braces", i, "ends", j))
        if item.ends[0] == item.ends[1]:
            raise BadKey(("braces", i, "ends"), "the brace has length zero", "two different joints")


def check_frame(model: FrameSpec) -> None:
    """Check names, geometry and connections; raises BadKey with a path below `model`."""
    check_unique((("joints", i, "name"), joint.name) for i, joint in enumerate(model.joints))
    check_unique((("members", i, "name"), member.name) for i, member in enumerate(model.members))
    if model.free and model.supports:
        raise BadKey(("free",), FREE_YET_HELD, NOT_HELD)
    _check_links(model)
    _check_joints(model)
    _check_members(model)
    bodies = _bodies(model, members=True)
    whole = bodies[model.joints[0].name]
    for i, joint in enumerate(model.joints):
        if joint.name not in whole:
            what = f"joint {joint.name!r} is not connected to {model.joints[0].name!r}"
            raise BadKey(("joints", i), what, "members or links that connect all joints")
    for key, items in (("joint_springs", model.joint_springs), ("rigid_ends", model.rigid_ends)):
        _check_ends(model, key, items)
    for i, spring in enumerate(model.joint_springs):
        path: KeyPath = ("joint_springs", i)
        _check_directions(tuple(spring.stiffness), model.plane, (*path, "stiffness"))
        if spring.arm_factor is not None and spring.arm == 0.0:
            raise BadKey((*path, "arm_factor"), "there is no arm", "arm > 0 with arm_factor")
    for i, support in enumerate(model.supports):
        _check_directions(support.fixed, model.plane, ("supports", i, "fixed"))
    members = {member.name: member.elements for member in model.members}
    for key in ("preloads", "eccentricities", "couplings"):
        for i, item in enumerate(getattr(model, key)):
            _check_known("member", item.member, members, (key, i, "member"))
    check_unique((("joint_kinds", i, "type"), k.type) for i, k in enumerate(model.joint_kinds))
    kinds = {joint.type or joint.name for joint in model.joints}
    for i, kind in enumerate(model.joint_kinds):
        _check_known("joint type", kind.type, kinds, ("joint_kinds", i, "type"))
    check_sets([(group.name, group.members) for group in model.sets], "member", members)
    for i, factor in enumerate(model.factors):
        if factor.factor == 0.0 and factor.quantity not in MAY_VANISH:
            what = f"a factor 0 leaves no {factor.quantity}"
            raise BadKey(("factors", i, "factor"), what, "a number > 0")
        for place in factor.at:
            if place != "all" and place not in members:
                _check_element(place, members, i)
    idle = _NORMAL.get(model.plane)
    for i, offset in enumerate(model.eccentricities):
        if idle is not None and getattr(offset, idle) != 0.0:
            what = f"an offset along {idle} does nothing in plane {model.plane!r}"
            raise BadKey(("eccentricities", i, idle), what, "0, or no key")
    total: dict[str, float] = {}
    for i, coupling in enumerate(model.couplings):
        if model.plane == "in-plane":
            what = "there is no torsion in plane 'in-plane'"
            raise BadKey(("couplings", i), what, "plane 'out-of-plane' or '3d'")
        member = coupling.member
        total[member] = total.get(member, 0.0) + coupling.coefficient
        if abs(total[member]) >= 1.0:
            what = f"the coefficients of member {member!r} add up to {total[member]:g}"
            raise BadKey(("couplings", i, "coefficient"), what, "a sum > -1 and < 1")
    _check_braces(model)


def _check_links(model: FrameSpec) -> None:
    joints = {joint.name for joint in model.joints}
    for i, link in enumerate(model.links):
        _check_known("joint", link.leads, joints, ("links", i, "leads"))
        path: KeyPath = ("links", i, "follows")
        check_unique(((*path, j), name) for j, name in enumerate(link.follows))
        for j, name in enumerate(link.follows):
            _check_known("joint", name, joints, (*path, j))
            if name == link.leads:
                raise BadKey((*path, j), f"joint {name!r} follows itself", "another joint")
        _check_directions(link.motions, model.plane, ("links", i, "motions"))


def _bodies(model: FrameSpec, *, members: bool) -> dict[str, set[str]]:
    """Return the joints that hang together with every joint, by links and perhaps by members."""
    group = {joint.name: {joint.name} for joint in model.joints}
    pairs = [(link.leads, name) for link in model.links for name in link.follows]
    for pair in (*pairs, *(member.ends for member in model.members if members)):
        first, second = (group[name] for name in pair)
        if first is not second:
            small, large = sorted((first, second), key=len)
            large |= small
            for name in small:
                group[name] = large
    return group


def _check_known(
    kind: str, name: str, known: Collection[str], path: KeyPath, expected: str | None = None
) -> None:
    if name not in known:
        raise BadKey(path, f"there is no {kind} {name!r}", expected or f"the name of a {kind}")


def check_sets(
    sets: Sequence[tuple[str, Sequence[str]]], kind: str, known: Collection[str]
) -> None:
    """Check that sets have names of their own and list each once what there is of a kind."""
    check_unique((("sets", i, "name"), name) for i, (name, _) in enumerate(sets))
    for i, (_, listed) in enumerate(sets):
        path = ("sets", i, f"{kind}s")
        check_unique(((*path, j), name) for j, name in enumerate(listed))
        for j, name in enumerate(listed):
            _check_known(kind, name, known, (*path, j))


def check_unique(names: Iterable[tuple[KeyPath, str]]) -> None:
    """Check that no name comes twice."""
    seen = set()
    for path, name in names:
        if name in seen:
            raise BadKey(path, f"{name!r} is listed twice", "a name of its own")
        seen.add(name)


def _check_directions(directions: Sequence[str], plane: Plane, path: KeyPath) -> None:
    allowed = ACTIVE[plane]
    for direction in directions:
        if direction not in allowed:
            expected = f"{', '.join(allowed)}, the directions of plane {plane!r}"
            raise BadKey(path, f"direction {direction!r} is not there", expected)
    if len(set(directions)) < len(directions):
        raise BadKey(path, "a direction is listed twice", "each direction once")


def _check_joints(model: FrameSpec) -> None:
    normal = _NORMAL.get(model.plane)
    xyz = np.array([joint.xyz for joint in model.joints])
    if normal is not None:
        column = xyz[:, "xyz".index(normal)]
        off = np.flatnonzero(np.abs(column - column[0]) > ON_MEMBER)
        if len(off):
            i = int(off[0])
            what = f"joint {model.joints[i].name!r} lies off the plane, {normal} = {column[i]:g}"
            raise BadKey(("joints", i, "xyz"), what, f"{normal} = {column[0]:g} as at the first")
    cells: dict[tuple[int, ...], str] = {}
    linked = _bodies(model, members=False)
    for i, joint in enumerate(model.joints):
        cell = tuple(int(v) for v in np.round(xyz[i] / ON_MEMBER))
        if cell in cells and joint.name not in linked[cells[cell]]:
            what = f"joint {joint.name!r} lies at the same point as {cells[cell]!r}"
            raise BadKey(("joints", i, "xyz"), what, "a point of its own, or a link")
        cells[cell] = joint.name


def _check_members(model: FrameSpec) -> None:
    places = {joint.name: np.array(joint.xyz) for joint in model.joints}
    elements = 0
    for i, member in enumerate(model.members):
        for j, end in enumerate(member.ends):
            if end not in places:
                what = f"member {member.name!r} ends at a joint {end!r} that is not there"
                raise BadKey(("members", i, "ends", j), what, "the name of a joint")
        if member.ends[0] == member.ends[1]:
            what = f"member {member.name!r} has length zero"
            raise BadKey(("members", i, "ends"), what, "two different joints")
        for key, table in (("section", model.sections), ("material", model.materials)):
            expected = ", ".join(table) or f"a table [model.{key}s.NAME]"
            _check_known(key, getattr(member, key), table, ("members", i, key), expected)
        if member.up is not None:
            _check_up(model, i, places[member.ends[1]] - places[member.ends[0]])
        elements += member.elements
        if elements > MOST_ELEMENTS:
            what, path = f"more than {MOST_ELEMENTS} elements", ("members", i, "elements")
            raise BadKey(path, what, f"fewer elements, {MOST_ELEMENTS} in all at most")


def _check_up(model: FrameSpec, i: int, along: FloatArray) -> None:
    path = ("members", i, "up")
    if model.plane != "3d":
        raise BadKey(path, f"not a key of plane {model.plane!r}", "no `up`, it belongs to 3d")
    up = np.array(model.members[i].up)
    across = np.linalg.norm(np.cross(up, along / np.linalg.norm(along)))
    if across < 1e-9 or across < 1e-6 * np.linalg.norm(up):
        raise BadKey(path, "lies along the member", "a vector in the local x-z plane")


def _check_ends(
    model: FrameSpec, key: str, items: Sequence[JointSpringSpec | RigidEndSpec]
) -> None:
    ends = {member.name: member.ends for member in model.members}
    seen = set()
    for i, item in enumerate(items):
        _check_known("member", item.member, ends, (key, i, "member"), "a member")
        if item.joint not in ends[item.member]:
            what = f"member {item.member!r} does not end at {item.joint!r}"
            raise BadKey((key, i, "joint"), what, f"one of {', '.join(ends[item.member])}")
        if (item.joint, item.member) in seen:
            what = f"the end of {item.member!r} at {item.joint!r} is listed twice"
            raise BadKey((key, i), what, "every member end once")
        seen.add((item.joint, item.member))
