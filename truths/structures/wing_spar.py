"""A tapered wing spar with ribs, clamped at its root."""

from dataclasses import replace

import numpy as np

from truths.sections import Section, bar, i_beam
from truths.structure import ALUMINIUM, Array, Change, Clamp, Lump, Member, Spring, Structure

LENGTH, TIP, SWEEP = 1.5, 0.55, 0.18  # m; share of the root's section; m at the tip
STATIONS = (0.0, 0.35, 0.7, 1.05, LENGTH)  # m
NOSE, TAIL, RIB, HEIGHT = 0.1, 0.2, 0.012, 0.068  # m, reach of the ribs; their section
DEPTH, WIDTH, WEB, FLANGE = 0.08, 0.05, 0.005, 0.006  # m, at the root


def bay(i: int) -> Section:
    """Return the section of the solid's even spar, drawn with that of the middle of a bay."""
    even = i_beam(WIDTH, DEPTH, WEB, FLANGE)
    share = 1 - (1 - TIP) * (STATIONS[i - 1] + STATIONS[i]) / 2 / LENGTH
    drawn = i_beam(*(share * size for size in (WIDTH, DEPTH, WEB, FLANGE))).drawn
    return replace(even, drawn=drawn)


def rib(i: int) -> Section:
    """Return the section of the solid's even rib, drawn with the height at its station."""
    share = 1 - (1 - TIP) * STATIONS[i] / LENGTH
    return replace(bar(RIB, HEIGHT), drawn=bar(RIB, share * HEIGHT).drawn)


def tapered(points: Array) -> Array:
    """Return points of the straight even spar where the swept and tapered one has them."""
    along = points[0] / LENGTH
    share = 1 - (1 - TIP) * along
    return np.array([points[0], points[1] * share - SWEEP * along, points[2] * share])


SPAR = tuple(
    Member(
        f"spar-{i}",
        (f"S{i - 1}", f"S{i}"),
        f"spar-{i}",
        "aluminium",
        4,
        extend=(0.0, RIB / 2 * (i == 4)),
    )
    for i in range(1, len(STATIONS))
)
RIBS = tuple(
    Member(f"{side}-{i}", (f"S{i}", f"{side[0].upper()}{i}"), f"rib-{i}", "aluminium", 2)
    for i in range(1, len(STATIONS))
    for side in ("nose", "tail")
)

STRUCTURE = Structure(
    name="wing-spar",
    title="Swept and tapered wing spar with ribs, clamped at the root",
    classes=("wing-like", "tapered members", "open sections", "clamped"),
    story="""
An aluminium spar, an I of 80 x 50 mm at the root that tapers to 55 % in depth, width and wall at the tip and
sweeps back by 180 mm over 1.5 m. Four ribs, bars 12 mm wide, reach 100 mm before and 200 mm behind the spar
at the root's scale; they are milled with the spar from one piece. The drawing steps the spar at the ribs to
one section each, taken at the middle of a bay, and takes the ribs at the scale of their station.
""",
    materials={"aluminium": ALUMINIUM},
    sections={f"spar-{i}": bay(i) for i in range(1, 5)} | {f"rib-{i}": rib(i) for i in range(1, 5)},
    joints={f"S{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {f"N{i}": (x, NOSE, 0.0) for i, x in enumerate(STATIONS) if i}
    | {f"T{i}": (x, -TAIL, 0.0) for i, x in enumerate(STATIONS) if i},
    types={f"S{i}": "rib-root" for i in range(1, 5)}
    | {f"N{i}": "rib-end" for i in range(1, 5)}
    | {f"T{i}": "rib-end" for i in range(1, 5)},
    members=(*RIBS, *SPAR),
    clamps=(Clamp("S0", (0.0, -0.1, -0.1), (0.0, 0.1, 0.1)),),
    warp=tapered,
    sensors=(
        ("S1", "yz"),
        ("S2", "yz"),
        ("S3", "yz"),
        ("S4", "yz"),
        ("N1", "z"),
        ("N2", "z"),
        ("N3", "z"),
        ("N4", "xz"),
        ("T1", "z"),
        ("T2", "z"),
        ("T3", "z"),
        ("T4", "xz"),
    ),
    changes=(
        Change("0.3 kg at T4", lumps=(Lump("T4", 0.3),)),
        Change(
            "0.5 kg at S2, spring of 5e4 N/m along z at S3",
            lumps=(Lump("S2", 0.5),),
            springs=(Spring("S3", "z", 5e4),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.018, 0.0128),
    graded=False,
    guess=20.0,
    scatter=0.004,
    shape_scatter=0.03,
)
