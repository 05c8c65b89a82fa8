"""A jetty's bent of two piles in layered ground under a cap beam."""

from truths.lacks import LUMP, plates, without_blocks
from truths.sections import bar
from truths.structure import Block, Change, Clamp, Lump, Material, Member, Spring, Structure

PILE, CAP = 0.4, (0.7, 0.8)  # m
PILES = {"S": (-1.6, 1.0), "N": (1.6, 0.0)}  # m along y; drop of the harder layer at that pile
TOE, TOP = -9.0, 4.0  # m; the sea bed is at 0
DEPTHS = (-1.0, -2.5, -4.0, -6.0)  # m, where the ground is lumped
REPORT = (4e6, 1.2e7, 3e7, 6e7)  # N/m at these depths, of the boring at pile N
# The sand begins a metre deeper at pile S.
DEEPER = (0.45, 0.5, 0.6, 0.9)


def _share(depth: float) -> float:
    return round((depth - TOE) / -TOE, 6)


STRUCTURE = Structure(
    name="pile-bent",
    title="Bent of a jetty: two concrete piles in sloping layers, a cap beam, fenders",
    classes=("after the rule", "pile bent", "soft soil", "solid sections", "clamped"),
    story="""
Two square piles of 400 mm stand 3.2 m apart, their toes held in gravel 9 m below the bed, and carry a cap
beam 700 x 800 mm. The ground between is lumped at four depths. The drawing has the values of the one boring,
at pile N; at pile S the sand begins a metre deeper and the upper layers give half as much. In the solid the
cap encases the piles' heads, a bollard's plinth stands on one end, and a rubbing strip of plate stiffens pile
N at the water line. The bollard itself is drawn as a mass.
""",
    materials={
        "concrete": Material(34e9, 0.2, 2500.0),
        "steel": Material(210e9, 0.3, 7850.0),
    },
    sections={"pile": bar(PILE, PILE), "cap": bar(*CAP)},
    joints={
        **{f"{p}t": (0.0, y, TOE) for p, (y, _) in PILES.items()},
        **{f"{p}b": (0.0, y, 0.0) for p, (y, _) in PILES.items()},
        **{f"{p}h": (0.0, y, TOP) for p, (y, _) in PILES.items()},
        "west": (0.0, -2.8, TOP),
        "east": (0.0, 2.4, TOP),
    },
    types={f"{p}{e}": t for p in PILES for e, t in (("t", "toe"), ("b", "bed"), ("h", "head"))}
    | {"west": "end", "east": "end"},
    members=(
        *(Member(f"ground-{p}", (f"{p}t", f"{p}b"), "pile", "concrete", 6) for p in PILES),
        *(Member(f"pile-{p}", (f"{p}b", f"{p}h"), "pile", "concrete", 5) for p in PILES),
        Member("cap-west", ("west", "Sh"), "cap", "concrete", 2),
        Member("cap", ("Sh", "Nh"), "cap", "concrete", 4),
        Member("cap-east", ("Nh", "east"), "cap", "concrete", 2),
    ),
    blocks=(
        Block("plinth", (-0.35, -2.8, TOP + 0.4), (0.35, -2.1, TOP + 0.9), "concrete"),
        Block("strip", (-0.22, 1.4, 0.6), (-0.2, 1.8, 3.0), "steel"),
    ),
    lumps=(Lump("west", 350.0, (0.0, 0.3, 1.1)),),
    springs=(
        *(
            Spring((f"ground-{p}", _share(z)), d, k)
            for p in PILES
            for z, k in zip(DEPTHS, REPORT, strict=True)
            for d in "xy"
        ),
        *(
            Spring(("ground-S", _share(z)), d, (left - 1) * k, drawn=False)
            for z, k, left in zip(DEPTHS, REPORT, DEEPER, strict=True)
            for d in "xy"
        ),
    ),
    clamps=tuple(
        Clamp(f"{p}t", (-0.3, y - 0.3, TOE), (0.3, y + 0.3, TOE)) for p, (y, _) in PILES.items()
    ),
    sensors=(
        ("west", "xyz"),
        ("Sh", "xz"),
        (("cap", 0.5), "xz"),
        ("Nh", "xz"),
        ("east", "xyz"),
        *(((f"pile-{p}", s), "xy") for p in PILES for s in (0.3, 0.65)),
        *((f"{p}b", "xy") for p in PILES),
    ),
    changes=(
        Change("1500 kg at the middle of the cap", lumps=(Lump(("cap", 0.5), 1500.0),)),
        Change(
            "fender of 3e6 N/m along x at east, 600 kg at west",
            lumps=(Lump("west", 600.0),),
            springs=(Spring("east", "x", 3e6),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.24, 0.2),
    graded=False,
    guess=1.5,
    beam="timoshenko",
    scatter=0.008,
    shape_scatter=0.04,
    together=0.4,
    weighed=0.0,
)

LACKS = (
    without_blocks(LUMP, "west", "a plinth", "plinth"),
    *plates(
        "pile-N", "a strip at the water line", "strip", mass=LUMP, stiffness="member-stiffness"
    ),
)
