"""Structures of any size for measurements: grids and lattices of tubes, a ladder of bricks."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from femubench.core.case.nodes import matrix_model
from femubench.core.fem.frame import Frame, Joint, Material, Member, Place, Support
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section

STEEL = Material(E=210e9, nu=0.3, rho=7850.0)
TUBE: Section = Section.round_tube(0.04, 0.003)
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


def brick_ladder(bay: int, section: int = 4, rungs: int = 10) -> Model:
    """Return a steel ladder of 20-node bricks that hangs free, in four groups a rung.

    A rung, the layer of bricks at each of its ends (`weld 1a`) and both rails along its bay.

    Arguments:
        bay: bricks of 10 mm between rungs, and of a rung.
        section: bricks along the sides of rails and rungs.
        rungs: their number.
    """
    from truths.elasticity import assemble
    from truths.solid import Solid

    x, y, z = (v.ravel() for v in np.indices((rungs * (bay + section), 2 * section + bay, section)))
    rail = (y < section) | (y >= section + bay)
    kept = rail | (x % (bay + section) < section)
    x, y, z, rail = (v[kept] for v in (x, y, z, rail))
    end = np.where(y == section, "a", np.where(y == section + bay - 1, "b", ""))
    kind = np.where(rail, "rails", np.where(end == "", "rung", "weld"))
    numbers = zip(kind, x // (bay + section) + 1, end, rail, strict=True)
    labels = np.array([f"{k} {n}{'' if r else e}" for k, n, e, r in numbers])
    one = np.zeros(1)
    corners = np.array([(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1),
                        (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)]).T  # fmt: skip
    brick = Solid(0.01 * corners, np.arange(8)[:, None], one.astype(int), ("brick",),
                  one + STEEL.E, one + STEEL.nu, one + STEEL.rho)  # fmt: skip
    own = assemble(brick, brick.points)
    # Half bricks count: 20-node bricks have nodes amid their edges.
    at = 2 * np.stack([x, y, z], axis=1)[:, None] + np.rint(200.0 * own.nodes.T).astype(int)
    nodes, cells = np.unique(at.reshape(-1, 3), axis=0, return_inverse=True)
    dofs = (3 * cells.reshape(len(x), 20, 1) + np.arange(3)).reshape(len(x), 60)
    size, names = 3 * len(nodes), np.unique(labels)

    def parts(matrix: sp.csc_array) -> dict[str, sp.csc_array]:
        one, found = sp.coo_array(matrix), {}
        for name in names:
            rows = dofs[labels == name]
            data = np.tile(one.data, len(rows))
            at = rows[:, one.row].ravel(), rows[:, one.col].ravel()
            found[str(name)] = sp.csc_array((data, at), shape=(size, size))
        return found

    stiffness, mass = parts(own.stiffness), parts(own.mass)
    found = matrix_model(
        sum(mass.values()), sum(stiffness.values()),
        np.repeat(np.arange(len(nodes)), 3).tolist(), list("xyz") * len(nodes),
        np.repeat(0.005 * nodes, 3, axis=0), stiffness,
    )  # fmt: skip
    welds = {str(name): 5.0 for name in names if name.startswith("weld")}
    return replace(found, mass_groups=mass, group_priors=welds, free=True)
