"""The solid model an engineer draws: members as they meet, in groups, as a deck of CalculiX.

It reads of a structure what the drawing of beams reads, how members pass each other, and plates,
gussets, feet and holes, which drawings of a workshop show. Welds, and what is marked as not drawn,
stay unknown to it. gmsh's tetrahedra of ten nodes, coarse, share nothing with the bricks of the
solid that was tested.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from truths.bricks import face_of
from truths.drawing import DOFS, place, table
from truths.seats import DIRECTIONS, rigid_motion
from truths.solid import Solid
from truths.structure import Block, Member, Place, Structure
from truths.suite import write_files
from truths.tetrahedra import Volume, box_volume, mesh_volumes

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Rectangle = tuple[float, float, float, float]  # y0, y1, z0, z1 in m
MOST, LARGEST = 3000, 7000  # tetrahedra of a drawing, wanted and where walls are thin
FINER = 0.87  # times the size of elements, as long as there are no more
ZONE = 0.6  # of a section's depth: so far from the face of what it meets a joint reaches
NEAR = 1e-6  # m; nearer points are one
WALLS = (0.5, 1.0, np.inf)  # of a thin-walled section's width: elements where such sections meet
APART = 0.15  # of a section's depth: cuts nearer than this are one
DECK, JOINT = "solid.inp", "joint-"  # the file, and how groups of joints begin
# The others: docs/scenarios.md says why not.
_NAMES = """
    a-frame arch bell-crank bicycle bracket c-press chair connecting-rod curved-deck
    drill-press engine-mount footing-frame fork-carriage gable gantry garteur h-tube
    haunched-portal hook-block ladder-channel lathe-bed mast-lumps mast-on-pad pi-portal
    pile-bent portal propeller robot-arm ski stepped-strip stiffened-strip table-feet
    tapered-cantilever tee-bridge tower trailer tuning-fork turbine-blade turbine-deck
    two-material-tee vierendeel wing-spar
