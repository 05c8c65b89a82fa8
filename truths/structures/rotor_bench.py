"""A rotor's test bench: ribbed cast pedestals and their shaft on a frame of channels."""

from truths.sections import bar, channel, rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Material, Member, Spring, Structure

STATIONS = (0.0, 0.3, 0.9, 1.25)  # m along x: end, pedestal, pedestal, end
RAILS = {"L": 0.16, "R": -0.16}  # m along y
AXIS = 0.26  # m, of the shaft over that of the frame
DISC = 1.12  # m, where the overhung disc sits
SOLE = 0.05  # m, upper face of the frame
RAIL = channel(0.05, 0.1, 0.006, 0.0085)
REACH = -RAIL.rectangles[0][1]  # m, from a rail's axis to the inner face of its web


def _pedestal(name: str, x: float) -> list[Block]:
    """Return what a pedestal has around its web: sole, ribs before and behind, housing."""
    return [
        Block(f"sole-{name}", (x - 0.055, -0.19, SOLE), (x + 0.055, 0.19, SOLE + 0.016), "iron"),
        Block(f"rib-{name}", (x - 0.05, -0.006, SOLE + 0.016), (x + 0.05, 0.006, 0.17), "iron"),
        Block(
            f"housing-{name}",
            (x - 0.035, -0.045, AXIS - 0.045),
            (x + 0.035, 0.045, AXIS + 0.045),
            "iron",
        ),
        Block(f"core-{name}", (x - 0.01, 0.03, 0.1), (x + 0.01, 0.07, 0.16), ""),
        Block(f"core-{name}", (x - 0.01, -0.07, 0.1), (x + 0.01, -0.03, 0.16), ""),
    ]


STRUCTURE = Structure(
    name="rotor-bench",
    title="Bench of an overhung rotor: cast pedestals on a frame of channels, on mounts",
    classes=(
        "after the rule",
        "casting",
        "ribs",
        "open sections",
        "machine foundation",
        "soft feet",
    ),
    story="""
Two channels 50 x 100 mm, open inwards, and four cross tubes 80 x 60 x 4 mm between them stand on four mounts.
Two pedestals of grey iron, webs of 180 x 20 mm, hold a shaft of 40 mm square with an overhung disc. They have
a sole across the channels, one rib along the shaft, two cores in the web and a thick housing; the drawing has
their webs alone, up to the shaft's axis. Disc and coupling are drawn, and the mounts by their catalogue; the
two mounts below the disc have aged and are softer along z.
""",
    materials={"steel": STEEL, "iron": Material(115e9, 0.26, 7200.0)},
    sections={
        "rail": RAIL,
        "cross": rectangular_tube(0.08, 0.06, 0.004),
        "web": bar(0.18, 0.02),
        "shaft": bar(0.04, 0.04),
    },
    joints={
        **{f"{s}{i}": (x, y, 0.0) for s, y in RAILS.items() for i, x in enumerate(STATIONS)},
        **{f"M{i}": (STATIONS[i], 0.0, 0.0) for i in (1, 2)},
        **{f"B{i}": (STATIONS[i], 0.0, AXIS) for i in (1, 2)},
        "coupling": (0.18, 0.0, AXIS),
        "disc": (DISC, 0.0, AXIS),
    },
    types={f"{s}{i}": "corner" if i in (0, 3) else "cross" for s in RAILS for i in range(4)}
    | {f"{j}{i}": t for j, t in (("M", "sole"), ("B", "bearing")) for i in (1, 2)},
    members=(
        *(
            Member(f"cross-{i}", (f"R{i}", f"L{i}"), "cross", "steel", 4, extend=(REACH, REACH))
            for i in (0, 3)
        ),
        *(
            Member(f"cross-{a}{i}", ends, "cross", "steel", 2, extend=reach)
            for i in (1, 2)
            for a, ends, reach in (
                ("R", (f"R{i}", f"M{i}"), (REACH, 0.0)),
                ("L", (f"M{i}", f"L{i}"), (0.0, REACH)),
            )
        ),
        *(
            Member(
                f"rail-{s}{i}",
                (f"{s}{i}", f"{s}{i + 1}"),
                "rail",
                "steel",
                3,
                up=(0.0, 0.0, up),
                extend=(0.04 * (i == 0), 0.04 * (i == 2)),
            )
            for s, up in (("L", -1.0), ("R", 1.0))
            for i in range(3)
        ),
        *(Member(f"web-{i}", (f"M{i}", f"B{i}"), "web", "iron", 3) for i in (1, 2)),
        Member("shaft-drive", ("coupling", "B1"), "shaft", "steel", 2),
        Member("shaft", ("B1", "B2"), "shaft", "steel", 5),
        Member("shaft-disc", ("B2", "disc"), "shaft", "steel", 3),
    ),
    blocks=(*_pedestal("1", STATIONS[1]), *_pedestal("2", STATIONS[2])),
    lumps=(Lump("disc", 9.0), Lump("coupling", 1.5)),
    springs=(
        *(
            Spring(f"{s}{i}", d, k)
            for s in RAILS
            for i in (0, 3)
            for d, k in (("x", 2.5e5), ("y", 2.5e5), ("z", 6e5))
        ),
        *(Spring(f"{s}3", "z", -1.5e5, drawn=False) for s in RAILS),
    ),
    sensors=(
        *((f"{s}{i}", "yz") for s in RAILS for i in range(4)),
        *((f"B{i}", "xyz") for i in (1, 2)),
        (("shaft", 0.5), "yz"),
        ("disc", "yz"),
        ("coupling", "yz"),
    ),
    changes=(
        Change("4 kg more on the disc", lumps=(Lump("disc", 4.0),)),
        Change(
            "stay of 2e6 N/m along y at B2, 8 kg at L0",
            lumps=(Lump("L0", 8.0),),
            springs=(Spring("B2", "y", 2e6),),
        ),
    ),
    used=8,
    held_out=4,
    size=(0.08, 0.056),
    guess=10.0,
    scatter=0.006,
    shape_scatter=0.04,
    together=0.5,
)
