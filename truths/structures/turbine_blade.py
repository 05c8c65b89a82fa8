"""A tapered and twisted blade with a root block."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, thin_walled
from truths.structure import (
    STEEL,
    Array,
    Block,
    Change,
    Clamp,
    Lump,
    Material,
    Member,
    Spring,
    Structure,
)

SPAN, CHORD, THICK = 0.42, 0.08, 0.014  # m, of the root's profile
TWIST, NARROW, THIN = (
    np.radians(38.0),
    0.6,
    0.4,
)  # over the span; tip's sizes in shares of the root's
STATIONS = (0.0, 0.07, 0.14, 0.21, 0.28, 0.35, SPAN)  # m
LINK = Section(
    0.03, 0.03, (), {"A": 1e-3, "Iy": 1e-7, "Iz": 1e-7, "J": 2e-7, "Jp": 2e-7, "kappa": 0.8}
)


def twisted(points: Array) -> Array:
    """Return points of an even straight blade where the tapered and twisted one has them."""
    x, y, z = points
    share = np.clip(x / SPAN, 0.0, 1.0)
    wide, thick = y * (1 - (1 - NARROW) * share), z * (1 - (1 - THIN) * share)
    turn = TWIST * share
    return np.array(
        [x, wide * np.cos(turn) - thick * np.sin(turn), wide * np.sin(turn) + thick * np.cos(turn)]
    )


def profile(wide: float = 1.0, thick: float = 1.0) -> Section:
    """Return a profile of five strips, thickest before its middle."""
    edges = [CHORD * wide * share for share in (0.0, 0.12, 0.4, 0.65, 0.85, 1.0)]
    depths = [THICK * thick * share for share in (0.6, 1.0, 0.85, 0.6, 0.35)]
    strips = [(a, b, -d / 2, d / 2) for (a, b), d in zip(pairwise(edges), depths, strict=True)]
    section = thin_walled(tuple(strips), 0.8 * CHORD * wide * THICK * thick)
    # J of a thin profile is the sum of b t^3 / 3 along the chord, not across it.
    J = sum((b - a) * (d - c) ** 3 / 3 for a, b, c, d in strips)
    return replace(section, drawn={**section.drawn, "J": J})


def _piece(start: float, end: float) -> Section:
    share = (start + end) / 2 / SPAN
    drawn = profile(1 - (1 - NARROW) * share, 1 - (1 - THIN) * share).drawn
    return replace(profile(), drawn=drawn)


def _up(start: float, end: float) -> tuple[float, float, float]:
    turn = TWIST * (start + end) / 2 / SPAN
    return (0.0, round(-float(np.sin(turn)), 6), round(float(np.cos(turn)), 6))


EDGES = {  # m along the chord, at the middle of the first and of the last strip
    name: sum(profile().rectangles[i][:2]) / 2 for name, i in (("front", 0), ("rear", -1))
}

STRUCTURE = Structure(
    name="turbine-blade",
    title="Tapered and twisted blade with a root block",
    classes=("after the rule", "blade", "tapered members", "twisted", "solid sections", "clamped"),
    story="""
A steel blade of 420 mm span, milled with its root block of 20 x 90 x 40 mm, which is brazed to a wall by its
back; a neck of 48 x 16 mm, 26 mm long, stands between it and the blade's platform of 4 mm. The profile
narrows from 80 x 14 mm to 48 x 5.6 mm and turns by 38 degrees. The drawing has six lengths of constant
profile, each turned to its middle, clamped rigidly at the platform.
""",
    materials={"steel": STEEL, "link": Material(2e11, 0.3, 1.0)},
    sections={f"piece-{i + 1}": _piece(a, b) for i, (a, b) in enumerate(pairwise(STATIONS))}
    | {"link": LINK},
    joints={f"J{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {f"{name}-{i}": (STATIONS[i], y, 0.0) for name, y in EDGES.items() for i in (4, 6)},
    types={"J0": "root", "J6": "tip"} | {f"{name}-{i}": "edge" for name in EDGES for i in (4, 6)},
    members=tuple(
        Member(
            f"blade-{i + 1}",
            (f"J{i}", f"J{i + 1}"),
            f"piece-{i + 1}",
            "steel",
            3,
            drawn_up=_up(a, b),
        )
        for i, (a, b) in enumerate(pairwise(STATIONS))
    )
    + tuple(
        Member(f"link-{name}-{i}", (f"J{i}", f"{name}-{i}"), "link", "link", 1)
        for name in EDGES
        for i in (4, 6)
    ),
    blocks=(
        Block("platform", (-0.004, -0.05, -0.03), (0.0, 0.05, 0.03), "steel"),
        Block("neck", (-0.03, -0.024, -0.008), (-0.004, 0.024, 0.008), "steel"),
        Block("block", (-0.05, -0.045, -0.02), (-0.03, 0.045, 0.02), "steel"),
    ),
    clamps=(Clamp("J0", (-0.05, -0.045, -0.02), (-0.05, 0.045, 0.02)),),
    warp=twisted,
    beam="timoshenko",
    sensors=(
        *((f"J{i}", "yz") for i in (2, 3, 4, 5, 6)),
        *((f"{name}-{i}", "z") for name in EDGES for i in (4, 6)),
    ),
    changes=(
        Change("50 g at J6", lumps=(Lump("J6", 0.05),)),
        Change(
            "0.1 kg at J3, spring of 5e4 N/m along z at J5",
            lumps=(Lump("J3", 0.1),),
            springs=(Spring("J5", "z", 5e4),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.024, 0.018),
    graded=False,
    guess=50.0,
    scatter=0.003,
    shape_scatter=0.02,
    together=0.4,
    weighed=0.0,
)
