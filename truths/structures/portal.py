"""A free portal of rectangular hollow sections with a stub on its beam."""

from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

HALF = 0.03  # m, half the depth of post and beam

STRUCTURE = Structure(
    name="portal",
    title="Portal of rectangular hollow sections with a stub, free",
    classes=("planar frame", "hollow sections", "free"),
    story="""
Two posts 60 x 40 x 3 mm, a beam of the same tube, a stub 40 x 40 x 3 mm, welded all around. The
beam lies on the posts, whose walls end at its lower face: the tubes meet as plates, so the corners
are far softer across the plane than in it. The beam's ends are closed by 3 mm plates, the others stay open.
""",
    materials={"steel": STEEL},
    sections={
        "tube": rectangular_tube(0.04, 0.06, 0.003),
        "stub": rectangular_tube(0.04, 0.04, 0.003),
    },
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (0.0, 0.0, 0.9),
        "C": (0.5, 0.0, 0.9),
        "D": (1.2, 0.0, 0.9),
        "E": (1.2, 0.0, 0.0),
        "F": (0.5, 0.0, 1.25),
    },
    types={"A": "foot", "E": "foot", "B": "corner", "D": "corner", "C": "tee", "F": "end"},
    members=(
        Member("post-left", ("A", "B"), "tube", "steel", 6, weld=0.004),
        Member("post-right", ("E", "D"), "tube", "steel", 6, weld=0.004),
        Member("stub", ("C", "F"), "stub", "steel", 3, weld=0.004),
        Member("beam-left", ("B", "C"), "tube", "steel", 4, extend=(HALF, 0.0)),
        Member("beam-right", ("C", "D"), "tube", "steel", 5, extend=(0.0, HALF)),
    ),
    blocks=(
        Block("cap-left", (-HALF, -0.02, 0.87), (-HALF + 0.003, 0.02, 0.93), "steel"),
        Block("cap-right", (1.2 + HALF - 0.003, -0.02, 0.87), (1.2 + HALF, 0.02, 0.93), "steel"),
    ),
    sensors=(
        ("A", "xy"),
        (("post-left", 0.5), "xy"),
        ("B", "xyz"),
        (("beam-left", 0.5), "yz"),
        ("C", "yz"),
        (("beam-right", 0.5), "yz"),
        ("D", "xyz"),
        (("post-right", 0.5), "xy"),
        ("E", "xy"),
        ("F", "xy"),
    ),
    changes=(
        Change("1.5 kg at E", lumps=(Lump("E", 1.5),)),
        Change(
            "0.8 kg at F, spring of 2e5 N/m along x at B",
            lumps=(Lump("F", 0.8),),
            springs=(Spring("B", "x", 2e5),),
        ),
    ),
    used=5,
    held_out=5,
    size=(0.015, 0.01),
    guess=60.0,
    default=True,
)
