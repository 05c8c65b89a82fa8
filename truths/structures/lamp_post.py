"""A tapered lamp post of thin plate with a door, an outreach arm and a lamp."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, rectangular_tube, round_bar, rounded
from truths.structure import (
    STEEL,
    Array,
    Block,
    Change,
    Clamp,
    Lump,
    Material,
    Member,
    Spring,
    Structure,
)

HEIGHT, REACH = 4.0, 0.9  # m
TOP, FOOT, WALL = 0.09, 1.7, 0.004  # m; the foot's size in multiples of the top's; m
STATIONS = (0.0, 0.9, 1.8, 2.8, HEIGHT)  # m
POLE = round_bar(TOP, WALL)
HALF = POLE.width / 2
INNER = HALF * (1 - 2 * WALL / TOP)
FLAT = np.pi / 4  # of its width is left of what lies far from the axis when squares are rounded


def shaped(points: Array) -> Array:
    """Return points of an even square pole where the round and tapered one has them."""
    grow = 1 + (FOOT - 1) * (1 - np.clip(points[2] / HEIGHT, 0.0, 1.0))
    x, y = rounded(points[0], points[1])
    return np.array([grow * x, grow * y, points[2]])


def _length(low: float, high: float) -> Section:
    """Return the even pole, drawn with the size at the middle of a length."""
    grow = 1 + (FOOT - 1) * (1 - (low + high) / 2 / HEIGHT)
    wall = round(WALL * grow, 4)
    return replace(POLE, drawn=round_bar(round(TOP * grow, 4), wall).drawn)


def _arm() -> Section:
    tube = rectangular_tube(0.06, 0.06, 0.003)
    wide = tuple((a / FLAT, b / FLAT, c, d, solid) for a, b, c, d, solid in tube.rectangles)
    return replace(tube, width=0.06 / FLAT, rectangles=wide)


STRUCTURE = Structure(
    name="lamp-post",
    title="Tapered round lamp post of plate with a door and an arm",
    classes=(
        "after the rule",
        "tower",
        "thin plates",
        "tapered members",
        "round sections",
        "lumps",
    ),
    story="""
A post 4 m high, rolled of plate to 153 mm at its foot and 90 mm at its top, whose wall thins with it from 6.8
to 4 mm; an arm of 60 x 60 x 3 mm, 0.9 m long, carries a lamp of 6 kg; two plates inside the post hold its
shape there. Near the foot a door of 90 x 380 mm is cut out; the foot plate of 20 mm stands on 25 mm of
mortar. The drawing has four lengths of constant round tube, clamped at the foot plate, without door and
mortar.
""",
    materials={"steel": STEEL, "mortar": Material(2.5e9, 0.2, 2000.0)},
    sections={f"post-{i + 1}": _length(a, b) for i, (a, b) in enumerate(pairwise(STATIONS))}
    | {"arm": _arm()},
    joints={f"J{i}": (0.0, 0.0, z) for i, z in enumerate(STATIONS)}
    | {"lamp": (REACH, 0.0, HEIGHT)},
    types={"J0": "foot", "J4": "corner", "lamp": "end"},
    members=(
        *(
            Member(f"post-{i + 1}", (f"J{i}", f"J{i + 1}"), f"post-{i + 1}", "steel", 4)
            for i in range(3)
        ),
        Member("post-4", ("J3", "J4"), "post-4", "steel", 5, extend=(0.0, 0.05)),
        Member("arm", ("J4", "lamp"), "arm", "steel", 5),
    ),
    blocks=(
        Block("hollow", (-INNER, -INNER, HEIGHT - 0.05), (INNER, INNER, HEIGHT + 0.05), ""),
        Block("ring-low", (-INNER, -INNER, HEIGHT - 0.036), (INNER, INNER, HEIGHT - 0.03), "steel"),
        Block(
            "ring-high", (-INNER, -INNER, HEIGHT + 0.03), (INNER, INNER, HEIGHT + 0.036), "steel"
        ),
        Block("door", (-0.03, -HALF, 0.3), (0.03, -HALF / 2, 0.68), ""),
        Block("plate", (-0.08, -0.08, -0.02), (0.08, 0.08, 0.0), "steel"),
        Block("mortar", (-0.08, -0.08, -0.045), (0.08, 0.08, -0.02), "mortar"),
        Block("lid", (-HALF, -HALF, HEIGHT + 0.05), (HALF, HALF, HEIGHT + 0.054), "steel"),
    ),
    lumps=(Lump("lamp", 6.0),),
    clamps=(Clamp("J0", (-0.1, -0.1, -0.045), (0.1, 0.1, -0.045)),),
    warp=shaped,
    sensors=(
        ("J1", "xy"),
        ("J2", "xy"),
        (("post-3", 0.5), "xy"),
        ("J3", "xy"),
        (("post-4", 0.5), "xy"),
        ("J4", "xy"),
        (("arm", 0.5), "yz"),
        ("lamp", "yz"),
    ),
    changes=(
        Change("8 kg at J3", lumps=(Lump("J3", 8.0),)),
        Change(
            "2 kg at lamp, spring of 6e4 N/m along y at J2",
            lumps=(Lump("lamp", 2.0),),
            springs=(Spring("J2", "y", 6e4),),
        ),
    ),
    used=5,
    held_out=3,
    size=(0.08, 0.056),
    guess=4.0,
    scatter=0.006,
    shape_scatter=0.03,
    together=0.7,
    weighed=0.0,
)
