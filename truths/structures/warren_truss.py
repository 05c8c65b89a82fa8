"""A Warren truss of solid bars whose diagonals meet the chords with gaps, free."""

from dataclasses import replace

import numpy as np

from truths.sections import bar
from truths.structure import STEEL, Array, Change, Lump, Member, Spring, Structure

BAY, HEIGHT, GAP, THICK = 0.36, 0.3, 0.09, 0.05  # m
POSTS = 9
CHORD, WEB = 0.04, 0.03  # m, depth of the chords, length of a diagonal's cut along the chord
EVEN = BAY / 2 * np.arange(POSTS)  # m, where diagonals stand before they lean
# Diagonals meet in pairs: 0 and 1 at the upper chord, 1 and 2 at the lower one, and so on.
MEET = {
    "U": np.array([BAY * (j // 2 + 0.5) + GAP / 2 * (-1) ** (j + 1) for j in range(POSTS)]),
    "L": np.array([BAY * ((j + 1) // 2) + GAP / 2 * (-1) ** j for j in range(POSTS)]),
}
LEAN = np.arctan((BAY / 2 - GAP) / HEIGHT)
WEB_BAR = replace(bar(THICK, WEB), drawn=bar(THICK, WEB * float(np.cos(LEAN))).drawn)


def _along(x: Array, chord: str) -> Array:
    """Return where a chord puts points along it; a diagonal's own width is kept."""
    before = np.sort(np.concatenate([EVEN - WEB / 2, EVEN + WEB / 2]))
    after = np.sort(np.concatenate([MEET[chord] - WEB / 2, MEET[chord] + WEB / 2]))
    moved = np.interp(x, before, after)
    outside = np.minimum(x - before[0], 0.0) + np.maximum(x - before[-1], 0.0)
    return np.asarray(moved + outside)


def leaning(points: Array) -> Array:
    """Return points of a ladder with upright posts where the truss has them."""
    clear = (HEIGHT - CHORD) / 2
    share = np.clip((points[2] + clear) / (2 * clear), 0.0, 1.0)
    x = (1 - share) * _along(points[0], "L") + share * _along(points[0], "U")
    return np.array([x, points[1], points[2]])


STRUCTURE = Structure(
    name="warren-truss",
    title="Warren truss of solid bars with gaps at its joints, free",
    classes=("truss", "planar frame", "solid sections", "free"),
    story="""
Chords 40 x 50 mm and diagonals cut from 50 mm plate. The diagonals end on the chords' edges, in
pairs with a gap of 90 mm between their axes, so the chords bend. The drawing knows these gaps and runs
the diagonals to the chords' centre lines; what lies inside the chords' depth does not bend on the solid.
""",
    materials={"steel": STEEL},
    sections={"chord": bar(THICK, CHORD), "web": WEB_BAR},
    joints={
        f"{c}{j}": (float(x), 0.0, (HEIGHT if c == "U" else -HEIGHT) / 2)
        for c in "LU"
        for j, x in enumerate(EVEN)
    },
    types={f"{c}{j}": "chord-joint" for c in "LU" for j in range(POSTS)},
    members=(
        *(Member(f"diagonal-{j}", (f"L{j}", f"U{j}"), "web", "steel", 4) for j in range(POSTS)),
        *(
            Member(
                f"{'upper' if c == 'U' else 'lower'}-{j}",
                (f"{c}{j}", f"{c}{j + 1}"),
                "chord",
                "steel",
                2,
                extend=(WEB / 2 * (j == 0), WEB / 2 * (j == POSTS - 2)),
            )
            for c in "LU"
            for j in range(POSTS - 1)
        ),
    ),
    plane="in-plane",
    warp=leaning,
    sensors=(
        *((f"{c}{j}", "xz") for c in "LU" for j in range(POSTS)),
        *(((f"diagonal-{j}", 0.5), "x") for j in range(POSTS)),
    ),
    changes=(
        Change("8 kg at U4", lumps=(Lump("U4", 8.0),)),
        Change(
            "5 kg at L6, spring of 4e6 N/m along z at L2",
            lumps=(Lump("L6", 5.0),),
            springs=(Spring("L2", "z", 4e6),),
        ),
    ),
    used=4,
    held_out=4,
    size=(0.03, 0.021),
    graded=False,
    guess=200.0,
    scatter=0.002,
)
