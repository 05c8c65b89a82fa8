"""A tapering jib of four chords that battens tie on their outer faces."""

from dataclasses import replace

import numpy as np

from truths.sections import Section, bar
from truths.structure import STEEL, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

STATIONS = (0.0, 0.3, 0.62, 0.95, 1.3, 1.6)  # m, of the battens
HALF, TIP = 0.15, 0.5  # m at the root, share of it at the tip
CHORD, PLATE, WIDE = 0.03, 0.006, 0.05  # m; thickness and width of a batten
CORNERS = {"A": (-1, -1), "B": (1, -1), "C": (1, 1), "D": (-1, 1)}  # signs of y and z
OUT = (CHORD + PLATE) / 2  # m, from a chord's axis to that of a batten
KNOTS = np.array([-HALF - OUT, -HALF + CHORD / 2, HALF - CHORD / 2, HALF + OUT])


def tapered(points: Array) -> Array:
    """Return points of the even jib where the tapered one has them; chords keep their size."""
    inwards = HALF * (1 - TIP) * np.clip(points[0] / STATIONS[-1], 0.0, 1.0)
    share = np.array([np.interp(v, KNOTS, [-1.0, -1.0, 1.0, 1.0]) for v in points[1:]])
    return np.array([points[0], *(points[1:] - share * inwards)])


def _batten(across: float, up: float) -> Section:
    """Return a flat on the outer face of the chords, drawn on their axes."""
    flat = bar(WIDE, PLATE) if up else bar(PLATE, WIDE)
    (y0, y1, z0, z1, solid), *_ = flat.rectangles
    moved = (y0 + across, y1 + across, z0 + up, z1 + up, solid)
    size = flat.width + 2 * abs(across), flat.height + 2 * abs(up)
    return replace(flat, width=size[0], height=size[1], rectangles=(moved,))


FACES = {"AB": (0.0, -OUT), "DC": (0.0, OUT), "AD": (OUT, 0.0), "BC": (-OUT, 0.0)}

STRUCTURE = Structure(
    name="battened-jib",
    title="Tapering crane jib of four chords with battens on their outer faces",
    classes=(
        "after the rule",
        "crane jib",
        "eccentric joints",
        "solid sections",
        "tapered",
        "clamped",
    ),
    story="""
Four chords of 30 mm square bar run from a square of 300 mm at the root to one of 150 mm at the tip. Battens,
flats of 50 x 6 mm, are welded onto the chords' outer faces at five stations: 18 mm outside the axes on which
the drawing puts them, and 50 mm long where the drawing has a point. A cross plate of 6 mm closes the tip for
the sheave, and the root's chords sit in sockets of 30 mm of which the drawing knows only the bottom. The hook
is drawn as a mass below the tip.
""",
    materials={"steel": STEEL},
    sections={"chord": bar(CHORD, CHORD)} | {f"batten-{f}": _batten(*o) for f, o in FACES.items()},
    joints={
        f"{c}{i}": (x, y * HALF, z * HALF)
        for c, (y, z) in CORNERS.items()
        for i, x in enumerate(STATIONS)
    },
    types={
        f"{c}{i}": "root" if i == 0 else "tip" if i == 5 else "joint"
        for c in CORNERS
        for i in range(6)
    },
    members=(
        *(
            Member(
                f"chord-{c}{i}",
                (f"{c}{i}", f"{c}{i + 1}"),
                "chord",
                "steel",
                2,
                extend=(0.0, 0.025 * (i == 4)),
            )
            for c in CORNERS
            for i in range(5)
        ),
        *(
            Member(
                f"batten-{f}{i}",
                (f"{f[0]}{i}", f"{f[1]}{i}"),
                f"batten-{f}",
                "steel",
                2,
                extend=(CHORD / 2, CHORD / 2),
            )
            for f in FACES
            for i in range(1, 6)
        ),
    ),
    blocks=(Block("sheave-plate", (1.59, -HALF, -HALF), (1.596, HALF, HALF), "steel"),),
    lumps=(
        Lump("A5", 1.5, (0.0, 0.075, -0.06)),
        Lump("B5", 1.5, (0.0, -0.075, -0.06)),
    ),
    clamps=tuple(
        Clamp(
            f"{c}0",
            (0.0, y * HALF - 0.02, z * HALF - 0.02),
            (0.03, y * HALF + 0.02, z * HALF + 0.02),
        )
        for c, (y, z) in CORNERS.items()
    ),
    warp=tapered,
    sensors=(
        *((f"{c}{i}", "yz") for c in "AC" for i in range(1, 6)),
        *((f"{c}{i}", "yz") for c in "BD" for i in (3, 5)),
        ("A5", "x"),
        ("C5", "x"),
        *(((f"chord-{c}{i}", 0.5), "yz") for c in "AC" for i in (1, 3)),
    ),
    changes=(
        Change("4 kg more on the hook", lumps=(Lump("A5", 2.0), Lump("B5", 2.0))),
        Change(
            "guy of 2e5 N/m along y at C4, 1.5 kg at D2",
            lumps=(Lump("D2", 1.5),),
            springs=(Spring("C4", "y", 2e5),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.06, 0.042),
    graded=False,
    guess=30.0,
    scatter=0.004,
    shape_scatter=0.03,
    together=0.5,
)
