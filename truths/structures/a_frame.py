"""A trapezoid frame with leaning legs on feet that also resist rotation."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from truths.lacks import LUMP, without_blocks
from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

HALF_BASE, HEIGHT, LEAN = 0.6, 1.3, 0.3  # m, m, and how far a leg leans over its height
WIDTH = 0.052  # m, of a leg, cut along its horizontal
INNER = HALF_BASE - WIDTH / 2
COSINE = 1 / np.hypot(1.0, LEAN)
LEG = rectangular_tube(0.05, WIDTH, 0.003)


def lean(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Move the legs inwards with height; what lies between them shortens."""
    x, y, z = points
    return np.array([x - LEAN * z * np.clip(x / INNER, -1.0, 1.0), y, z])


# A catalogue gives what lies across the leaning axis.
DRAWN = {
    "shape": "rectangular-tube",
    "width": 0.05,
    "height": round(WIDTH * COSINE, 4),
    "wall": 0.003,
}

STRUCTURE = Structure(
    name="a-frame",
    title="A-frame of tubes with leaning legs on soft feet",
    classes=("planar frame", "hollow sections", "leaning members", "soft feet"),
    story="""
Two legs of tube 50 x 50 x 3 mm lean inwards and carry a beam of the same tube; a narrower tie of
44 x 44 x 3 mm joins them below. The feet are plates on thin rubber: the drawing has their stiffness across
and along the floor as the maker of the rubber states it, and takes the feet as hinges, but the plates
resist rotation. The tie's ends sit on walls that bend.
""",
    materials={"steel": STEEL},
    sections={
        "leg": replace(LEG, drawn=DRAWN),
        "beam": rectangular_tube(0.05, 0.05, 0.003),
        "tie": rectangular_tube(0.044, 0.044, 0.003),
    },
    joints={
        "A": (-HALF_BASE, 0.0, 0.0),
        "B": (-HALF_BASE, 0.0, 0.45),
        "C": (-HALF_BASE, 0.0, HEIGHT),
        "D": (HALF_BASE, 0.0, HEIGHT),
        "E": (HALF_BASE, 0.0, 0.45),
        "F": (HALF_BASE, 0.0, 0.0),
    },
    types={"A": "foot", "F": "foot", "B": "tee", "E": "tee", "C": "corner", "D": "corner"},
    members=(
        Member("tie", ("B", "E"), "tie", "steel", 5, weld=0.004),
        Member("leg-left-low", ("A", "B"), "leg", "steel", 4),
        Member("leg-left-high", ("B", "C"), "leg", "steel", 5, weld=0.004),
        Member("leg-right-low", ("F", "E"), "leg", "steel", 4),
        Member("leg-right-high", ("E", "D"), "leg", "steel", 5, weld=0.004),
        Member("beam", ("C", "D"), "beam", "steel", 5, extend=(WIDTH / 2, WIDTH / 2)),
    ),
    blocks=tuple(
        Block(f"foot-{x:g}", (x - WIDTH / 2, -0.025, -0.008), (x + WIDTH / 2, 0.025, 0.0), "steel")
        for x in (-HALF_BASE, HALF_BASE)
    ),
    lumps=(Lump(("beam", 0.35), 2.5),),
    springs=(
        *(Spring(foot, "x", 4e6) for foot in "AF"),
        *(Spring(foot, "z", 9e6) for foot in "AF"),
        *(Spring(foot, "y", 4e6, drawn=False) for foot in "AF"),
        *(Spring(foot, "rx", 2e4, drawn=False) for foot in "AF"),
        *(Spring(foot, "ry", 8e3, drawn=False) for foot in "AF"),
    ),
    plane="in-plane",
    warp=lean,
    sensors=(
        ("A", "xz"),
        (("leg-left-low", 0.5), "x"),
        ("B", "xz"),
        (("leg-left-high", 0.4), "x"),
        (("leg-left-high", 0.7), "x"),
        ("C", "xz"),
        (("beam", 0.5), "z"),
        (("tie", 0.25), "z"),
        (("tie", 0.5), "z"),
        (("tie", 0.75), "z"),
        ("D", "xz"),
        (("leg-right-high", 0.7), "x"),
        (("leg-right-high", 0.4), "x"),
        ("E", "xz"),
        ("F", "xz"),
    ),
    changes=(
        Change("2 kg at the middle of the tie", lumps=(Lump(("tie", 0.5), 2.0),)),
        Change(
            "spring of 8e5 N/m along x at D, 1.5 kg at C",
            lumps=(Lump("C", 1.5),),
            springs=(Spring("D", "x", 8e5),),
        ),
    ),
    used=5,
    held_out=3,
    size=(0.03, 0.021),
    guess=35.0,
    scatter=0.004,
    shape_scatter=0.025,
    together=0.2,
)

LACKS = (without_blocks(LUMP, "type:foot", "plates under the legs", "foot"),)
