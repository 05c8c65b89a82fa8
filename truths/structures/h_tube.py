"""A free H of three different tubes, drawn for motion across its plane."""

from truths.lacks import LUMP, without_blocks
from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

WIDTH = 0.62  # m, between the legs

STRUCTURE = Structure(
    name="h-tube",
    title="H of unequal tubes, free, motion across its plane",
    classes=("planar frame", "hollow sections", "out of plane", "free"),
    story="""
A long leg 60 x 50 x 4 mm, a short one 40 x 50 x 4 mm, a crossbar 40 x 50 x 4 mm at neither's middle, welded
all around onto the legs' side walls. What moves across the plane twists the crossbar, and its ends turn on
walls that bend. A plate of 10 mm closes one end of the long leg. The drawing has centre lines and rigid
joints; it knows the 0.9 kg block at the short leg's end.
""",
    materials={"steel": STEEL},
    sections={
        "long": rectangular_tube(0.06, 0.05, 0.004),
        "short": rectangular_tube(0.04, 0.05, 0.004),
        "bar": rectangular_tube(0.04, 0.05, 0.004),
    },
    joints={
        "A": (0.0, -0.5, 0.0),
        "B": (0.0, 0.0, 0.0),
        "C": (0.0, 0.78, 0.0),
        "D": (WIDTH, -0.34, 0.0),
        "E": (WIDTH, 0.0, 0.0),
        "F": (WIDTH, 0.44, 0.0),
    },
    types={"B": "tee", "E": "tee", "A": "end", "C": "end", "D": "end", "F": "end"},
    members=(
        Member("crossbar", ("B", "E"), "bar", "steel", 5, weld=0.004),
        Member("long-south", ("A", "B"), "long", "steel", 4),
        Member("long-north", ("B", "C"), "long", "steel", 6),
        Member("short-south", ("D", "E"), "short", "steel", 4),
        Member("short-north", ("E", "F"), "short", "steel", 4),
    ),
    blocks=(Block("end-plate", (-0.03, 0.77, -0.025), (0.03, 0.78, 0.025), "steel"),),
    lumps=(Lump("F", 0.9),),
    plane="out-of-plane",
    sensors=(
        ("A", "z"),
        (("long-south", 0.5), "z"),
        ("B", "z"),
        (("long-north", 0.35), "z"),
        (("long-north", 0.7), "z"),
        ("C", "z"),
        (("crossbar", 0.25), "z"),
        (("crossbar", 0.6), "z"),
        ("D", "z"),
        (("short-south", 0.5), "z"),
        ("E", "z"),
        (("short-north", 0.5), "z"),
        ("F", "z"),
    ),
    changes=(
        Change("2 kg at A", lumps=(Lump("A", 2.0),)),
        Change(
            "spring of 4e5 N/m along z at C, 0.7 kg at D",
            lumps=(Lump("D", 0.7),),
            springs=(Spring("C", "z", 4e5),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.018, 0.0125),
    guess=60.0,
    scatter=0.002,
    shape_scatter=0.02,
    together=0.4,
)

LACKS = (without_blocks(LUMP, "C", "a plate that closes an end", "end-plate"),)
