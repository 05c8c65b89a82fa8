"""A connecting rod with an I-shaped shank between two eyes, free."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truths.sections import Section, bar, i_beam
from truths.structure import STEEL, Array, Block, Change, Lump, Material, Member, Spring, Structure

LENGTH = 0.36  # m, between the eyes' centres
BIG, SMALL = 0.055, 0.034  # m, half the size of the eyes
HOLE = {"big": 0.034, "small": 0.018}  # m, half of it
THICK = {"big": 0.036, "small": 0.04}  # m
STATIONS = (-BIG, 0.0, BIG, 0.13, 0.21, 0.28, LENGTH - SMALL, LENGTH, LENGTH + SMALL)  # m
DEEP, WIDE, WEB, FLANGE = 0.052, 0.03, 0.008, 0.009  # m, of the shank at the big eye
END = 0.65  # of these sizes are left at the small eye


def forged(points: Array) -> Array:
    """Return points of an even shank where the tapered one has them."""
    x, y, z = points
    share = np.clip((x - BIG) / (LENGTH - SMALL - BIG), 0.0, 1.0)
    # The eyes keep their shape: only what lies between them narrows.
    between = (x > BIG - 1e-9) & (x < LENGTH - SMALL + 1e-9)
    size = np.where(between, 1 - (1 - END) * share, 1.0)
    return np.array([x, y, z * size])


def _shank(start: float, end: float) -> Section:
    share = ((start + end) / 2 - BIG) / (LENGTH - SMALL - BIG)
    grow = 1 - (1 - END) * share
    drawn = i_beam(WIDE, DEEP * grow, WEB, FLANGE * grow).drawn
    return replace(i_beam(WIDE, DEEP, WEB, FLANGE), drawn=drawn)


def _eye(name: str, half: float) -> Section:
    """Return an eye's section, drawn with the share of a bar that its opening leaves."""
    thick, deep = THICK[name], 2 * half
    share = 1 - 3 * HOLE[name] ** 2 / deep**2
    Iy, Iz = share * thick * deep**3 / 12, share * deep * thick**3 / 12
    J = share * 0.25 * thick**3 * deep
    drawn = {"A": share * thick * deep, "Iy": Iy, "Iz": Iz, "J": J, "Jp": Iy + Iz, "kappa": 0.6}
    return replace(bar(thick, 2 * half), drawn=drawn)


def _hole(name: str, x: float) -> tuple[Block, ...]:
    """Return the blocks that cut a hole with bevelled corners."""
    reach, bevel = HOLE[name], HOLE[name] / 2
    return tuple(
        Block(f"hole-{name}-{i}", (x - a, -0.05, -b), (x + a, 0.05, b), "")
        for i, (a, b) in enumerate(((reach, bevel), (bevel, reach)))
    )


NAMES = ("cap-big", "eye-big", "shank-1", "shank-2", "shank-3", "shank-4", "eye-small", "cap-small")
LINK = Section(
    0.036, 0.04, (), {"A": 1e-3, "Iy": 1e-7, "Iz": 1e-7, "J": 2e-7, "Jp": 2e-7, "kappa": 0.8}
)
LUG = 0.03  # m, height of a balancing lug
LUGS = {"big": ("J1", 0.0, BIG), "small": ("J7", LENGTH, SMALL)}  # eye: joint, place, half size

STRUCTURE = Structure(
    name="connecting-rod",
    title="Connecting rod with an I-shaped shank, free",
    classes=("after the rule", "machine part", "stubby members", "open sections", "free"),
    story="""
A forged steel rod, 360 mm between the centres of its eyes. The shank is an I of 52 x 30 mm at the big eye and
34 x 30 mm at the small one; the eyes are square rings around cross-shaped openings of 68 and 36 mm; balancing
lugs of 30 mm height stand on both. The drawing has four lengths of constant I on the centre line, each eye as
a bar with the share of metal that its opening leaves, and the lugs on stiff links.
""",
    materials={"steel": STEEL, "link": Material(2e11, 0.3, 1.0)},
    sections={
        "eye-big": _eye("big", BIG),
        "eye-small": _eye("small", SMALL),
        **{f"shank-{i}": _shank(*ends) for i, ends in enumerate(list(pairwise(STATIONS))[2:6], 1)},
        "link": LINK,
        **{f"lug-{name}": bar(WIDE, HOLE[name]) for name in LUGS},
    },
    joints={f"J{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {f"side-{name}": (x, 0.0, half) for name, (_, x, half) in LUGS.items()}
    | {f"lug-{name}": (x, 0.0, half + LUG) for name, (_, x, half) in LUGS.items()},
    types={"J1": "eye", "J7": "eye", "J2": "neck", "J6": "neck", "J0": "cap", "J8": "cap"}
    | {f"side-{name}": "lug-root" for name in LUGS}
    | {f"lug-{name}": "lug-end" for name in LUGS},
    members=tuple(
        Member(
            name,
            (f"J{i}", f"J{i + 1}"),
            name.replace("cap", "eye"),
            "steel",
            3 if "shank" in name else 2,
        )
        for i, name in enumerate(NAMES)
    )
    + tuple(
        member
        for name, (joint, *_) in LUGS.items()
        for member in (
            Member(f"link-{name}", (joint, f"side-{name}"), "link", "link", 1),
            Member(f"lug-{name}", (f"side-{name}", f"lug-{name}"), f"lug-{name}", "steel", 1),
        )
    ),
    blocks=(*_hole("big", 0.0), *_hole("small", LENGTH)),
    warp=forged,
    beam="timoshenko",
    sensors=(
        ("J0", "yz"),
        *((f"J{i}", "yz") for i in (1, 2, 3, 4, 5, 6, 7)),
        ("J8", "yz"),
        *((f"lug-{name}", "xy") for name in LUGS),
    ),
    changes=(
        Change("0.4 kg at J2", lumps=(Lump("J2", 0.4),)),
        Change(
            "0.2 kg at J6, spring of 2e6 N/m along y at J4",
            lumps=(Lump("J6", 0.2),),
            springs=(Spring("J4", "y", 2e6),),
        ),
    ),
    used=3,
    held_out=3,
    size=(0.026, 0.018),
    graded=False,
    guess=900.0,
    scatter=0.002,
    shape_scatter=0.02,
    together=0.4,
)
