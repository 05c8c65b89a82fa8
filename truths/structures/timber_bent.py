"""A bent of a timber hall: housed knee braces, posts on steel shoes."""

from truths.sections import bar
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

SPAN, HEIGHT, KNEE, OVER = 4.2, 2.8, 0.9, 0.6  # m
POST, TIE, BRACE = 0.16, 0.2, 0.1  # m
SHOE = {"x": 1.2e7, "z": 6e7, "ry": 3e5}  # N/m, N m/rad of a shoe


def _housing(x: float, side: int) -> list[Block]:
    """Return the slots of the tenons in a post and in the tie above it."""
    inner, at = x + side * POST / 2, x + side * KNEE
    low, high = sorted((inner - side * 0.05, inner))
    return [
        Block("slot", (low, -0.02, HEIGHT - KNEE - 0.13), (high, 0.02, HEIGHT - KNEE - 0.085), ""),
        Block("slot", (at - 0.06, -0.02, HEIGHT + 0.02), (at + 0.06, 0.02, HEIGHT + TIE / 2), ""),
        Block("mortise", (x - 0.05, -0.02, HEIGHT - TIE / 2), (x - 0.02, 0.02, HEIGHT), ""),
    ]


STRUCTURE = Structure(
    name="timber-bent",
    title="Bent of a timber hall with knee braces, on steel shoes",
    classes=("after the rule", "timber frame", "solid sections", "cut-outs", "on feet"),
    story="""
Posts 160 x 160 mm, tie beam 160 x 200 mm, knee braces 100 x 100 mm at 45 degrees, all of spruce along the
grain, which the solid takes as isotropic, since what is tested is bending of slender sticks. Mortises and
slots for pegs are cut into posts and tie where they meet; the tie lies on the posts' heads and passes them by
600 mm. The steel shoes hold the posts' feet: the drawing has their stiffness along x and z and lets them
turn; in truth each holds the end of its post by 3e5 N m/rad. The purlins' ends on the tie are drawn as
masses.
""",
    materials={"spruce": Material(11.5e9, 0.3, 460.0)},
    sections={"post": bar(POST, POST), "tie": bar(POST, TIE), "brace": bar(BRACE, BRACE)},
    joints={
        "LF": (0.0, 0.0, 0.0),
        "LK": (0.0, 0.0, HEIGHT - KNEE),
        "LH": (0.0, 0.0, HEIGHT),
        "RF": (SPAN, 0.0, 0.0),
        "RK": (SPAN, 0.0, HEIGHT - KNEE),
        "RH": (SPAN, 0.0, HEIGHT),
        "LT": (KNEE, 0.0, HEIGHT),
        "RT": (SPAN - KNEE, 0.0, HEIGHT),
        "LE": (-OVER, 0.0, HEIGHT),
        "RE": (SPAN + OVER, 0.0, HEIGHT),
    },
    types={
        f"{s}{e}": t
        for s in "LR"
        for e, t in (("F", "shoe"), ("K", "knee"), ("H", "head"), ("T", "knee"), ("E", "end"))
    },
    members=(
        *(Member(f"brace-{s}", (f"{s}K", f"{s}T"), "brace", "spruce", 3) for s in "LR"),
        *(Member(f"post-{s}", (f"{s}F", f"{s}K"), "post", "spruce", 5) for s in "LR"),
        *(Member(f"upper-{s}", (f"{s}K", f"{s}H"), "post", "spruce", 3) for s in "LR"),
        Member("eave-L", ("LE", "LH"), "tie", "spruce", 2),
        Member("tie-L", ("LH", "LT"), "tie", "spruce", 3),
        Member("tie", ("LT", "RT"), "tie", "spruce", 6),
        Member("tie-R", ("RT", "RH"), "tie", "spruce", 3),
        Member("eave-R", ("RH", "RE"), "tie", "spruce", 2),
    ),
    blocks=(*_housing(0.0, 1), *_housing(SPAN, -1)),
    lumps=(Lump("LE", 14.0), Lump(("tie", 0.5), 20.0), Lump("RE", 14.0)),
    springs=tuple(Spring(f"{s}F", d, k, drawn=d != "ry") for s in "LR" for d, k in SHOE.items()),
    plane="in-plane",
    sensors=(
        *((f"{s}{e}", "xz") for s in "LR" for e in "KHE"),
        *(((f"post-{s}", 0.5), "x") for s in "LR"),
        *((f"{s}T", "z") for s in "LR"),
        *(((f"brace-{s}", 0.5), "xz") for s in "LR"),
        *((("tie", share), "z") for share in (0.25, 0.5, 0.75)),
    ),
    changes=(
        Change("30 kg at RH", lumps=(Lump("RH", 30.0),)),
        Change(
            "15 kg at LT, spring of 1.5e5 N/m along x at RK",
            lumps=(Lump("LT", 15.0),),
            springs=(Spring("RK", "x", 1.5e5),),
        ),
    ),
    mesher="tetrahedra",
    used=5,
    held_out=4,
    size=(0.12, 0.085),
    guess=4.0,
    beam="timoshenko",
    scatter=0.006,
    shape_scatter=0.03,
    together=0.7,
)
