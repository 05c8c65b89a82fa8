"""A free ladder of open channels, like the frame of a lorry."""

from truths.sections import channel
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure

RUNGS = (0.0, 0.85, 1.7, 2.6)  # m, stations of the rungs
HALF_WIDTH = 0.26  # m, from the middle to a rail's centroid
RAIL = channel(0.05, 0.09, 0.006, 0.007)
BACK = -RAIL.rectangles[0][0]  # m, from the rail's centroid to the back of its web
LAST = len(RUNGS) - 1


def _rail(side: str, i: int) -> Member:
    """Return a bay of a rail; both rails open inwards, so that they run opposite ways."""
    name, (a, b) = f"rail-{side}{i}", (f"{side}{i}", f"{side}{i + 1}")
    ends = (0.05 * (i == 0), 0.05 * (i + 1 == LAST))
    if side == "S":
        return Member(name, (a, b), "rail", "steel", 3, extend=ends)
    return Member(name, (b, a), "rail", "steel", 3, extend=ends[::-1])


STRUCTURE = Structure(
    name="ladder-channel",
    title="Ladder frame of open channels, free",
    classes=("ladder", "open sections", "torsion", "out of plane", "free"),
    story="""
Two rails of channel 90 x 50 mm, web 6 and flanges 7 mm, open inwards; four rungs of channel 70 x 40 mm,
web 5 and flanges 6 mm, whose ends are welded to the rails' webs and not to their flanges. Open sections
warp when they twist, their shear centres lie outside their webs, and the rungs pull on one wall of a rail:
the drawing of centroid lines with St Venant's torsion knows none of it.
""",
    materials={"steel": STEEL},
    sections={"rail": RAIL, "rung": channel(0.04, 0.07, 0.005, 0.006)},
    joints={
        f"{side}{i}": (x, y, 0.0)
        for side, y in (("S", -HALF_WIDTH), ("N", HALF_WIDTH))
        for i, x in enumerate(RUNGS)
    },
    types={f"{side}{i}": "corner" if i in (0, LAST) else "tee" for side in "SN" for i in range(4)},
    members=(
        *(
            Member(f"rung-{i}", (f"S{i}", f"N{i}"), "rung", "steel", 4, extend=(BACK, BACK))
            for i in range(4)
        ),
        *(_rail(side, i) for side in "SN" for i in range(LAST)),
    ),
    plane="out-of-plane",
    sensors=(
        *((f"{side}{i}", "z") for side in "SN" for i in range(4)),
        *(((f"rail-{side}{i}", 0.5), "z") for side in "SN" for i in (0, 1, 2)),
        *(((f"rung-{i}", 0.5), "z") for i in range(4)),
    ),
    changes=(
        Change("6 kg at S0", lumps=(Lump("S0", 6.0),)),
        Change(
            "spring of 1e4 N/m along z at N3, 4 kg at S2",
            lumps=(Lump("S2", 4.0),),
            springs=(Spring("N3", "z", 1e4),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.028, 0.0195),
    guess=12.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.5,
)
