"""A C-press: a throat between stubby arms, free."""

from truths.lacks import plates
from truths.sections import bar
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

THROAT, HEIGHT = 0.45, 0.62  # m

STRUCTURE = Structure(
    name="c-press",
    title="C-press of stubby plates, free",
    classes=("machine frame", "stubby members", "solid sections", "free"),
    story="""
A frame cut from 40 mm plate: back 120 mm deep, arms 110 and 140 mm deep and hardly four times as long, with
two steps of 25 mm left standing in each inner corner in place of a fillet. A ram of 60 x 60 mm hangs on the
upper arm, welded to its lower face. The drawing shows centre lines and no steps; the table is a lump.
""",
    materials={"steel": STEEL},
    sections={
        "back": bar(0.04, 0.12),
        "arm": bar(0.04, 0.11),
        "bed": bar(0.04, 0.14),
        "ram": bar(0.06, 0.06),
    },
    joints={
        "low": (0.0, 0.0, 0.0),
        "back": (0.0, 0.0, HEIGHT / 2),
        "high": (0.0, 0.0, HEIGHT),
        "table": (THROAT, 0.0, 0.0),
        "head": (THROAT, 0.0, HEIGHT),
        "ram": (THROAT, 0.0, HEIGHT - 0.22),
    },
    types={"low": "corner", "high": "corner"},
    members=(
        Member("back-low", ("low", "back"), "back", "steel", 4, up=(1.0, 0.0, 0.0)),
        Member("back-high", ("back", "high"), "back", "steel", 4, up=(1.0, 0.0, 0.0)),
        Member("ram", ("head", "ram"), "ram", "steel", 4, weld=0.004),
        Member("arm", ("high", "head"), "arm", "steel", 5, extend=(0.06, 0.03)),
        Member("bed", ("low", "table"), "bed", "steel", 5, extend=(0.06, 0.06)),
    ),
    blocks=(
        Block("step-low", (0.06, -0.02, 0.07), (0.11, 0.02, 0.095), "steel"),
        Block("step-low-2", (0.06, -0.02, 0.095), (0.085, 0.02, 0.12), "steel"),
        Block("step-high", (0.06, -0.02, HEIGHT - 0.08), (0.11, 0.02, HEIGHT - 0.055), "steel"),
        Block("step-high-2", (0.06, -0.02, HEIGHT - 0.105), (0.085, 0.02, HEIGHT - 0.08), "steel"),
    ),
    lumps=(Lump("table", 5.0, (0.0, 0.0, 0.085)),),
    sensors=(
        ("low", "xyz"),
        ("back", "xy"),
        ("high", "xyz"),
        (("arm", 0.5), "yz"),
        ("head", "xyz"),
        ("ram", "xy"),
        (("bed", 0.5), "yz"),
        ("table", "xyz"),
    ),
    changes=(
        Change("6 kg at head", lumps=(Lump("head", 6.0),)),
        Change(
            "2 kg at ram, spring of 5e6 N/m along y at head",
            lumps=(Lump("ram", 2.0),),
            springs=(Spring("head", "y", 5e6),),
        ),
    ),
    used=5,
    held_out=3,
    size=(0.035, 0.024),
    guess=200.0,
    beam="timoshenko",
    scatter=0.002,
)

LACKS = plates("type:corner", "steps in the inner corners", "step")
