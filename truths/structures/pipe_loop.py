"""A pipe bent twice in space between a flange and a hanger."""

import numpy as np

from truths.sections import round_bar, rounded
from truths.structure import STEEL, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

RADIUS = 0.13  # m, of both bends
ARC = RADIUS * np.pi / 2
FIRST, SECOND, THIRD = 0.4, 0.35, 0.5  # m, straight lengths
A, B = FIRST, FIRST + ARC  # m along the pipe, ends of the first bend
C, D = B + SECOND, B + SECOND + ARC  # of the second
END = D + THIRD
STATIONS = (0.0, FIRST / 2, A, (A + B) / 2, B, (B + C) / 2, C, (C + D) / 2, D, D + THIRD / 2, END)
TUBE = round_bar(0.06, 0.003)
FLANGE = 0.048  # m, half its size


def bent(points: Array) -> Array:
    """Return points of the straight square tube where the round and bent one has them."""
    s, (y, z) = points[0], rounded(points[1], points[2])
    one = np.clip(s - A, 0.0, ARC) / RADIUS  # turns x towards z
    two = np.clip(s - C, 0.0, ARC) / RADIUS  # turns z towards y
    straight = np.minimum(s, A)
    middle, last = np.clip(s - B, 0.0, SECOND), np.maximum(s - D, 0.0)
    x = straight + (RADIUS - z) * np.sin(one)
    up = RADIUS - (RADIUS - z) * np.cos(one) + middle
    # After the first bend the pipe's own z points along -x, its y stays until the second.
    behind = s > B
    x = np.where(behind, A + RADIUS - z, x)
    up = np.where(behind, RADIUS + middle + (RADIUS - y) * np.sin(two), up)
    side = np.where(behind, RADIUS - (RADIUS - y) * np.cos(two) + last, y)
    return np.array([x, side, up])


STRUCTURE = Structure(
    name="pipe-loop",
    title="Pipe with two bends in space between a flange and a hanger",
    classes=("after the rule", "piping", "curved members", "round sections", "clamped"),
    story="""
A steel pipe of 60 x 3 mm with two bends of 130 mm radius in two planes. It is welded to a flange of 16 mm
that is bolted to a wall over its whole face, and hangs on a spring at its far end. A clamp ring of 5 mm lies
around the middle length and carries a valve of 2.5 kg. The bends turn oval when they bend, the flange's neck
stiffens the root: the drawing has straight pieces of round tube through points on the axis, a rigid root at
the flange's face, the valve and the hanger's catalogue stiffness.
""",
    materials={"steel": STEEL},
    sections={"tube": TUBE},
    joints={f"P{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)},
    types={"P0": "flange", "P10": "end"} | {f"P{i}": "bend" for i in (2, 3, 4, 6, 7, 8)},
    members=tuple(
        Member(f"piece-{i + 1}", (f"P{i}", f"P{i + 1}"), "tube", "steel", 3) for i in range(10)
    ),
    blocks=(
        Block("flange", (-0.016, -FLANGE, -FLANGE), (0.0, FLANGE, FLANGE), "steel"),
        Block("ring", (0.765, -0.036, -0.036), (0.795, 0.036, 0.036), "steel", first=True),
    ),
    lumps=(Lump("P5", 2.5),),
    springs=(Spring("P10", "z", 4e4), Spring("P10", "x", 1.5e4)),
    clamps=(Clamp("P0", (-0.016, -0.1, -0.1), (-0.016, 0.1, 0.1)),),
    warp=bent,
    graded=False,
    sensors=(
        ("P1", "yz"),
        ("P2", "yz"),
        ("P4", "xyz"),
        ("P5", "xy"),
        ("P6", "xyz"),
        ("P8", "xyz"),
        ("P9", "xz"),
        ("P10", "xyz"),
    ),
    changes=(
        Change("1.5 kg at P8", lumps=(Lump("P8", 1.5),)),
        Change(
            "1 kg at P10, spring of 8e4 N/m along y at P4",
            lumps=(Lump("P10", 1.0),),
            springs=(Spring("P4", "y", 8e4),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.04, 0.03),
    guess=12.0,
    scatter=0.006,
    shape_scatter=0.035,
    together=0.6,
    weighed=0.0,
)
