"""A clamped portal of I sections with plate haunches under its beam."""

from truths.lacks import plates, rigid_feet
from truths.sections import i_beam
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

SPAN, HEIGHT = 2.4, 1.6  # m
HALF = 0.06  # m, half the depth of post and beam
REACH, DROP, STEPS = 0.32, 0.24, 4  # of a haunch, m
FOOT = 0.035  # m, half the width that the anchor bolts hold down


def _haunch(side: int) -> list[Block]:
    """Return the steps of a haunch; side is 1 at the left post, -1 at the right one."""
    corner = HALF if side > 0 else SPAN - HALF
    steps = []
    for i in range(STEPS):
        ends = sorted((corner, corner + side * REACH * (STEPS - i) / STEPS))
        low, high = (HEIGHT - HALF - DROP * (i + j) / STEPS for j in (1, 0))
        steps.append(
            Block(f"haunch-{i}", (ends[0], -0.0035, low), (ends[1], 0.0035, high), "steel")
        )
    return steps


def _base(x: float) -> Block:
    return Block("base-plate", (x - 0.09, -0.06, -0.015), (x + 0.09, 0.06, 0.0), "steel")


STRUCTURE = Structure(
    name="haunched-portal",
    title="Portal of I sections with plate haunches, clamped feet",
    classes=("planar frame", "haunches", "open sections", "clamped"),
    story="""
Posts and beam of an I section 120 x 80 mm, web 6 and flanges 8 mm. The beam lies on the posts, whose webs
have no stiffeners where they meet it; a 7 mm plate of 320 x 240 mm fills each inner corner and carries no
flange. The feet stand on 15 mm base plates that two anchor bolts hold down along their middle strip. The
drawing shows centre lines and rigid clamps alone.
""",
    materials={"steel": STEEL},
    sections={"i": i_beam(0.08, 2 * HALF, 0.006, 0.008)},
    joints={
        "A": (0.0, 0.0, 0.0),
        "B": (0.0, 0.0, HEIGHT),
        "C": (SPAN, 0.0, HEIGHT),
        "D": (SPAN, 0.0, 0.0),
    },
    types={"A": "foot", "D": "foot", "B": "corner", "C": "corner"},
    members=(
        Member("post-left", ("A", "B"), "i", "steel", 6, weld=0.004),
        Member("post-right", ("D", "C"), "i", "steel", 6, weld=0.004),
        Member("beam", ("B", "C"), "i", "steel", 8, extend=(HALF, HALF)),
    ),
    blocks=(*_haunch(1), *_haunch(-1), _base(0.0), _base(SPAN)),
    clamps=(
        Clamp("A", (-FOOT, -0.06, -0.015), (FOOT, 0.06, -0.015)),
        Clamp("D", (SPAN - FOOT, -0.06, -0.015), (SPAN + FOOT, 0.06, -0.015)),
    ),
    plane="in-plane",
    sensors=(
        (("post-left", 0.35), "x"),
        (("post-left", 0.7), "x"),
        ("B", "xz"),
        (("beam", 0.25), "z"),
        (("beam", 0.5), "xz"),
        (("beam", 0.75), "z"),
        ("C", "xz"),
        (("post-right", 0.7), "x"),
        (("post-right", 0.35), "x"),
    ),
    changes=(
        Change("25 kg at the middle of the beam", lumps=(Lump(("beam", 0.5), 25.0),)),
        Change(
            "spring of 2e6 N/m along x at B, 12 kg at C",
            lumps=(Lump("C", 12.0),),
            springs=(Spring("B", "x", 2e6),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.045, 0.03),
    guess=30.0,
    scatter=0.004,
    shape_scatter=0.03,
    together=0.3,
    default=True,
)

LACKS = (
    *plates("type:corner", "haunches", "haunch"),
    rigid_feet("type:foot", "base plates held along a strip", "base-plate"),
)
