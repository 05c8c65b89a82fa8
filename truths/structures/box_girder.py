"""A bridge of one concrete box with diaphragms, drawn as one line, on four bearings."""

from dataclasses import replace

from truths.sections import Section, bar, thin_walled
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

SPAN = 24.0  # m
STATIONS = (0.0, 4.0, 8.0, 12.0, 16.0, 20.0, SPAN)  # m
WIDE, DEEP, DECK = 2.4, 1.6, 4.8  # m, box and deck
WEB, FLOOR, SLAB = 0.25, 0.2, 0.22  # m
INNER = WIDE / 2 - WEB  # m, where bearings and sensors are, along y
SHELL = thin_walled(
    (
        (-WIDE / 2, WIDE / 2, 0.0, FLOOR),
        (-WIDE / 2, -INNER, FLOOR, DEEP - SLAB),
        (INNER, WIDE / 2, FLOOR, DEEP - SLAB),
        (-DECK / 2, DECK / 2, DEEP - SLAB, DEEP),
    ),
    2 * WEB * DEEP,
)
LOW = SHELL.rectangles[0][2]  # m, underside of the box


def _closed() -> Section:
    """Return the box with the torsion constant of its middle line (Bredt)."""
    b, h = WIDE - WEB, DEEP - (FLOOR + SLAB) / 2
    J = 4 * (b * h) ** 2 / (b / FLOOR + b / SLAB + 2 * h / WEB)
    return replace(SHELL, drawn={**SHELL.drawn, "J": J})


def _diaphragm(i: int) -> list[Block]:
    """Return a diaphragm with a manhole: thick at the bearings, thin between them."""
    x, thick = STATIONS[i], 0.25
    low, high = (
        (x, x + 0.6) if i == 0 else (x - 0.6, x) if i == 6 else (x - thick / 2, x + thick / 2)
    )
    return [
        Block(
            f"diaphragm-{i}",
            (low, -INNER, LOW + FLOOR),
            (high, INNER, LOW + DEEP - SLAB),
            "concrete",
        ),
        Block(f"manhole-{i}", (low, -0.35, LOW + 0.4), (high, 0.35, LOW + 1.0), ""),
    ]


STRUCTURE = Structure(
    name="box-girder",
    title="Bridge of one concrete box with diaphragms, drawn as one line",
    classes=(
        "after the rule",
        "bridge",
        "box girder",
        "thin plates",
        "eccentric supports",
        "on bearings",
    ),
    story="""
A box 2400 mm wide and 1600 mm deep with webs of 250 mm, a floor of 200 mm and a deck 4800 mm wide and 220 mm
thick spans 24 m. Diaphragms with manholes stand over the bearings and at the middle; the box between them can
lose its shape. A kerb of 300 x 250 mm runs along each edge of the deck. The drawing is one line through the
centroid with Bredt's torsion constant, and has rigid arms to four elastomeric bearings under the webs and to
the places of the sensors on them. Kerbs, diaphragms and what the deck's edges lag behind are not on it.
""",
    materials={"concrete": Material(34e9, 0.2, 2500.0), "link": Material(3.4e11, 0.2, 1.0)},
    sections={"box": _closed(), "link": replace(bar(1.3, 0.5), rectangles=())},
    joints={f"G{i}": (x, 0.0, 0.0) for i, x in enumerate(STATIONS)}
    | {f"D{i}": (STATIONS[i], 0.0, LOW) for i in (0, 6)}
    | {f"{s}{i}": (STATIONS[i], y, LOW) for s, y in (("L", INNER), ("R", -INNER)) for i in (0, 6)}
    | {
        f"{s}{i}": (STATIONS[i], y, 0.0)
        for s, y in (("L", INNER), ("R", -INNER))
        for i in range(1, 6)
    },
    types={f"G{i}": "end" if i in (0, 6) else "station" for i in range(7)}
    | {f"D{i}": "under" for i in (0, 6)}
    | {f"{s}{i}": "bearing" if i in (0, 6) else "web" for s in "LR" for i in range(7)},
    members=(
        *(Member(f"box-{i + 1}", (f"G{i}", f"G{i + 1}"), "box", "concrete", 4) for i in range(6)),
        *(Member(f"drop-{i}", (f"G{i}", f"D{i}"), "link", "link", 1) for i in (0, 6)),
        *(
            Member(
                f"arm-{s}{i}", (f"{'D' if i in (0, 6) else 'G'}{i}", f"{s}{i}"), "link", "link", 1
            )
            for s in "LR"
            for i in range(7)
        ),
    ),
    blocks=(
        *(block for i in (0, 3, 6) for block in _diaphragm(i)),
        *(
            Block(
                f"kerb-{s}",
                (0.0, y - 0.15, LOW + DEEP),
                (SPAN, y + 0.15, LOW + DEEP + 0.25),
                "concrete",
            )
            for s, y in (("L", 2.25), ("R", -2.25))
        ),
    ),
    springs=tuple(
        Spring(f"{s}{i}", d, k)
        for s in "LR"
        for i in (0, 6)
        for d, k in (("x", 4e7), ("y", 8e7), ("z", 1.5e9))
    ),
    sensors=(
        *((f"{s}{i}", "z") for s in "LR" for i in range(7)),
        *((f"L{i}", "y") for i in range(7)),
        ("L0", "x"),
        ("R6", "x"),
    ),
    changes=(
        Change("20 t at L3", lumps=(Lump("L3", 2e4),)),
        Change(
            "12 t at R2, prop of 3e8 N/m along z at L4",
            lumps=(Lump("R2", 1.2e4),),
            springs=(Spring("L4", "z", 3e8),),
        ),
    ),
    beam="timoshenko",
    used=5,
    held_out=4,
    size=(0.47, 0.36),
    graded=False,
    guess=6.0,
    scatter=0.006,
    shape_scatter=0.03,
    together=0.6,
    weighed=0.0,
)
