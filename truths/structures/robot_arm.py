"""A robot's arm: a pedestal, an upright arm, a forearm set off to its side."""

from truths.sections import bar, rectangular_tube
from truths.structure import STEEL, Block, Change, Clamp, Lump, Material, Member, Spring, Structure

BASE, ELBOW, OFFSET, REACH = 0.4, 1.05, 0.15, 0.8  # m
DRIVE = 0.02  # m, thickness of a drive that turns a joint

STRUCTURE = Structure(
    name="robot-arm",
    title="Robot's arm of box castings with drives in its joints",
    classes=(
        "after the rule",
        "robot",
        "casting",
        "hollow sections",
        "eccentric joints",
        "clamped",
    ),
    story="""
A pedestal of 200 x 200 x 12 mm stands on a foot plate, an arm of 120 x 160 x 8 mm above it, and a forearm of
100 x 110 x 7 mm is set 150 mm aside on a solid axle of 110 mm square; all are cast iron. Three layers of 20 mm
stand for the drives and their bearings: between pedestal and arm, in the axle, and at the wrist. The makers state
no stiffness of them, and the drawing goes through rigidly. Motors, gripper and a cover of plastic are drawn as
masses, the foot plate is drawn as a clamp; in truth it is bolted down at two edges.
""",
    materials={
        "iron": Material(120e9, 0.27, 7200.0),
        "drive": Material(24e9, 0.3, 6000.0),
        "steel": STEEL,
    },
    sections={
        "pedestal": rectangular_tube(0.2, 0.2, 0.012),
        "arm": rectangular_tube(0.12, 0.16, 0.008),
        "axle": bar(0.11, 0.11),
        "forearm": rectangular_tube(0.1, 0.11, 0.007),
        "wrist": bar(0.06, 0.06),
    },
    joints={
        "floor": (0.0, 0.0, 0.0),
        "shoulder": (0.0, 0.0, BASE),
        "elbow": (0.0, 0.0, ELBOW),
        "side": (0.0, OFFSET, ELBOW),
        "rear": (-0.16, OFFSET, ELBOW),
        "wrist": (REACH, OFFSET, ELBOW),
        "gripper": (REACH + 0.14, OFFSET, ELBOW),
    },
    members=(
        Member("pedestal", ("floor", "shoulder"), "pedestal", "iron", 4),
        Member("arm", ("shoulder", "elbow"), "arm", "iron", 5, extend=(0.0, 0.06)),
        Member("axle", ("elbow", "side"), "axle", "iron", 2, extend=(0.06, 0.05)),
        Member("rear", ("rear", "side"), "forearm", "iron", 2),
        Member("forearm", ("side", "wrist"), "forearm", "iron", 6),
        Member("wrist", ("wrist", "gripper"), "wrist", "steel", 2),
    ),
    blocks=(
        Block("plate", (-0.14, -0.14, -0.016), (0.14, 0.14, 0.0), "iron"),
        Block("ceiling", (-0.1, -0.1, BASE - 0.02), (0.1, 0.1, BASE), "iron"),
        Block("shoulder-drive", (-0.08, -0.06, BASE), (0.08, 0.06, BASE + DRIVE), "drive"),
        Block(
            "elbow-drive",
            (-0.055, 0.07, ELBOW - 0.055),
            (0.055, 0.07 + DRIVE, ELBOW + 0.055),
            "drive",
        ),
        Block(
            "end",
            (REACH - DRIVE, OFFSET - 0.05, ELBOW - 0.055),
            (REACH, OFFSET + 0.05, ELBOW + 0.055),
            "iron",
        ),
        Block(
            "wrist-drive",
            (REACH, OFFSET - 0.03, ELBOW - 0.03),
            (REACH + DRIVE, OFFSET + 0.03, ELBOW + 0.03),
            "drive",
        ),
        Block(
            "tail",
            (-0.16, OFFSET - 0.05, ELBOW - 0.055),
            (-0.15, OFFSET + 0.05, ELBOW + 0.055),
            "iron",
        ),
    ),
    lumps=(
        Lump("shoulder", 14.0, (0.0, -0.12, 0.0)),
        Lump("rear", 11.0, (-0.08, 0.0, 0.0)),
        Lump("elbow", 6.0, (0.0, -0.1, 0.0)),
        Lump("gripper", 7.0),
    ),
    clamps=(
        Clamp("floor", (-0.14, -0.14, -0.016), (-0.1, 0.14, -0.016)),
        Clamp("floor", (0.1, -0.14, -0.016), (0.14, 0.14, -0.016)),
    ),
    sensors=(
        (("pedestal", 0.5), "xy"),
        ("shoulder", "xyz"),
        (("arm", 0.5), "xy"),
        ("elbow", "xyz"),
        ("rear", "yz"),
        (("forearm", 0.5), "yz"),
        ("wrist", "yz"),
        ("gripper", "xyz"),
    ),
    changes=(
        Change("6 kg more at the gripper", lumps=(Lump("gripper", 6.0),)),
        Change(
            "stay of 4e5 N/m along y at wrist, 5 kg at elbow",
            lumps=(Lump("elbow", 5.0),),
            springs=(Spring("wrist", "y", 4e5),),
        ),
    ),
    beam="timoshenko",
    used=4,
    held_out=3,
    size=(0.05, 0.036),
    graded=False,
    guess=12.0,
    scatter=0.005,
    shape_scatter=0.03,
    together=0.4,
    weighed=0.01,
)
