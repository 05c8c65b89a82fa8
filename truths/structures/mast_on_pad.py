"""A mast on a base plate that stands on a soft layer."""

from truths.lacks import LUMP, rigid_feet, without_blocks
from truths.sections import rectangular_tube
from truths.structure import (
    ALUMINIUM,
    Block,
    Change,
    Clamp,
    Lump,
    Material,
    Member,
    Spring,
    Structure,
)

LOW, HIGH, ARM = 1.0, 1.7, 0.35  # m
PLATE, PAD = 0.012, 0.01  # m, thickness

STRUCTURE = Structure(
    name="mast-on-pad",
    title="Mast with a yard on a base plate, over a rubber layer",
    classes=("tower", "soft feet", "hollow sections", "two materials"),
    story="""
An aluminium tube 60 x 40 x 3 mm, welded to a steel plate 160 x 120 x 12 mm, which is bonded to a rubber layer
of 10 mm. Half way up a yard of 60 x 30 x 2 mm, as wide as the mast, is welded to its sides in two halves. The
drawing clamps the mast at the plate and knows nothing of the rubber.
""",
    materials={
        "aluminium": ALUMINIUM,
        "steel": Material(206e9, 0.3, 7850.0),
        "rubber": Material(25e6, 0.45, 1100.0),
    },
    sections={
        "mast": rectangular_tube(0.04, 0.06, 0.003),
        "yard": rectangular_tube(0.06, 0.03, 0.002),
    },
    joints={
        "base": (0.0, 0.0, 0.0),
        "cross": (0.0, 0.0, LOW),
        "top": (0.0, 0.0, HIGH),
        "left": (0.0, ARM, LOW),
        "right": (0.0, -0.7 * ARM, LOW),
    },
    types={"left": "end", "right": "end"},
    members=(
        Member("yard-left", ("cross", "left"), "yard", "aluminium", 4, weld=0.004),
        Member("yard-right", ("cross", "right"), "yard", "aluminium", 4, weld=0.004),
        Member("mast-low", ("base", "cross"), "mast", "aluminium", 6, weld=0.004),
        Member("mast-high", ("cross", "top"), "mast", "aluminium", 5),
    ),
    blocks=(
        Block("plate", (-0.08, -0.06, -PLATE), (0.08, 0.06, 0.0), "steel"),
        Block("layer", (-0.08, -0.06, -PLATE - PAD), (0.08, 0.06, -PLATE), "rubber"),
        Block("lid", (-0.03, -0.02, HIGH), (0.03, 0.02, HIGH + 0.003), "aluminium"),
    ),
    lumps=(Lump("top", 0.6),),
    clamps=(Clamp("base", (-0.1, -0.1, -PLATE - PAD), (0.1, 0.1, -PLATE - PAD)),),
    sensors=(
        (("mast-low", 0.25), "xy"),
        (("mast-low", 0.5), "xy"),
        (("mast-low", 0.75), "xy"),
        ("cross", "xy"),
        (("mast-high", 0.33), "xy"),
        (("mast-high", 0.67), "xy"),
        ("top", "xy"),
        ("left", "xz"),
        ("right", "xz"),
    ),
    changes=(
        Change("0.5 kg at cross", lumps=(Lump("cross", 0.5),)),
        Change(
            "0.3 kg at left, spring of 2e4 N/m along x at cross",
            lumps=(Lump("left", 0.3),),
            springs=(Spring("cross", "x", 2e4),),
        ),
    ),
    used=5,
    held_out=3,
    size=(0.022, 0.0155),
    guess=8.0,
    scatter=0.007,
    shape_scatter=0.03,
    together=0.7,
    default=True,
)

LACKS = (
    rigid_feet("type:base", "a plate on rubber", "plate", "layer"),
    without_blocks(LUMP, "top", "a lid", "lid"),
)
