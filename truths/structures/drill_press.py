"""A drill press: a box column on a base like an H, a table and a head on it."""

from dataclasses import replace

from truths.sections import bar, rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Material, Member, Spring, Structure

TABLE, TOP = 0.52, 1.12  # m, heights of table and head over the base's axis
BACK, FRONT, HALF = -0.12, 0.34, 0.17  # m, of the feet
REACH, MOTOR = 0.24, -0.24  # m along x, of spindle and motor
BOX, SLEEVE = 0.09, 0.07  # m, of the column; half the size of the table's sleeve
FOOT = {"x": 6e5, "y": 6e5, "z": 2.5e6}  # N/m

STRUCTURE = Structure(
    name="drill-press",
    title="Drill press with a box column on an H-shaped base, on rubber feet",
    classes=(
        "after the rule",
        "machine frame",
        "cantilevers",
        "hollow sections",
        "lumps",
        "soft feet",
    ),
    story="""
A base like an H, bars of 130 x 36 mm and 80 x 36 mm of grey iron, stands on four rubber feet. A steel column of
90 x 90 x 6 mm is welded to a plate of 20 mm that two strips join to the base. At half its height a sleeve holds
an arm of 60 x 44 mm with the table, at its top the head, a box of 130 x 150 x 8 mm, carries spindle and motor;
table, spindle and motor are drawn as masses, the feet by their catalogue. Sleeve, plate and strips are not
drawn; a stub as wide as the column joins the arm to its axis.
""",
    materials={"steel": STEEL, "iron": Material(112e9, 0.26, 7200.0)},
    sections={
        "spine": bar(0.13, 0.036),
        "bar": bar(0.08, 0.036),
        "column": rectangular_tube(BOX, BOX, 0.006),
        "arm": bar(0.06, 0.044),
        "stub": replace(bar(BOX, 0.1), rectangles=()),
        "head": rectangular_tube(0.13, 0.15, 0.008),
    },
    joints={
        "base": (0.0, 0.0, 0.0),
        "back": (BACK, 0.0, 0.0),
        "front": (FRONT, 0.0, 0.0),
        **{
            f"foot-{s}{e}": (x, y, 0.0)
            for e, x in (("B", BACK), ("F", FRONT))
            for s, y in (("L", HALF), ("R", -HALF))
        },
        "sleeve": (0.0, 0.0, TABLE),
        "arm": (SLEEVE, 0.0, TABLE),
        "table": (0.25, 0.0, TABLE),
        "head": (0.0, 0.0, TOP),
        "spindle": (REACH, 0.0, TOP),
        "motor": (MOTOR, 0.0, TOP),
    },
    types={f"foot-{s}{e}": "foot" for s in "LR" for e in "BF"}
    | {"back": "cross", "front": "cross"},
    members=(
        Member("spine-back", ("back", "base"), "spine", "iron", 2),
        Member("spine-front", ("base", "front"), "spine", "iron", 3),
        *(
            Member(f"cross-{s}{e}", (j, f"foot-{s}{e}"), "bar", "iron", 2)
            for e, j in (("B", "back"), ("F", "front"))
            for s in "LR"
        ),
        Member("stub", ("sleeve", "arm"), "stub", "iron", 1),
        Member("arm", ("arm", "table"), "arm", "iron", 4, extend=(0.0, 0.05)),
        Member("head-back", ("motor", "head"), "head", "iron", 3),
        Member("head-front", ("head", "spindle"), "head", "iron", 3),
        # Last, so that the column goes through the head.
        Member("column-low", ("base", "sleeve"), "column", "steel", 5, extend=(-0.05, 0.0)),
        Member("column-high", ("sleeve", "head"), "column", "steel", 5, extend=(0.0, 0.075)),
    ),
    blocks=(
        Block("strip", (-0.065, -0.065, 0.018), (-0.02, 0.065, 0.03), "iron"),
        Block("strip", (0.02, -0.065, 0.018), (0.065, 0.065, 0.03), "iron"),
        Block("plate", (-0.065, -0.065, 0.03), (0.065, 0.065, 0.05), "steel"),
        Block(
            "sleeve",
            (-SLEEVE, -SLEEVE, TABLE - 0.05),
            (SLEEVE, SLEEVE, TABLE + 0.05),
            "iron",
            first=True,
        ),
        Block("nose", (REACH - 0.012, -0.065, TOP - 0.075), (REACH, 0.065, TOP + 0.075), "iron"),
        Block("rear", (MOTOR, -0.065, TOP - 0.075), (MOTOR + 0.012, 0.065, TOP + 0.075), "iron"),
    ),
    lumps=(
        Lump("table", 9.0, (0.0, 0.0, 0.04)),
        Lump("spindle", 8.0, (-0.03, 0.0, -0.05)),
        Lump("motor", 13.0, (-0.05, 0.0, 0.02)),
    ),
    springs=tuple(
        Spring(f"foot-{s}{e}", d, k) for s in "LR" for e in "BF" for d, k in FOOT.items()
    ),
    sensors=(
        *((f"foot-{s}{e}", "z") for s in "LR" for e in "BF"),
        ("foot-LF", "y"),
        ("foot-LB", "xy"),
        (("column-low", 0.5), "xy"),
        ("sleeve", "xy"),
        ("table", "xyz"),
        (("column-high", 0.5), "xy"),
        ("head", "xy"),
        ("spindle", "yz"),
        ("motor", "yz"),
    ),
    changes=(
        Change("vice of 8 kg on the table", lumps=(Lump("table", 8.0),)),
        Change(
            "stay of 4e5 N/m along y at motor, 5 kg at spindle",
            lumps=(Lump("spindle", 5.0),),
            springs=(Spring("motor", "y", 4e5),),
        ),
    ),
    used=7,
    held_out=4,
    size=(0.06, 0.042),
    guess=10.0,
    beam="timoshenko",
    scatter=0.006,
    shape_scatter=0.04,
    together=0.5,
)
