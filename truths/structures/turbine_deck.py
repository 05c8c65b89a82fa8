"""A table foundation of a turbine set: a deck of beams on six columns, a mat on piles."""

from dataclasses import replace

from truths.sections import bar
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

STATIONS = (0.0, 3.4, 7.6)  # m along x, of the columns
SIDES = {"L": 2.2, "R": -2.2}  # m along y
DECK = 5.4  # m, from the middle of the mat to the axis of the deck
MAT, OVER = 0.9, 0.9  # m, thickness of the mat, reach beyond the columns
PILES = {"x": 1.6e8, "y": 1.6e8, "z": 7e8}  # N/m, of the group under a column
LAST = STATIONS[-1]

STRUCTURE = Structure(
    name="turbine-deck",
    title="Table foundation of a turbine set: deck, six columns, a mat on piles",
    classes=(
        "after the rule",
        "machine foundation",
        "stubby members",
        "solid sections",
        "on piles",
    ),
    story="""
Two beams of 800 x 1200 mm and three cross beams of 1000 x 1200 mm stand on six columns of 800 x 800 mm, these on
a mat 900 mm thick over six groups of piles. Turbine and generator are drawn as masses above the deck. Columns
have haunches under the deck, a gallery of 180 mm runs along one side, the middle cross beam has an opening
for the steam pipes: the drawing has none of these. It has the mat as strips along and across, the latter
without mass, and the piles' stiffness by the soil report; under one column of the generator they are softer.
""",
    materials={"concrete": Material(32e9, 0.2, 2500.0), "light": Material(32e9, 0.2, 1.0)},
    sections={
        "column": bar(0.8, 0.8),
        "beam": bar(0.8, 1.2),
        "cross": bar(1.0, 1.2),
        "strip": replace(bar(3.0, MAT), rectangles=()),
    },
    joints={
        f"{s}{i}{k}": (x, y, z)
        for s, y in SIDES.items()
        for i, x in enumerate(STATIONS)
        for k, z in (("m", 0.0), ("d", DECK))
    }
    | {
        f"{s}{e}": (x, y, 0.0)
        for s, y in SIDES.items()
        for e, x in (("a", -OVER), ("z", LAST + OVER))
    },
    types={
        f"{s}{i}{k}": t for s in SIDES for i in range(3) for k, t in (("m", "foot"), ("d", "head"))
    }
    | {f"{s}{e}": "edge" for s in SIDES for e in "az"},
    members=(
        *(
            Member(f"column-{s}{i}", (f"{s}{i}m", f"{s}{i}d"), "column", "concrete", 4)
            for s in SIDES
            for i in range(3)
        ),
        *(
            Member(f"cross-{i}", (f"R{i}d", f"L{i}d"), "cross", "concrete", 4, extend=(0.4, 0.4))
            for i in range(3)
        ),
        *(
            Member(
                f"beam-{s}{i}",
                (f"{s}{i}d", f"{s}{i + 1}d"),
                "beam",
                "concrete",
                4,
                extend=(0.5 * (i == 0), 0.5 * (i == 1)),
            )
            for s in SIDES
            for i in range(2)
        ),
        *(
            Member(f"mat-{s}{a}", (f"{s}{a}", f"{s}{b}"), "strip", "concrete", 2)
            for s in SIDES
            for a, b in (("a", "0m"), ("0m", "1m"), ("1m", "2m"), ("2m", "z"))
        ),
        *(Member(f"mat-{i}", (f"R{i}m", f"L{i}m"), "strip", "light", 3) for i in range(3)),
    ),
    blocks=(
        Block("mat", (-OVER, -3.0, -MAT / 2), (LAST + OVER, 3.0, MAT / 2), "concrete"),
        Block("gallery", (-0.5, 2.6, DECK + 0.42), (LAST + 0.5, 3.5, DECK + 0.6), "concrete"),
        *(
            Block(
                f"haunch-{s}{i}",
                (x, y - 0.4, DECK - 1.0),
                (x + 0.8, y + 0.4, DECK - 0.6),
                "concrete",
            )
            for s, y in SIDES.items()
            for i, x in ((0, 0.4), (1, -1.2 + STATIONS[1]), (1, STATIONS[1] + 0.4), (2, LAST - 1.2))
        ),
        Block(
            "opening",
            (STATIONS[1] - 0.5, -0.6, DECK - 0.3),
            (STATIONS[1] + 0.5, 0.6, DECK + 0.2),
            "",
        ),
    ),
    lumps=(
        Lump(("cross-0", 0.5), 2.2e4, (0.0, 0.0, 1.5)),
        Lump(("beam-L0", 0.5), 1.2e4, (0.0, -0.8, 1.5)),
        Lump(("beam-R0", 0.5), 1.2e4, (0.0, 0.8, 1.5)),
        Lump(("beam-L1", 0.5), 2.4e4, (0.0, -0.8, 1.4)),
        Lump(("beam-R1", 0.5), 2.4e4, (0.0, 0.8, 1.4)),
        Lump(("cross-2", 0.5), 1.0e4, (0.0, 0.0, 1.2)),
    ),
    springs=(
        *(Spring(f"{s}{i}m", d, k) for s in SIDES for i in range(3) for d, k in PILES.items()),
        *(Spring("R2m", d, -0.3 * k, drawn=False) for d, k in PILES.items()),
    ),
    sensors=(
        *((f"{s}{i}d", "xyz") for s in SIDES for i in (0, 2)),
        *((f"{s}1d", "yz") for s in SIDES),
        *((f"{s}{i}m", "yz") for s in SIDES for i in (0, 2)),
        *(((f"column-{s}{i}", 0.5), "xy") for s in SIDES for i in (0, 1, 2)),
        *(((f"cross-{i}", 0.5), "xz") for i in range(3)),
        *(((f"beam-{s}1", 0.5), "yz") for s in SIDES),
    ),
    changes=(
        Change("15 t at the middle of cross-1", lumps=(Lump(("cross-1", 0.5), 1.5e4),)),
        Change(
            "8 t at R0d, strut of 4e8 N/m along y at L2d",
            lumps=(Lump("R0d", 8e3),),
            springs=(Spring("L2d", "y", 4e8),),
        ),
    ),
    beam="timoshenko",
    used=6,
    held_out=5,
    size=(0.47, 0.4),
    graded=False,
    guess=5.0,
    scatter=0.008,
    shape_scatter=0.04,
    together=0.4,
    weighed=0.0,
)
