"""A free aluminium strip with a rib under part of its length."""

from dataclasses import replace

from truths.sections import Section, bar, tee
from truths.structure import ALUMINIUM, Block, Change, Lump, Member, Spring, Structure

WIDTH, PLATE, DEPTH, RIB = 0.09, 0.01, 0.04, 0.012  # m; depth of plate and rib together
START, END, LENGTH = 0.35, 0.95, 1.15  # m


def _flush(section: Section) -> Section:
    """Return the tee moved so that its flange continues the plain strip."""
    shift = PLATE / 2 - section.rectangles[1][3]
    moved = tuple((a, b, c + shift, d + shift, s) for a, b, c, d, s in section.rectangles)
    return replace(section, rectangles=moved, height=2 * DEPTH)


STRUCTURE = Structure(
    name="stiffened-strip",
    title="Aluminium strip with a rib under a part of it, free",
    classes=("strip", "open sections", "offset axes", "free"),
    story="""
A strip 90 x 10 mm, 1.15 m long, with a rib 12 mm thick and 30 mm deep under the part from 0.35 m to 0.95 m,
milled from one piece. The rib runs out in steps over 45 mm on either side. The drawing has three bars on one
line, the middle one a T with its own centroid: the step between the axes and the run-out are not drawn.
""",
    materials={"aluminium": ALUMINIUM},
    sections={"strip": bar(WIDTH, PLATE), "ribbed": _flush(tee(WIDTH, DEPTH, RIB, PLATE))},
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (START, 0.0, 0.0),
        "C": (END, 0.0, 0.0),
        "D": (LENGTH, 0.0, 0.0),
    },
    types={"A": "end", "D": "end", "B": "step", "C": "step"},
    members=(
        Member("left", ("A", "B"), "strip", "aluminium", 6),
        Member("middle", ("B", "C"), "ribbed", "aluminium", 6),
        Member("right", ("C", "D"), "strip", "aluminium", 5),
    ),
    blocks=tuple(
        Block(
            f"run-out-{side}-{i}",
            (low, -RIB / 2, -PLATE / 2 - drop),
            (high, RIB / 2, -PLATE / 2),
            "aluminium",
        )
        for i, drop in enumerate((0.02, 0.01))
        for side, low, high in (
            ("left", START - 0.0225 * (i + 1), START - 0.0225 * i),
            ("right", END + 0.0225 * i, END + 0.0225 * (i + 1)),
        )
    ),
    plane="in-plane",
    sensors=(
        ("A", "z"),
        (("left", 0.3), "z"),
        (("left", 0.65), "z"),
        ("B", "z"),
        (("middle", 0.25), "z"),
        (("middle", 0.5), "z"),
        (("middle", 0.75), "z"),
        ("C", "z"),
        (("right", 0.5), "z"),
        ("D", "z"),
    ),
    changes=(
        Change("0.3 kg at A", lumps=(Lump("A", 0.3),)),
        Change(
            "spring of 1e4 N/m along z at D, 0.2 kg at B",
            lumps=(Lump("B", 0.2),),
            springs=(Spring("D", "z", 1e4),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.028, 0.019),
    graded=False,
    guess=60.0,
    scatter=0.001,
    shape_scatter=0.01,
    together=0.0,
)
