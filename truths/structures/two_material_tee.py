"""A free T of a steel tube and an aluminium bar."""

from truths.lacks import plates
from truths.sections import bar, rectangular_tube
from truths.structure import ALUMINIUM, STEEL, Block, Change, Lump, Member, Spring, Structure

HALF = 0.025  # m, half the width of the beam
PLATE = 0.012  # m

STRUCTURE = Structure(
    name="two-material-tee",
    title="T of a steel tube and an aluminium bar, free",
    classes=("planar frame", "two materials", "hollow sections", "solid sections", "free"),
    story="""
A steel tube 50 x 50 x 3 mm, 0.95 m long, carries an aluminium bar 40 x 30 mm of 0.55 m at 0.4 m of its
length. The bar ends in an aluminium foot of 90 x 50 x 12 mm that is bonded to the tube's wall on its whole
face. The drawing lets the bar begin at the tube's axis and knows no foot.
""",
    materials={"steel": STEEL, "aluminium": ALUMINIUM},
    sections={"tube": rectangular_tube(0.05, 2 * HALF, 0.003), "bar": bar(0.03, 0.04)},
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (0.4, 0.0, 0.0),
        "C": (0.95, 0.0, 0.0),
        "D": (0.4, 0.0, 0.55),
    },
    types={"A": "end", "B": "tee", "C": "end", "D": "end"},
    members=(
        Member("stem", ("B", "D"), "bar", "aluminium", 6, weld=0.004),
        Member("beam-short", ("A", "B"), "tube", "steel", 5),
        Member("beam-long", ("B", "C"), "tube", "steel", 6),
    ),
    blocks=(Block("foot", (0.355, -0.025, HALF), (0.445, 0.025, HALF + PLATE), "aluminium"),),
    sensors=(
        ("A", "yz"),
        (("beam-short", 0.5), "yz"),
        ("B", "yz"),
        (("beam-long", 0.4), "yz"),
        (("beam-long", 0.7), "yz"),
        ("C", "yz"),
        (("stem", 0.35), "xy"),
        (("stem", 0.7), "xy"),
        ("D", "xy"),
    ),
    changes=(
        Change("0.8 kg at D", lumps=(Lump("D", 0.8),)),
        Change(
            "spring of 1.5e5 N/m along z at C, 0.5 kg at A",
            lumps=(Lump("A", 0.5),),
            springs=(Spring("C", "z", 1.5e5),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.0145, 0.0102),
    guess=100.0,
    scatter=0.001,
    shape_scatter=0.01,
    together=0.0,
)

LACKS = plates("type:tee", "a foot under the bar", "foot")
