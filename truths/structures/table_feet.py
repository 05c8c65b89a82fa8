"""A table of angles on four tubes that stand on rubber feet."""

from dataclasses import replace

from truths.sections import Section, angle, rectangular_tube
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure

LENGTH, WIDTH, HEIGHT = 0.95, 0.6, 0.7  # m
HALF = 0.015  # m, half the width of a leg
WALL = 0.005  # m, of the angles


def _outside(section: Section) -> Section:
    """Return the angle moved out, so that its upright wall touches the legs' outer faces."""
    shift = -HALF - WALL - section.rectangles[0][0]
    moved = tuple((a + shift, b + shift, c, d, s) for a, b, c, d, s in section.rectangles)
    return replace(section, rectangles=moved, width=section.width + 2 * abs(shift))


ANGLE = angle(0.05, 0.05, WALL)
UNDER_FLANGE = -ANGLE.rectangles[1][3]  # m, from the angles' centroid up to the flange's lower face

STRUCTURE = Structure(
    name="table-feet",
    title="Table of angles on four legs with rubber feet",
    classes=("space frame", "open sections", "hollow sections", "soft feet"),
    story="""
Four legs of tube 30 x 30 x 3 mm stand on rubber feet, whose stiffness the drawing has from a catalogue. They
carry a frame of angles 50 x 50 x 5 mm, whose flanges lie on the legs and whose upright walls pass outside
them: the angles' centroids lie outside the legs' axes, on which the drawing puts them. The angles are mitred
and welded to each other; an instrument of 4 kg on the frame is drawn.
""",
    materials={"steel": STEEL},
    sections={"leg": rectangular_tube(2 * HALF, 2 * HALF, 0.003), "angle": _outside(ANGLE)},
    joints={
        f"{c}{i}": (x, y, z)
        for i, z in ((0, 0.0), (1, HEIGHT))
        for c, x, y in (
            ("A", 0.0, 0.0),
            ("B", LENGTH, 0.0),
            ("C", LENGTH, WIDTH),
            ("D", 0.0, WIDTH),
        )
    },
    types={f"{c}{i}": ("foot", "corner")[i] for c in "ABCD" for i in (0, 1)},
    members=(
        *(
            Member(
                f"leg-{c}",
                (f"{c}0", f"{c}1"),
                "leg",
                "steel",
                5,
                extend=(0.0, UNDER_FLANGE),
            )
            for c in "ABCD"
        ),
        # Clockwise seen from above, with the flange up: the upright wall is then outside.
        *(
            Member(
                f"top-{a}{b}",
                (f"{a}1", f"{b}1"),
                "angle",
                "steel",
                5,
                up=(0.0, 0.0, -1.0),
                extend=(HALF + WALL, HALF + WALL),
            )
            for a, b in ("DC", "CB", "BA", "AD")
        ),
    ),
    lumps=(Lump(("top-BA", 0.4), 4.0),),
    springs=tuple(
        Spring(f"{c}0", direction, stiffness)
        for c in "ABCD"
        for direction, stiffness in (("x", 4e5), ("y", 4e5), ("z", 1.5e6))
    ),
    sensors=(
        *((f"{c}1", "xyz") for c in "ABCD"),
        *(((f"leg-{c}", 0.5), "xy") for c in "ABCD"),
        *(((f"top-{a}", 0.5), "xyz") for a in ("DC", "BA")),
        *(((f"top-{a}", 0.5), "xz") for a in ("CB", "AD")),
        *((f"{c}0", "z") for c in "ABCD"),
    ),
    changes=(
        Change("6 kg at the middle of top-DC", lumps=(Lump(("top-DC", 0.5), 6.0),)),
        Change(
            "spring of 1e5 N/m along x at C1, 3 kg at A1",
            lumps=(Lump("A1", 3.0),),
            springs=(Spring("C1", "x", 1e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.03, 0.021),
    guess=15.0,
    scatter=0.008,
    shape_scatter=0.04,
    together=0.6,
)
