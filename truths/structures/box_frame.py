"""A free space frame of square tubes, nearly a cube."""

from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

SIDES, HEIGHT = (0.56, 0.568), 0.5  # m
HALF = 0.015  # m, half the width of a tube
CORNERS = {"A": (0.0, 0.0), "B": (SIDES[0], 0.0), "C": SIDES, "D": (0.0, SIDES[1])}

STRUCTURE = Structure(
    name="box-frame",
    title="Space frame of square tubes on solid corner cubes, free",
    classes=("space frame", "hollow sections", "close modes", "free"),
    story="""
Twelve tubes 30 x 30 x 3 mm on a plan of 560 x 568 mm, 500 mm high, welded all around onto solid steel cubes of
30 mm at the corners. The plan is all but square, so that many modes come in pairs which lie within a few percent.
The drawing lets the tubes run to the centres of the cubes: it knows neither their stiffness nor their mass.
""",
    materials={"steel": STEEL},
    sections={"tube": rectangular_tube(2 * HALF, 2 * HALF, 0.003)},
    joints={f"{c}{i}": (*CORNERS[c], z) for i, z in ((0, 0.0), (1, HEIGHT)) for c in "ABCD"},
    types={f"{c}{i}": "corner" for c in "ABCD" for i in (0, 1)},
    members=(
        *(Member(f"post-{c}", (f"{c}0", f"{c}1"), "tube", "steel", 4, weld=0.004) for c in "ABCD"),
        *(
            Member(f"y-{a}{b}{i}", (f"{a}{i}", f"{b}{i}"), "tube", "steel", 4, weld=0.004)
            for i in (0, 1)
            for a, b in ("AD", "BC")
        ),
        *(
            Member(f"x-{a}{b}{i}", (f"{a}{i}", f"{b}{i}"), "tube", "steel", 4, weld=0.004)
            for i in (0, 1)
            for a, b in ("AB", "DC")
        ),
    ),
    blocks=tuple(
        Block(
            f"cube-{c}{i}", (x - HALF, y - HALF, z - HALF), (x + HALF, y + HALF, z + HALF), "steel"
        )
        for i, z in ((0, 0.0), (1, HEIGHT))
        for c, (x, y) in CORNERS.items()
    ),
    sensors=(
        *((f"{c}{i}", "xyz") for i in (0, 1) for c in "ABCD"),
        *(((f"post-{c}", 0.5), "xy") for c in "ABCD"),
        *(((f"x-{a}{b}{i}", 0.5), "yz") for i in (0, 1) for a, b in ("AB", "DC")),
        *(((f"y-{a}{b}{i}", 0.5), "xz") for i in (0, 1) for a, b in ("AD", "BC")),
    ),
    changes=(
        Change("1.2 kg at B1", lumps=(Lump("B1", 1.2),)),
        Change(
            "spring of 5e4 N/m along z at D0, 0.8 kg at A1",
            lumps=(Lump("A1", 0.8),),
            springs=(Spring("D0", "z", 5e4),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.02, 0.014),
    guess=100.0,
    scatter=0.003,
    shape_scatter=0.02,
    together=0.5,
)
