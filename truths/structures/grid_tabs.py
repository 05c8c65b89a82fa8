"""A grid of solid bars on four clamped tabs."""

from dataclasses import replace
from itertools import pairwise

from truths.lacks import STIFFNESS, clamped, plates, without_blocks
from truths.sections import bar
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

XS, YS = (0.0, 0.42, 0.84), (0.0, 0.3, 0.6)  # m, of the bars
TAB = 0.09  # m, from the axis of an edge bar to the end of a tab
WIDTH, HEIGHT = 0.03, 0.024  # m, of the long bars
NAMES = {(i, j): f"{row}{i + 1}" for j, row in enumerate("ABC") for i in range(3)}


def _notch(i: int, j: int, side: int, edge: int) -> Block:
    """Return the edge of a cross bar that its weld to a long bar does not reach."""
    x, y = XS[i], YS[j] + side * (WIDTH / 2 + 0.001)
    low, high = sorted((x + edge * 0.0075, x + edge * 0.0125))
    return Block("notch", (low, y - 0.001, -0.012), (high, y + 0.001, 0.012), "")


STRUCTURE = Structure(
    name="grid-tabs",
    title="Grid of three by three solid bars on four clamped tabs",
    classes=("grid", "solid sections", "out of plane", "clamped"),
    story="""
Three long bars 30 x 24 mm run through; cross bars 25 x 24 mm are butt-welded between them over the middle
15 mm of their width. Plates of 60 x 70 x 5 mm cover the middle crossing above and below. At each corner a
tab of 12 x 24 mm ends in jaws that grip the last 15 mm of it. The drawing has centre lines, welds that hold
over the whole section, and the tabs up to their ends.
""",
    materials={"steel": STEEL},
    sections={"long": bar(WIDTH, HEIGHT), "cross": bar(0.025, HEIGHT), "tab": bar(0.012, HEIGHT)},
    joints={name: (XS[i], YS[j], 0.0) for (i, j), name in NAMES.items()}
    | {f"T{row}1": (-TAB, YS[j], 0.0) for j, row in ((0, "A"), (2, "C"))}
    | {f"T{row}3": (XS[-1] + TAB, YS[j], 0.0) for j, row in ((0, "A"), (2, "C"))},
    types=dict.fromkeys(NAMES.values(), "crossing")
    | {f"T{row}{i}": "support" for row in "AC" for i in (1, 3)},
    members=(
        *(
            Member(
                f"cross-{i + 1}{a}", (NAMES[i, j], NAMES[i, j + 1]), "cross", "steel", 3, weld=0.004
            )
            for i in range(3)
            for j, a in ((0, "A"), (1, "B"))
        ),
        *(Member(f"tab-{row}1", (f"T{row}1", f"{row}1"), "tab", "steel", 2) for row in "AC"),
        *(Member(f"tab-{row}3", (f"{row}3", f"T{row}3"), "tab", "steel", 2) for row in "AC"),
        *(
            Member(
                f"long-{row}{i + 1}",
                (f"{row}{i + 1}", f"{row}{i + 2}"),
                "long",
                "steel",
                4,
                extend=(0.015 * (i == 0), 0.015 * (i == 1)),
            )
            for row in "ABC"
            for i, _ in pairwise(range(3))
        ),
    ),
    blocks=(
        Block("plate-above", (0.39, 0.265, 0.012), (0.45, 0.335, 0.017), "steel"),
        Block("plate-below", (0.39, 0.265, -0.017), (0.45, 0.335, -0.012), "steel"),
        *(
            _notch(i, j, side, edge)
            for i in range(3)
            for j, side in ((0, 1), (1, -1), (1, 1), (2, -1))
            for edge in (-1, 1)
        ),
    ),
    clamps=(
        *(
            Clamp(f"T{row}1", (-TAB, YS[j] - 0.006, -0.012), (-TAB + 0.015, YS[j] + 0.006, 0.012))
            for j, row in ((0, "A"), (2, "C"))
        ),
        *(
            Clamp(
                f"T{row}3",
                (XS[-1] + TAB - 0.015, YS[j] - 0.006, -0.012),
                (XS[-1] + TAB, YS[j] + 0.006, 0.012),
            )
            for j, row in ((0, "A"), (2, "C"))
        ),
    ),
    plane="out-of-plane",
    sensors=(
        *((name, "z") for name in NAMES.values()),
        *(((f"long-{row}{i}", 0.5), "z") for row in "ABC" for i in (1, 2)),
        *(((f"cross-{i}{a}", 0.5), "z") for i in (1, 2, 3) for a in "AB"),
    ),
    changes=(
        Change("5 kg at A2", lumps=(Lump("A2", 5.0),)),
        Change(
            "spring of 4e5 N/m along z at B1, 2 kg at C3",
            lumps=(Lump("C3", 2.0),),
            springs=(Spring("B1", "z", 4e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.02, 0.014),
    guess=80.0,
    scatter=0.002,
    shape_scatter=0.02,
    together=0.5,
)


def _at_its_end(structure: Structure, clamp: Clamp) -> Clamp:
    x = structure.joints[clamp.at][0]
    return replace(clamp, low=(x, *clamp.low[1:]), high=(x, *clamp.high[1:]))


LACKS = (
    *plates("B2", "plates over a crossing", "plate"),
    without_blocks(STIFFNESS, "type:crossing", "welds over a part of the width", "notch"),
    clamped("type:support", "jaws that grip the tabs' ends", _at_its_end),
)
