"""A timber stair: housed treads between two leaning strings, hung from a trimmer."""

from truths.sections import bar
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

RISE, GOING, STEPS = 0.18, 0.26, 12  # m; treads are 1 to 11
HALF = 0.43  # m, from the middle to a string
THICK, DEEP = 0.045, 0.24  # m, of a string
SIDES = {"L": HALF, "R": -HALF}
TREADS = range(1, STEPS)


def _at(step: float) -> tuple[float, float]:
    """Return x and z of the strings' line at a step."""
    return (step * GOING, step * RISE)


STRUCTURE = Structure(
    name="timber-stair",
    title="Timber stair of two strings with housed treads, hung from a trimmer",
    classes=(
        "after the rule",
        "stair",
        "timber frame",
        "leaning members",
        "solid sections",
        "on feet",
    ),
    story="""
Two strings of larch, 45 x 240 mm, rise by 2160 mm over 3120 mm; eleven treads of 40 x 250 mm are housed and
glued between them. The foot stands on a sill, the head hangs by two brackets from a trimmer; sill and brackets
are drawn by their stiffness. A newel post stands on the left string and its handrail on that: it is drawn as a
mass. In the solid a riser board closes the lowest step, housings take slots 15 mm deep out of the strings under
every tread, and the treads, 250 mm wide, tie the strings over most of their length, where the drawing, from
centre line to centre line, has them meet in points.
""",
    materials={"larch": Material(12e9, 0.35, 590.0), "board": Material(9e9, 0.35, 550.0)},
    sections={"string": bar(THICK, DEEP), "tread": bar(0.25, 0.04)},
    joints={
        f"{s}{i}": (_at(i)[0], y, _at(i)[1]) for s, y in SIDES.items() for i in range(STEPS + 1)
    },
    types={
        f"{s}{i}": "sill" if i == 0 else "bracket" if i == STEPS else "housing"
        for s in SIDES
        for i in range(STEPS + 1)
    },
    members=(
        *(
            Member(f"string-{s}{i}", (f"{s}{i}", f"{s}{i + 1}"), "string", "larch", 1)
            for s in SIDES
            for i in range(STEPS)
        ),
        *(Member(f"tread-{i}", (f"R{i}", f"L{i}"), "tread", "larch", 4) for i in TREADS),
    ),
    blocks=(
        Block("riser", (0.37, -HALF + THICK / 2, 0.0), (0.39, HALF - THICK / 2, 0.16), "board"),
        *(
            Block("housing", (x - 0.09, low, z - 0.036), (x + 0.09, high, z - 0.02), "")
            for x, z in map(_at, TREADS)
            for low, high in (
                (HALF - THICK / 2, HALF - THICK / 2 + 0.015),
                (-HALF + THICK / 2 - 0.015, -HALF + THICK / 2),
            )
        ),
    ),
    lumps=(Lump("L1", 9.0, (0.0, 0.0, 0.5)),),
    springs=tuple(
        Spring(f"{s}{i}", d, k)
        for s in SIDES
        for i, own in ((0, (2e6, 1e6, 6e6)), (STEPS, (3e6, 1.5e6, 4e6)))
        for d, k in zip("xyz", own, strict=True)
    ),
    sensors=(
        *((f"{s}{i}", "yz") for s in SIDES for i in (2, 4, 6, 8, 10)),
        *((f"{s}{i}", "xz") for s in SIDES for i in (0, STEPS)),
        *(((f"tread-{i}", 0.5), "z") for i in (2, 4, 6, 8, 10)),
        ("L6", "x"),
        ("R6", "x"),
    ),
    changes=(
        Change("40 kg on the middle of tread-6", lumps=(Lump(("tread-6", 0.5), 40.0),)),
        Change(
            "25 kg at L9, prop of 3e5 N/m along z at R6",
            lumps=(Lump("L9", 25.0),),
            springs=(Spring("R6", "z", 3e5),),
        ),
    ),
    mesher="tetrahedra",
    used=3,
    held_out=3,
    size=(0.1, 0.075),
    guess=12.0,
    beam="timoshenko",
    scatter=0.008,
    shape_scatter=0.04,
    together=0.5,
    weighed=0.0,
)
