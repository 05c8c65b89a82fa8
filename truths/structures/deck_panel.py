"""A stiffened panel of a ship's deck: plating on longitudinals and deep frames, free."""

from itertools import pairwise

from truths.sections import Section, thin_walled
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

LENGTH = 2.4  # m
FRAMES = (0.3, 0.95, 1.5, 2.1)  # m along x
LINES = {"P": -0.22, "C": 0.0, "S": 0.22}  # m along y, of the longitudinals
PLATE, WIDTH = 0.008, 0.64  # m
STATIONS = (0.0, *FRAMES, LENGTH)


def _with_plate(height: float, web: float, strip: float) -> Section:
    """Return a flat bar below a strip of the plating, at its own height in the solid.

    The drawing takes the axis of all bars as one; the solid hangs each below the plating.
    """
    return thin_walled(
        ((-web / 2, web / 2, 0.0, height), (-strip / 2, strip / 2, height, height + PLATE)),
        web * height,
    )


def _hung(drawn: Section, height: float, web: float) -> Section:
    """Return the bar alone, below the plating's lower face at z = 0, drawn with its strip."""
    return Section(web, 2 * height, ((-web / 2, web / 2, -height, 0.0, True),), drawn.drawn)


STRUCTURE = Structure(
    name="deck-panel",
    title="Stiffened panel of a ship's deck, drawn as a grillage, free",
    classes=(
        "after the rule",
        "grillage",
        "stiffened plate",
        "open sections",
        "out of plane",
        "free",
    ),
    story="""
Plating of 2400 x 640 x 8 mm on three longitudinals, flat bars 55 x 10 mm, and four frames 75 x 10 mm across,
all welded below it, hung on ropes. Frames are notched where the longitudinals pass. The drawing is the usual
grillage: a longitudinal with the strip of plating between the middles of its neighbours, a frame with a strip
of 60 mm, so that no plating counts twice by much; all in one plane. It knows neither the shear of the plating
nor what the axes' offsets do.
""",
    materials={"steel": STEEL},
    sections={
        "inner": _hung(_with_plate(0.055, 0.01, 0.22), 0.055, 0.01),
        "outer": _hung(_with_plate(0.055, 0.01, 0.21), 0.055, 0.01),
        "frame": _hung(_with_plate(0.075, 0.01, 0.06), 0.075, 0.01),
    },
    joints={f"{s}{i}": (x, y, 0.0) for s, y in LINES.items() for i, x in enumerate(STATIONS)},
    types={f"{s}{i}": "end" if i in (0, 5) else "crossing" for s in LINES for i in range(6)},
    members=(
        *(
            Member(
                f"frame-{i}{a}",
                (f"{a}{i}", f"{b}{i}"),
                "frame",
                "steel",
                3,
                extend=(0.1 * (a == "P"), 0.1 * (b == "S")),
            )
            for i in (1, 2, 3, 4)
            for a, b in ("PC", "CS")
        ),
        *(
            Member(f"line-{s}{i}", (f"{s}{i}", f"{s}{i + 1}"), kind, "steel", 3)
            for s, kind in (("P", "outer"), ("C", "inner"), ("S", "outer"))
            for i in range(5)
        ),
    ),
    blocks=(
        *(
            Block("plating", (a, -WIDTH / 2, 0.0), (b, WIDTH / 2, PLATE), "steel")
            for a, b in pairwise(STATIONS)
        ),
        *(
            Block("notch", (x - 0.005, y + 0.005, -0.055), (x + 0.005, y + 0.025, -0.035), "")
            for x in FRAMES
            for y in LINES.values()
        ),
    ),
    lumps=(Lump("S2", 9.0),),
    plane="out-of-plane",
    sensors=(
        *((f"{s}{i}", "z") for s in LINES for i in range(6)),
        *(((f"line-{s}{i}", 0.5), "z") for s in "PS" for i in (1, 2)),
    ),
    changes=(
        Change("8 kg at P0", lumps=(Lump("P0", 8.0),)),
        Change(
            "stanchion of 4e5 N/m along z at C1, 5 kg at S5",
            lumps=(Lump("S5", 5.0),),
            springs=(Spring("C1", "z", 4e5),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.065, 0.046),
    graded=False,
    guess=40.0,
    scatter=0.004,
    shape_scatter=0.03,
    together=0.5,
)
