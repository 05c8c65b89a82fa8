"""What the extensions of a frame must be to its members, joints and plane."""

from __future__ import annotations

from femubench.core.case.faults import Fault
from femubench.core.case.schema import FrameSpec
from femubench.core.fem.nominal import MAY_VANISH

# A planar frame moves its masses in its own directions, so that one offset does nothing there.
_IDLE_OFFSET = {"in-plane": "y", "out-of-plane": "z"}


def check_extensions(model: FrameSpec) -> None:
    """Check places and planes; raises Fault with a path below `model`."""
    members = {member.name: member.elements for member in model.members}
    for key in ("preloads", "eccentricities", "couplings"):
        for i, item in enumerate(getattr(model, key)):
            if item.member not in members:
                what = f"there is no member {item.member!r}"
                raise Fault((key, i, "member"), what, "the name of a member")
    _check_factors(model, members)
    _check_eccentricities(model)
    _check_couplings(model)
    _check_braces(model)


def _check_factors(model: FrameSpec, members: dict[str, int]) -> None:
    for i, item in enumerate(model.factors):
        if item.factor == 0.0 and item.quantity not in MAY_VANISH:
            what = f"a factor 0 leaves no {item.quantity}"
            raise Fault(("factors", i, "factor"), what, "a number > 0")
        for place in item.at:
            if place != "all" and place not in members:
                _check_element(place, members, i)


def _check_element(place: str, members: dict[str, int], i: int) -> None:
    path, expected = ("factors", i, "at"), '"all", the name of a member or "member/k"'
    member, found, number = place.rpartition("/")
    if not found or member not in members:
        raise Fault(path, f"there is no member {member if found else place!r}", expected)
    count = members[member]
    # Only the plain way to write a number: "m/02" would be no label of an element.
    if number not in map(str, range(1, count + 1)):
        what = f"member {member!r} has no element {number[:20]!r}"
        raise Fault(path, what, f"a number from 1 to {count}")


def _check_eccentricities(model: FrameSpec) -> None:
    idle = _IDLE_OFFSET.get(model.plane)
    for i, item in enumerate(model.eccentricities):
        if idle is not None and getattr(item, idle) != 0.0:
            what = f"an offset along {idle} does nothing in plane {model.plane!r}"
            raise Fault(("eccentricities", i, idle), what, "0, or no key")


def _check_couplings(model: FrameSpec) -> None:
    total: dict[str, float] = {}
    for i, item in enumerate(model.couplings):
        if model.plane == "in-plane":
            what = "there is no torsion in plane 'in-plane'"
            raise Fault(("couplings", i), what, "plane 'out-of-plane' or '3d'")
        total[item.member] = total.get(item.member, 0.0) + item.coefficient
        if abs(total[item.member]) >= 1.0:
            what = f"the coefficients of member {item.member!r} add up to {total[item.member]:g}"
            raise Fault(("couplings", i, "coefficient"), what, "a sum > -1 and < 1")


def _check_braces(model: FrameSpec) -> None:
    joints = {joint.name for joint in model.joints}
    for i, item in enumerate(model.braces):
        if model.plane == "out-of-plane":
            what = "a brace does nothing in plane 'out-of-plane'"
            raise Fault(("braces", i), what, "plane 'in-plane' or '3d'")
        for j, end in enumerate(item.ends):
            if end not in joints:
                what = f"there is no joint {end!r}"
                raise Fault(("braces", i, "ends", j), what, "the name of a joint")
        if item.ends[0] == item.ends[1]:
            raise Fault(("braces", i, "ends"), "the brace has length zero", "two different joints")
