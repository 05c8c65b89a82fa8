"""The aeroplane-like test bed of the GARTEUR action group 19, with its damping layer."""

from truths.sections import Section, bar
from truths.structure import Block, Change, Lump, Material, Member, Spring, Structure

WING, DRUM, TAIL = 0.096, 0.106, 0.355  # m, heights of centre lines
# Without rectangles, the solid has none of it: it joins centre lines that do not meet.
LINK = Section(
    0.04, 0.04, (), {"A": 0.01, "Iy": 1e-5, "Iz": 1e-5, "J": 2e-5, "Jp": 2e-5, "kappa": 0.8}
)

STRUCTURE = Structure(
    name="garteur",
    title="Aeroplane-like test bed GARTEUR SM-AG19 with its layer, free",
    classes=("wing-like", "solid sections", "free", "close modes"),
    story="""
The test bed of the GARTEUR action group 19 (sizes after Balmes & Wright 1997): fuselage, wing, tip drums,
fin and tailplane are aluminium bars. A thin aluminium layer lies on a viscoelastic tape along most of the
wing and stiffens its bending; no drawing of beams shows it. The drums lie on the wing, the wing on a pad on
the fuselage: where centre lines do not meet, short stiff members join them. The plate at the wing root,
the mass on the fin and those at the drums are drawn as lumps. The tape's Young modulus of 1.2 MPa is chosen
so that the first bending meets the published 6.38 Hz; suspension cords are left out.
""",
    materials={
        "aluminium": Material(72e9, 0.3, 2700.0),
        "link": Material(2e11, 0.3, 1.0),
        "tape": Material(1.2e6, 0.45, 1200.0),
    },
    sections={
        "fuselage": bar(0.05, 0.15),
        "wing": bar(0.1, 0.01),
        "drum": bar(0.1, 0.01),
        "fin": bar(0.01, 0.1),
        "tailplane": bar(0.1, 0.01),
        "link": LINK,
    },
    joints={
        "nose": (0.6, 0.0, 0.0),
        "body": (0.0, 0.0, 0.0),
        "stern": (-0.85, 0.0, 0.0),
        "end": (-0.9, 0.0, 0.0),
        "root": (0.0, 0.0, WING),
        "left": (0.0, 0.95, WING),
        "right": (0.0, -0.95, WING),
        "left-tip": (0.0, 1.0, WING),
        "right-tip": (0.0, -1.0, WING),
        "left-drum": (0.0, 0.95, DRUM),
        "right-drum": (0.0, -0.95, DRUM),
        "left-front": (0.2, 0.95, DRUM),
        "left-rear": (-0.2, 0.95, DRUM),
        "right-front": (0.2, -0.95, DRUM),
        "right-rear": (-0.2, -0.95, DRUM),
        "fin-foot": (-0.85, 0.0, 0.05),
        "tail": (-0.85, 0.0, TAIL),
        "tail-left": (-0.85, 0.2, TAIL),
        "tail-right": (-0.85, -0.2, TAIL),
    },
    types={
        "left": "drum-seat",
        "right": "drum-seat",
        "left-tip": "tip",
        "right-tip": "tip",
        "left-drum": "drum",
        "right-drum": "drum",
        "left-front": "drum-end",
        "left-rear": "drum-end",
        "right-front": "drum-end",
        "right-rear": "drum-end",
        "tail-left": "tail-end",
        "tail-right": "tail-end",
    },
    members=(
        Member("wing-left", ("root", "left"), "wing", "aluminium", 6),
        Member("wing-right", ("root", "right"), "wing", "aluminium", 6),
        Member("wing-left-end", ("left", "left-tip"), "wing", "aluminium", 1),
        Member("wing-right-end", ("right", "right-tip"), "wing", "aluminium", 1),
        Member("drum-left-front", ("left-drum", "left-front"), "drum", "aluminium", 2),
        Member("drum-left-rear", ("left-drum", "left-rear"), "drum", "aluminium", 2),
        Member("drum-right-front", ("right-drum", "right-front"), "drum", "aluminium", 2),
        Member("drum-right-rear", ("right-drum", "right-rear"), "drum", "aluminium", 2),
        Member("fuselage-front", ("body", "nose"), "fuselage", "aluminium", 3),
        Member("fuselage-rear", ("body", "stern"), "fuselage", "aluminium", 4),
        Member("fuselage-end", ("stern", "end"), "fuselage", "aluminium", 1),
        Member("fin", ("fin-foot", "tail"), "fin", "aluminium", 3, extend=(0.0, -0.005)),
        Member("tailplane-left", ("tail", "tail-left"), "tailplane", "aluminium", 2),
        Member("tailplane-right", ("tail", "tail-right"), "tailplane", "aluminium", 2),
        Member("link-wing", ("body", "root"), "link", "link", 1),
        Member("link-fin", ("stern", "fin-foot"), "link", "link", 1),
        Member("link-left", ("left", "left-drum"), "link", "link", 1),
        Member("link-right", ("right", "right-drum"), "link", "link", 1),
    ),
    blocks=(
        Block("pad", (-0.05, -0.025, 0.075), (0.05, 0.025, 0.091), "aluminium"),
        Block("notch-left", (-0.9, 0.005, 0.05), (-0.8, 0.025, 0.075), ""),
        Block("notch-right", (-0.9, -0.025, 0.05), (-0.8, -0.005, 0.075), ""),
        Block("tape", (-0.05, -0.85, 0.101), (0.0262, 0.85, 0.1021), "tape"),
        Block("layer", (-0.05, -0.85, 0.1021), (0.0262, 0.85, 0.1031), "aluminium"),
    ),
    lumps=(
        Lump(("drum-left-front", 0.9), 0.2, (0.0, -0.03, 0.0)),
        Lump(("drum-right-front", 0.9), 0.2, (0.0, 0.03, 0.0)),
        Lump("root", 1.143),
        Lump("tail", 0.353),
    ),
    sensors=(
        ("left-front", "xz"),
        ("left-rear", "z"),
        (("wing-left", 0.75), "z"),
        (("wing-left", 0.5), "xz"),
        (("wing-left", 0.25), "z"),
        ("root", "z"),
        (("wing-right", 0.25), "z"),
        (("wing-right", 0.5), "xz"),
        (("wing-right", 0.75), "z"),
        ("right-front", "xz"),
        ("right-rear", "z"),
        ("nose", "yz"),
        ("stern", "yz"),
        ("tail", "y"),
        ("tail-left", "xz"),
        ("tail-right", "xz"),
    ),
    changes=(
        Change(
            "0.6 kg at left-rear, 0.6 kg at right-rear",
            lumps=(Lump("left-rear", 0.6), Lump("right-rear", 0.6)),
        ),
        Change(
            "1 kg at tail-left, spring of 4e4 N/m along y at nose",
            lumps=(Lump("tail-left", 1.0),),
            springs=(Spring("nose", "y", 4e4),),
        ),
    ),
    used=6,
    held_out=6,
    size=(0.03, 0.02),
    guess=6.4,
    scatter=0.005,
    shape_scatter=0.02,
    together=0.3,
)
