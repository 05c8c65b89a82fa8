"""A cast handwheel on a shaft that a flange holds."""

from itertools import pairwise

import numpy as np

from truths.sections import Section, bar, round_bar, rounded
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

RADIUS, HUB, SHAFT = 0.24, 0.05, 0.42  # m; length of the shaft
FLAT = np.pi / 4  # of its width is left of what lies far from the axis when squares are rounded
CORNERS = ((1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))  # of the rim before it is rounded
RIM = [  # joints in turn, in quarters of the sides; the spokes' ends are 2, 6, 10, 14
    tuple(RADIUS * (a + (b - a) * i / 4) for a, b in zip(start, end, strict=True))
    for start, end in pairwise(CORNERS)
    for i in range(4)
]
SPOKES = {2: "east", 6: "north", 10: "west", 14: "south"}


def round_all(points: Array) -> Array:
    """Return points of the square wheel where the round one has them."""
    return np.array([*rounded(points[0], points[1]), points[2]])


def _spoke(width: float, height: float) -> Section:
    """Return a bar that has its catalogue size after it is rounded; local y is in the plane."""
    wide = bar(width / FLAT, height)
    return Section(wide.width, height, wide.rectangles, bar(width, height).drawn)


STUB = Section(0.05, 0.05, (), bar(0.05, 0.05).drawn)

STRUCTURE = Structure(
    name="handwheel",
    title="Cast handwheel of four spokes on an overhung shaft",
    classes=(
        "after the rule",
        "wheel",
        "curved members",
        "round sections",
        "close modes",
        "clamped",
    ),
    story="""
A wheel of grey iron, 480 mm in diameter on the middle of its rim of 28 x 36 mm, with four spokes of 26 x 16 mm
and a hub of 100 mm in diameter, 56 mm long. It sits on a shaft of 38 mm, 420 mm long, welded into a flange
plate of 10 mm that a wall holds along two of its edges. Webs lie between rim and spokes where the casting is
filleted, a balance pad is cast inside the rim, the handle is drawn as a mass. The drawing has the rim as sixteen
straight pieces, a stub for each quarter of the hub, and a shaft clamped at the flange.
""",
    materials={"steel": STEEL, "iron": Material(110e9, 0.26, 7200.0)},
    sections={
        "rim": bar(0.028, 0.036),
        "spoke": _spoke(0.026, 0.016),
        "stub": STUB,
        "shaft": round_bar(0.038),
    },
    joints={f"R{i}": (x, y, 0.0) for i, (x, y) in enumerate(RIM)}
    | {f"H{i}": (RIM[i][0] * HUB / RADIUS, RIM[i][1] * HUB / RADIUS, 0.0) for i in SPOKES}
    | {"wall": (0.0, 0.0, -SHAFT), "centre": (0.0, 0.0, 0.0)},
    types={f"R{i}": "spoke-end" if i in SPOKES else "rim" for i in range(16)}
    | {f"H{i}": "hub" for i in SPOKES},
    members=(
        Member(
            "shaft",
            ("wall", "centre"),
            "shaft",
            "steel",
            6,
            up=(1.0, 0.0, 0.0),
            extend=(0.0, 0.028),
        ),
        *(
            Member(
                f"rim-{i}",
                (f"R{i}", f"R{(i + 1) % 16}"),
                "rim",
                "iron",
                2,
                extend=(0.014 * (i % 4 == 0), 0.014 * (i % 4 == 3)),
            )
            for i in range(16)
        ),
        *(
            Member(f"spoke-{name}", (f"H{i}", f"R{i}"), "spoke", "iron", 4)
            for i, name in SPOKES.items()
        ),
        *(
            Member(f"stub-{name}", ("centre", f"H{i}"), "stub", "iron", 1)
            for i, name in SPOKES.items()
        ),
    ),
    blocks=(
        Block("hub", (-HUB, -HUB, -0.028), (HUB, HUB, 0.028), "iron", first=True),
        Block("flange", (-0.075, -0.075, -SHAFT - 0.01), (0.075, 0.075, -SHAFT), "steel"),
        *(
            Block(f"fillet-{i}", tuple(low), tuple(high), "iron")
            for i, (low, high) in {
                n: (
                    np.minimum(a, b).round(6).tolist(),
                    np.maximum(a, b).round(6).tolist(),
                )
                for n, (x, y) in ((n, (np.sign(RIM[n][0]), np.sign(RIM[n][1]))) for n in SPOKES)
                for a, b in [
                    (
                        np.array([x * 0.2 - abs(y) * 0.03, y * 0.2 - abs(x) * 0.03, -0.008]),
                        np.array([x * 0.226 + abs(y) * 0.03, y * 0.226 + abs(x) * 0.03, 0.008]),
                    )
                ]
            }.items()
        ),
        Block("pad", (-0.226, 0.08, -0.018), (-0.2, 0.16, 0.018), "iron"),
    ),
    lumps=(Lump("R3", 1.2, (0.0, 0.0, 0.07)),),
    clamps=(
        Clamp("wall", (-0.08, -0.08, -SHAFT - 0.01), (-0.075, 0.08, -SHAFT)),
        Clamp("wall", (0.075, -0.08, -SHAFT - 0.01), (0.08, 0.08, -SHAFT)),
    ),
    warp=round_all,
    sensors=(
        *((f"R{i}", "z") for i in range(0, 16, 2)),
        *((f"R{i}", "xy") for i in (0, 4, 8, 12)),
        *((f"R{i}", "y" if i in (2, 10) else "x") for i in SPOKES),
        *(((f"spoke-{name}", 0.5), "z") for name in SPOKES.values()),
        (("shaft", 0.5), "xy"),
        ("centre", "xyz"),
    ),
    changes=(
        Change("0.6 kg at R10", lumps=(Lump("R10", 0.6),)),
        Change(
            "0.4 kg at R6, spring of 1e5 N/m along z at R15",
            lumps=(Lump("R6", 0.4),),
            springs=(Spring("R15", "z", 1e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.04, 0.028),
    graded=False,
    guess=25.0,
    beam="timoshenko",
    scatter=0.004,
    shape_scatter=0.03,
    together=0.5,
)
