"""A tapered tower of solid bars, knees in its corners, on four clamped legs."""

import numpy as np

from truths.lacks import plates
from truths.sections import bar
from truths.structure import ALUMINIUM, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

LEVELS = (0.0, 0.45, 0.85, 1.2)  # m
LEG, RAIL, REACH = 0.024, 0.014, 0.03  # m
HALF, LEAN = np.array([0.18, 0.15]), 0.07
CORNERS = {"A": (-1, -1), "B": (1, -1), "C": (1, 1), "D": (-1, 1)}
AROUND = (("A", "B"), ("B", "C"), ("D", "C"), ("A", "D"))
TOP = len(LEVELS) - 1


def leaning(points: Array) -> Array:
    """Return points of an upright tower where its leaning legs have them."""
    inwards = LEAN * points[2] * np.clip(points[:2] / (HALF[:, None] - LEG / 2), -1.0, 1.0)
    return np.array([*(points[:2] - inwards), points[2]])


def _knee(corner: str, level: int, along: int) -> Block:
    """Return the block under a rail, between it and the leg."""
    sign = CORNERS[corner]
    face = np.array(sign) * (HALF - LEG / 2)
    low, high = [0.0, 0.0], [0.0, 0.0]
    ends = sorted((face[along], face[along] - sign[along] * REACH))
    low[along], high[along] = ends
    across = sign[1 - along] * HALF[1 - along]
    low[1 - along], high[1 - along] = across - RAIL / 2, across + RAIL / 2
    under = LEVELS[level] - RAIL / 2
    return Block(
        f"knee-{corner}{level}-{'xy'[along]}",
        (low[0], low[1], under - REACH),
        (high[0], high[1], under),
        "aluminium",
    )


LEGS = tuple(
    Member(
        f"leg-{c}{i + 1}",
        (f"{c}{i}", f"{c}{i + 1}"),
        "leg",
        "aluminium",
        2,
        extend=(0.0, RAIL / 2 * (i + 1 == TOP)),
    )
    for c in CORNERS
    for i in range(TOP)
)
RAILS = tuple(
    Member(f"rail-{a}{b}{i}", (f"{a}{i}", f"{b}{i}"), "rail", "aluminium", 3)
    for i in range(1, TOP + 1)
    for a, b in AROUND
)

STRUCTURE = Structure(
    name="tower",
    title="Tapered tower of aluminium bars with knee blocks, clamped",
    classes=("tower", "space frame", "solid sections", "clamped"),
    story="""
Four legs of 24 mm square bar lean inwards by 4 degrees, three rings of rails of 14 mm square bar tie them,
all aluminium and welded. Knee blocks of 30 x 30 x 14 mm sit below the rails of the lowest ring. The drawing takes rails
from centre line to centre line and leaves the knees out.
""",
    materials={"aluminium": ALUMINIUM},
    sections={"leg": bar(LEG, LEG), "rail": bar(RAIL, RAIL)},
    joints={
        f"{corner}{level}": (x * HALF[0], y * HALF[1], height)
        for level, height in enumerate(LEVELS)
        for corner, (x, y) in CORNERS.items()
    },
    types={f"{c}{i}": f"level-{i}" if i else "foot" for c in CORNERS for i in range(TOP + 1)},
    members=(*RAILS, *LEGS),
    blocks=tuple(_knee(corner, 1, along) for corner in CORNERS for along in (0, 1)),
    clamps=tuple(
        Clamp(
            f"{c}0",
            (x * HALF[0] - LEG, y * HALF[1] - LEG, 0.0),
            (x * HALF[0] + LEG, y * HALF[1] + LEG, 0.0),
        )
        for c, (x, y) in CORNERS.items()
    ),
    warp=leaning,
    sensors=tuple((f"{c}{i}", "xy") for i in range(1, TOP + 1) for c in "AC"),
    changes=(
        Change("0.8 kg at A3, 0.5 kg at C2", lumps=(Lump("A3", 0.8), Lump("C2", 0.5))),
        Change(
            "0.5 kg at B2, spring of 1e5 N/m along y at D2",
            lumps=(Lump("B2", 0.5),),
            springs=(Spring("D2", "y", 1e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.04, 0.028),
    graded=False,
    guess=40.0,
    scatter=0.003,
)

LACKS = plates("type:level-1", "knee blocks", "knee")
