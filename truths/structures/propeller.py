"""A wooden propeller of two twisted blades on a hub with a flange, on its shaft."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, bar
from truths.structure import Array, Block, Change, Lump, Material, Member, Spring, Structure

RADIUS, HUB = 0.65, 0.06  # m; half the hub
CHORD, THICK = 0.09, 0.034  # m, of the even bar, as at the hub
STATIONS = (0.0, HUB, 0.2, 0.35, 0.5, RADIUS)  # m from the axis
PLACES = (HUB, 0.2, 0.45, RADIUS)  # m
WIDTHS, DEPTHS = (1.0, 1.25, 1.1, 0.6), (1.0, 0.62, 0.36, 0.22)  # shares there
PITCH = 0.45  # m for each turn
SIDES = {"A": 1.0, "B": -1.0}


def size(radius: Array) -> tuple[Array, Array]:
    """Return the shares of chord and thickness at a radius (m)."""
    return np.interp(radius, PLACES, WIDTHS), np.interp(radius, PLACES, DEPTHS)


def turn(radius: Array) -> Array:
    """Return the blade's angle at a radius (m), which the hub does not have yet."""
    angle = np.arctan2(PITCH, 2 * np.pi * np.maximum(radius, 0.15))
    return np.asarray(angle * np.clip((radius - HUB) / 0.1, 0.0, 1.0))


def carved(points: Array) -> Array:
    """Return points of a straight bar where the carved propeller has them."""
    x, y, z = points
    wide, thick = size(np.abs(x))
    angle = np.sign(x) * turn(np.abs(x))
    blade = np.abs(x) > HUB - 1e-9
    y, z = np.where(blade, y * wide, y), np.where(blade, z * thick, z)
    return np.array(
        [x, y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)]
    )


def _piece(a: float, b: float) -> Section:
    wide, thick = (float(v) for v in size(np.array((a + b) / 2)))
    return replace(
        bar(CHORD, THICK), drawn=bar(round(CHORD * wide, 4), round(THICK * thick, 4)).drawn
    )


def _up(side: str, a: float, b: float) -> tuple[float, float, float]:
    angle = SIDES[side] * float(turn(np.array((a + b) / 2)))
    return (0.0, round(-float(np.sin(angle)), 6), round(float(np.cos(angle)), 6))


STRUCTURE = Structure(
    name="propeller",
    title="Propeller of two twisted blades on a springy shaft",
    classes=("after the rule", "propeller", "blade", "twisted", "tapered members", "on springs"),
    story="""
A propeller of 1.3 m diameter carved of beech in one piece: the hub is 120 mm long, 90 mm wide and 34 mm thick
with steel discs of 90 x 90 x 6 mm on both faces; the blades are up to 112 mm wide, thin out to 7 mm and turn
by the pitch of 450 mm. The hub sits on a shaft whose stiffness is in the drawing. The drawing has five
lengths of constant bar for each blade, each turned to its middle, and knows the nut and spinner of 0.6 kg,
not the discs.
""",
    materials={"beech": Material(13.5e9, 0.33, 710.0), "steel": Material(206e9, 0.3, 7850.0)},
    sections={f"piece-{i}": _piece(a, b) for i, (a, b) in enumerate(pairwise(STATIONS), 1)},
    joints={"hub": (0.0, 0.0, 0.0)}
    | {f"{s}{i}": (m * STATIONS[i], 0.0, 0.0) for s, m in SIDES.items() for i in range(1, 6)},
    types={f"{s}{i}": "tip" if i == 5 else "blade" for s in SIDES for i in range(1, 6)},
    members=tuple(
        Member(
            f"blade-{s}{i}",
            (f"{s}{i - 1}" if i > 1 else "hub", f"{s}{i}"),
            f"piece-{i}",
            "beech",
            3,
            up=(0.0, 0.0, 1.0),
            drawn_up=_up(s, a, b),
        )
        for s in SIDES
        for i, (a, b) in enumerate(pairwise(STATIONS), 1)
    ),
    blocks=tuple(
        Block(f"disc-{name}", (-0.045, -0.045, min(z)), (0.045, 0.045, max(z)), "steel")
        for name, z in (
            ("front", (THICK / 2, THICK / 2 + 0.006)),
            ("rear", (-THICK / 2, -THICK / 2 - 0.006)),
        )
    ),
    lumps=(Lump("hub", 0.6, (0.0, 0.0, 0.04)),),
    springs=tuple(
        Spring("hub", d, k)
        for d, k in (("x", 4e6), ("y", 4e6), ("z", 3e6), ("rx", 6e3), ("ry", 6e3), ("rz", 3e3))
    ),
    warp=carved,
    sensors=(
        ("hub", "xyz"),
        *((f"{s}{i}", "yz") for s in SIDES for i in (2, 3, 4, 5)),
        *(((f"blade-{s}5", 0.5), "z") for s in SIDES),
    ),
    changes=(
        Change("40 g at B5", lumps=(Lump("B5", 0.04),)),
        Change(
            "80 g at A4, spring of 5e3 N/m along z at B3",
            lumps=(Lump("A4", 0.08),),
            springs=(Spring("B3", "z", 5e3),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.032, 0.022),
    graded=False,
    guess=40.0,
    scatter=0.004,
    shape_scatter=0.03,
    together=0.5,
)
