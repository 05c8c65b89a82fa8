"""A bicycle frame of square tubes, free."""

from dataclasses import replace

import numpy as np

from truths.sections import Section, bar, rectangular_tube
from truths.structure import STEEL, Array, Change, Lump, Member, Spring, Structure

REAR, SEAT, HEAD = -0.42, 0.0, 0.56  # m, along the frame
LOW, HIGH = (0.06, 0.0, 0.34), (0.14, 0.5, 0.52)  # m, heights of both runs of tubes there
EVEN, FLAT, LEAN = (
    0.5,
    0.026,
    0.3,
)  # m; half the depth of what keeps its shape; slope of the seat tube
TUBE, WALL, STAY = 0.03, 0.002, 0.018  # m
COSINES = {
    name: float(np.cos(np.arctan2(rise, run)))
    for name, rise, run in (
        ("top", HIGH[2] - HIGH[1], HEAD - SEAT),
        ("down", LOW[2] - LOW[1], HEAD - SEAT),
        ("seat-stay", HIGH[1] - HIGH[0], SEAT - REAR),
        ("chain-stay", LOW[1] - LOW[0], SEAT - REAR),
    )
}


def diamond(points: Array) -> Array:
    """Return points of a flat ladder of tubes where the frame has them."""
    x, y, z = points
    low, high = (np.interp(x, (REAR, SEAT, HEAD), heights) for heights in (LOW, HIGH))
    share = np.clip((z - FLAT) / (EVEN - 2 * FLAT), 0.0, 1.0)
    height = z + (1 - share) * low + share * (high - EVEN)
    return np.array([x - LEAN * height, y, height])


def _leaning(name: str, width: float, wall: float) -> Section:
    """Return a square tube cut upright, so that across its slope it has its catalogue size."""
    tube, cosine = rectangular_tube(width, width, wall), COSINES[name]
    cut = tuple((a, b, c / cosine, d / cosine, solid) for a, b, c, d, solid in tube.rectangles)
    return replace(tube, height=width / cosine, rectangles=cut)


STRUCTURE = Structure(
    name="bicycle",
    title="Bicycle frame of square tubes, free",
    classes=("planar frame", "hollow sections", "free", "bicycle frame"),
    story="""
A diamond frame: top and down tube 30 x 30 x 2 mm, seat and head tube of the same, stays of one 18 x 18 x 2 mm
tube each side merged into one, all brazed all around without lugs, with a solid dropout bar at the rear. The tubes meet at
slanting angles and reach into each other's depth, which centre lines do not show.
""",
    materials={"steel": STEEL},
    sections={
        "tube": rectangular_tube(TUBE, TUBE, WALL),
        "top": _leaning("top", TUBE, WALL),
        "down": _leaning("down", TUBE, WALL),
        "seat-stay": _leaning("seat-stay", STAY, WALL),
        "chain-stay": _leaning("chain-stay", STAY, WALL),
        "dropout": bar(0.01, 0.025),
    },
    joints={
        "bracket": (SEAT, 0.0, 0.0),
        "saddle": (SEAT, 0.0, EVEN),
        "head-low": (HEAD, 0.0, 0.0),
        "head-high": (HEAD, 0.0, EVEN),
        "drop-low": (REAR, 0.0, 0.0),
        "drop-high": (REAR, 0.0, EVEN),
    },
    types={"head-low": "head", "head-high": "head", "drop-low": "drop", "drop-high": "drop"},
    members=(
        Member("top", ("saddle", "head-high"), "top", "steel", 5),
        Member("down", ("bracket", "head-low"), "down", "steel", 6),
        Member("seat-stay", ("drop-high", "saddle"), "seat-stay", "steel", 5),
        Member("chain-stay", ("drop-low", "bracket"), "chain-stay", "steel", 5),
        Member("seat", ("bracket", "saddle"), "tube", "steel", 5, extend=(0.02, 0.025)),
        Member("head", ("head-low", "head-high"), "tube", "steel", 2, extend=(0.02, 0.02)),
        Member("dropout", ("drop-low", "drop-high"), "dropout", "steel", 1, extend=(0.009, 0.009)),
    ),
    warp=diamond,
    sensors=(
        ("bracket", "xyz"),
        ("saddle", "xyz"),
        ("head-low", "xyz"),
        ("head-high", "xy"),
        ("drop-low", "xyz"),
        (("top", 0.5), "yz"),
        (("down", 0.5), "yz"),
        (("down", 0.25), "y"),
        (("seat-stay", 0.5), "yz"),
        (("chain-stay", 0.5), "yz"),
        (("seat", 0.5), "xy"),
    ),
    changes=(
        Change("0.8 kg at saddle", lumps=(Lump("saddle", 0.8),)),
        Change(
            "0.5 kg at head-high, spring of 2e5 N/m along y at drop-low",
            lumps=(Lump("head-high", 0.5),),
            springs=(Spring("drop-low", "y", 2e5),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.028, 0.02),
    graded=False,
    guess=80.0,
    scatter=0.004,
    shape_scatter=0.03,
)
