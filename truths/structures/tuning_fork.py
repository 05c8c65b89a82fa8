"""A big tuning fork on a stem, bent of a bar and held in a jaw."""

import numpy as np

from truths.sections import bar
from truths.structure import ALUMINIUM, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

RADIUS, TINE, STEM = 0.06, 0.5, 0.16  # m
ARC = RADIUS * np.pi / 2  # m, from the crown to where a tine begins
WIDE, THICK = 0.03, 0.022  # m
JAW = 0.05  # m, of the stem in the jaw
MIRROR = {"L": -1.0, "R": 1.0}


def bent(points: Array) -> Array:
    """Return points of a straight bar with a stem below where the fork has them."""
    x, y, z = points
    turn = np.clip(x, -ARC, ARC) / RADIUS
    beyond = np.sign(x) * np.maximum(np.abs(x) - ARC, 0.0)
    out = (RADIUS - z) * np.sin(turn)
    up = RADIUS - (RADIUS - z) * np.cos(turn) + np.abs(beyond)
    # The stem keeps its width below the bar, whose outer face it is cut to.
    stem = np.abs(x) < 0.03
    fade = np.clip((-THICK / 2 - z) / 0.02, 0.0, 1.0) * stem
    return np.array([(1 - fade) * out + fade * x, y, (1 - fade) * up + fade * z])


STRUCTURE = Structure(
    name="tuning-fork",
    title="Tuning fork bent of a bar, its stem in a jaw",
    classes=(
        "after the rule",
        "fork",
        "curved members",
        "solid sections",
        "close modes",
        "clamped",
    ),
    story="""
An aluminium bar 30 x 22 mm is bent to a U of 60 mm radius with tines of 500 mm. A stem of 24 x 24 mm, 160 mm
long below the bar's middle line, is welded under the crown with a fillet block of 50 mm; a jaw holds its last
50 mm. The drawing clamps the stem where the jaw begins, takes the bend as four straight pieces, and has the
screw of 80 g at one tine's end, but not the fillet nor the notch of 4 mm filed into the crown's inner side to
tune it.
""",
    materials={"aluminium": ALUMINIUM},
    sections={"bar": bar(WIDE, THICK), "stem": bar(0.024, 0.024)},
    joints={
        "crown": (0.0, 0.0, 0.0),
        "foot": (0.0, 0.0, -STEM),
        **{f"{s}1": (m * ARC / 2, 0.0, 0.0) for s, m in MIRROR.items()},
        **{f"{s}2": (m * ARC, 0.0, 0.0) for s, m in MIRROR.items()},
        **{f"{s}3": (m * (ARC + TINE / 2), 0.0, 0.0) for s, m in MIRROR.items()},
        **{f"{s}4": (m * (ARC + TINE), 0.0, 0.0) for s, m in MIRROR.items()},
    },
    types={"foot": "foot"}
    | {
        f"{s}{i}": kind for s in MIRROR for i, kind in enumerate(("bend", "bend", "tine", "end"), 1)
    },
    members=(
        Member("stem", ("foot", "crown"), "stem", "aluminium", 3, extend=(JAW, 0.0)),
        *(
            Member(f"{name}-{s}", (start.format(s), f"{s}{i}"), "bar", "aluminium", n)
            for s in MIRROR
            for i, (name, start, n) in enumerate(
                (
                    ("bend-1", "crown", 2),
                    ("bend-2", "{}1", 2),
                    ("tine-1", "{}2", 4),
                    ("tine-2", "{}3", 4),
                ),
                1,
            )
        ),
    ),
    blocks=(
        Block("fillet", (-0.025, -0.012, -0.03), (0.025, 0.012, -THICK / 2), "aluminium"),
        Block("notch", (-0.004, -WIDE / 2, THICK / 2 - 0.004), (0.004, WIDE / 2, THICK / 2), ""),
    ),
    lumps=(Lump("R4", 0.08),),
    clamps=(Clamp("foot", (-0.1, -0.1, -STEM - JAW), (0.1, 0.1, -STEM)),),
    warp=bent,
    sensors=(
        ("crown", "xy"),
        *((f"{s}2", "xy") for s in MIRROR),
        *(((f"tine-1-{s}", 0.5), "xy") for s in MIRROR),
        *((f"{s}3", "xy") for s in MIRROR),
        *(((f"tine-2-{s}", 0.5), "xy") for s in MIRROR),
        *((f"{s}4", "xy") for s in MIRROR),
    ),
    changes=(
        Change("0.1 kg at L4", lumps=(Lump("L4", 0.1),)),
        Change(
            "0.15 kg at R3, spring of 2e4 N/m along x at L3",
            lumps=(Lump("R3", 0.15),),
            springs=(Spring("L3", "x", 2e4),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.022, 0.015),
    guess=50.0,
    scatter=0.001,
    shape_scatter=0.015,
    together=0.3,
)
