"""A gantry of rectangular tubes: two portals joined by a bridge with a lump at its middle."""

from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Clamp, Lump, Member, Spring, Structure

SPAN, TRACK, HEIGHT = 1.5, 0.7, 1.0  # m
LEG, END = 0.05, 0.025  # m, side of a leg; by which a runner passes its corner

SIDES = {"W": -SPAN / 2, "E": SPAN / 2}
ENDS = {"N": TRACK / 2, "S": -TRACK / 2}

LEGS = tuple(
    Member(f"leg-{s}{e}", (f"foot-{s}{e}", f"{s}{e}"), "leg", "steel", 4, weld=0.004)
    for s in SIDES
    for e in ENDS
)
RUNNERS = tuple(
    Member(
        f"runner-{s}{e}",
        (f"{s}{e}", f"{s}M"),
        "runner",
        "steel",
        3,
        extend=(END, 0.0),
    )
    for s in SIDES
    for e in ENDS
)
BRIDGE = (
    Member("bridge-W", ("M", "WM"), "bridge", "steel", 4, weld=0.004),
    Member("bridge-E", ("M", "EM"), "bridge", "steel", 4, weld=0.004),
)

STRUCTURE = Structure(
    name="gantry",
    title="Gantry of rectangular tubes with a trolley at mid-span, clamped feet",
    classes=("space frame", "hollow sections", "lumps", "clamped"),
    story="""
Four legs 50 x 50 x 3 mm carry two runners 60 x 50 x 4 mm, whose open ends are closed by plates. The bridge,
a tube 60 x 60 x 4 mm, is welded with its open ends onto the runners' webs, which bend like plates there.
A trolley of 15 kg hangs at mid-span, drawn as a lump.
""",
    materials={"steel": STEEL},
    sections={
        "leg": rectangular_tube(LEG, LEG, 0.003),
        "runner": rectangular_tube(0.05, 0.06, 0.004),
        "bridge": rectangular_tube(0.06, 0.06, 0.004),
    },
    joints={f"foot-{s}{e}": (x, y, 0.0) for s, x in SIDES.items() for e, y in ENDS.items()}
    | {f"{s}{e}": (x, y, HEIGHT) for s, x in SIDES.items() for e, y in ENDS.items()}
    | {f"{s}M": (x, 0.0, HEIGHT) for s, x in SIDES.items()}
    | {"M": (0.0, 0.0, HEIGHT)},
    types={f"foot-{s}{e}": "foot" for s in SIDES for e in ENDS}
    | {f"{s}{e}": "corner" for s in SIDES for e in ENDS}
    | {"WM": "tee", "EM": "tee"},
    members=(*LEGS, *BRIDGE, *RUNNERS),
    blocks=tuple(
        Block(
            f"cap-{s}{e}",
            (x - END, y + (0.021 if e == "N" else -0.025), HEIGHT - 0.03),
            (x + END, y + (0.025 if e == "N" else -0.021), HEIGHT + 0.03),
            "steel",
        )
        for s, x in SIDES.items()
        for e, y in ENDS.items()
    ),
    lumps=(Lump("M", 15.0, (0.0, 0.0, -0.1)),),
    clamps=tuple(
        Clamp(f"foot-{s}{e}", (x - LEG, y - LEG, 0.0), (x + LEG, y + LEG, 0.0))
        for s, x in SIDES.items()
        for e, y in ENDS.items()
    ),
    sensors=(
        ("WN", "xyz"),
        ("WS", "xy"),
        ("EN", "xy"),
        ("ES", "xyz"),
        ("WM", "xz"),
        ("EM", "xz"),
        ("M", "xyz"),
        (("bridge-W", 0.5), "yz"),
        (("bridge-E", 0.5), "yz"),
        (("leg-WN", 0.5), "xy"),
        (("leg-ES", 0.5), "xy"),
        (("leg-WS", 0.5), "xy"),
        (("leg-EN", 0.5), "xy"),
    ),
    changes=(
        Change("10 kg at WM", lumps=(Lump("WM", 10.0),)),
        Change(
            "5 kg at EN, spring of 4e5 N/m along x at WS",
            lumps=(Lump("EN", 5.0),),
            springs=(Spring("WS", "x", 4e5),),
        ),
    ),
    used=7,
    held_out=4,
    size=(0.022, 0.0155),
    guess=15.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.4,
)