"""
DRAWN = tuple(_NAMES.split())
FEWEST = 8  # nodes of a seat
EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))  # of a tetrahedron in Abaqus' order


@dataclass(frozen=True)
class Piece:
    """A part of a member between two sections, and the group it belongs to."""

    member: Member
    group: str
    low: float
    high: float


def pieces_of(structure: Structure) -> list[Piece]:
    """Return the members cut into groups, and where something is measured or attached."""
    found = []
    for member in structure.solid_members:
        _, length = structure.axes(member)
        section = structure.sections[member.section]
        depth = max(section.width, section.height)
        zones = [_zone(structure, member, end) for end in (0, 1)]
        reach = np.array([z + ZONE * depth if z is not None else 0.0 for z in zones])
        reach *= min(1.0, 0.8 * length / max(reach.sum(), 1e-9))
        ends = (-member.extend[0], length + member.extend[1])
        cuts = [*ends, reach[0], length - reach[1]]
        wanted = [
            at[1] * length
            for at in places(structure)
            if not isinstance(at, str) and at[0] == member.name
        ]
        wanted += [x for x, zone in zip((0.0, length), zones, strict=True) if zone is None]
        for at in wanted:
            if ends[0] < at < ends[1] and np.abs(np.array(cuts) - at).min() > APART * depth:
                cuts.append(at)
        cuts = sorted(set(cuts))
        for low, high in pairwise(cuts):
            middle, group = (low + high) / 2, member.name
            if middle < reach[0] and zones[0] is not None:
                group = JOINT + member.ends[0]
            elif middle > length - reach[1] and zones[1] is not None:
                group = JOINT + member.ends[1]
            if high - low > NEAR:
                found.append(Piece(member, group, low, high))
    made = {(piece.group, piece.member.material) for piece in found}
    several = {group for group, _ in made if sum(group == other for other, _ in made) > 1}
    return [
        replace(p, group=f"{p.group}-{p.member.material}") if p.group in several else p
        for p in found
    ]


def group_of(block: Block) -> str:
    """Return the group of a plate, which may be of several blocks that are counted."""
    return re.sub(r"-?\d+$", "", block.name)


def places(structure: Structure) -> list[Place]:
    """Return the places where something is measured, attached, or hangs."""
    found = [at for at, _ in structure.sensors]
    for change in structure.changes:
        found += [lump.at for lump in change.lumps] + [spring.at for spring in change.springs]
    found += [lump.at for lump in structure.lumps if lump.drawn]
    found += [spring.at for spring in structure.springs if spring.drawn]
    return list(dict.fromkeys(found))


def _zone(structure: Structure, member: Member, end: int) -> float | None:
    """Return the distance from a joint to the face of what a member meets or is held by there."""
    joint, (axes, _) = member.ends[end], structure.axes(member)
    across = [
        other
        for other in structure.solid_members
        if other is not member
        and joint in other.ends
        and abs(structure.axes(other)[0][0] @ axes[0]) < 0.95
    ]
    held = any(clamp.at == joint for clamp in structure.clamps)
    return face_of(structure, member, end) if across or held else None


@dataclass(frozen=True)
class Box:
    """A box in the axes of a member, which takes the place of what is there.

    Arguments:
        ends, sides: its limits along and across the axes, m.
        parts: group, material and ends of the pieces that fill it; none in a hole.
        axes, start: (3, 3) and (3,), of the member; global ones of a plate.
    """

    ends: tuple[float, float]
    sides: Rectangle
    parts: tuple[tuple[str, str, tuple[float, float]], ...]
    axes: Array
    start: Array


def boxes_of(structure: Structure) -> Iterator[Box]:
    """Yield what a structure is made of, in the order in which one takes the place of another."""

    def plates(first: bool) -> Iterator[Box]:
        for block in structure.blocks:
            if block.first == first:
                x, y, z = zip(block.low, block.high, strict=True)
                # Where jaws end on a plate nodes are needed, or a line of them is all that is held.
                cuts = sorted({*x, *(c for c in _jaws(structure, block) if x[0] < c < x[1])})
                fill = [(group_of(block), block.material, ends) for ends in pairwise(cuts)]
                yield Box(
                    x, (*y, *z), tuple(fill if block.material else ()), np.eye(3), np.zeros(3)
                )

    pieces = pieces_of(structure)
    yield from plates(True)
    for member in structure.solid_members:
        axes, length = structure.axes(member)
        ends = -member.extend[0], length + member.extend[1]
        own = [(p.group, member.material, (p.low, p.high)) for p in pieces if p.member is member]
        for y0, y1, z0, z1, solid in structure.sections[member.section].rectangles:
            fill = tuple(own) if solid else ()
            yield Box(ends, (y0, y1, z0, z1), fill, axes, structure.point(member.ends[0]))
    yield from plates(False)


def _jaws(structure: Structure, block: Block) -> Iterator[float]:
    """Yield the limits in x of clamps that touch a plate."""
    for clamp in structure.clamps:
        low, high = np.maximum(clamp.low, block.low), np.minimum(clamp.high, block.high)
        if (low < high + NEAR).all():
            yield from (clamp.low[0], clamp.high[0])


def _volumes(structure: Structure) -> list[Volume]:
    """Add all boxes to gmsh's model; where they overlap is the later one, or its void."""
    import gmsh

    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    found: list[Volume] = []
    for box in boxes_of(structure):

        def add(ends: tuple[float, float], sides: Rectangle) -> tuple[int, int]:
            y0, y1, z0, z1 = sides
            size = np.array([ends[1] - ends[0], y1 - y0, z1 - z0])
            return box_volume(np.array([ends[0], y0, z0]), size, box.axes, box.start)  # noqa: B023

        gone = add(box.ends, box.sides)
        left: list[Volume] = []
        for name, material, tag in found:
            rest = [tag]
            if _touch(tag, gone):
                rest, _ = gmsh.model.occ.cut([tag], [gone], removeTool=False)
            left += [(name, material, piece) for piece in rest]
        gmsh.model.occ.remove([gone], recursive=True)
        found = left
        for half in _halves(structure, box.axes, box.sides):
            found += [(group, material, add(ends, half)) for group, material, ends in box.parts]
    return found


def _touch(*tags: tuple[int, int]) -> bool:
    """Tell whether two volumes of gmsh's model may overlap: their boxes do."""
    import gmsh

    first, second = (np.array(gmsh.model.occ.getBoundingBox(*tag)) for tag in tags)
    low, high = np.maximum(first[:3], second[:3]), np.minimum(first[3:], second[3:])
    return bool((high - low > NEAR).all())


def _halves(structure: Structure, axes: Array, box: Sequence[float]) -> list[Rectangle]:
    """Return a rectangle, in two where the plane of a planar drawing cuts it."""
    y0, y1, z0, z1 = box
    if structure.plane == "3d":
        return [(y0, y1, z0, z1)]
    across = 1 if structure.plane == "in-plane" else 2
    if abs(axes[1, across]) > 0.5 and y0 < -NEAR and y1 > NEAR:
        return [(y0, 0.0, z0, z1), (0.0, y1, z0, z1)]
    if abs(axes[2, across]) > 0.5 and z0 < -NEAR and z1 > NEAR:
        return [(y0, y1, z0, 0.0), (y0, y1, 0.0, z1)]
    return [(y0, y1, z0, z1)]


