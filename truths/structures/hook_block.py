"""A crane's hook block: two cheek plates on an axle, a crosshead and a hook below it, free."""

from truths.sections import bar
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

CHEEKS = {"L": 0.1, "R": -0.1}  # m along y, of the plates' middles
PLATE, WIDE = 0.018, 0.16  # m
AXLE, BOLT, OVER = 0.36, 0.64, 0.07  # m, heights over the crosshead; plate beyond the last pins
HOOK = {
    "shank": (0.0, 0.0, -0.17),
    "back-high": (-0.11, 0.0, -0.17),
    "back-low": (-0.11, 0.0, -0.4),
    "saddle": (0.0, 0.0, -0.4),
    "throat": (0.1, 0.0, -0.4),
    "tip": (0.1, 0.0, -0.27),
}
HEIGHTS = {"0": 0.0, "1": AXLE, "2": BOLT}

STRUCTURE = Structure(
    name="hook-block",
    title="Hook block of a crane: cheek plates, axle, crosshead and hook, free",
    classes=(
        "after the rule",
        "machine part",
        "stubby members",
        "solid sections",
        "cut-outs",
        "free",
    ),
    story="""
Two cheek plates of 160 x 18 mm, 200 mm apart, are held together by the sheaves' axle of 60 mm square, a bolt of
40 mm square above it and a crosshead of 90 x 80 mm below, from which the hook hangs: a shank of 56 mm square and
a flat hook 56 mm thick, 76 mm deep. The block was tested in slings. The plates have bosses at the axle, a hole
between axle and bolt, and end 70 mm beyond the outer pins; the crosshead enters them by necks of 50 mm. The
drawing has centre lines without bosses, holes, necks and ends, and the two sheaves as masses on the axle.
""",
    materials={"steel": STEEL},
    sections={
        "cheek": bar(PLATE, WIDE),
        "axle": bar(0.06, 0.06),
        "bolt": bar(0.04, 0.04),
        "crosshead": bar(0.09, 0.08),
        "shank": bar(0.056, 0.056),
        "hook": bar(0.056, 0.076),
    },
    joints={f"{s}{i}": (0.0, y, z) for s, y in CHEEKS.items() for i, z in HEIGHTS.items()}
    | {"middle": (0.0, 0.0, 0.0)}
    | HOOK,
    types={
        f"{s}{i}": t for s in CHEEKS for i, t in zip("012", ("neck", "axle", "bolt"), strict=True)
    },
    members=(
        *(
            Member(
                f"cheek-{s}{i}",
                (f"{s}{i}", f"{s}{int(i) + 1}"),
                "cheek",
                "steel",
                3,
                extend=(OVER * (i == "0"), OVER * (i == "1")),
            )
            for s in CHEEKS
            for i in "01"
        ),
        Member("axle", ("R1", "L1"), "axle", "steel", 4, extend=(0.04, 0.04)),
        Member("bolt", ("R2", "L2"), "bolt", "steel", 3, extend=(0.02, 0.02)),
        Member("crosshead-R", ("R0", "middle"), "crosshead", "steel", 2),
        Member("crosshead-L", ("middle", "L0"), "crosshead", "steel", 2),
        Member("shank", ("middle", "shank"), "shank", "steel", 3),
        Member("shoulder", ("back-high", "shank"), "hook", "steel", 2, extend=(0.038, 0.038)),
        Member("back", ("back-low", "back-high"), "hook", "steel", 3),
        Member("saddle-back", ("back-low", "saddle"), "hook", "steel", 2, extend=(0.038, 0.0)),
        Member("saddle-front", ("saddle", "throat"), "hook", "steel", 2, extend=(0.0, 0.038)),
        Member("tip", ("throat", "tip"), "hook", "steel", 2),
    ),
    blocks=(
        *(
            Block(
                f"boss-{s}{side}",
                (-0.055, min(a, b), AXLE - 0.055),
                (0.055, max(a, b), AXLE + 0.055),
                "steel",
                first=True,
            )
            for s, y in CHEEKS.items()
            for side in (-1, 1)
            for a, b in [(y + side * PLATE / 2, y + side * (PLATE / 2 + 0.012))]
        ),
        *(
            Block(f"hole-{s}", (-0.045, y - PLATE / 2, 0.45), (0.045, y + PLATE / 2, 0.58), "")
            for s, y in CHEEKS.items()
        ),
        *(
            Block("gap", (a, low, -0.04), (b, high, 0.04), "")
            for low, high in ((0.079, 0.091), (-0.091, -0.079))
            for a, b in ((-0.045, -0.025), (0.025, 0.045))
        ),
    ),
    lumps=(Lump(("axle", 0.35), 12.0), Lump(("axle", 0.65), 12.0)),
    sensors=(
        *((f"{s}{i}", "xy") for s in CHEEKS for i in "012"),
        *(((f"cheek-{s}{i}", 0.5), "xy") for s in CHEEKS for i in "01"),
        ("middle", "xy"),
        ("shank", "xy"),
        ("back-high", "yz"),
        ("back-low", "xyz"),
        ("throat", "yz"),
        ("tip", "xyz"),
    ),
    changes=(
        Change("4 kg at tip", lumps=(Lump("tip", 4.0),)),
        Change(
            "6 kg at L2, stay of 2e7 N/m along y at saddle",
            lumps=(Lump("L2", 6.0),),
            springs=(Spring("saddle", "y", 2e7),),
        ),
    ),
    used=3,
    held_out=3,
    size=(0.06, 0.042),
    graded=False,
    guess=120.0,
    beam="timoshenko",
    scatter=0.003,
    shape_scatter=0.025,
    together=0.4,
)
