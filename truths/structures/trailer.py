"""The frame of a small trailer on its axle springs and hitch."""

from itertools import pairwise

from truths.lacks import plates
from truths.sections import bar, rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

HALF_TRACK = 0.36  # m, from the middle to a rail
REAR, AXLE, FRONT, HITCH = 0.0, 0.75, 1.45, 2.1  # m, stations
STATIONS = (("R", REAR), ("A", AXLE), ("F", FRONT))

STRUCTURE = Structure(
    name="trailer",
    title="Trailer frame of tubes on axle springs and hitch",
    classes=("ladder", "hollow sections", "solid sections", "torsion", "on springs"),
    story="""
Two rails of tube 40 x 60 x 4 mm, two cross tubes 40 x 44 x 3 mm between them, a solid axle 40 x 44 mm that
passes through both rails, and a drawbar of tube 60 x 60 x 4 mm welded to the front cross tube with a 6 mm
plate above and below. The wheels hang on springs and weigh 5 kg each, the hitch rests on a spring: all of
these are drawn. The drawing has centre lines and rigid joints without the plates.
""",
    materials={"steel": STEEL},
    sections={
        "rail": rectangular_tube(0.04, 0.06, 0.004),
        "cross": rectangular_tube(0.04, 0.044, 0.003),
        "axle": bar(0.04, 0.044),
        "drawbar": rectangular_tube(0.06, 0.06, 0.004),
    },
    joints={
        **{
            f"{s}{n}": (x, y, 0.0)
            for s, y in (("S", -HALF_TRACK), ("N", HALF_TRACK))
            for n, x in STATIONS
        },
        "SW": (AXLE, -HALF_TRACK - 0.16, 0.0),
        "NW": (AXLE, HALF_TRACK + 0.16, 0.0),
        "M": (FRONT, 0.0, 0.0),
        "H": (HITCH, 0.0, 0.0),
    },
    types={"SW": "wheel", "NW": "wheel", "M": "tee", "H": "hitch"}
    | {f"{s}{n}": "cross" for s in "SN" for n in "RAF"},
    members=(
        Member("cross-rear", ("SR", "NR"), "cross", "steel", 4, weld=0.004),
        Member("drawbar", ("M", "H"), "drawbar", "steel", 4),
        Member("cross-front-S", ("SF", "M"), "cross", "steel", 3, weld=0.004),
        Member("cross-front-N", ("M", "NF"), "cross", "steel", 3, weld=0.004),
        *(
            Member(
                f"rail-{s}{a}{b}",
                (f"{s}{a}", f"{s}{b}"),
                "rail",
                "steel",
                4,
                extend=(0.02 * (a == "R"), 0.02 * (b == "F")),
            )
            for s in "SN"
            for (a, _), (b, _) in pairwise(STATIONS)
        ),
        Member("axle-S", ("SW", "SA"), "axle", "steel", 2),
        Member("axle", ("SA", "NA"), "axle", "steel", 4),
        Member("axle-N", ("NA", "NW"), "axle", "steel", 2),
    ),
    blocks=(
        Block("plate-above", (FRONT - 0.02, -0.09, 0.022), (FRONT + 0.02, 0.09, 0.03), "steel"),
        Block("plate-below", (FRONT - 0.02, -0.09, -0.03), (FRONT + 0.02, 0.09, -0.022), "steel"),
    ),
    lumps=(Lump("SW", 5.0), Lump("NW", 5.0)),
    springs=(
        *(Spring(wheel, d, k) for wheel in ("SW", "NW") for d, k in (("x", 3e5), ("z", 1.5e5))),
        Spring("SW", "y", 3e5),
        Spring("H", "y", 2e5),
        Spring("H", "z", 4e5),
    ),
    sensors=(
        *((f"{s}{n}", "yz") for s in "SN" for n in "RF"),
        *((f"{s}W", "xz") for s in "SN"),
        *((f"{s}A", "z") for s in "SN"),
        *(((f"rail-{s}RA", 0.5), "yz") for s in "SN"),
        *(((f"rail-{s}AF", 0.5), "yz") for s in "SN"),
        ("M", "xz"),
        (("drawbar", 0.5), "yz"),
        ("H", "yz"),
    ),
    changes=(
        Change("15 kg at NR", lumps=(Lump("NR", 15.0),)),
        Change(
            "spring of 1e5 N/m along z at SR, 6 kg at M",
            lumps=(Lump("M", 6.0),),
            springs=(Spring("SR", "z", 1e5),),
        ),
    ),
    used=7,
    held_out=4,
    size=(0.033, 0.023),
    guess=12.0,
    scatter=0.01,
    shape_scatter=0.05,
    together=0.4,
)

LACKS = plates("type:tee", "plates on the drawbar", "plate")
