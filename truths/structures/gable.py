"""A gable frame of I-beams with haunch plates, on a base plate at either foot."""

import numpy as np

from truths.sections import i_beam
from truths.structure import STEEL, Array, Block, Change, Clamp, Lump, Member, Spring, Structure

HALF_SPAN, EAVES, PITCH = 1.6, 1.4, np.tan(np.radians(15.0))
DEPTH, WIDTH, WEB, FLANGE = 0.1, 0.1, 0.006, 0.01  # m, of HEB 100
IN = DEPTH / 2


def pitched(points: Array) -> Array:
    """Return points of the frame with a flat roof where the pitched one has them."""
    rise = (HALF_SPAN - np.abs(points[0])) * PITCH
    share = np.clip((points[2] - (EAVES - 0.35)) / 0.35, 0.0, 1.0)
    return np.array([points[0], points[1], points[2] + rise * share])


def _haunch(side: int) -> Block:
    inner, outer = side * (HALF_SPAN - IN - 0.2), side * (HALF_SPAN - IN)
    low, high = min(inner, outer), max(inner, outer)
    return Block(
        f"haunch-{'left' if side < 0 else 'right'}",
        (low, -WEB / 2, EAVES - IN - 0.12),
        (high, WEB / 2, EAVES - IN),
        "steel",
    )


def _stiffener(side: int) -> Block:
    x = side * (HALF_SPAN - IN)
    low, high = sorted((x, x + side * FLANGE))
    name = f"end-plate-{'left' if side < 0 else 'right'}"
    return Block(
        name, (low, -WIDTH / 2, EAVES - IN), (high, WIDTH / 2, EAVES + IN), "steel", first=True
    )


STRUCTURE = Structure(
    name="gable",
    title="Gable frame of rolled I-beams with haunch plates, clamped feet",
    classes=("planar frame", "open sections", "haunches", "clamped"),
    story="""
Columns and rafters of HEB 100, roof pitch 15 degrees. The columns run up to the rafters' lower flange; their
inner flange goes on through the rafter's depth as a stiffener, and a web plate of 200 x 120 mm fills each eaves corner. At
the ridge the rafters are welded butt to butt. The drawing shows centre lines from foot to eaves to ridge.
""",
    materials={"steel": STEEL},
    sections={"heb": i_beam(WIDTH, DEPTH, WEB, FLANGE)},
    joints={
        "foot-left": (-HALF_SPAN, 0.0, 0.0),
        "eaves-left": (-HALF_SPAN, 0.0, EAVES),
        "ridge": (0.0, 0.0, EAVES),
        "eaves-right": (HALF_SPAN, 0.0, EAVES),
        "foot-right": (HALF_SPAN, 0.0, 0.0),
    },
    types={
        "foot-left": "foot",
        "foot-right": "foot",
        "eaves-left": "eaves",
        "eaves-right": "eaves",
    },
    members=(
        Member("column-left", ("foot-left", "eaves-left"), "heb", "steel", 6, weld=0.004),
        Member("column-right", ("foot-right", "eaves-right"), "heb", "steel", 6, weld=0.004),
        Member("rafter-left", ("eaves-left", "ridge"), "heb", "steel", 6, extend=(IN, 0.0)),
        Member("rafter-right", ("ridge", "eaves-right"), "heb", "steel", 6, extend=(0.0, IN)),
    ),
    blocks=(_haunch(-1), _haunch(1), _stiffener(-1), _stiffener(1)),
    clamps=(
        Clamp("foot-left", (-HALF_SPAN - 0.1, -0.1, 0.0), (-HALF_SPAN + 0.1, 0.1, 0.0)),
        Clamp("foot-right", (HALF_SPAN - 0.1, -0.1, 0.0), (HALF_SPAN + 0.1, 0.1, 0.0)),
    ),
    plane="in-plane",
    warp=pitched,
    sensors=(
        (("column-left", 0.33), "x"),
        (("column-left", 0.67), "x"),
        ("eaves-left", "xz"),
        (("rafter-left", 0.33), "z"),
        (("rafter-left", 0.67), "z"),
        ("ridge", "xz"),
        (("rafter-right", 0.33), "z"),
        (("rafter-right", 0.67), "z"),
        ("eaves-right", "xz"),
        (("column-right", 0.33), "x"),
        (("column-right", 0.67), "x"),
    ),
    changes=(
        Change("12 kg at ridge", lumps=(Lump("ridge", 12.0),)),
        Change(
            "8 kg at eaves-left, spring of 1e6 N/m along x at eaves-right",
            lumps=(Lump("eaves-left", 8.0),),
            springs=(Spring("eaves-right", "x", 1e6),),
        ),
    ),
    used=4,
    held_out=3,
    size=(0.045, 0.03),
    guess=25.0,
    scatter=0.003,
    shape_scatter=0.025,
)
