"""A satellite's solar wing: a yoke and two sandwich panels on hinges, drawn as a grid."""

from itertools import pairwise

from truths.sections import Section, bar, rectangular_tube
from truths.structure import (
    ALUMINIUM,
    Block,
    Change,
    Clamp,
    Lump,
    Material,
    Member,
    Spring,
    Structure,
)

SKIN, TALL = 0.0015, 0.025  # m, of a panel
LINES = {"L": 0.24, "R": -0.24}  # m along y, of the hinges and of the drawing's strips
HALF = 0.45  # m, half the panels' width
ARM, YOKE, GAP, LONG = 0.2, 0.42, 0.026, 0.84  # m: boom, first hinges, a hinge's length, a panel
STARTS = (YOKE + GAP, YOKE + 2 * GAP + LONG)  # m, of the panels
ROWS = [[start + share * LONG for share in (0.0, 0.5, 1.0)] for start in STARTS]  # m
CORE = Material(0.4e9, 0.3, 60.0)
# The panel as one material of the same bending stiffness and mass (sandwich of thin skins).
INSIDE = 1 - 2 * SKIN / TALL
LIKE = Material(
    round(ALUMINIUM.E * (1 - INSIDE**3) + CORE.E * INSIDE**3, -7),
    0.33,
    round(ALUMINIUM.rho * (1 - INSIDE) + CORE.rho * INSIDE, 1),
)


def _strip(width: float) -> Section:
    """Return a strip of panel that is only drawn, whose seats are small."""
    return Section(0.12, TALL, (), bar(width, TALL).drawn)


def _joints() -> dict[str, tuple[float, float, float]]:
    """Return joints by name: of the yoke, and P, panel, line, row of the panels."""
    found = {"root": (0.0, 0.0, 0.0), "boom": (ARM, 0.0, 0.0)}
    for s, y in LINES.items():
        found |= {f"yoke-{s}": (ARM, y, 0.0), f"hinge-{s}": (YOKE, y, 0.0)}
        found |= {
            f"P{p}{s}{r}": (x, y, 0.0) for p, rows in enumerate(ROWS) for r, x in enumerate(rows)
        }
    return found


STRUCTURE = Structure(
    name="solar-wing",
    title="Solar wing of a satellite: a yoke and two sandwich panels, deployed",
    classes=(
        "after the rule",
        "spacecraft",
        "sandwich",
        "plate as beam",
        "two materials",
        "out of plane",
        "clamped",
    ),
    story="""
Two panels of 840 x 900 mm, skins of 1.5 mm aluminium on a core of 22 mm, hang on a yoke by hinges 40 mm wide,
10 mm thick and 26 mm long, and on each other by two more. The yoke's tubes are 40 x 40 x 3 mm and 40 x 20 x 3 mm.
It is held by a drive, a block of 20 mm with half of aluminium's stiffness, which the drawing takes as rigid.
The drawing has each panel as two strips along and three across, of a material with the sandwich's bending
stiffness; the strips across have no mass. It knows neither the core's shear nor what the strips leave out of a
plate; the inserts of 40 x 40 mm that the hinges end in, the yoke's solid corners and the fittings at the ends
of its legs are not on it.
""",
    materials={
        "aluminium": ALUMINIUM,
        "sandwich": LIKE,
        "light": Material(LIKE.E, LIKE.nu, 1.0),
        "core": CORE,
        "drive": Material(35e9, 0.33, 4000.0),
    },
    sections={
        "boom": rectangular_tube(0.04, 0.04, 0.003),
        "leg": rectangular_tube(0.04, 0.02, 0.003),
        "hinge": bar(0.04, 0.01),
        "along": _strip(HALF),
        "end": _strip(LONG / 4),
        "middle": _strip(LONG / 2),
    },
    joints=_joints(),
    types={name: "hinge" if name[0] == "h" or name[-1] in "02" else "panel" for name in _joints()}
    | {"root": "root", "boom": "tee", "yoke-L": "corner", "yoke-R": "corner"},
    members=(
        Member("boom", ("root", "boom"), "boom", "aluminium", 3),
        *(
            member
            for s in LINES
            for member in (
                Member(
                    f"cross-{s}", ("boom", f"yoke-{s}"), "boom", "aluminium", 3, extend=(0.0, 0.02)
                ),
                Member(f"leg-{s}", (f"yoke-{s}", f"hinge-{s}"), "leg", "aluminium", 3),
                Member(
                    f"hinge-0{s}",
                    (f"hinge-{s}", f"P0{s}0"),
                    "hinge",
                    "aluminium",
                    1,
                    extend=(0.03, 0.04),
                ),
                Member(
                    f"hinge-1{s}",
                    (f"P0{s}2", f"P1{s}0"),
                    "hinge",
                    "aluminium",
                    1,
                    extend=(0.04, 0.04),
                ),
            )
        ),
        *(
            Member(f"panel-{p}{s}{a}", (f"P{p}{s}{a}", f"P{p}{s}{b}"), "along", "sandwich", 4)
            for p in range(2)
            for s in LINES
            for a, b in pairwise(range(3))
        ),
        *(
            Member(
                f"across-{p}{r}",
                (f"P{p}R{r}", f"P{p}L{r}"),
                "middle" if r == 1 else "end",
                "light",
                4,
            )
            for p in range(2)
            for r in range(3)
        ),
    ),
    blocks=(
        *(
            Block(f"panel-{p}", (x, -HALF, low), (x + LONG, HALF, high), kind, first=True)
            for p, x in enumerate(STARTS)
            for low, high, kind in (
                (-TALL / 2, TALL / 2, "aluminium"),
                (SKIN - TALL / 2, TALL / 2 - SKIN, "core"),
            )
        ),
        *(
            Block(
                f"insert-{s}",
                (x, y - 0.02, SKIN - TALL / 2),
                (x + 0.04, y + 0.02, TALL / 2 - SKIN),
                "aluminium",
            )
            for s, y in LINES.items()
            for x in (*STARTS, STARTS[0] + LONG - 0.04)
        ),
        *(
            Block(
                f"fitting-{s}",
                (YOKE - 0.03, y - 0.02, -0.01),
                (YOKE, y + 0.02, 0.01),
                "aluminium",
            )
            for s, y in LINES.items()
        ),
        *(
            Block(
                f"plug-{n}",
                (ARM - 0.02, y - 0.02, -0.02),
                (ARM + 0.02, y + 0.02, 0.02),
                "aluminium",
            )
            for n, y in (("boom", 0.0), *LINES.items())
        ),
        Block("drive", (-0.02, -0.02, -0.02), (0.0, 0.02, 0.02), "drive"),
    ),
    clamps=(Clamp("root", (-0.02, -0.02, -0.02), (-0.02, 0.02, 0.02)),),
    plane="out-of-plane",
    sensors=(
        *((f"P{p}{s}{r}", "z") for p in range(2) for s in LINES for r in range(3)),
        *((f"hinge-{s}", "z") for s in LINES),
        ("boom", "z"),
    ),
    changes=(
        Change("0.5 kg at P1L2", lumps=(Lump("P1L2", 0.5),)),
        Change(
            "0.4 kg at P0R1, cord of 1500 N/m along z at P1R0",
            lumps=(Lump("P0R1", 0.4),),
            springs=(Spring("P1R0", "z", 1500.0),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.16, 0.13),
    graded=False,
    guess=12.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.5,
)
