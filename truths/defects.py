"""Defects of solids: what each kind edits, where it may sit, what an engineer would call it.

A defect edits the description (what is attached, a section) or the meshed solid (cells). The
drawing never sees it. Places are those of the project's grammar; sizes run from barely visible to
gross.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from truths.bricks import brick_mesh, weld_reach
from truths.drawing import DOFS
from truths.solid import Solid
from truths.structure import (
    Block,
    Lump,
    Material,
    Member,
    Oscillator,
    Place,
    Spring,
    Structure,
    Strut,
)

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.bool_]
Generator = np.random.Generator
State = tuple[Structure, Solid]
WATER = 1000.0  # kg/m3
OTHER_MATERIALS = {
    "stainless steel": Material(193e9, 0.29, 8000.0),
    "grey cast iron": Material(110e9, 0.26, 7200.0),
    "titanium": Material(114e9, 0.34, 4430.0),
    "aluminium": Material(70e9, 0.33, 2700.0),
    "steel": Material(210e9, 0.3, 7850.0),
    "brass": Material(100e9, 0.35, 8500.0),
}


@dataclass(frozen=True)
class Defect:
    """Describe one defect of one structure.

    Arguments:
        what: in words, with its size.
        effect, place, also: as in a truth file; `also` holds `effect@place`.
        size, unit: where the kind has a size in the effect's unit.
        edit: returns the description and the solid with the defect.
        turns: member end whose added flexibility is the equivalent size, (member, joint).
        preload: relative misfit of a member's length, and the member.
    """

    kind: str
    what: str
    effect: str
    place: str
    edit: Callable[[Structure, Solid], State]
    also: tuple[str, ...] = ()
    size: float | None = None
    unit: str = ""
    turns: tuple[str, str] | None = None
    preload: tuple[str, float] | None = None


Maker = Callable[[Structure, Solid, Generator], Defect | None]


def local(structure: Structure, solid: Solid, member: Member) -> Array:
    """Return the cells' centres in a member's axes, (3, cells), m from its first end."""
    axes, _ = structure.axes(member)
    start = structure.point(member.ends[0])[:, None]
    return np.asarray(axes @ (solid.centres - start))


def element_at(member: Member, share: float) -> int:
    """Return the number, from 1, of the drawn element that holds a share of a member."""
    return min(int(share * member.elements) + 1, member.elements)


def cut_elements(structure: Structure, solid: Solid, member: Member, cut: Cells) -> list[str]:
    """Return the drawn elements that a cut touches, as places, the most cut one first."""
    axes, length = structure.axes(member)
    start = structure.point(member.ends[0])[:, None]
    along = (axes[0] @ (solid.points - start))[solid.cells[:, cut]] / length
    low, high = along.min(), along.max()
    edges = np.linspace(0.0, 1.0, member.elements + 1)
    share = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    order = [int(k) for k in np.argsort(-share) if share[k] > 1e-6]
    return [f"{member.name}/{k + 1}" for k in order]


def nodes_at(member: Member, share: float) -> tuple[str, ...]:
    """Return the drawn nodes on both sides of a share of a member, as places."""
    low = element_at(member, share) - 1
    found = []
    for k in (low, low + 1):
        joint = {0: member.ends[0], member.elements: member.ends[1]}.get(k)
        found.append(joint or f"{member.name}@{k / member.elements:g}")
    return tuple(found)


def pick(rng: Generator, items: list[Member]) -> Member | None:
    """Return one of the members, or None where there is none."""
    return items[int(rng.integers(len(items)))] if items else None


def between(rng: Generator, low: float, high: float) -> float:
    """Return a number drawn log-uniformly, with three digits."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def is_tube(structure: Structure, member: Member) -> bool:
    """Tell whether a member is hollow."""
    section = structure.sections[member.section]
    return any(not solid for *_, solid in section.rectangles)


def weld_cells(structure: Structure, solid: Solid, member: Member, end: int) -> Cells:
    """Return the cells of the layer where a member's end is welded on."""
    x, (_, length) = local(structure, solid, member)[0], structure.axes(member)
    low, high = weld_reach(structure, member, end)
    from_joint = x if end == 0 else length - x
    return np.asarray(solid.of_part(member.name) & (from_joint > low) & (from_joint < high))


def runs_up_to(structure: Structure, member: Member, end: int) -> bool:
    """Tell whether a member ends at the face of another, which is painted later."""
    order = {other.name: i for i, other in enumerate(structure.members)}
    crossing = [
        other
        for other in structure.members
        if other is not member
        and member.ends[end] in other.ends
        and abs(structure.axes(other)[0][0] @ structure.axes(member)[0][0]) < 0.5
    ]
    return any(order[other.name] > order[member.name] for other in crossing)


