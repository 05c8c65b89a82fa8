"""A wide thin strip with steps and a crosspiece, drawn as beams, clamped at one end."""

from truths.sections import bar
from truths.structure import ALUMINIUM, Change, Clamp, Lump, Member, Spring, Structure

THICK, MIDDLE, THIN = 0.008, 0.006, 0.004  # m
WIDE, NARROW = 0.12, 0.08  # m

STRUCTURE = Structure(
    name="stepped-strip",
    title="Stepped plate strip with a crosspiece, drawn as beams, clamped at one end",
    classes=("plate as beam", "tapered members", "solid sections", "clamped"),
    story="""
A strip milled of one aluminium plate in three steps, 120 x 8, 120 x 6 and 80 x 4 mm, with a crosspiece
60 x 6 mm at its tip. The drawing knows beams only: a plate so wide is stiffer in bending than a beam, twists
with a restrained end, and its flow of force narrows at the steps and at the crosspiece.
""",
    materials={"aluminium": ALUMINIUM},
    sections={
        "thick": bar(WIDE, THICK),
        "middle": bar(WIDE, MIDDLE),
        "thin": bar(NARROW, THIN),
        "cross": bar(0.06, MIDDLE),
    },
    joints={
        "root": (0.0, 0.0, 0.0),
        "step-1": (0.16, 0.0, 0.0),
        "step-2": (0.38, 0.0, 0.0),
        "tip": (0.6, 0.0, 0.0),
        "left": (0.6, 0.14, 0.0),
        "right": (0.6, -0.1, 0.0),
    },
    types={"step-1": "step", "step-2": "step", "left": "end", "right": "end"},
    members=(
        Member("thick", ("root", "step-1"), "thick", "aluminium", 5),
        Member("middle", ("step-1", "step-2"), "middle", "aluminium", 6),
        Member("thin", ("step-2", "tip"), "thin", "aluminium", 6, extend=(0.0, 0.03)),
        Member("cross-left", ("tip", "left"), "cross", "aluminium", 3),
        Member("cross-right", ("tip", "right"), "cross", "aluminium", 3),
    ),
    clamps=(Clamp("root", (0.0, -0.1, -0.1), (0.0, 0.1, 0.1)),),
    sensors=(
        ("step-1", "z"),
        (("middle", 0.33), "z"),
        (("middle", 0.67), "z"),
        ("step-2", "z"),
        (("thin", 0.25), "z"),
        (("thin", 0.5), "z"),
        (("thin", 0.75), "z"),
        ("tip", "z"),
        ("left", "z"),
        (("cross-left", 0.5), "z"),
        (("cross-right", 0.5), "z"),
        ("right", "z"),
    ),
    changes=(
        Change("0.1 kg at tip", lumps=(Lump("tip", 0.1),)),
        Change(
            "0.05 kg at step-2, spring of 4e3 N/m along z at thin@0.5",
            lumps=(Lump("step-2", 0.05),),
            springs=(Spring(("thin", 0.5), "z", 4e3),),
        ),
    ),
    plane="out-of-plane",
    used=4,
    held_out=3,
    size=(0.02, 0.014),
    guess=15.0,
    scatter=0.002,
    shape_scatter=0.02,
    together=0.2,
    default=True,
)
