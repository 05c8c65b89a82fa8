"""A free skew grid of tubes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from truths.sections import rectangular_tube
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure

SLOPE = 0.42  # m along x for each m along y
XS, YS = (0.0, 0.4, 0.9), (-0.36, 0.0, 0.36)  # m, stations before the shear
NAMES = {(i, j): f"{row}{i + 1}" for j, row in enumerate("ABC") for i in range(3)}
COSINE = 1 / np.hypot(1.0, SLOPE)
WIDTH = 0.033  # m, of a cross tube, cut along the long ones


def skew(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Shear the grid along x."""
    x, y, z = points
    return np.array([x + SLOPE * y, y, z])


CROSS = rectangular_tube(WIDTH, 0.044, 0.003)
# A catalogue gives what lies across the skew axis.
DRAWN = {
    "shape": "rectangular-tube",
    "width": round(WIDTH * COSINE, 4),
    "height": 0.044,
    "wall": 0.003,
}

STRUCTURE = Structure(
    name="skew-grid",
    title="Skew grid of rectangular tubes, free",
    classes=("grid", "hollow sections", "skew", "close modes", "out of plane", "free"),
    story="""
Three long tubes 30 x 50 x 3 mm and three cross tubes 30 x 44 x 3 mm that meet them at 67 degrees. The long
tubes run through, the cross tubes are welded onto their side walls, which bend under them. A block of 2.5 kg
stands on one corner; with it the second and third modes lie within 2 %, and skewness couples bending and
twisting in both. The drawing has the block, centre lines and rigid joints.
""",
    materials={"steel": STEEL},
    sections={
        "long": rectangular_tube(0.03, 0.05, 0.003),
        "cross": replace(CROSS, drawn=DRAWN),
    },
    joints={name: (XS[i], YS[j], 0.0) for (i, j), name in NAMES.items()},
    types={name: "edge" if j in (0, 2) else "middle" for (i, j), name in NAMES.items()},
    members=(
        *(
            Member(
                f"cross-{i + 1}{a}", (NAMES[i, j], NAMES[i, j + 1]), "cross", "steel", 3, weld=0.004
            )
            for i in range(3)
            for j, a in ((0, "A"), (1, "B"))
        ),
        *(
            Member(
                f"long-{row}{i + 1}",
                (NAMES[i, j], NAMES[k, j]),
                "long",
                "steel",
                4,
                extend=(0.05 * (i == 0), 0.05 * (k == 2)),
            )
            for j, row in enumerate("ABC")
            for i, k in pairwise(range(3))
        ),
    ),
    plane="out-of-plane",
    sensors=(
        *((name, "z") for name in NAMES.values()),
        *(((f"long-{row}{i}", 0.5), "z") for row in "ABC" for i in (1, 2)),
        *(((f"cross-{i}{a}", 0.5), "z") for i in (1, 3) for a in "AB"),
    ),
    lumps=(Lump("A1", 2.5),),
    changes=(
        Change("2 kg at C2", lumps=(Lump("C2", 2.0),)),
        Change(
            "spring of 2e4 N/m along z at C3, 1.5 kg at B2",
            lumps=(Lump("B2", 1.5),),
            springs=(Spring("C3", "z", 2e4),),
        ),
    ),
    warp=skew,
    used=5,
    held_out=4,
    size=(0.036, 0.025),
    guess=80.0,
    scatter=0.003,
    shape_scatter=0.025,
    together=0.6,
    default=True,
)
