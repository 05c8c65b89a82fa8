"""A two-storey concrete frame on pad footings in uneven ground."""

from truths.lacks import LUMP, without_blocks
from truths.sections import bar, tee
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

AXES = {"A": 0.0, "B": 6.0, "C": 10.2}  # m, of the columns
LEVELS = (0.0, 3.8, 7.0)  # m, top of the footings, floors
DEEP, WIDE = 0.4, 1.3  # m, of a footing
COLUMN = 0.4  # m
# Of a footing by the ground's report, N/m and N m/rad.
GROUND = {"x": 1.6e8, "z": 2.2e8, "ry": 1.3e8}
MADE_GROUND = 0.65  # what the middle footing really has of it, on a filled trench


STRUCTURE = Structure(
    name="footing-frame",
    title="Two-storey concrete frame on footings, the middle one on a filled trench",
    classes=("after the rule", "building frame", "soft soil", "solid sections"),
    story="""
One frame of a small concrete building: columns 400 x 400 mm, floors as tees of 300 x 500 mm with the slab's
strip of 1.2 m x 160 mm. The drawing has the stiffness of the ground under each footing from the report of the
ground. It does not know that the middle footing stands on a filled trench, which has 65 % of that, nor that
backfill holds the lower end of column C, nor the footings' own mass, nor the parapet at the roof's left edge.
It takes spans and storeys between centre lines.
""",
    materials={"concrete": Material(31e9, 0.2, 2450.0)},
    sections={
        "column": bar(COLUMN, COLUMN),
        "floor": tee(1.2, 0.5, 0.3, 0.16),
        "footing": bar(WIDE, WIDE),
    },
    joints={f"{c}{i}": (x, 0.0, z) for c, x in AXES.items() for i, z in enumerate(LEVELS)}
    | {f"{c}g": (x, 0.0, -DEEP) for c, x in AXES.items()},
    types={f"{c}{i}": "footing" if i == 0 else "floor-joint" for c in AXES for i in range(3)}
    | {f"{c}g": "ground" for c in AXES},
    members=(
        *(
            Member(f"floor-{a}{i}", (f"{a}{i}", f"{b}{i}"), "floor", "concrete", 6, extend=ends)
            for i in (1, 2)
            for a, b, ends in (("A", "B", (0.2, 0.0)), ("B", "C", (0.0, 0.2)))
        ),
        *(Member(f"footing-{c}", (f"{c}g", f"{c}0"), "footing", "concrete", 1) for c in AXES),
        *(
            Member(f"column-{c}{i}", (f"{c}{i - 1}", f"{c}{i}"), "column", "concrete", 4)
            for c in AXES
            for i in (1, 2)
        ),
    ),
    blocks=(Block("parapet", (-0.2, -0.6, 7.15), (-0.05, 0.6, 8.0), "concrete"),),
    springs=(
        *(Spring(f"{c}g", d, k) for c in AXES for d, k in GROUND.items()),
        *(Spring("Bg", d, (MADE_GROUND - 1) * k, drawn=False) for d, k in GROUND.items()),
        Spring(("column-C1", 0.1), "x", 4e7, drawn=False),
    ),
    plane="in-plane",
    sensors=(
        *((f"{c}{i}", "xz") for c in AXES for i in (1, 2)),
        *(((f"floor-{a}{i}", 0.5), "z") for a in "AB" for i in (1, 2)),
        *(((f"column-{c}1", 0.5), "x") for c in AXES),
        *((f"{c}g", "xz") for c in AXES),
    ),
    changes=(
        Change("4000 kg on the middle of floor-A2", lumps=(Lump(("floor-A2", 0.5), 4000.0),)),
        Change(
            "bracing of 3e7 N/m along x at C1, 2500 kg at B1",
            lumps=(Lump("B1", 2500.0),),
            springs=(Spring("C1", "x", 3e7),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.3, 0.21),
    guess=4.0,
    beam="timoshenko",
    scatter=0.006,
    shape_scatter=0.04,
    together=0.5,
    weighed=0.0,
)

LACKS = (without_blocks(LUMP, "A2", "a parapet", "parapet"),)
