"""A free space frame of square tubes, nearly a cube."""

from truths.lacks import plates
from truths.sections import rectangular_tube
from truths.structure import STEEL, Block, Change, Lump, Member, Spring, Structure

SIDES, HEIGHT = (0.56, 0.568), 0.5  # m
HALF = 0.015  # m, half the width of a tube
PEG = 0.04  # m, from a cube's face into a tube
BORE = 0.012  # m, half the inner width of a tube
CORNERS = {"A": (0.0, 0.0), "B": (SIDES[0], 0.0), "C": SIDES, "D": (0.0, SIDES[1])}


def _connector(corner: str, level: int) -> list[Block]:
    """Return the cube of a corner and its three pegs, each inside a tube."""
    x, y = CORNERS[corner]
    middle = (x, y, HEIGHT * level)
    inwards = [1 if value == 0 else -1 for value in middle]
    ranges = [(value - HALF, value + HALF) for value in middle]
    blocks = [_block(f"cube-{corner}{level}", ranges)]
    for axis in range(3):
        ranges = [(value - BORE, value + BORE) for value in middle]
        face = middle[axis] + inwards[axis] * HALF
        low, high = sorted((face, face + inwards[axis] * PEG))
        ranges[axis] = (low, high)
        blocks.append(_block(f"peg-{corner}{level}-{'xyz'[axis]}", ranges))
    return blocks


def _block(name: str, ranges: list[tuple[float, float]]) -> Block:
    (x0, x1), (y0, y1), (z0, z1) = ranges
    return Block(name, (x0, y0, z0), (x1, y1, z1), "steel")


STRUCTURE = Structure(
    name="box-frame",
    title="Space frame of square tubes on solid corner pieces, free",
    classes=("space frame", "hollow sections", "close modes", "free"),
    story="""
Twelve tubes 30 x 30 x 3 mm on a plan of 560 x 568 mm, 500 mm high, pushed over the pegs of solid corner pieces
and bonded to them: a cube of 30 mm with three pegs that reach 40 mm into the tubes. The plan is all but square,
so that modes come in close groups. The drawing lets the tubes run to the centres of the cubes: it knows neither
the pieces' stiffness nor their mass.
""",
    materials={"steel": STEEL},
    sections={"tube": rectangular_tube(2 * HALF, 2 * HALF, 0.003)},
    joints={f"{c}{i}": (*CORNERS[c], z) for i, z in ((0, 0.0), (1, HEIGHT)) for c in "ABCD"},
    types={f"{c}{i}": "corner" for c in "ABCD" for i in (0, 1)},
    members=(
        *(Member(f"post-{c}", (f"{c}0", f"{c}1"), "tube", "steel", 4, weld=0.004) for c in "ABCD"),
        *(
            Member(f"y-{a}{b}{i}", (f"{a}{i}", f"{b}{i}"), "tube", "steel", 4, weld=0.004)
            for i in (0, 1)
            for a, b in ("AD", "BC")
        ),
        *(
            Member(f"x-{a}{b}{i}", (f"{a}{i}", f"{b}{i}"), "tube", "steel", 4, weld=0.004)
            for i in (0, 1)
            for a, b in ("AB", "DC")
        ),
    ),
    blocks=tuple(block for c in CORNERS for level in (0, 1) for block in _connector(c, level)),
    sensors=(
        *((f"{c}{i}", "xyz") for i in (0, 1) for c in "ABCD"),
        *(((f"post-{c}", 0.5), "xy") for c in "ABCD"),
        *(((f"x-{a}{b}{i}", 0.5), "yz") for i in (0, 1) for a, b in ("AB", "DC")),
        *(((f"y-{a}{b}{i}", 0.5), "xz") for i in (0, 1) for a, b in ("AD", "BC")),
    ),
    changes=(
        Change("1.2 kg at B1", lumps=(Lump("B1", 1.2),)),
        Change(
            "spring of 5e4 N/m along z at D0, 0.8 kg at A1",
            lumps=(Lump("A1", 0.8),),
            springs=(Spring("D0", "z", 5e4),),
        ),
    ),
    used=6,
    held_out=4,
    size=(0.02, 0.014),
    guess=100.0,
    scatter=0.003,
    shape_scatter=0.02,
    together=0.5,
)

LACKS = plates("type:corner", "pegs in the tubes", "peg")
