"""Names on the drawing of a structure: beside members and joints, off the lines that meet there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from femubench.reports.diagnosis_svg import label

Data = Mapping[str, Any]
Flat = tuple[float, float]

_MOST_NAMES = 30
# Where a name stands beside its joint: across, down, anchor of the text.
_OFFSETS = {
    "up": (0.0, -10.0, "middle"),
    "down": (0.0, 19.0, "middle"),
    "left": (-10.0, 4.0, "end"),
    "right": (10.0, 4.0, None),
    "corner": (9.0, 15.0, None),
}


def names_on(structure: Data, joints: Sequence[Flat]) -> Iterator[Markup]:
    """Return the names of members and joints, where there are few enough to read.

    Arguments:
        structure: the block of the JSON.
        joints: where its joints are on the page.
    """
    if not joints:
        return
    middle = middle_of(joints)
    leaving: dict[int, set[str]] = {}
    for member in structure["members"]:
        for here, there in (member["ends"], member["ends"][::-1]):
            leaving.setdefault(here, set()).add(_side(joints[here], joints[there]))
    if len(structure["members"]) <= _MOST_NAMES:
        for member in structure["members"]:
            a, b = member["ends"]
            yield _member_name(member["name"], joints[a], joints[b], middle)
    held = {tuple(support["xyz"]) for support in structure["supports"]}
    if len(joints) <= _MOST_NAMES:
        for i, (joint, (x, y)) in enumerate(zip(structure["joints"], joints, strict=True)):
            order = ("up", "down") if y <= middle[1] else ("down", "up")
            taken = leaving.get(i, set())
            side = next((s for s in (*order, "left", "right") if s not in taken), "corner")
            across, down, anchor = _OFFSETS[side]
            down += 10.0 if side == "down" and tuple(joint["xyz"]) in held else 0.0
            yield label(x + across, y + down, joint["name"], "name joint-name", anchor)


def _side(here: Flat, there: Flat) -> str:
    """Return into which of four directions a line leaves."""
    across, down = there[0] - here[0], there[1] - here[1]
    if abs(across) > abs(down):
        return "right" if across > 0.0 else "left"
    return "down" if down > 0.0 else "up"


def _member_name(name: str, a: Flat, b: Flat, middle: Flat) -> Markup:
    """Return the name of a member on its side towards the middle of the structure."""
    x, y = middle_of([a, b])
    if abs(b[1] - a[1]) <= abs(b[0] - a[0]):
        # Beside the middle, where a cause may have its number.
        x, y = x + 0.12 * (a[0] - b[0]), y + 0.12 * (a[1] - b[1])
        return label(x, y + (-11.0 if y > middle[1] else 19.0), name, "name", "middle")
    left = x > middle[0] + 1.0
    across = -14.0 if left else 14.0
    return label(x + across, y + 16.0, name, "name", "end" if left else None)


def middle_of(points: Sequence[Flat]) -> Flat:
    """Return the mean of some points."""
    across, down = zip(*points, strict=True)
    return sum(across) / len(points), sum(down) / len(points)
