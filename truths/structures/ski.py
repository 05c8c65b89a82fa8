"""A ski: a wooden core between aluminium sheets, waisted, thin at its ends, with a binding plate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, bar
from truths.structure import (
    ALUMINIUM,
    Array,
    Block,
    Change,
    Lump,
    Material,
    Member,
    Spring,
    Structure,
)

LENGTH, WIDE, THICK = 1.6, 0.09, 0.02  # m, of the even straight sandwich
SHEET = 0.0016  # m, each of the two
STATIONS = (0.0, 0.15, 0.35, 0.6, 0.85, 1.1, 1.35, LENGTH)  # m
PLACES, WIDTHS = (0.0, 0.12, 0.7, 1.4, LENGTH), (0.8, 1.1, 0.78, 1.2, 0.7)  # shares of WIDE
HEIGHTS = (0.4, 0.5, 1.0, 0.45, 0.35)  # shares of the core's thickness
CAMBER, TIP = 0.012, 0.07  # m
WOOD = Material(11e9, 0.35, 620.0)


def pressed(points: Array) -> Array:
    """Return points of the even straight sandwich in the shape of the press."""
    x, y, z = points
    core = (THICK - 2 * SHEET) / 2
    inside = np.clip(z, -core, core)
    height = inside * np.interp(x, PLACES, HEIGHTS) + (z - inside)
    bow = CAMBER * np.sin(np.pi * np.clip(x / 1.4, 0.0, 1.0))
    up = TIP * (np.maximum(x - 1.35, 0.0) / 0.25) ** 2
    return np.array([x, y * np.interp(x, PLACES, WIDTHS), height + bow + up])


def _piece(start: float, end: float) -> Section:
    """Return the sandwich, drawn as an aluminium section of equal bending stiffness and area."""
    middle = (start + end) / 2
    wide = WIDE * float(np.interp(middle, PLACES, WIDTHS))
    core = (THICK - 2 * SHEET) * float(np.interp(middle, PLACES, HEIGHTS))
    share, deep = WOOD.E / ALUMINIUM.E, core + 2 * SHEET
    area = wide * (2 * SHEET + core * WOOD.rho / ALUMINIUM.rho)
    Iy = wide * (deep**3 - core**3 * (1 - share)) / 12
    Iz = (2 * SHEET + share * core) * wide**3 / 12
    J = 4 * (wide * (core + SHEET)) ** 2 / (2 * wide / SHEET + 2 * core * 26e9 / 0.5e9 / wide)
    drawn = {"A": area, "Iy": Iy, "Iz": Iz, "J": min(J, 4 * Iy), "Jp": Iy + Iz, "kappa": 0.6}
    return replace(bar(WIDE, THICK), drawn=drawn)


STRUCTURE = Structure(
    name="ski",
    title="Ski of wood between aluminium sheets with a binding plate, free",
    classes=("after the rule", "strip", "sandwich", "two materials", "tapered members", "free"),
    story="""
A ski 1.6 m long: a core of ash, 17 mm thick under the boot and 6 mm at the ends, between aluminium sheets of
1.6 mm; 70 mm wide at its waist and up to 108 mm at the shovel, with a camber of 12 mm and an upturned tip. A
binding plate of 300 x 60 x 5 mm is glued onto its middle. The drawing is a polygon of seven lengths, each
with the handbook's stiffness and mass of its middle; it has the binding's two lumps without the plate. Only
bending across the snow is tested.
""",
    materials={"aluminium": ALUMINIUM, "wood": WOOD},
    sections={f"piece-{i + 1}": _piece(a, b) for i, (a, b) in enumerate(pairwise(STATIONS))},
    joints={f"J{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)},
    types={"J0": "tail", "J7": "tip"},
    members=tuple(
        Member(f"ski-{i + 1}", (f"J{i}", f"J{i + 1}"), f"piece-{i + 1}", "aluminium", 3)
        for i in range(7)
    ),
    blocks=(
        *(
            Block(
                f"core-{i}",
                (a, -WIDE / 2, SHEET - THICK / 2),
                (b, WIDE / 2, THICK / 2 - SHEET),
                "wood",
            )
            for i, (a, b) in enumerate(pairwise(STATIONS), 1)
        ),
        Block("plate", (0.45, -0.038, THICK / 2), (0.75, 0.038, THICK / 2 + 0.005), "aluminium"),
    ),
    lumps=(Lump(("ski-3", 0.6), 0.45), Lump(("ski-4", 0.4), 0.35)),
    plane="in-plane",
    warp=pressed,
    sensors=(
        *((f"J{i}", "z") for i in range(8)),
        *(((f"ski-{i}", 0.5), "z") for i in (3, 4, 5, 6)),
    ),
    changes=(
        Change("0.3 kg at J7", lumps=(Lump("J7", 0.3),)),
        Change(
            "0.2 kg at J0, spring of 6e3 N/m along z at J5",
            lumps=(Lump("J0", 0.2),),
            springs=(Spring("J5", "z", 6e3),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.06, 0.04),
    graded=False,
    guess=15.0,
    scatter=0.004,
    shape_scatter=0.02,
    together=0.4,
)
