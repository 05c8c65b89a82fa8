"""An arch of rectangular tube, bent to a circle, clamped at both ends."""

import numpy as np

from truths.sections import rectangular_tube
from truths.structure import STEEL, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

RADIUS, HALF_ANGLE, PIECES = 1.5, np.radians(60.0), 8
HALF = RADIUS * HALF_ANGLE  # m, half the length along the arc


def bend(points: Array) -> Array:
    """Return points where rolling the straight tube has put them; x runs along the arc."""
    turn = points[0] / RADIUS
    from_centre = RADIUS + points[2]
    height = from_centre * np.cos(turn) - RADIUS * np.cos(HALF_ANGLE)
    return np.array([from_centre * np.sin(turn), points[1], height])


STATIONS = [-HALF + 2 * HALF * i / PIECES for i in range(PIECES + 1)]

STRUCTURE = Structure(
    name="arch",
    title="Rolled arch of rectangular tube, clamped at both ends",
    classes=("curved members", "hollow sections", "clamped"),
    story="""
A steel tube 80 x 50 x 4 mm, rolled to a circle of 1.5 m radius over 120 degrees. Both ends stand 60 mm deep
in a foundation. A splice sleeve of 4 mm plate lies around the crown, which the drawing leaves out; the
drawing is a polygon of eight straight pieces between points on the circle.
""",
    materials={"steel": STEEL},
    sections={"tube": rectangular_tube(0.05, 0.08, 0.004)},
    joints={f"P{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)},
    types={"P0": "foot", f"P{PIECES}": "foot", f"P{PIECES // 2}": "bend"}
    | {f"P{i}": "bend" for i in range(1, PIECES) if i != PIECES // 2},
    members=tuple(
        Member(
            f"piece-{i + 1}",
            (f"P{i}", f"P{i + 1}"),
            "tube",
            "steel",
            3,
            extend=(0.06 * (i == 0), 0.06 * (i == PIECES - 1)),
            weld=0.004 if i in (3, 4) else 0.0,
        )
        for i in range(PIECES)
    ),
    blocks=(
        Block("sleeve-top", (-0.1, -0.029, 0.04), (0.1, 0.029, 0.044), "steel"),
        Block("sleeve-foot", (-0.1, -0.029, -0.044), (0.1, 0.029, -0.04), "steel"),
        Block("sleeve-left", (-0.1, 0.025, -0.04), (0.1, 0.029, 0.04), "steel"),
        Block("sleeve-right", (-0.1, -0.029, -0.04), (0.1, -0.025, 0.04), "steel"),
    ),
    clamps=(
        Clamp("P0", (-HALF - 0.06, -0.05, -0.05), (-HALF, 0.05, 0.05)),
        Clamp(f"P{PIECES}", (HALF, -0.05, -0.05), (HALF + 0.06, 0.05, 0.05)),
    ),
    warp=bend,
    sensors=(
        ("P1", "xyz"),
        ("P2", "xyz"),
        ("P3", "xyz"),
        ("P4", "xyz"),
        ("P5", "xyz"),
        ("P6", "xyz"),
        ("P7", "xyz"),
    ),
    changes=(
        Change("6 kg at P3", lumps=(Lump("P3", 6.0),)),
        Change(
            "4 kg at P5, spring of 1e6 N/m along y at P4",
            lumps=(Lump("P5", 4.0),),
            springs=(Spring("P4", "y", 1e6),),
        ),
    ),
    used=5,
    held_out=3,
    size=(0.045, 0.03),
    guess=50.0,
    scatter=0.004,
    shape_scatter=0.03,
    default=True,
)
