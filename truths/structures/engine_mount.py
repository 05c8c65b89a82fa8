"""An engine bracket with two splayed legs on rubber bushes, an engine's foot on its head."""

import numpy as np

from truths.sections import bar, rectangular_tube
from truths.structure import STEEL, Array, Block, Change, Lump, Member, Spring, Structure

HEIGHT, SPREAD, HEAD = 0.28, 0.13, 0.3  # m; half the distance of the legs; overhang of the head
LEAN = 0.3  # m sideways for each m of height
DEEP = 0.05  # m, of the legs


def splayed(points: Array) -> Array:
    """Return points of upright legs where the splayed ones have them."""
    x, y, z = points
    share = np.clip((HEIGHT - DEEP / 2 - z) / (HEIGHT - DEEP / 2), 0.0, 1.0)
    return np.array([x, y + LEAN * HEIGHT * share * np.clip(y / (SPREAD - 0.02), -1.0, 1.0), z])


STRUCTURE = Structure(
    name="engine-mount",
    title="Engine bracket with two splayed legs on rubber bushes",
    classes=(
        "after the rule",
        "bracket",
        "leaning members",
        "hollow sections",
        "soft feet",
        "lumps",
    ),
    story="""
Two legs of tube 50 x 50 x 4 mm, splayed by 17 degrees, meet a cross tube of 50 x 50 x 4 mm with gussets of 6
mm on both faces; a head of bar 40 x 50 mm reaches 300 mm forward from the cross tube's middle, passes through
it and carries 9 kg of the engine 60 mm above its axis. The legs stand on sole plates of 80 x 80 x 10 mm on
rubber bushes, which also resist tilting. The drawing has centre lines, soles, the engine's share, and the
bushes' three catalogue stiffnesses; it leaves out gussets and tilting.
""",
    materials={"steel": STEEL},
    sections={
        "leg": rectangular_tube(0.05, DEEP, 0.004),
        "cross": rectangular_tube(0.05, 0.05, 0.004),
        "sole": bar(0.08, 0.08),
        "head": bar(0.04, 0.05),
    },
    joints={
        "sole-L": (0.0, SPREAD, -0.01),
        "sole-R": (0.0, -SPREAD, -0.01),
        "foot-L": (0.0, SPREAD, 0.0),
        "foot-R": (0.0, -SPREAD, 0.0),
        "L": (0.0, SPREAD, HEIGHT),
        "R": (0.0, -SPREAD, HEIGHT),
        "M": (0.0, 0.0, HEIGHT),
        "head": (HEAD, 0.0, HEIGHT),
    },
    types={"L": "corner", "R": "corner", "M": "tee", "head": "end"}
    | {f"foot-{s}": "foot" for s in "LR"}
    | {f"sole-{s}": "sole" for s in "LR"},
    members=(
        Member("cross-R", ("R", "M"), "cross", "steel", 3, extend=(0.025, 0.0)),
        Member("cross-L", ("M", "L"), "cross", "steel", 3, extend=(0.0, 0.025)),
        *(
            Member(f"leg-{s}", (f"foot-{s}", s), "leg", "steel", 4, up=(0.0, 1.0, 0.0))
            for s in "LR"
        ),
        *(Member(f"sole-{s}", (f"foot-{s}", f"sole-{s}"), "sole", "steel", 1) for s in "LR"),
        Member("head", ("M", "head"), "head", "steel", 4),
    ),
    blocks=(
        Block(
            "hollow",
            (-0.021, -SPREAD - 0.025, HEIGHT - 0.021),
            (0.021, SPREAD + 0.025, HEIGHT + 0.021),
            "",
        ),
        Block("through", (-0.031, -0.02, HEIGHT - 0.025), (0.025, 0.02, HEIGHT + 0.025), "steel"),
        *(
            Block(
                f"gusset-{s}-{face}",
                (x, min(sign * 0.06, sign * 0.155), HEIGHT - 0.08),
                (x + 0.006, max(sign * 0.06, sign * 0.155), HEIGHT + 0.02),
                "steel",
            )
            for s, sign in (("L", 1.0), ("R", -1.0))
            for face, x in (("rear", -0.031), ("front", 0.025))
        ),
    ),
    lumps=(Lump("head", 9.0, (0.0, 0.0, 0.06)),),
    springs=(
        *(
            Spring(f"foot-{s}", d, k)
            for s in "LR"
            for d, k in (("x", 1.5e6), ("y", 1.5e6), ("z", 6e6), ("ry", 1.2e4))
        ),
        *(Spring(f"foot-{s}", d, 3e3, drawn=False) for s in "LR" for d in ("rx", "rz")),
    ),
    warp=splayed,
    sensors=(
        *((f"foot-{s}", "xyz") for s in "LR"),
        *(((f"leg-{s}", 0.5), "xy") for s in "LR"),
        *((s, "xyz") for s in "LR"),
        ("M", "xz"),
        (("head", 0.5), "yz"),
        ("head", "yz"),
    ),
    changes=(
        Change("3 kg at M", lumps=(Lump("M", 3.0),)),
        Change(
            "2 kg at L, spring of 2e6 N/m along y at head",
            lumps=(Lump("L", 2.0),),
            springs=(Spring("head", "y", 2e6),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.036, 0.025),
    graded=False,
    guess=20.0,
    scatter=0.006,
    shape_scatter=0.03,
    together=0.5,
)