@dataclass(frozen=True)
class SolidDrawing:
    """A mesh of tetrahedra with a node amid every edge.

    Arguments:
        structure: that is drawn.
        solid: its corners and groups.
        straight, nodes: (3, n) in the straight description and in the real shape, m; those amid
            edges come last.
        cells: (10, m) in Abaqus' order.
    """

    structure: Structure
    solid: Solid
    straight: Array
    nodes: Array
    cells: Integers

    def seat(self, at: Place) -> Integers:
        """Return the nodes of the section around a place.

        Raises:
            ValueError: where there are too few.
        """
        item = self.structure
        member = item.member(at[0]) if isinstance(at, tuple) else item.at_joint(at)
        axes, length = item.axes(member)
        section = item.sections[member.section]
        x, y, z = axes @ (self.straight - item.point(at)[:, None])
        near = (np.abs(y) < section.width / 2 + NEAR) & (np.abs(z) < section.height / 2 + NEAR)
        for thickness in (1e-4, *(0.02 * length * 1.5 ** np.arange(6))):
            found = np.flatnonzero(near & (np.abs(x) < thickness))
            if len(found) >= FEWEST and np.linalg.cond(self._motion(found, at)) < 1e4:
                return found
        raise ValueError(f"{item.name}: {len(found)} nodes at {place(at)}")

    def centre(self, at: Place) -> Array:
        """Return where a place really is, (3,), m."""
        return np.asarray(self.structure.warped(self.structure.point(at)[:, None])[:, 0])

    def _motion(self, nodes: Integers, at: Place) -> Array:
        arms = self.nodes[:, nodes] - self.centre(at)[:, None]
        return rigid_motion(arms / np.abs(arms).max())

    def held(self) -> Iterator[tuple[Integers, tuple[int, ...]]]:
        """Yield nodes and the directions, 1 to 3, in which they are held.

        Raises:
            ValueError: where no node lies in a clamp.
        """
        item = self.structure
        for clamp in item.clamps:
            found = np.flatnonzero(clamp.holds(self.straight))
            if not len(found):
                raise ValueError(f"{item.name}: no node in the clamp at {clamp.at}")
            yield found, (1, 2, 3)
        if item.plane != "3d":
            across = 1 if item.plane == "in-plane" else 2
            amid = np.flatnonzero(np.abs(self.straight[across]) < NEAR)
            along = {"x", "y", "z"} - {*DOFS[item.plane]}
            yield amid, tuple(sorted("xyz".index(d) + 1 for d in along))


def draw(structure: Structure) -> SolidDrawing:
    """Mesh a structure as an engineer draws it, with coarse tetrahedra.

    Raises:
        ValueError: where parts do not hang together, or details take too many nodes.
    """
    depth = max(max(s.width, s.height) for s in structure.sections.values())
    sizes = [float(size) for size in 8.0 * depth * FINER ** np.arange(0, 32, 2)]
    for wall in WALLS:
        solid = mesh_volumes(structure, sizes, _volumes, MOST, _finer(structure, wall))
        if solid.cells.shape[1] <= LARGEST:
            break
    else:
        raise ValueError(f"{structure.name}: {solid.cells.shape[1]} cells, {LARGEST} at most")
    if solid.pieces > 1:
        raise ValueError(f"{structure.name}: {solid.pieces} pieces that share no corner")
    return drawing_of(structure, solid)


def drawing_of(structure: Structure, solid: Solid) -> SolidDrawing:
    """Return the drawing of a mesh of tetrahedra, with a node amid every edge."""
    ends = np.sort(np.array([solid.cells[list(edge)] for edge in EDGES]), axis=1)
    edges, index = np.unique(ends.transpose(0, 2, 1).reshape(-1, 2), axis=0, return_inverse=True)
    middle = index.reshape(len(EDGES), -1) + solid.points.shape[1]
    straight = np.hstack([solid.points, solid.points[:, edges].mean(axis=2)])
    cells = np.vstack([solid.cells, middle])
    nodes = straight if structure.warp is None else structure.warped(straight)
    return SolidDrawing(structure, solid, straight, nodes, cells)


def _finer(structure: Structure, wall: float) -> dict[str, float]:
    """Return the largest size of elements where walls meet, m, by group: there they bend.

    Arguments:
        wall: that size by the width of the section.
    """
    found: dict[str, float] = {}
    for piece in pieces_of(structure):
        section = structure.sections[piece.member.section]
        if piece.group.startswith(JOINT) and len(section.rectangles) > 1:
            size = wall * min(section.width, section.height)
            found[piece.group] = min(size, found.get(piece.group, size))
    return found


