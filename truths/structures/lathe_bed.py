"""A lathe bed: two slender shears on stubby cross ribs, headstock and tailstock as lumps, on pads."""

from truths.lacks import LUMP, plates
from truths.sections import bar, rectangular_tube
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

LENGTH, SPAN, FOOT = 1.2, 0.2, -0.3  # m
RIBS = (0.0, 0.25, 0.55, 0.85, 1.2)  # m, along the bed
SIDES = {"L": SPAN / 2, "R": -SPAN / 2}

SHEARS = tuple(
    Member(
        f"shear-{s}{i + 1}",
        (f"{s}{i}", f"{s}{i + 1}"),
        "shear",
        "iron",
        3,
        extend=(0.03 * (i == 0), 0.03 * (i + 2 == len(RIBS))),
    )
    for s in SIDES
    for i in range(len(RIBS) - 1)
)
CROSS = tuple(Member(f"rib-{i}", (f"R{i}", f"L{i}"), "rib", "iron", 2) for i in range(len(RIBS)))
LEGS = tuple(
    Member(f"leg-{s}{i}", (f"foot-{s}{i}", f"{s}{i}"), "leg", "iron", 3)
    for i in (0, 4)
    for s in SIDES
)
PADS = tuple((f"foot-{s}{i}", direction) for s in SIDES for i in (0, 4) for direction in "xyz")
STIFFNESS = {"x": 1.5e6, "y": 1.5e6, "z": 8e6}  # N/m of a pad

STRUCTURE = Structure(
    name="lathe-bed",
    title="Bed of a small lathe with stubby ribs and a headstock, on pads",
    classes=("machine frame", "stubby members", "solid sections", "on feet"),
    story="""
Two shears 30 x 80 mm of cast iron are tied by five short cross ribs, and stand on four
legs of 60 x 60 x 8 mm on rubber pads. A chip tray of 5 mm closes the bed between the second and the fourth rib from below;
the drawing leaves it out. Headstock and tailstock are drawn as lumps above the shears.
""",
    materials={"iron": Material(110e9, 0.26, 7200.0)},
    sections={
        "shear": bar(0.03, 0.08),
        "rib": bar(0.06, 0.06),
        "leg": rectangular_tube(0.06, 0.06, 0.008),
    },
    joints={f"{s}{i}": (x, y, 0.0) for s, y in SIDES.items() for i, x in enumerate(RIBS)}
    | {f"foot-{s}{i}": (RIBS[i], y, FOOT) for s, y in SIDES.items() for i in (0, 4)},
    types={f"{s}{i}": "rib-end" for s in SIDES for i in (1, 2, 3)}
    | {f"{s}{i}": "corner" for s in SIDES for i in (0, 4)}
    | {f"foot-{s}{i}": "foot" for s in SIDES for i in (0, 4)},
    members=(*LEGS, *CROSS, *SHEARS),
    blocks=(Block("tray", (0.22, -0.085, -0.035), (0.88, 0.085, -0.03), "iron"),),
    lumps=(Lump(("rib-0", 0.5), 9.0, (0.0, 0.0, 0.12)), Lump(("rib-3", 0.5), 3.0, (0.0, 0.0, 0.1))),
    springs=tuple(Spring(at, d, STIFFNESS[d]) for at, d in PADS),
    sensors=(
        ("L0", "xyz"),
        ("L1", "yz"),
        ("L2", "yz"),
        ("L3", "yz"),
        ("L4", "xyz"),
        ("R0", "z"),
        ("R1", "z"),
        ("R2", "z"),
        ("R3", "z"),
        ("R4", "z"),
        ("foot-L0", "xy"),
        ("foot-L4", "xy"),
        ("foot-R0", "xy"),
        ("foot-R4", "xy"),
    ),
    changes=(
        Change("8 kg at L2", lumps=(Lump("L2", 8.0),)),
        Change(
            "4 kg at R4, spring of 5e6 N/m along y at L1",
            lumps=(Lump("R4", 4.0),),
            springs=(Spring("L1", "y", 5e6),),
        ),
    ),
    used=6,
    held_out=5,
    size=(0.04, 0.028),
    graded=False,
    guess=30.0,
    beam="timoshenko",
    scatter=0.006,
    shape_scatter=0.04,
    together=0.6,
)

LACKS = plates("all", "a tray", "tray", mass=LUMP, stiffness="plate")
