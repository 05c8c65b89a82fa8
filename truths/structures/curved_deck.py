"""A footbridge curved in plan: a trough of concrete over two spans, drawn as one line."""

from dataclasses import replace

import numpy as np

from truths.lacks import LUMP, plates
from truths.sections import bar, thin_walled
from truths.structure import Array, Block, Change, Lump, Material, Member, Spring, Structure

RADIUS, SPAN = 14.0, 8.0  # m, in plan; along the axis
STATIONS = tuple(2.0 * i for i in range(9))  # m
WIDE, SLAB, EDGE, UP = 2.4, 0.26, 0.3, 0.3  # m; width and height of the edge beams over the slab
SIDE = WIDE / 2 - EDGE  # m, inner face of an edge beam
TROUGH = thin_walled(
    (
        (-WIDE / 2, WIDE / 2, 0.0, SLAB),
        (-WIDE / 2, -SIDE, SLAB, SLAB + UP),
        (SIDE, WIDE / 2, SLAB, SLAB + UP),
    ),
    2 * EDGE * (SLAB + UP),
)
LOW = TROUGH.rectangles[0][2]  # m, underside
SIDES = {"L": SIDE, "R": -SIDE}
ENDS = (0, 4, 8)  # stations over bearings


def curved(points: Array) -> Array:
    """Return points of the straight deck where the curved one has them."""
    turn, reach = points[0] / RADIUS, RADIUS - points[1]
    return np.array([reach * np.sin(turn), RADIUS - reach * np.cos(turn), points[2]])


STRUCTURE = Structure(
    name="curved-deck",
    title="Footbridge curved in plan, a trough of concrete over two spans",
    classes=("after the rule", "bridge", "curved members", "open sections", "slab", "on bearings"),
    story="""
A slab 2400 mm wide and 260 mm thick with edge beams that rise 300 mm above it runs over two spans of 8 m on a
circle of 14 m radius. Pairs of bearings stand under the edge beams at both ends and in the middle, where a cross
beam below the slab takes them; the inner bearing at one end has settled and gives way twice as much. One edge
carries a low parapet that stops at joints, whose stiffness and mass are not drawn. The drawing is a polygon
of eight straight pieces of the trough on its centroid, with the torsion constant of its rectangles, and rigid
arms to the bearings and to the places of the sensors.
""",
    materials={
        "concrete": Material(33e9, 0.2, 2500.0),
        "parapet": Material(10e9, 0.3, 2600.0),
        "link": Material(3.3e11, 0.2, 1.0),
    },
    sections={"trough": TROUGH, "link": replace(bar(1.1, 0.6), rectangles=())},
    joints={f"G{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {f"{s}{i}": (x, y, 0.0) for s, y in SIDES.items() for i, x in enumerate(STATIONS)},
    types={f"G{i}": "axis" for i in range(9)}
    | {f"{s}{i}": "bearing" if i in ENDS else "edge" for s in SIDES for i in range(9)},
    members=(
        *(
            Member(f"deck-{i + 1}", (f"G{i}", f"G{i + 1}"), "trough", "concrete", 3)
            for i in range(8)
        ),
        *(
            Member(f"arm-{s}{i}", (f"G{i}", f"{s}{i}"), "link", "link", 1)
            for s in SIDES
            for i in range(9)
        ),
    ),
    blocks=(
        Block(
            "cross", (SPAN - 0.3, -WIDE / 2, LOW - 0.35), (SPAN + 0.3, WIDE / 2, LOW), "concrete"
        ),
        *(
            Block(
                f"parapet-{i}",
                (a, SIDE + 0.1, LOW + SLAB + UP),
                (a + 3.6, SIDE + 0.2, LOW + SLAB + UP + 0.4),
                "parapet",
            )
            for i, a in enumerate((0.2, 4.2, 8.2, 12.2))
        ),
    ),
    springs=(
        *(
            Spring(f"{s}{i}", d, k)
            for s in SIDES
            for i in ENDS
            for d, k in (("x", 2e7), ("y", 4e7), ("z", 3e8))
        ),
        Spring("L8", "z", -1.5e8, drawn=False),
    ),
    warp=curved,
    sensors=(
        *((f"{s}{i}", "z") for s in SIDES for i in range(9)),
        *((f"L{i}", "xy") for i in (0, 2, 4, 6, 8)),
    ),
    changes=(
        Change("2 t at R2", lumps=(Lump("R2", 2e3),)),
        Change(
            "1.5 t at L6, prop of 3e7 N/m along z at R6",
            lumps=(Lump("L6", 1.5e3),),
            springs=(Spring("R6", "z", 3e7),),
        ),
    ),
    beam="timoshenko",
    used=4,
    held_out=3,
    size=(0.4, 0.3),
    graded=False,
    guess=6.0,
    scatter=0.006,
    shape_scatter=0.03,
    together=0.6,
    weighed=0.0,
)

LACKS = (
    *plates("all", "a parapet", "parapet", mass=LUMP, stiffness="plate"),
    *plates("G4", "a cross beam", "cross", mass=LUMP, stiffness="plate"),
)
