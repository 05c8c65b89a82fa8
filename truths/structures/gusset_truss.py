"""A planar truss of flat bars on gusset plates, clamped at one end."""

from truths.sections import bar
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

BAYS, BAY, DEPTH = 4, 0.35, 0.3  # m
JOINTS = {f"L{i}": (i * BAY, 0.0, 0.0) for i in range(BAYS + 1)} | {
    f"U{i}": (i * BAY, 0.0, DEPTH) for i in range(BAYS + 1)
}


def _gusset(name: str) -> Block:
    x, _, z = JOINTS[name]
    low, high = (z - 0.015, z + 0.06) if name[0] == "L" else (z - 0.06, z + 0.015)
    return Block(f"gusset-{name}", (x - 0.06, -0.007, low), (x + 0.06, 0.007, high), "steel")


CHORDS = [(f"L{i}", f"L{i + 1}") for i in range(BAYS)] + [
    (f"U{i}", f"U{i + 1}") for i in range(BAYS)
]
POSTS = [(f"L{i}", f"U{i}") for i in range(1, BAYS + 1)]
DIAGONALS = [(f"U{i}", f"L{i + 1}") for i in range(BAYS)]

STRUCTURE = Structure(
    name="gusset-truss",
    title="Cantilever truss of flat bars on gusset plates",
    classes=("truss", "gussets", "clamped", "solid sections"),
    story="""
Chords 30 x 14 mm, posts and diagonals 20 x 14 mm, welded to gusset plates of 120 x 75 x 14 mm, which no
drawing of centre lines shows. Both chords are clamped at the wall.
""",
    materials={"steel": STEEL},
    sections={"chord": bar(0.014, 0.03), "web": bar(0.014, 0.02)},
    joints=JOINTS,
    members=(
        *(Member(f"chord-{a}-{b}", (a, b), "chord", "steel", 3) for a, b in CHORDS),
        *(Member(f"post-{a}", (a, b), "web", "steel", 3) for a, b in POSTS),
        *(Member(f"diagonal-{a}", (a, b), "web", "steel", 4) for a, b in DIAGONALS),
    ),
    blocks=tuple(_gusset(name) for name in JOINTS),
    clamps=tuple(
        Clamp(
            f"{c}0",
            (-0.061, -0.1, JOINTS[f"{c}0"][2] - 0.07),
            (0.0, 0.1, JOINTS[f"{c}0"][2] + 0.07),
        )
        for c in "LU"
    ),
    plane="in-plane",
    sensors=tuple((name, "xz") for name in JOINTS if name[1] != "0"),
    changes=(
        Change("2 kg at U4", lumps=(Lump("U4", 2.0),)),
        Change("spring of 5e6 N/m along z at L2", springs=(Spring("L2", "z", 5e6),)),
    ),
    mesher="tetrahedra",
    used=4,
    held_out=4,
    size=(0.024, 0.017),
    guess=120.0,
)
