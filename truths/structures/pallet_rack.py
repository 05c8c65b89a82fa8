"""A bay of a pallet rack: uprights of open channel, beams on end plates, shims under the feet."""

from dataclasses import replace

from truths.sections import Section, bar, channel, rectangular_tube
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

Span = tuple[float, float]  # m
BAY, DEPTH = 1.8, 0.8  # m along x and y, between the uprights' centroids
LEVELS = (0.0, 0.3, 0.95, 1.95, 2.4)  # m; ties at 1 and 4, beams at 2 and 3
BEAMS, TIES = (2, 3), (1, 4)
WALL = 0.003  # m
WEB, FLANGE = 0.08, 0.06  # m, of an upright
UPRIGHT = channel(FLANGE, WEB, WALL, WALL)
BACK, FRONT = UPRIGHT.rectangles[0][0], UPRIGHT.rectangles[1][1]  # m from the centroid
PLATE = (WEB / 2, WEB / 2 + 0.005), (BACK, FRONT)  # m, of a beam's end, at an upright
POSTS = {"FL": (0.0, 0.0), "FR": (BAY, 0.0), "RL": (0.0, DEPTH), "RR": (BAY, DEPTH)}
INWARDS = {"F": 1.0, "R": -1.0}  # along y, the way the channels open
TOWARDS = {"L": 1.0, "R": -1.0}  # along x, from an upright into the bay


def _moved(section: Section, by: float) -> Section:
    """Return a section aside along local y, drawn on its joints' line."""
    moved = tuple((a + by, b + by, c, d, s) for a, b, c, d, s in section.rectangles)
    return replace(section, width=section.width + 2 * abs(by), rectangles=moved)


def _box(name: str, post: str, x: Span, y: Span, z: Span) -> Block:
    """Return a plate at an upright: x into the bay, y the way its channel opens."""
    (x0, y0), bay, way = POSTS[post], TOWARDS[post[1]], INWARDS[post[0]]
    xs, ys = sorted(x0 + bay * v for v in x), sorted(y0 + way * v for v in y)
    return Block(name, (xs[0], ys[0], z[0]), (xs[1], ys[1], z[1]), "steel")


STRUCTURE = Structure(
    name="pallet-rack",
    title="Bay of a pallet rack of open channels, beams on end plates, on shims",
    classes=(
        "after the rule",
        "rack",
        "space frame",
        "open sections",
        "eccentric joints",
        "clamped",
    ),
    story="""
Four uprights of channel 80 x 60 x 3 mm, open towards each other, carry beams of tube 50 x 110 x 3 mm at two
levels. The beams end on plates of 60 x 200 x 5 mm, which are bolted flat to the uprights' flanges, so that these
bend where a beam turns. Ties of flat 20 x 40 mm, welded into one corner of the channels, make the sides ladders
without diagonals. The feet are plates of 8 mm on shims of 80 x 50 mm below the webs, on which alone they rest. The
drawing runs from centroid to centroid with rigid joints and clamped feet, and has the goods as masses on the beams.
It knows neither the flanges' bending, nor the plates and shims, nor where the channels' shear centres are.
""",
    materials={"steel": STEEL},
    sections={
        "upright": UPRIGHT,
        "beam-F": _moved(rectangular_tube(0.05, 0.11, WALL), BACK + 0.025),
        "beam-R": _moved(rectangular_tube(0.05, 0.11, WALL), -BACK - 0.025),
        "tie-L": _moved(bar(0.02, 0.04), WEB / 2 - WALL - 0.01),
        "tie-R": _moved(bar(0.02, 0.04), WALL + 0.01 - WEB / 2),
    },
    joints={f"{c}{i}": (x, y, z) for c, (x, y) in POSTS.items() for i, z in enumerate(LEVELS)},
    types={
        f"{c}{i}": "foot" if i == 0 else "beam-end" if i in BEAMS else "tie-end"
        for c in POSTS
        for i in range(len(LEVELS))
    },
    members=(
        *(
            Member(
                f"post-{c}{i}",
                (f"{c}{i - 1}", f"{c}{i}"),
                "upright",
                "steel",
                3,
                up=(-INWARDS[c[0]], 0.0, 0.0),
                extend=(0.0, 0.05 * (i == 4)),
            )
            for c in POSTS
            for i in range(1, len(LEVELS))
        ),
        *(
            Member(
                f"beam-{s}{i}",
                (f"{s}L{i}", f"{s}R{i}"),
                f"beam-{s}",
                "steel",
                6,
                extend=(-WEB / 2, -WEB / 2),
            )
            for i in BEAMS
            for s in INWARDS
        ),
        *(
            Member(
                f"tie-{s}{i}",
                (f"F{s}{i}", f"R{s}{i}"),
                f"tie-{s}",
                "steel",
                3,
                extend=(-BACK - WALL, -BACK - WALL),
            )
            for i in TIES
            for s in TOWARDS
        ),
    ),
    blocks=(
        *(
            _box(f"plate-{c}{i}", c, *PLATE, (LEVELS[i] - 0.1, LEVELS[i] + 0.1))
            for c in POSTS
            for i in BEAMS
        ),
        *(
            _box(f"foot-{c}", c, (-0.07, 0.07), (BACK - 0.03, FRONT + 0.03), (-0.008, 0.0))
            for c in POSTS
        ),
    ),
    lumps=tuple(
        Lump((f"beam-{s}{i}", share), mass)
        for i, mass in ((2, 50.0), (3, 25.0))
        for s in INWARDS
        for share in (0.25, 0.75)
    ),
    clamps=tuple(
        Clamp(f"{shim.name[-2:]}0", shim.low, shim.high)
        for shim in (
            _box(f"shim-{c}", c, (-0.04, 0.04), (BACK, BACK + 0.05), (-0.008, -0.008))
            for c in POSTS
        )
    ),
    sensors=(
        *((f"{c}{i}", "xy") for c in POSTS for i in BEAMS),
        *((f"{c}4", "xyz") for c in ("FL", "RR")),
        *(((f"beam-{s}{i}", 0.5), "yz") for s in INWARDS for i in BEAMS),
        *(((f"beam-{s}3", 0.25), "z") for s in INWARDS),
    ),
    changes=(
        Change("35 kg at the middle of beam-F3", lumps=(Lump(("beam-F3", 0.5), 35.0),)),
        Change(
            "20 kg at the middle of beam-R2, brace of 3e5 N/m along x at RL4",
            lumps=(Lump(("beam-R2", 0.5), 20.0),),
            springs=(Spring("RL4", "x", 3e5),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.043, 0.031),
    guess=7.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.5,
)