def welded(structure: Structure, solid: Solid) -> list[tuple[Member, int]]:
    """Return the member ends that have a layer of weld between them and a crossing member."""
    return [
        (member, end)
        for member in structure.members
        for end in (0, 1)
        if member.weld
        and runs_up_to(structure, member, end)
        and weld_cells(structure, solid, member, end).any()
    ]


def joint_words(structure: Structure, member: Member, end: int) -> tuple[str, ...]:
    """Return what else names the flexibility of a member's end."""
    joint = member.ends[end]
    element = 1 if end == 0 else member.elements
    words = [f"local-stiffness-loss@{member.name}/{element}", f"joint-flexibility@{joint}"]
    if sum(joint in other.ends for other in structure.members) <= 2:
        words.append(f"joint-rotation@{joint}")
        words += [
            f"joint-rotation@{other.name}@{joint}"
            for other in structure.members
            if joint in other.ends and other is not member
        ]
    return tuple(words)


def missing_weld(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Leave one, two or three sides of a member's end unwelded."""
    ends = welded(structure, solid)
    if not ends:
        return None
    member, end = ends[int(rng.integers(len(ends)))]
    sides = rng.permutation(4)[: int(rng.choice([1, 1, 1, 2, 2, 3]))]
    layer = weld_cells(structure, solid, member, end)
    y, z = local(structure, solid, member)[1:]
    across = [y, -y, z, -z]
    reach = [across[i][layer].max() for i in range(4)]
    cut = layer & np.any([across[i] > reach[i] - 1e-6 for i in sides], axis=0)
    if cut.sum() == layer.sum() or solid.without(cut).pieces > 1:
        return None
    joint = member.ends[end]
    return Defect(
        "missing-weld",
        f"{len(sides)} of 4 sides of {member.name} not welded at {joint}",
        "joint-rotation",
        f"{member.name}@{joint}",
        lambda s, mesh: (s, mesh.without(cut)),
        joint_words(structure, member, end),
        turns=(member.name, joint),
    )


def loose_joint(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Put a soft layer where a member's end is welded on."""
    ends = welded(structure, solid)
    if not ends:
        return None
    member, end = ends[int(rng.integers(len(ends)))]
    layer, softer = weld_cells(structure, solid, member, end), between(rng, 20, 2000)
    joint = member.ends[end]
    return Defect(
        "loose-joint",
        f"layer of {1000 * member.weld:g} mm with a modulus {softer:g} times lower "
        f"between {member.name} and {joint}",
        "joint-rotation",
        f"{member.name}@{joint}",
        lambda s, mesh: (s, mesh.scaled(layer, 1 / softer)),
        joint_words(structure, member, end),
        turns=(member.name, joint),
    )


def thin_wall(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Make the wall of one hollow member thinner, outside unchanged."""
    member = pick(rng, [m for m in structure.solid_members if is_tube(structure, m)])
    if member is None or structure.mesher != "bricks":
        return None
    section, (axes, length) = structure.sections[member.section], structure.axes(member)
    less = between(rng, 0.02, 0.3)
    outer, inner = section.rectangles
    wall, start = outer[1] - inner[1], structure.point(member.ends[0])[:, None]

    def place_of(block: Block) -> Array:
        middle = (np.array(block.low) + np.array(block.high)) / 2
        return np.asarray(axes @ (middle - start[:, 0]))

    filled = [
        block
        for block in structure.blocks
        if block.material
        and (np.abs(place_of(block)[1:]) < [inner[1], inner[3]]).all()
        and 0 < place_of(block)[0] < length
    ]
    if filled:
        return None

    def edit(s: Structure, mesh: Solid) -> State:
        x, y, z = axes @ (mesh.points - start)
        own = np.zeros(mesh.points.shape[1], dtype=bool)
        own[mesh.cells[:, mesh.of_part(member.name)].ravel()] = True
        own[mesh.cells[:, ~mesh.of_part(member.name)].ravel()] = False
        own &= (np.abs(y) < inner[1] + 1e-6) & (np.abs(z) < inner[3] + 1e-6)
        y = np.where(own & (np.abs(y) > inner[1] - 1e-6), y + np.sign(y) * less * wall, y)
        z = np.where(own & (np.abs(z) > inner[3] - 1e-6), z + np.sign(z) * less * wall, z)
        return s, mesh.moved(axes.T @ np.array([x, y, z]) + start)

    return Defect(
        "thin-wall",
        f"wall of {member.name} thinner by {100 * less:.3g} %",
        "wall-thickness",
        member.name,
        edit,
        (f"member-stiffness@{member.name}", f"member-mass@{member.name}"),
        size=-less,
    )


def slot(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Cut a slot into one side of a member."""
    member = pick(rng, structure.solid_members)
    assert member is not None
    _, length = structure.axes(member)
    share = float(rng.uniform(0.15, 0.85))
    x, y, z = local(structure, solid, member)
    width = between(rng, 0.004, 0.04)
    band = solid.of_part(member.name) & (np.abs(x - share * length) < width / 2)
    if not band.any():
        near = np.abs(x - share * length)
        band = solid.of_part(member.name) & (near < near[solid.of_part(member.name)].min() + 1e-4)
    side = [y, -y, z, -z][int(rng.integers(4))]
    cut = band & (side > side[band].max() - 1e-6)
    if cut.sum() >= band.sum() or solid.without(cut).pieces > 1:
        return None
    long = float(np.ptp(solid.points[:, solid.cells[:, cut]], axis=(1, 2)).max())
    share = float(x[cut].mean() / length)
    first, *others = cut_elements(structure, solid, member, cut)
    return Defect(
        "slot",
        f"slot of {1000 * long:.3g} mm in one side of {member.name} at {share:.2f} of its length",
        "local-stiffness-loss",
        first,
        lambda s, mesh: (s, mesh.without(cut)),
        tuple(f"local-stiffness-loss@{other}" for other in others),
    )


def cut_flange(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Cut one side of a flange of an open section away over some length."""
    opened = [
        m
        for m in structure.solid_members
        if len(structure.sections[m.section].rectangles) > 1 and not is_tube(structure, m)
    ]
    member = pick(rng, opened)
    if member is None:
        return None
    _, length = structure.axes(member)
    share, long = float(rng.uniform(0.2, 0.8)), between(rng, 0.02, 0.12)
    x, y, z = local(structure, solid, member)
    part = solid.of_part(member.name)
    flange = part & (z > z[part].max() - 1e-6) & (y > 0)
    if not flange.any():
        return None
    near = np.abs(x - share * length)
    cut = flange & (near < max(long / 2, near[flange].min() + 1e-4))
    if solid.without(cut).pieces > 1:
        return None
    share = float(x[cut].mean() / length)
    first, *others = cut_elements(structure, solid, member, cut)
    return Defect(
        "cut-flange",
        f"half a flange of {member.name} cut away around {share:.2f} of its length",
        "local-stiffness-loss",
        first,
        lambda s, mesh: (s, mesh.without(cut)),
        tuple(f"local-stiffness-loss@{other}" for other in others),
    )


def clamp_mass(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Leave a clamp next to the axis of a member."""
    member = pick(rng, structure.solid_members)
    assert member is not None
    share = round(float(rng.uniform(0.1, 0.9)), 2)
    mass = between(rng, 0.001, 0.06) * total_mass(solid)
    mass = float(f"{mass:.3g}")
    axes, _ = structure.axes(member)
    section = structure.sections[member.section]
    arm = (section.height / 2 + 0.02) * axes[2]
    at: Place = (member.name, share)
    lump = Lump(at, mass, (float(arm[0]), float(arm[1]), float(arm[2])), drawn=False)
    nodes = nodes_at(member, share)
    return Defect(
        "clamp-mass",
        f"clamp of {mass:g} kg next to the axis of {member.name} at {share:g}",
        "added-mass",
        f"{member.name}@{share:g}",
        lambda s, mesh: (replace(s, lumps=(*s.lumps, lump)), mesh),
        (*(f"added-mass@{n}" for n in nodes), f"mass-offset@{member.name}@{share:g}"),
        size=mass,
        unit="kg",
    )


def total_mass(solid: Solid) -> float:
    """Return the mass of a solid in its straight description, kg."""
    corners = solid.points[:, solid.cells]
    if solid.cells.shape[0] == 4:
        edges = corners[:, 1:] - corners[:, :1]
        volume = np.abs(np.linalg.det(edges.transpose(2, 0, 1))) / 6
    else:
        volume = np.ptp(corners, axis=1).prod(axis=0)
    return float((volume * solid.density).sum())


def soft_foot(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Put a soft layer at one clamp, or weaken one foot's springs."""
    feet = [clamp.at for clamp in structure.clamps]
    sprung = sorted({s.at for s in structure.springs if s.drawn and isinstance(s.at, str)})
    if feet:
        clamp = structure.clamps[int(rng.integers(len(feet)))]
        layer: Cells = np.asarray(clamp.holds(solid.points)[solid.cells].any(axis=0))
        softer = between(rng, 2, 300)
        member = next(m for m in structure.members if clamp.at in m.ends)
        k = 1 if member.ends[0] == clamp.at else member.elements
        return Defect(
            "soft-foot",
            f"the cells at the clamp of {clamp.at} have a modulus {softer:g} times lower",
            "support-flexibility",
            f"support:{clamp.at}",
            lambda s, mesh: (s, mesh.scaled(layer, 1 / softer)),
            (
                *(f"support-flexibility@support:{clamp.at}:{d}" for d in DOFS[structure.plane]),
                f"local-stiffness-loss@{member.name}/{k}",
                f"joint-rotation@{member.name}@{clamp.at}",
            ),
        )
    if not sprung:
        return None
    foot, left = sprung[int(rng.integers(len(sprung)))], between(rng, 0.1, 0.9)
    return Defect(
        "soft-foot",
        f"the springs at {foot} have {100 * left:.3g} % of their stiffness",
        "support-flexibility",
        f"support:{foot}",
        lambda s, mesh: (
            replace(
                s,
                springs=tuple(
                    replace(p, stiffness=p.stiffness * left) if p.at == foot else p
                    for p in s.springs
                ),
            ),
            mesh,
        ),
        tuple(
            f"support-flexibility@support:{foot}:{p.direction}"
            for p in structure.springs
            if p.at == foot and p.drawn
        ),
        size=left - 1,
    )


def wrong_material(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Make one member of another metal."""
    member = pick(rng, structure.solid_members)
    assert member is not None
    drawn = structure.materials[member.material]
    others = {k: m for k, m in OTHER_MATERIALS.items() if abs(m.E / drawn.E - 1) > 0.03}
    name = str(rng.choice(sorted(others)))
    other, cells = others[name], solid.of_part(member.name)
    return Defect(
        "wrong-material",
        f"{member.name} is made of {name}",
        "member-stiffness",
        member.name,
        lambda s, mesh: (s, mesh.of(cells, other)),
        (f"member-mass@{member.name}",),
        size=other.E / drawn.E - 1,
    )


def water(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Fill a hollow member with water to some length of it."""
    member = pick(rng, [m for m in structure.solid_members if is_tube(structure, m)])
    if member is None:
        return None
    _, length = structure.axes(member)
    section = structure.sections[member.section]
    outer, bore = ((r[1] - r[0]) * (r[3] - r[2]) for r in section.rectangles)
    relative = WATER * bore / (structure.materials[member.material].rho * (outer - bore))
    shares = (np.arange(8) + 0.5) / 8
    each = WATER * bore * length / len(shares)
    lumps = tuple(Lump((member.name, float(s)), float(each), drawn=False) for s in shares)
    return Defect(
        "water",
        f"{member.name} is full of water",
        "member-mass",
        member.name,
        lambda s, mesh: (replace(s, lumps=(*s.lumps, *lumps)), mesh),
        size=float(relative),
    )


def strut(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Tie two joints that no member joins by a thin rod."""
    tied = {frozenset(m.ends) for m in structure.members}
    joints = list(structure.joints)
    chords = [
        (a, b)
        for i, a in enumerate(joints)
        for b in joints[i + 1 :]
        if frozenset((a, b)) not in tied and not _on_a_line(structure, a, b)
    ]
    if not chords or structure.plane == "out-of-plane":
        return None
    a, b = chords[int(rng.integers(len(chords)))]
    ends = structure.warped(np.column_stack([structure.point(a), structure.point(b)]))
    distance = float(np.linalg.norm(ends[:, 1] - ends[:, 0]))
    diameter = between(rng, 0.0007, 0.005)
    area = np.pi / 4 * diameter**2
    stiffness = float(f"{210e9 * area / distance:.4g}")
    rod = Strut((a, b), stiffness, float(7850 * area * distance))
    return Defect(
        "strut",
        f"rod of {1000 * diameter:.3g} mm between {a} and {b}",
        "brace-spring",
        f"{a}-{b}",
        lambda s, mesh: (replace(s, struts=(*s.struts, rod)), mesh),
        (f"brace-spring@{b}-{a}",),
        size=stiffness,
        unit="N/m",
    )


def _on_a_line(structure: Structure, a: str, b: str) -> bool:
    """Tell whether two joints lie along one axis, where members in a row join them already."""
    return int((np.abs(structure.point(a) - structure.point(b)) > 1e-9).sum()) < 2


def stiff_cord(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Hold a joint by a spring to ground that nobody drew."""
    seen = [d for d in DOFS[structure.plane] if d in "xyz"]
    clamped = {clamp.at for clamp in structure.clamps}
    joints = [j for j in structure.joints if j not in clamped]
    joint = joints[int(rng.integers(len(joints)))]
    direction = str(rng.choice(seen))
    scale = total_mass(solid) * (2 * np.pi * structure.guess) ** 2
    stiffness = float(f"{between(rng, 0.01, 0.5) * scale:.3g}")
    spring = Spring(joint, direction, stiffness, drawn=False)
    return Defect(
        "stiff-cord",
        f"cord of {stiffness:g} N/m along {direction} at {joint}",
        "grounding-spring",
        f"{joint}:{direction}",
        lambda s, mesh: (replace(s, springs=(*s.springs, spring)), mesh),
        (f"grounding-spring@{joint}",),
        size=stiffness,
        unit="N/m",
    )


def resonating_instrument(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Mount an instrument on a bracket that resonates within the test's band."""
    place, directions = structure.sensors[int(rng.integers(len(structure.sensors)))]
    direction = str(rng.choice(list(directions)))
    mass = float(f"{between(rng, 0.001, 0.03) * total_mass(solid):.3g}")
    frequency = float(f"{structure.guess * rng.uniform(0.8, 3.0):.3g}")
    item = Oscillator(place, direction, mass, frequency)
    if isinstance(place, str):
        words: tuple[str, ...] = (place,)
    else:
        words = (f"{place[0]}@{place[1]:g}", *nodes_at(structure.member(place[0]), place[1]))
    return Defect(
        "instrument",
        f"instrument of {mass:g} kg resonating at {frequency:g} Hz along {direction} at {words[0]}",
        "attached-oscillator",
        f"{words[0]}:{direction}",
        lambda s, mesh: (replace(s, oscillators=(*s.oscillators, item)), mesh),
        tuple(f"attached-oscillator@{w}{end}" for w in words for end in (f":{direction}", "")),
        size=mass,
        unit="kg",
    )


def warm(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Warm the whole structure, which lowers its modulus."""
    less = between(rng, 0.003, 0.05)
    return Defect(
        "warm",
        f"modulus of everything lower by {100 * less:.3g} %",
        "youngs-modulus",
        "all",
        lambda s, mesh: (s, mesh.scaled(np.ones(len(mesh.part), dtype=bool), 1 - less)),
        ("temperature@all",),
        size=-less,
    )


def in_a_loop(structure: Structure, member: Member) -> bool:
    """Tell whether a member's ends hang together without it, by other members or the ground."""
    ground = {clamp.at: "" for clamp in structure.clamps}
    links = [{ground.get(j, j) for j in m.ends} for m in structure.members if m is not member]
    start, goal = (ground.get(joint, joint) for joint in member.ends)
    reached = {start}
    while more := [link for link in links if link & reached and not link <= reached]:
        reached |= set().union(*more)
    return goal in reached


def unfit_member(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Weld a member in that is too long or too short."""
    straight = structure.mesher == "bricks" and structure.warp is None
    if not straight or structure.plane == "out-of-plane":
        return None
    member = pick(
        rng,
        [
            m
            for m in structure.solid_members
            if in_a_loop(structure, m) and "shape" in structure.sections[m.section].drawn
        ],
    )
    if member is None:
        return None
    drawn = structure.sections[member.section].drawn
    size = min(float(drawn[k]) for k in ("width", "height") if k in drawn)
    _, length = structure.axes(member)
    # In parts of the strain at which a hinged bar of that depth buckles (Euler 1744).
    strain = between(rng, 0.02, 0.6) * np.pi**2 / 12 * (size / length) ** 2
    strain *= 1 if rng.random() < 0.5 else -1
    word = "long" if strain > 0 else "short"
    return Defect(
        "unfit-member",
        f"{member.name} was {100 * abs(strain):.3g} % too {word} when it was welded in",
        "axial-preload",
        member.name,
        lambda s, mesh: (s, mesh),
        size=None,
        unit="N",
        preload=(member.name, strain),
    )


KINDS: dict[str, Maker] = {
    "missing-weld": missing_weld,
    "loose-joint": loose_joint,
    "thin-wall": thin_wall,
    "slot": slot,
    "cut-flange": cut_flange,
    "clamp-mass": clamp_mass,
    "soft-foot": soft_foot,
    "wrong-material": wrong_material,
    "water": water,
    "strut": strut,
    "stiff-cord": stiff_cord,
    "instrument": resonating_instrument,
    "warm": warm,
    "unfit-member": unfit_member,
}


def waist(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Turn a member down towards its middle."""
    if structure.mesher != "bricks":
        return None
    member = pick(rng, structure.solid_members)
    assert member is not None
    axes, length = structure.axes(member)
    depth = between(rng, 0.05, 0.3)
    start = structure.point(member.ends[0])[:, None]
    section = structure.sections[member.section]

    def edit(s: Structure, mesh: Solid) -> State:
        own = np.zeros(mesh.points.shape[1], dtype=bool)
        own[mesh.cells[:, mesh.of_part(member.name)].ravel()] = True
        x, y, z = axes @ (mesh.points - start)
        own &= (np.abs(y) < section.width / 2 + 1e-6) & (np.abs(z) < section.height / 2 + 1e-6)
        lean = np.clip(x / length, 0.0, 1.0)
        scale = np.where(own, 1 - depth * np.sin(np.pi * lean) ** 2, 1.0)
        moved = axes.T @ np.array([x, y * scale, z * scale]) + start
        return s, mesh.moved(moved)

    return Defect(
        "waist",
        f"{member.name} is {100 * depth:.3g} % thinner at its middle, tapering to its ends",
        "",
        member.name,
        edit,
    )


def patch(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Bond a plate onto one side of a member."""
    if structure.mesher != "bricks":
        return None
    member = pick(rng, structure.solid_members)
    assert member is not None
    axes, length = structure.axes(member)
    section = structure.sections[member.section]
    share, thick = float(rng.uniform(0.25, 0.6)), between(rng, 0.0008, 0.006)
    first = float(rng.uniform(0.15, 0.85 - share))
    box = np.array(
        [
            [first * length, -section.width / 2, section.height / 2],
            [(first + share) * length, section.width / 2, section.height / 2 + thick],
        ]
    )
    corners = structure.point(member.ends[0]) + box @ axes
    low, high = (tuple(map(float, f(corners, axis=0))) for f in (np.min, np.max))
    plate = Block("patch", low, high, member.material)  # type: ignore[arg-type]

    def edit(s: Structure, mesh: Solid) -> State:
        return s, brick_mesh(replace(s, blocks=(*s.blocks, plate)), s.size[0])

    return Defect(
        "patch",
        f"plate of {1000 * thick:.3g} mm bonded on {member.name} over {100 * share:.2g} % of it",
        "",
        member.name,
        edit,
    )


def sliding_joint(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Put a nearly incompressible layer into a joint, which shears but does not open."""
    ends = [(m, e) for m, e in welded(structure, solid) if not is_tube(structure, m)]
    if not ends:
        return None
    member, end = ends[int(rng.integers(len(ends)))]
    layer, softer = weld_cells(structure, solid, member, end), between(rng, 300, 10000)
    rubber = Material(structure.materials[member.material].E / softer, 0.4995, 1200.0)
    joint = member.ends[end]
    return Defect(
        "sliding-joint",
        f"{member.name} slides at {joint} on a layer with a modulus {softer:g} times lower",
        "",
        f"{member.name}@{joint}",
        lambda s, mesh: (s, mesh.of(layer, rubber)),
    )


def gradient(structure: Structure, solid: Solid, rng: Generator) -> Defect | None:
    """Let the modulus fall along one axis, as over a casting or a heated side."""
    spans = np.ptp(solid.points, axis=1)
    axis = int(rng.choice(np.flatnonzero(spans > 0.3 * spans.max())))
    fall = between(rng, 0.02, 0.3)
    lean = (solid.centres[axis] - solid.points[axis].min()) / spans[axis]
    return Defect(
        "gradient",
        f"modulus lower by 0 to {100 * fall:.3g} % along {'xyz'[axis]}",
        "",
        "all",
        lambda s, mesh: (s, replace(mesh, modulus=mesh.modulus * (1 - fall * lean))),
    )


OUTSIDE: dict[str, Maker] = {
    "waist": waist,
    "patch": patch,
    "sliding-joint": sliding_joint,
    "gradient": gradient,
}


ATTACHED = ("clamp-mass", "water", "strut", "stiff-cord", "instrument")  # edit no cell
