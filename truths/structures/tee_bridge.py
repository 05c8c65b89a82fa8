"""A model bridge of two T-girders with cross girders, on bearings."""

from dataclasses import replace

from truths.sections import Section, bar, tee
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

SPAN, HALF = 2.4, 0.2  # m; half the distance of the girders
STATIONS = (0.0, 0.6, 1.2, 1.8, SPAN)  # m
SLAB, WIDE, DEEP, WEB = 0.03, 0.4, 0.16, 0.05  # m
SIDES = {"L": HALF, "R": -HALF}
GIRDER = tee(WIDE, DEEP, WEB, SLAB)
TOP = GIRDER.rectangles[1][3]  # m, of the slab above the girders' centroid
LOW = GIRDER.rectangles[0][2]
CROSS = 0.1  # m, depth of a cross girder under the slab
STEPS = (0, 2, 4)  # stations of cross girders


def _drawn_only() -> Section:
    """Return a strip of slab as it is drawn across; the girders' flanges are that slab."""
    return replace(bar(0.6, SLAB), rectangles=(), width=0.04, height=0.04)


def _cross(i: int) -> Block:
    x, thick = STATIONS[i], 0.04
    low, high = (x, x + thick) if i == 0 else (x - thick, x) if i == 4 else (x - 0.02, x + 0.02)
    top = TOP - SLAB
    return Block(
        f"cross-{i}", (low, WEB / 2 - HALF, top - CROSS), (high, HALF - WEB / 2, top), "micro"
    )


STRUCTURE = Structure(
    name="tee-bridge",
    title="Model bridge of two T-girders with cross girders on bearings",
    classes=("after the rule", "bridge", "grid", "slab", "open sections", "on bearings"),
    story="""
A bridge of micro-concrete, 2.4 m long: a slab 800 x 30 mm on two webs of 50 x 130 mm, 400 mm apart, with
cross girders of 40 x 100 mm at both ends and in the middle; a kerb of 40 x 30 mm stands along each edge,
which the drawing leaves out. Four rubber bearings carry the webs at their ends. The drawing is a grid: two
T-girders on their centroids, joined by strips of slab at the quarter points and by cross girders of T shape,
whose slab already weighs with the girders, on springs of the bearings' catalogue stiffness.
""",
    materials={"micro": Material(28e9, 0.2, 2200.0), "light": Material(28e9, 0.2, 1.0)},
    sections={
        "girder": GIRDER,
        "strip": _drawn_only(),
        "cross": replace(
            tee(0.3, CROSS + SLAB, 0.04, SLAB), rectangles=(), width=0.04, height=0.04
        ),
    },
    joints={f"{s}{i}": (x, y, 0.0) for s, y in SIDES.items() for i, x in enumerate(STATIONS)},
    types={f"{s}{i}": "bearing" if i in (0, 4) else "crossing" for s in SIDES for i in range(5)},
    members=(
        *(
            Member(f"girder-{s}{i + 1}", (f"{s}{i}", f"{s}{i + 1}"), "girder", "micro", 3)
            for s in SIDES
            for i in range(4)
        ),
        *(
            Member(
                f"across-{i}", (f"R{i}", f"L{i}"), "cross" if i in STEPS else "strip", "light", 2
            )
            for i in range(5)
        ),
    ),
    blocks=(
        *(_cross(i) for i in STEPS),
        *(
            Block(f"kerb-{s}", (0.0, y - 0.02, TOP), (SPAN, y + 0.02, TOP + 0.03), "micro")
            for s, y in (("L", 0.38), ("R", -0.38))
        ),
    ),
    springs=tuple(
        Spring(f"{s}{i}", d, k)
        for s in SIDES
        for i in (0, 4)
        for d, k in zip("xyz", (2e6, 2e6, 2e7), strict=True)
    ),
    sensors=(
        *((f"{s}{i}", "z") for s in SIDES for i in range(5)),
        *(((f"girder-{s}{i}", 0.5), "z") for s in SIDES for i in (1, 2, 3, 4)),
        ("L0", "xy"),
        ("L4", "y"),
        ("L2", "y"),
        ("R2", "x"),
    ),
    changes=(
        Change("25 kg at L2", lumps=(Lump("L2", 25.0),)),
        Change(
            "15 kg at R1, spring of 1e7 N/m along z at R3",
            lumps=(Lump("R1", 15.0),),
            springs=(Spring("R3", "z", 1e7),),
        ),
    ),
    beam="timoshenko",
    used=6,
    held_out=4,
    size=(0.2, 0.14),
    graded=False,
    guess=30.0,
    scatter=0.006,
    shape_scatter=0.03,
    together=0.6,
)
