"""A free Vierendeel girder of square tubes, posts narrower than the chords."""

from itertools import pairwise

from truths.sections import rectangular_tube
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure

STATIONS = (0.0, 0.42, 0.84, 1.34)  # m, of the posts
DEPTH = 0.46  # m
POSTS = range(len(STATIONS))

STRUCTURE = Structure(
    name="vierendeel",
    title="Vierendeel girder of square tubes, free",
    classes=("planar frame", "hollow sections", "soft joints", "free"),
    story="""
Chords 50 x 50 x 4 mm run through; posts 42 x 42 x 4 mm are welded all around onto the chords' inner faces,
which bend as plates under them: a girder without diagonals lives on the stiffness of its joints, and these
are soft. Chord ends reach 60 mm past the outer posts and stay open. The drawing has centre lines between
the posts and rigid joints.
""",
    materials={"steel": STEEL},
    sections={
        "chord": rectangular_tube(0.05, 0.05, 0.004),
        "post": rectangular_tube(0.042, 0.042, 0.004),
    },
    joints={
        f"{chord}{i}": (STATIONS[i], 0.0, z)
        for chord, z in (("L", 0.0), ("U", DEPTH))
        for i in POSTS
    },
    types={
        f"{chord}{i}": "end" if i in (0, POSTS[-1]) else "inner" for chord in "LU" for i in POSTS
    },
    members=(
        *(Member(f"post-{i}", (f"L{i}", f"U{i}"), "post", "steel", 3, weld=0.004) for i in POSTS),
        *(
            Member(
                f"chord-{chord}{i}",
                (f"{chord}{i}", f"{chord}{j}"),
                "chord",
                "steel",
                3,
                extend=(0.06 * (i == 0), 0.06 * (j == POSTS[-1])),
            )
            for chord in "LU"
            for i, j in pairwise(POSTS)
        ),
    ),
    plane="in-plane",
    sensors=(
        *((f"{chord}{i}", "xz") for chord in "LU" for i in POSTS),
        *(((f"post-{i}", 0.5), "x") for i in POSTS),
    ),
    changes=(
        Change("3 kg at U2", lumps=(Lump("U2", 3.0),)),
        Change(
            "spring of 1e6 N/m along z at L0, 1.5 kg at U3",
            lumps=(Lump("U3", 1.5),),
            springs=(Spring("L0", "z", 1e6),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.03, 0.02),
    guess=60.0,
    scatter=0.002,
    shape_scatter=0.015,
    together=0.6,
)
