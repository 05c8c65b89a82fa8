"""A beech chair with a leaning back and a glued seat board, on rubber tips."""

import numpy as np

from truths.sections import bar
from truths.structure import Array, Block, Change, Lump, Material, Member, Spring, Structure

DEPTH, HALF, SEAT, BACK = 0.4, 0.2, 0.43, 0.86  # m; half the width
LOW, SLAT = 0.18, 0.64  # m, heights of the stretchers and of the back's lower slat
POST, RAIL = 0.034, 0.06  # m, size of the posts, height of the seat's rails
LEAN, SPLAY = 0.22, 0.16  # m back for each m of height over the seat and under it
SIDES = {"L": HALF, "R": -HALF}


def leaning(points: Array) -> Array:
    """Return points of an upright chair where the leaning posts of its back have them."""
    x, y, z = points
    rear = np.clip((DEPTH - POST / 2 - x) / (DEPTH - POST), 0.0, 1.0)
    back = LEAN * np.maximum(z - SEAT - RAIL / 2, 0.0) + SPLAY * np.maximum(
        SEAT - RAIL / 2 - z, 0.0
    )
    return np.array([x - rear * back, y, z])


def _parts(s: str) -> tuple[Member, ...]:
    """Return the members of one side."""
    posts = (
        ("front-low", f"F{s}0", f"F{s}1", 2),
        ("front-high", f"F{s}1", f"F{s}2", 3),
        ("rear-low", f"B{s}0", f"B{s}1", 2),
        ("rear-high", f"B{s}1", f"B{s}2", 3),
        ("back-low", f"B{s}2", f"B{s}3", 2),
        ("back-high", f"B{s}3", f"B{s}4", 2),
    )
    return (
        Member(f"rail-{s}", (f"B{s}2", f"F{s}2"), "rail", "beech", 4, weld=0.004),
        Member(f"stretcher-{s}-rear", (f"B{s}1", f"S{s}"), "stretcher", "beech", 2),
        Member(f"stretcher-{s}-front", (f"S{s}", f"F{s}1"), "stretcher", "beech", 2),
        *(
            Member(f"{name}-{s}", (a, b), "post", "beech", n, extend=(0.0, 0.03 * (b == f"F{s}2")))
            for name, a, b, n in posts
        ),
    )


STRUCTURE = Structure(
    name="chair",
    title="Beech chair with a leaning back and a glued seat, on rubber tips",
    classes=(
        "after the rule",
        "furniture",
        "space frame",
        "leaning members",
        "solid sections",
        "soft feet",
    ),
    story="""
Posts of 34 mm square, seat rails of 20 x 60 mm, stretchers of 20 mm square in the shape of an H and two slats
of 20 x 60 mm across the back, all beech, tenoned and glued. The rear posts lean back above the seat and splay
out under it. A seat board of 10 mm is glued into the rails, which the drawing leaves out. The drawing runs
from centre line to centre line and has the rubber tips' catalogue stiffness.
""",
    materials={"beech": Material(12e9, 0.35, 700.0), "board": Material(7e9, 0.3, 650.0)},
    sections={
        "post": bar(POST, POST),
        "rail": bar(0.02, RAIL),
        "stretcher": bar(0.02, 0.02),
        "slat": bar(0.02, 0.06),
    },
    joints={
        **{
            f"F{s}{i}": (DEPTH, y, z)
            for s, y in SIDES.items()
            for i, z in enumerate((0.0, LOW, SEAT))
        },
        **{
            f"B{s}{i}": (0.0, y, z)
            for s, y in SIDES.items()
            for i, z in enumerate((0.0, LOW, SEAT, SLAT, BACK))
        },
        **{f"S{s}": (DEPTH / 2, y, LOW) for s, y in SIDES.items()},
    },
    types={f"{c}{s}{i}": f"{c}{i}" for c in "FB" for s in SIDES for i in range(3)}
    | {f"B{s}{i}": "slat" for s in SIDES for i in (3, 4)}
    | {f"S{s}": "stretcher" for s in SIDES},
    members=(
        Member("rail-front", ("FR2", "FL2"), "rail", "beech", 4, weld=0.004),
        Member("rail-rear", ("BR2", "BL2"), "rail", "beech", 4, weld=0.004),
        Member("stretcher", ("SR", "SL"), "stretcher", "beech", 4),
        Member("slat-low", ("BR3", "BL3"), "slat", "beech", 4),
        Member("slat-high", ("BR4", "BL4"), "slat", "beech", 4),
        *(member for s in SIDES for member in _parts(s)),
    ),
    blocks=(
        Block(
            "seat",
            (0.01, 0.01 - HALF, SEAT + 0.01),
            (DEPTH - 0.01, HALF - 0.01, SEAT + 0.02),
            "board",
            first=True,
        ),
    ),
    springs=tuple(
        Spring(f"{c}{s}0", d, k)
        for c in "FB"
        for s in SIDES
        for d, k in (("x", 8e4), ("y", 8e4), ("z", 4e5))
    ),
    warp=leaning,
    sensors=(
        *((f"F{s}2", "xyz") for s in SIDES),
        *((f"B{s}2", "yz") for s in SIDES),
        *((f"B{s}4", "xyz") for s in SIDES),
        *((f"{c}{s}1", "xy") for c in "FB" for s in SIDES),
        (("slat-high", 0.5), "xz"),
        (("rail-front", 0.5), "xz"),
        (("stretcher", 0.5), "xz"),
    ),
    changes=(
        Change("1.5 kg at BL4", lumps=(Lump("BL4", 1.5),)),
        Change(
            "1 kg at FR2, spring of 5e4 N/m along x at BR4",
            lumps=(Lump("FR2", 1.0),),
            springs=(Spring("BR4", "x", 5e4),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.095, 0.066),
    graded=False,
    guess=25.0,
    scatter=0.008,
    shape_scatter=0.04,
    together=0.5,
)
