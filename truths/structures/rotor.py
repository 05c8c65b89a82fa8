"""A stepped rotor with three discs in two bearings on soft seats."""

from dataclasses import replace

import numpy as np

from truths.sections import Section, bar, round_bar, rounded
from truths.structure import STEEL, Array, Block, Change, Lump, Material, Member, Spring, Structure

STATIONS = (0.0, 0.09, 0.24, 0.26, 0.42, 0.45, 0.6, 0.74, 0.76)  # m, along the shaft
THICK = (0.028, 0.056, 0.168, 0.056, 0.112, 0.056, 0.028, 0.168)  # m, diameter of each length
BEARINGS = {"P1": (2.2e6, 3.5e6), "P6": (2.8e6, 4.2e6)}  # N/m along y and z
TURN = {"P1": 1.5e3, "P6": 1.5e3}  # N m/rad, of a bearing as wide as it is
HALF = {d: round_bar(d).width / 2 for d in (0.056, 0.084)}  # m
RIMS = {"rim-1": ("P3", 0.07), "rim-3": ("P8", 0.084)}  # off the axis: the disc's joint, m
FLAT = np.pi / 4  # of its width is left of what lies far from the axis when squares are rounded
LINK = Section(
    0.04, 0.04, (), {"A": 1e-3, "Iy": 1e-7, "Iz": 1e-7, "J": 2e-7, "Jp": 2e-7, "kappa": 0.8}
)
PIN = round_bar(0.028).width / 2  # m, half the finger's width before it is turned
FINGER = replace(
    bar(0.02, round(2 * FLAT * PIN, 4)),
    rectangles=((0.0, 0.02, -PIN, PIN, True),),
    width=0.04,
    height=2 * PIN,
)


def turned(points: Array) -> Array:
    """Return points of squares along x as turned on a lathe."""
    return np.array([points[0], *rounded(points[1], points[2])])


def _collar(name: str, x: float, length: float, diameter: float) -> Block:
    half = HALF[diameter]
    return Block(name, (x, -half, -half), (x + length, half, half), "steel")


STRUCTURE = Structure(
    name="rotor",
    title="Stepped rotor with three discs in bearings on soft seats",
    classes=("after the rule", "rotor", "round sections", "stepped shaft", "soft feet"),
    story="""
A shaft of 28 and 56 mm diameter carries discs of 168 x 20 mm and 112 x 30 mm between its bearings and one of
168 x 20 mm at its overhanging end, from whose rim a driving finger of 20 x 23 mm stands out, all of one
piece; it turns in two bearings whose rubber seats are stiffer upright than sideways. Hubs of 84 mm and a nut
of 56 mm diameter stand at the discs. The drawing has the steps of the shaft, the discs as short thick lengths
and the seats' catalogue stiffness; it leaves out the hubs, the nut, and that a bearing of some width also
resists tilting.
""",
    materials={"steel": STEEL, "link": Material(2e11, 0.3, 1.0)},
    sections={f"d{round(1000 * d)}": round_bar(d) for d in sorted(set(THICK))}
    | {
        "link": LINK,
        "driver": FINGER,
    },
    joints={f"P{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {name: (STATIONS[int(at[1])], y, 0.0) for name, (at, y) in RIMS.items()}
    | {"driver": (STATIONS[8], 0.13, 0.0)},
    types={"P0": "end", "P8": "end", "P1": "bearing", "P6": "bearing"}
    | {f"P{i}": "disc-side" for i in (2, 3, 4, 5, 7)}
    | {**dict.fromkeys(RIMS, "rim"), "driver": "end"},
    members=tuple(
        Member(
            f"part-{i + 1}",
            (f"P{i}", f"P{i + 1}"),
            f"d{round(1000 * d)}",
            "steel",
            2 if d > 0.1 else 4,
        )
        for i, d in enumerate(THICK)
    )
    + tuple(Member(f"link-{name}", (at, name), "link", "link", 1) for name, (at, _) in RIMS.items())
    + (Member("driver", ("rim-3", "driver"), "driver", "steel", 2),),
    blocks=(
        _collar("hub-1", 0.215, 0.025, 0.084),
        _collar("hub-2", 0.45, 0.02, 0.084),
        _collar("nut", 0.72, 0.02, 0.056),
    ),
    springs=(
        *(
            Spring(at, d, k)
            for at, pair in BEARINGS.items()
            for d, k in zip("yz", pair, strict=True)
        ),
        *(Spring(at, d, k, drawn=False) for at, k in TURN.items() for d in ("ry", "rz")),
        Spring("P1", "x", 3e6),
    ),
    warp=turned,
    beam="timoshenko",
    sensors=(
        ("P0", "xyz"),
        ("P1", "yz"),
        (("part-2", 0.5), "yz"),
        (("part-3", 0.5), "yz"),
        (("part-4", 0.5), "yz"),
        (("part-5", 0.5), "yz"),
        (("part-6", 0.5), "yz"),
        ("P6", "yz"),
        ("P8", "yz"),
        ("rim-1", "z"),
        (("driver", 0.5), "x"),
        ("driver", "xz"),
    ),
    changes=(
        Change("2 kg at P7", lumps=(Lump("P7", 2.0),)),
        Change(
            "1.5 kg at part-4@0.5, spring of 3e6 N/m along y at P0",
            lumps=(Lump(("part-4", 0.5), 1.5),),
            springs=(Spring("P0", "y", 3e6),),
        ),
    ),
    used=5,
    held_out=4,
    size=(0.065, 0.045),
    guess=80.0,
    scatter=0.004,
    shape_scatter=0.03,
    together=0.5,
)
