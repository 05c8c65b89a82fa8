"""A bell crank with two tapered arms on a bush, held by a link."""

from dataclasses import replace

import numpy as np

from truths.sections import Section, bar
from truths.structure import Array, Block, Change, Lump, Material, Member, Spring, Structure

LONG, SHORT, BOSS = 0.34, 0.22, 0.035  # m, arms from the pivot's centre; half the boss
DEEP, THICK = 0.056, 0.02  # m, of an arm at the boss
TIP = {"long": 0.5, "short": 0.65}  # share of the depth that is left at an arm's end


def tapered(points: Array) -> Array:
    """Return points of even arms where the tapered ones have them."""
    x, y, z = points
    on_long = np.clip((x - BOSS) / (LONG - BOSS), 0.0, 1.0)
    on_short = np.clip((z - BOSS) / (SHORT - BOSS), 0.0, 1.0)
    return np.array(
        [x * (1 - (1 - TIP["short"]) * on_short), y, z * (1 - (1 - TIP["long"]) * on_long)]
    )


def _half(arm: str, share: float) -> Section:
    """Return an arm's even section, drawn with the depth at a share of its length."""
    deep = DEEP * (1 - (1 - TIP[arm]) * share)
    return replace(bar(THICK, DEEP), drawn=bar(THICK, round(deep, 4)).drawn)


def _slot(name: str, low: tuple[float, float], high: tuple[float, float]) -> Block:
    return Block(name, (low[0], -THICK, low[1]), (high[0], THICK, high[1]), "")


STRUCTURE = Structure(
    name="bell-crank",
    title="Bell crank with two tapered arms on a bush",
    classes=(
        "after the rule",
        "machine part",
        "rocker",
        "stubby members",
        "tapered members",
        "soft feet",
    ),
    story="""
A cast iron crank 20 mm thick with arms of 340 and 220 mm at a right angle around a boss of 70 x 70 x 60 mm;
the arms narrow from 56 mm to 28 and 36 mm. A slot lightens the long arm, a web of 8 mm fills the inner
corner, a fork end of 40 mm stands at the short arm. The boss sits on a bush, the long arm's end on a link.
The drawing has two lengths of constant bar an arm from the pivot's centre on, bush and link with their
catalogue stiffness, has the boss as a short bar across, and knows neither slot nor web nor the fork.
""",
    materials={"iron": Material(120e9, 0.26, 7150.0)},
    sections={
        "boss": bar(2 * BOSS, 2 * BOSS),
        "long-1": _half("long", 0.2),
        "long-2": _half("long", 0.75),
        "short-1": _half("short", 0.2),
        "short-2": _half("short", 0.75),
    },
    joints={
        "pivot": (0.0, 0.0, 0.0),
        "boss-L": (0.0, 0.03, 0.0),
        "boss-R": (0.0, -0.03, 0.0),
        "long": (0.19, 0.0, 0.0),
        "rod": (LONG, 0.0, 0.0),
        "short": (0.0, 0.0, 0.13),
        "fork": (0.0, 0.0, SHORT),
    },
    types={
        "boss-L": "boss",
        "boss-R": "boss",
        "rod": "end",
        "fork": "end",
        "long": "middle",
        "short": "middle",
    },
    members=(
        *(Member(f"boss-{s}", ("pivot", f"boss-{s}"), "boss", "iron", 1) for s in "LR"),
        Member("long-1", ("pivot", "long"), "long-1", "iron", 4),
        Member("long-2", ("long", "rod"), "long-2", "iron", 4, extend=(0.0, 0.015)),
        Member("short-1", ("pivot", "short"), "short-1", "iron", 3, up=(-1.0, 0.0, 0.0)),
        Member("short-2", ("short", "fork"), "short-2", "iron", 3, up=(-1.0, 0.0, 0.0)),
    ),
    blocks=(
        _slot("slot", (0.09, -0.012), (0.2, 0.012)),
        Block("web", (0.028, -0.004, 0.028), (0.1, 0.004, 0.06), "iron"),
        Block("web-2", (0.028, -0.004, 0.06), (0.06, 0.004, 0.1), "iron"),
        Block("fork", (-DEEP / 2, -0.02, SHORT - 0.02), (DEEP / 2, 0.02, SHORT + 0.012), "iron"),
    ),
    springs=(
        Spring("pivot", "x", 6e7),
        Spring("pivot", "y", 2e7),
        Spring("pivot", "z", 6e7),
        Spring("pivot", "rx", 4e4),
        Spring("pivot", "rz", 4e4),
        Spring("rod", "z", 5e5),
    ),
    warp=tapered,
    beam="timoshenko",
    sensors=(
        ("pivot", "xyz"),
        (("long-1", 0.7), "yz"),
        ("long", "yz"),
        (("long-2", 0.5), "yz"),
        ("rod", "yz"),
        ("short", "xy"),
        (("short-2", 0.5), "xy"),
        ("fork", "xyz"),
    ),
    changes=(
        Change("0.5 kg at fork", lumps=(Lump("fork", 0.5),)),
        Change(
            "0.4 kg at long, spring of 1e6 N/m along y at rod",
            lumps=(Lump("long", 0.4),),
            springs=(Spring("rod", "y", 1e6),),
        ),
    ),
    used=4,
    held_out=4,
    size=(0.03, 0.02),
    graded=False,
    guess=150.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.4,
)
