"""Whether a word names a place of a model, by the grammar of docs/effects.md."""

from __future__ import annotations

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import DIRECTIONS


def known_place(model: Model, place: str) -> bool:
    """Tell whether a place is in a model."""
    if model.structure is not None:
        names = _in_frame
        frame: Frame = model.structure.frame
        return names(frame, place) or names(frame, _without_suffix(place))
    known = set(model.groups) | {"all"}
    if isinstance(model.geometry, MatrixGeometry):
        known |= set(model.geometry.names)
    return place in known or _without_suffix(place) in known


def _without_suffix(place: str) -> str:
    """Return a place without its direction or role."""
    head, colon, last = place.rpartition(":")
    return head if colon and (last in DIRECTIONS or last == "branch") else place


def _in_frame(frame: Frame, place: str) -> bool:
    joints, members = set(frame.joint_index), frame.member_index
    types = {joint.type for joint in frame.joints if joint.type}
    if place in {"all", *joints, *members, *types} or place.removeprefix("type:") in types:
        return True
    one, dash, other = place.partition("-")
    if dash and {one, other} <= joints:
        return True
    for mark in "/@":
        member, found, rest = place.rpartition(mark)
        if found and member in members:
            chosen = frame.members[members[member]]
            return _within(rest, mark, chosen.elements, chosen.ends)
    return False


def _within(rest: str, mark: str, elements: int, ends: tuple[str, str]) -> bool:
    if mark == "/":
        return rest.isdecimal() and 1 <= int(rest) <= elements
    try:
        return rest in ends or 0.0 <= float(rest) <= 1.0
    except ValueError:
        return False
