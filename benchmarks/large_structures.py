"""Structures of any size for measurements: planar grids and lattices of one steel tube."""

from __future__ import annotations

import itertools

from femubench.core.fem.frame import Frame, Joint, Material, Member, Place, Support
from femubench.core.fem.sections import Section, round_tube

STEEL = Material(E=210e9, nu=0.3, rho=7850.0)
TUBE: Section = round_tube(0.04, 0.003)
BAY = (0.5, 0.56, 0.63)  # m; with one size, every second mode would be repeated


def planar_grid(joints: int, elements: int = 3) -> Frame:
    """Return a grid that hangs free and moves out of its plane.

    Arguments:
        joints: along a side; the model has 3 (j^2 + 2 j (j - 1)(e - 1)) dofs.
        elements: of a member.
    """
    return _grid((joints, joints, 1), elements, "out-of-plane")


def lattice(joints: int, elements: int = 3, *, standing: bool = False) -> Frame:
    """Return a lattice of box cells that hangs free, or stands on its four lower corners.

    Arguments:
        joints: along an edge; the model has 6 (j^3 + 3 j^2 (j - 1)(e - 1)) dofs.
        elements: of a member.
        standing: fix the four corners.
    """
    return _grid((joints,) * 3, elements, "3d", standing=standing)


def _grid(sides: tuple[int, ...], elements: int, plane: str, *, standing: bool = False) -> Frame:
    places = list(itertools.product(*(range(side) for side in sides)))
    names = {place: "n" + "-".join(map(str, place)) for place in places}
    joints = tuple(
        Joint(names[at], (BAY[0] * at[0], BAY[1] * at[1], BAY[2] * at[2])) for at in places
    )
    members = []
    for at in places:
        for axis in range(3):
            beyond = tuple(x + (i == axis) for i, x in enumerate(at))
            if beyond in names:
                ends = names[at], names[beyond]
                up = (1.0, 0.0, 0.0) if axis == 2 else (0.0, 0.0, 1.0)
                members.append(
                    Member("m" + "xyz"[axis] + ends[0][1:], ends, elements, TUBE, STEEL,
                           up if plane == "3d" else None)
                )  # fmt: skip
    corners = itertools.product((0, sides[0] - 1), (0, sides[1] - 1))
    held = tuple(
        Support(Place(joint=names[(*corner, 0)]), ("x", "y", "z", "rx", "ry", "rz"))
        for corner in corners
    )
    return Frame(
        plane=plane,  # type: ignore[arg-type]
        beam="euler-bernoulli",
        joints=joints,
        members=tuple(members),
        supports=held if standing else (),
    )