def deck_of(drawing: SolidDrawing) -> str:
    """Return the drawing as an input file: groups, couplings at places, lumps and springs."""
    item, solid, points = drawing.structure, drawing.solid, drawing.nodes.copy()
    hung = [(place(at), at, np.zeros(3)) for at in places(item)]
    lumps = [(i, lump) for i, lump in enumerate(item.lumps, 1) if lump.drawn]
    # The arm of a lump is rigid: it is coupled to the same nodes.
    hung += [(f"lump-{i}", m.at, np.array(m.offset)) for i, m in lumps if any(m.offset)]
    first = points.shape[1] + 1
    number = {name: first + i for i, (name, _, _) in enumerate(hung)}
    centres = np.array([drawing.centre(at) + offset for _, at, offset in hung]).T
    for centre in centres.T:  # a place is that of one node
        points[0] += np.where(np.linalg.norm(points - centre[:, None], axis=0) < 1e-5, 2e-5, 0.0)
    lines = ["*NODE"]
    for i, xyz in enumerate(np.hstack([points, centres]).T, 1):
        lines.append(",".join([str(i), *(f"{v:.6f}".rstrip("0").rstrip(".") for v in xyz)]))
    own = [np.flatnonzero(solid.of_part(name)) for name in solid.parts]
    for name, cells in zip(solid.parts, own, strict=True):
        lines.append(f"*ELEMENT, TYPE=C3D10, ELSET={name}")
        lines += [",".join(map(str, (i + 1, *(drawing.cells[:, i] + 1)))) for i in cells]
    for name, cells in zip(solid.parts, own, strict=True):
        values = (solid.modulus[cells[0]], solid.poisson[cells[0]], solid.density[cells[0]])
        modulus, poisson, density = (f"{value:.9g}" for value in values)
        lines += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{modulus},{poisson}"]
        lines += ["*DENSITY", density, f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"]
    for i, (name, at, _) in enumerate(hung, 1):
        lines += [f"*NSET, NSET=seat-{i}", *_rows(drawing.seat(at) + 1)]
        lines += [f"*SURFACE, NAME=at-{i}, TYPE=NODE", f"seat-{i}"]
        lines += [f"*COUPLING, REF NODE={number[name]}, SURFACE=at-{i}, CONSTRAINT NAME={name}"]
        lines += ["*DISTRIBUTING", "1,6"]
    count = solid.cells.shape[1]
    for i, lump in lumps:
        count += 1
        node = number.get(f"lump-{i}") or number[place(lump.at)]
        lines += [f"*ELEMENT, TYPE=MASS, ELSET=lump-{i}", f"{count},{node}"]
        lines += [f"*MASS, ELSET=lump-{i}", f"{lump.mass:.9g}"]
    for spring in item.springs:
        if spring.drawn and spring.direction in DOFS[item.plane]:
            count += 1
            name = f"spring-{place(spring.at)}-{spring.direction}"
            lines += [
                f"*ELEMENT, TYPE=SPRING1, ELSET={name}",
                f"{count},{number[place(spring.at)]}",
            ]
            lines += [f"*SPRING, ELSET={name}", str(DIRECTIONS.index(spring.direction) + 1)]
            lines.append(f"{spring.stiffness:.9g}")
    for i, (nodes, along) in enumerate(drawing.held(), 1):
        lines += [f"*NSET, NSET=held-{i}", *_rows(nodes + 1), "*BOUNDARY"]
        lines += [f"held-{i},{d},{d}" for d in along]
    return "\n".join([*lines, ""])


def toml_of(drawing: SolidDrawing) -> str:
    """Return the file that names the deck as a drawing of the case."""
    kinds = {piece.group: "part" for piece in pieces_of(drawing.structure)}  # however light
    kinds |= {name: "joint" for name in drawing.solid.parts if name.startswith(JOINT)}
    values: dict[str, object] = {"kind": "file", "file": DECK}
    known = [{"name": name, "kind": kinds[name]} for name in drawing.solid.parts if name in kinds]
    groups = [table("[[model.groups]]", group) for group in known]
    return "\n".join(["# Written by `make truths`.\n", table("[model]", values), *groups])


def write(structure: Structure, folder: Path) -> list[str]:
    """Draw a structure and write its files; return what differs from what was there."""
    drawing = draw(structure)
    files = {DECK: deck_of(drawing), "solid.toml": toml_of(drawing)}
    return write_files(folder / structure.name, files)


def _rows(numbers: Integers) -> list[str]:
    return [",".join(map(str, numbers[i : i + 16])) for i in range(0, len(numbers), 16)]
