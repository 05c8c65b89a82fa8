"""A pi-shaped portal with cantilevers for insulators, on mortar."""

from truths.lacks import plates, rigid_feet
from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Clamp, Lump, Material, Member, Spring, Structure

HALF, HEIGHT, REACH, TOP = 0.45, 1.5, 1.0, 1.75  # m; reach of a cantilever from the middle
WIDE, WALL = 0.06, 0.003  # m, of the posts
SIDES = {"L": -1.0, "R": 1.0}


def _foot(s: str, low: float, high: float, half: float, material: str) -> Block:
    x = SIDES[s] * HALF
    return Block(f"{material}-{s}", (x - half, -half, low), (x + half, half, high), material)


def _span(s: str, low: float, high: float) -> tuple[float, float]:
    """Return two distances from a post's axis outwards as places along x."""
    a, b = sorted(SIDES[s] * (HALF + value) for value in (low, high))
    return a, b


def _bracket(s: str, i: int) -> Block:
    """Return a step of the plate under a cantilever at a post's outer face."""
    x0, x1 = _span(s, WIDE / 2, WIDE / 2 + 0.05 * (3 - i))
    z = HEIGHT - 0.025
    return Block(
        f"plate-{s}{i}", (x0, -0.003, z - 0.04 * (i + 1)), (x1, 0.003, z - 0.04 * i), "steel"
    )


STRUCTURE = Structure(
    name="pi-portal",
    title="Pi-shaped portal with cantilevers and insulators, on mortar",
    classes=(
        "after the rule",
        "portal with cantilevers",
        "hollow sections",
        "lumps",
        "gussets",
        "soft feet",
    ),
    story="""
Two posts 60 x 60 x 3 mm pass a crossbeam of 60 x 50 x 3 mm that runs on as a cantilever at each side; the
posts end 250 mm above it. Stepped plates of 6 mm stand under the cantilevers at the posts, and the beam
passes the posts through cut-outs, welded all around. The posts stand on plates of 130 x 130 x 12 mm over 20
mm of mortar. Insulators of 3, 3 and 4 kg hang 120 mm under the ends and the middle. The drawing has centre
lines clamped at the plates and the insulators at their heights, without plates and mortar.
""",
    materials={"steel": STEEL, "mortar": Material(1.5e9, 0.2, 1900.0)},
    sections={
        "post": rectangular_tube(WIDE, WIDE, WALL),
        "beam": rectangular_tube(0.06, 0.05, 0.003),
    },
    joints={
        **{f"{s}0": (m * HALF, 0.0, 0.0) for s, m in SIDES.items()},
        **{f"{s}1": (m * HALF, 0.0, HEIGHT) for s, m in SIDES.items()},
        **{f"{s}2": (m * HALF, 0.0, TOP) for s, m in SIDES.items()},
        **{f"{s}3": (m * REACH, 0.0, HEIGHT) for s, m in SIDES.items()},
        "M": (0.0, 0.0, HEIGHT),
    },
    types={f"{s}{i}": ("foot", "crossing", "top", "end")[i] for s in SIDES for i in range(4)},
    members=(
        *(Member(f"post-{s}", (f"{s}0", f"{s}1"), "post", "steel", 6) for s in SIDES),
        *(Member(f"peak-{s}", (f"{s}1", f"{s}2"), "post", "steel", 2) for s in SIDES),
        Member("beam-L", ("L1", "M"), "beam", "steel", 4),
        Member("beam-R", ("M", "R1"), "beam", "steel", 4),
        *(Member(f"arm-{s}", (f"{s}1", f"{s}3"), "beam", "steel", 4) for s in SIDES),
    ),
    blocks=(
        *(_bracket(s, i) for s in SIDES for i in range(3)),
        *(_foot(s, -0.012, 0.0, 0.065, "steel") for s in SIDES),
        *(_foot(s, -0.032, -0.012, 0.065, "mortar") for s in SIDES),
    ),
    lumps=tuple(
        Lump(at, mass, (0.0, 0.0, -0.12)) for at, mass in (("L3", 3.0), ("R3", 3.0), ("M", 4.0))
    ),
    clamps=tuple(
        Clamp(f"{s}0", (m * HALF - 0.1, -0.1, -0.032), (m * HALF + 0.1, 0.1, -0.032))
        for s, m in SIDES.items()
    ),
    sensors=(
        *(((f"post-{s}", 0.5), "xy") for s in SIDES),
        *((f"{s}1", "xyz") for s in SIDES),
        *((f"{s}2", "xy") for s in SIDES),
        *((f"{s}3", "yz") for s in SIDES),
        ("M", "yz"),
    ),
    changes=(
        Change("5 kg at R2", lumps=(Lump("R2", 5.0),)),
        Change(
            "3 kg at L3, spring of 1e5 N/m along y at M",
            lumps=(Lump("L3", 3.0),),
            springs=(Spring("M", "y", 1e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.06, 0.04),
    guess=8.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.6,
    weighed=0.0,
)

LACKS = (
    *plates("type:crossing", "stepped plates under the cantilevers", "plate"),
    rigid_feet("type:foot", "plates on mortar", "steel", "mortar"),
)
