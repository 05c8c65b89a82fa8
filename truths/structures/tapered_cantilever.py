"""A cantilever of a solid bar that tapers in width and depth."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from truths.sections import Section, bar
from truths.structure import ALUMINIUM, Block, Change, Clamp, Lump, Member, Spring, Structure

LENGTH, WIDTH, HEIGHT = 1.4, 0.08, 0.06  # m, sizes at the root
STATIONS = (0.0, 0.35, 0.7, 1.05, LENGTH)  # m
TIP_WIDTH, TIP_HEIGHT = 0.65, 0.35  # of the root's sizes
FOOT = 0.02  # m


def taper(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Narrow the bar towards its tip."""
    x, y, z = points
    share = np.clip(x / LENGTH, 0.0, 1.0)
    return np.array([x, y * (1 - (1 - TIP_WIDTH) * share), z * (1 - (1 - TIP_HEIGHT) * share)])


def _piece(start: float, end: float) -> Section:
    """Return the root's bar, drawn with the sizes at the middle of a piece."""
    middle = np.array([[(start + end) / 2], [WIDTH], [HEIGHT]])
    _, width, height = taper(middle)[:, 0]
    drawn = bar(round(float(width), 4), round(float(height), 4)).drawn
    return replace(bar(WIDTH, HEIGHT), drawn=drawn)


STRUCTURE = Structure(
    name="tapered-cantilever",
    title="Tapered solid cantilever",
    classes=("cantilever", "tapered", "solid sections", "clamped"),
    story="""
An aluminium bar 1.4 m long that narrows from 80 x 60 mm at its root to 52 x 21 mm at its tip, milled from one
piece with a foot of 140 x 120 x 20 mm, held over its whole back. The drawing has four pieces of
constant size from the foot's face on, rigidly clamped, and the 0.6 kg instrument at the tip without the 0.1 kg
screws and plate that hold it, 35 mm above the axis.
""",
    materials={"aluminium": ALUMINIUM},
    sections={f"piece-{i + 1}": _piece(a, b) for i, (a, b) in enumerate(pairwise(STATIONS))},
    joints={f"J{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)},
    types={"J0": "root", "J4": "tip"},
    members=tuple(
        Member(
            f"bar-{i + 1}",
            (f"J{i}", f"J{i + 1}"),
            f"piece-{i + 1}",
            "aluminium",
            4,
            weld=0.004 if i == 0 else 0.0,
        )
        for i in range(4)
    ),
    blocks=(Block("foot", (-FOOT, -0.07, -0.06), (0.0, 0.07, 0.06), "aluminium"),),
    lumps=(Lump("J4", 0.6), Lump("J4", 0.1, (0.0, 0.0, 0.035), drawn=False)),
    clamps=(Clamp("J0", (-FOOT, -0.07, -0.06), (-FOOT, 0.07, 0.06)),),
    sensors=(
        *(((f"bar-{i}", 0.5), "yz") for i in (1, 2, 3, 4)),
        ("J1", "z"),
        ("J2", "yz"),
        ("J3", "yz"),
        ("J4", "yz"),
    ),
    changes=(
        Change("1 kg at J3", lumps=(Lump("J3", 1.0),)),
        Change("spring of 5e4 N/m along z at J4", springs=(Spring("J4", "z", 5e4),)),
    ),
    warp=taper,
    used=4,
    held_out=3,
    size=(0.03, 0.021),
    guess=30.0,
    scatter=0.0015,
    shape_scatter=0.015,
    together=0.5,
)
