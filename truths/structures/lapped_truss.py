"""A mono-pitch truss of flats whose web bars lap the chords on one side."""

from dataclasses import replace

from truths.sections import Section, bar
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure

BAY, BAYS, LOW, HIGH = 0.45, 4, 0.25, 0.55  # m; heights at both ends
CHORD, WEB = 0.012, 0.01  # m, thicknesses
ASIDE = (CHORD + WEB) / 2  # m, from the chords' plane to that of the web bars
JOINTS = {f"L{i}": (BAY * i, 0.0, 0.0) for i in range(BAYS + 1)} | {
    f"U{i}": (BAY * i, 0.0, LOW + (HIGH - LOW) * i / BAYS) for i in range(BAYS + 1)
}


def _lapped() -> Section:
    """Return a web bar on the near face of the chords, drawn in their plane."""
    flat = bar(WEB, 0.04)
    (y0, y1, z0, z1, solid), *_ = flat.rectangles
    moved = ((y0 + ASIDE, y1 + ASIDE, z0, z1, solid),)
    return replace(flat, width=WEB + 2 * ASIDE, rectangles=moved)


STRUCTURE = Structure(
    name="lapped-truss",
    title="Mono-pitch roof truss of flats with lapped web bars",
    classes=(
        "after the rule",
        "roof truss",
        "eccentric joints",
        "leaning members",
        "solid sections",
        "on bearings",
    ),
    story="""
Chords of 60 x 12 mm and web bars of 40 x 10 mm, which all lie on the same face of the chords and are welded all
round where they lap: their planes are 11 mm apart, and each bar's end of 30 mm lies flat on a chord. Wall plates
carry the lower chord at both ends, purlins hold the upper chord sideways; both are drawn by their stiffness. The
drawing has all bars in one plane, from point to point. The roofing on the purlins is drawn as masses.
""",
    materials={"steel": STEEL},
    sections={"chord": bar(CHORD, 0.06), "web": _lapped()},
    joints=JOINTS,
    types={"L0": "bearing", f"L{BAYS}": "bearing", "U0": "eave", f"U{BAYS}": "ridge"},
    members=(
        *(
            Member(
                f"{name}-{i}",
                (f"{c}{i}", f"{c}{i + 1}"),
                "chord",
                "steel",
                4,
                extend=(0.03 * (i == 0), 0.03 * (i + 1 == BAYS)),
            )
            for c, name in (("L", "lower"), ("U", "upper"))
            for i in range(BAYS)
        ),
        *(
            Member(
                f"post-{i}",
                (f"L{i}", f"U{i}"),
                "web",
                "steel",
                3,
                up=(-1.0, 0.0, 0.0),
                extend=(0.025, 0.025),
            )
            for i in range(BAYS + 1)
        ),
        *(Member(f"diagonal-{i}", (f"U{i}", f"L{i + 1}"), "web", "steel", 4) for i in range(BAYS)),
    ),
    lumps=tuple(
        Lump(f"U{i}", 3.0 if i in (0, BAYS) else 6.0, (0.0, 0.0, 0.05)) for i in range(BAYS + 1)
    ),
    springs=(
        *(
            Spring(f"L{i}", d, k)
            for i in (0, BAYS)
            for d, k in (("x", 8e6), ("y", 4e6), ("z", 2e7))
        ),
        *(Spring(f"U{i}", "y", 6e5) for i in range(BAYS + 1)),
    ),
    sensors=(
        *((f"U{i}", "yz") for i in range(BAYS + 1)),
        *((f"L{i}", "yz") for i in range(1, BAYS)),
        *(((f"upper-{i}", 0.5), "y") for i in range(BAYS)),
        *(((f"lower-{i}", 0.5), "y") for i in range(BAYS)),
        ("U0", "x"),
        (f"U{BAYS}", "x"),
        (("post-4", 0.5), "y"),
    ),
    changes=(
        Change("8 kg at L2", lumps=(Lump("L2", 8.0),)),
        Change(
            "5 kg at U3, stay of 4e5 N/m along y at L1",
            lumps=(Lump("U3", 5.0),),
            springs=(Spring("L1", "y", 4e5),),
        ),
    ),
    mesher="tetrahedra",
    used=4,
    held_out=3,
    size=(0.032, 0.024),
    guess=15.0,
    scatter=0.005,
    shape_scatter=0.035,
    together=0.5,
)
