"""A clamped mast with three lumps; its bending modes come in close pairs."""

from truths.lacks import rigid_feet
from truths.sections import rectangular_tube
from truths.structure import ALUMINIUM, STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

HALF = 0.03  # m, half the width of the mast
PLATE = 0.016  # m

STRUCTURE = Structure(
    name="mast-lumps",
    title="Aluminium mast with three lumps, clamped, close pairs",
    classes=("cantilever", "lumps", "hollow sections", "close modes", "clamped"),
    story="""
A square aluminium tube 60 x 60 x 5 mm, 2.1 m high, with an arm of 30 x 40 mm near its top and three
instruments, of which one hangs on the arm. The holders of the two others stick out to one side and weigh
0.25 kg each; they are not drawn. The tube is welded into a steel base plate of 130 x 130 x 16 mm that is
held along a strip alone, so that the foot is softer one way than the other. The two planes of bending differ by little.
""",
    materials={"aluminium": ALUMINIUM, "steel": STEEL},
    sections={
        "mast": rectangular_tube(2 * HALF, 2 * HALF, 0.005),
        "arm": rectangular_tube(0.03, 0.04, 0.005),
    },
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (0.0, 0.0, 0.75),
        "C": (0.0, 0.0, 1.45),
        "D": (0.0, 0.0, 1.9),
        "E": (0.0, 0.0, 2.1),
        "F": (0.28, 0.0, 1.9),
    },
    types={"A": "foot", "D": "tee", "E": "end", "F": "end"},
    members=(
        Member("arm", ("D", "F"), "arm", "aluminium", 3, weld=0.004),
        Member("mast-1", ("A", "B"), "mast", "aluminium", 5, weld=0.004),
        Member("mast-2", ("B", "C"), "mast", "aluminium", 5),
        Member("mast-3", ("C", "D"), "mast", "aluminium", 4),
        Member("mast-4", ("D", "E"), "mast", "aluminium", 2),
    ),
    blocks=(Block("base-plate", (-0.065, -0.065, -PLATE), (0.065, 0.065, 0.0), "steel"),),
    lumps=(
        Lump("B", 3.0),
        Lump("C", 2.0),
        Lump("F", 0.6),
        Lump("B", 0.25, (0.0, 0.09, 0.0), drawn=False),
        Lump("C", 0.25, (0.0, 0.09, 0.0), drawn=False),
    ),
    clamps=(Clamp("A", (-HALF, -0.065, -PLATE), (HALF, 0.065, -PLATE)),),
    sensors=(
        (("mast-1", 0.5), "xy"),
        ("B", "xy"),
        (("mast-2", 0.5), "xy"),
        ("C", "xy"),
        (("mast-3", 0.5), "xy"),
        ("D", "xy"),
        ("E", "xy"),
        (("arm", 0.5), "yz"),
        ("F", "yz"),
    ),
    changes=(
        Change("1.5 kg at E", lumps=(Lump("E", 1.5),)),
        Change(
            "spring of 2e4 N/m along x at C, 1 kg at D",
            lumps=(Lump("D", 1.0),),
            springs=(Spring("C", "x", 2e4),),
        ),
    ),
    used=6,
    held_out=3,
    size=(0.021, 0.0145),
    guess=8.0,
    scatter=0.005,
    shape_scatter=0.05,
    together=0.7,
)

LACKS = (rigid_feet("type:foot", "a base plate held along a strip", "base-plate"),)
