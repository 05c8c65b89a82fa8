"""A stubby bracket of thick bars with a gusset, clamped by its foot."""

from truths.lacks import plates, rigid_feet
from truths.sections import bar
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

HEIGHT, ARM = 0.24, 0.3  # m
HALF = 0.025  # m, half the depth of post and arm
LEG, STEPS = 0.1, 4  # of the gusset, m


def _gusset(i: int) -> Block:
    drop = HEIGHT - HALF
    low, high = (drop - LEG * (i + j) / STEPS for j in (1, 0))
    return Block(
        f"gusset-{i}", (HALF, -0.005, low), (HALF + LEG * (STEPS - i) / STEPS, 0.005, high), "steel"
    )


STRUCTURE = Structure(
    name="bracket",
    title="Stubby bracket with gusset and lug, clamped",
    classes=("bracket", "stubby members", "gussets", "solid sections", "clamped"),
    story="""
A post 40 x 50 mm, 240 mm high, stands on a foot of 110 x 80 x 18 mm that is held over its whole underside.
An arm of the same bar, 300 mm long, meets it under a 10 mm gusset of 100 x 100 mm; a lug of 20 x 30 mm
stands aside at the arm's end and carries a 1.2 kg instrument, whose holder of 0.15 kg sits 30 mm above the
lug's axis and is not drawn. The drawing has centre lines of Timoshenko beams from the foot's upper face on.
""",
    materials={"steel": STEEL},
    sections={"bar": bar(0.04, 2 * HALF), "lug": bar(0.02, 0.03)},
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (0.0, 0.0, HEIGHT),
        "C": (ARM, 0.0, HEIGHT),
        "D": (ARM, 0.14, HEIGHT),
    },
    types={"A": "foot", "B": "corner", "C": "corner", "D": "end"},
    members=(
        Member("post", ("A", "B"), "bar", "steel", 5, extend=(0.0, HALF), weld=0.004),
        Member("lug", ("C", "D"), "lug", "steel", 4, weld=0.004),
        Member("arm", ("B", "C"), "bar", "steel", 6, extend=(HALF, 0.015), weld=0.004),
    ),
    blocks=(
        *(_gusset(i) for i in range(STEPS)),
        Block("foot", (-0.055, -0.04, -0.018), (0.055, 0.04, 0.0), "steel"),
    ),
    lumps=(Lump("D", 1.2), Lump("D", 0.15, (0.0, 0.0, 0.03), drawn=False)),
    clamps=(Clamp("A", (-0.055, -0.04, -0.018), (0.055, 0.04, -0.018)),),
    beam="timoshenko",
    sensors=(
        (("post", 0.5), "xy"),
        ("B", "xyz"),
        (("arm", 0.5), "yz"),
        ("C", "xyz"),
        (("lug", 0.5), "xz"),
        ("D", "xyz"),
    ),
    changes=(
        Change("1 kg at C", lumps=(Lump("C", 1.0),)),
        Change(
            "spring of 4e6 N/m along z at C, 0.5 kg at B",
            lumps=(Lump("B", 0.5),),
            springs=(Spring("C", "z", 4e6),),
        ),
    ),
    used=4,
    held_out=4,
    size=(0.021, 0.0145),
    guess=150.0,
    scatter=0.006,
    shape_scatter=0.04,
    together=0.3,
    default=True,
)

LACKS = (
    *plates("type:corner", "a gusset", "gusset"),
    rigid_feet("type:foot", "a foot plate that gives way", "foot"),
)
