"""A lift truck's fork carriage: two tapering forks before two cross bars, on rollers and chains."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, bar
from truths.structure import STEEL, Array, Block, Change, Lump, Member, Spring, Structure

TOP, HEEL, REACH = 0.4, -0.09, 1.05  # m: upper bar over the lower, forks' blades, their length
FORKS = {"L": 0.27, "R": -0.27}  # m along y
HALF, ROLLER = 0.48, 0.4  # m along y: of the bars, of the rollers
DEEP, WIDE, THICK, TIP = 0.04, 0.12, 0.04, 0.35  # m; thickness at the tip as a share
STATIONS = (0.0, 0.35, 0.7, REACH)  # m along a blade
ASIDE = (DEEP + THICK) / 2  # m, a fork's shank before the bars' axes


def tapered(points: Array) -> Array:
    """Return points of even blades where the tapered ones have them; their upper face is even."""
    x, y, z = points
    upper = HEEL + THICK / 2
    share = 1 - (1 - TIP) * np.clip((x - 0.1) / (REACH - 0.1), 0.0, 1.0)
    return np.array([x, y, np.where(z < upper, upper + (z - upper) * share, z)])


def _blade(start: float, end: float) -> Section:
    """Return the even blade, drawn with the thickness at the middle of a length."""
    share = 1 - (1 - TIP) * (start + end) / 2 / REACH
    return replace(bar(WIDE, THICK), drawn=bar(WIDE, round(THICK * share, 4)).drawn)


def _shank() -> Section:
    """Return a fork's upright part before the bars, drawn in their plane."""
    y0, y1, z0, z1, solid = bar(WIDE, THICK).rectangles[0]
    moved = ((y0, y1, z0 + ASIDE, z1 + ASIDE, solid),)
    return replace(bar(WIDE, THICK), height=THICK + 2 * ASIDE, rectangles=moved)


STRUCTURE = Structure(
    name="fork-carriage",
    title="Fork carriage of a lift truck with tapering forks, on rollers and chains",
    classes=(
        "after the rule",
        "lifting gear",
        "cantilevers",
        "tapered members",
        "eccentric joints",
        "on springs",
    ),
    story="""
Two forks hang before two cross bars of 40 x 100 mm, 960 mm long and 400 mm apart: shanks of 120 x 40 mm and
blades 1050 mm long, 40 mm thick at the heel and 14 mm at the tip, flat above. Two plates of 16 mm tie the bars.
Four rollers hold the carriage in the mast along x and y, two chains carry it; all are drawn by their stiffness,
the shift cylinder on the upper bar as a mass. In the drawing shanks and bars lie in one plane, blades begin in it
and are three pieces of even thickness on one line; the plates between the bars are not on it.
""",
    materials={"steel": STEEL},
    sections={
        "bar": bar(DEEP, 0.1),
        "shank": _shank(),
        **{f"blade-{i + 1}": _blade(a, b) for i, (a, b) in enumerate(pairwise(STATIONS))},
    },
    joints={
        f"{c}{n}": (0.0, y, z)
        for c, z in (("U", TOP), ("W", 0.0))
        for n, y in (("l", HALF), ("L", FORKS["L"]), ("m", 0.0), ("R", FORKS["R"]), ("r", -HALF))
    }
    | {f"{s}{i}": (x, y, HEEL) for s, y in FORKS.items() for i, x in enumerate(STATIONS)},
    types={
        f"{c}{n}": t
        for c in "UW"
        for n, t in zip("lLmRr", ("end", "hook", "middle", "hook", "end"), strict=True)
    }
    | {f"{s}{i}": t for s in FORKS for i, t in enumerate(("heel", "blade", "blade", "tip"))},
    members=(
        *(
            Member(f"{name}-{a}{b}", (f"{c}{b}", f"{c}{a}"), "bar", "steel", 3)
            for c, name in (("U", "upper"), ("W", "lower"))
            for a, b in pairwise("lLmRr")
        ),
        *(
            Member(f"shank-{s}", (f"W{s}", f"U{s}"), "shank", "steel", 4, extend=(0.0, 0.05))
            for s in FORKS
        ),
        *(
            Member(f"heel-{s}", (f"{s}0", f"W{s}"), "shank", "steel", 2, extend=(THICK / 2, 0.0))
            for s in FORKS
        ),
        *(
            Member(
                f"blade-{s}{i}",
                (f"{s}{i}", f"{s}{i + 1}"),
                f"blade-{i + 1}",
                "steel",
                3,
                extend=(-DEEP / 2 * (i == 0), 0.0),
            )
            for s in FORKS
            for i in range(3)
        ),
    ),
    blocks=tuple(
        Block(f"tie-{n}", (-0.02, y - 0.008, 0.05), (0.02, y + 0.008, TOP - 0.05), "steel")
        for n, y in (("L", 0.12), ("R", -0.12))
    ),
    lumps=(Lump("Um", 11.0, (0.0, 0.0, 0.05)),),
    springs=(
        *(
            Spring((f"{c}-{a}", 0.5), d, k)
            for c in ("upper", "lower")
            for a in ("lL", "Rr")
            for d, k in (("x", 1.5e7), ("y", 3e6))
        ),
        *(Spring(f"U{s}", "z", 4e6) for s in FORKS),
    ),
    warp=tapered,
    sensors=(
        *((f"{s}{i}", "yz") for s in FORKS for i in (1, 2, 3)),
        *((f"{s}0", "xz") for s in FORKS),
        *((f"{c}{n}", "xz") for c in "UW" for n in "lr"),
        ("Um", "xyz"),
        ("Wm", "xy"),
    ),
    changes=(
        Change("6 kg at R3", lumps=(Lump("R3", 6.0),)),
        Change(
            "5 kg at L2, prop of 4e5 N/m along z at R2",
            lumps=(Lump("L2", 5.0),),
            springs=(Spring("R2", "z", 4e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.036, 0.027),
    graded=False,
    guess=20.0,
    beam="timoshenko",
    scatter=0.005,
    shape_scatter=0.03,
    together=0.5,
)
