"""Meshes of tetrahedra by gmsh, for members that run at any angle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from truths.solid import Solid
from truths.structure import Member, Structure

Array = npt.NDArray[np.float64]
Volume = tuple[str, str, tuple[int, int]]  # part, material, gmsh's (dimension, tag)
TETRAHEDRON = 4  # gmsh's number of the four-node element


def box_volume(low: Array, size: Array, axes: Array, start: Array) -> tuple[int, int]:
    """Add a box given in a member's axes; return gmsh's (dimension, tag)."""
    import gmsh

    tag = gmsh.model.occ.addBox(*low, *size)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = axes.T, start
    gmsh.model.occ.affineTransform([(3, tag)], list(turn.ravel()))
    return 3, tag


def member_volume(structure: Structure, member: Member) -> list[tuple[int, int]]:
    """Add a member to gmsh's model; return its volumes."""
    import gmsh

    axes, length = structure.axes(member)
    start, section = structure.point(member.ends[0]), structure.sections[member.section]
    before, after = member.extend
    body: list[tuple[int, int]] = []
    for y0, y1, z0, z1, solid in section.rectangles:
        low = np.array([-before, y0, z0])
        size = np.array([length + before + after, y1 - y0, z1 - z0])
        box = [box_volume(low, size, axes, start)]
        body = [*body, *box] if solid else gmsh.model.occ.cut(body, box)[0]
    return list(body)


def tetrahedral_mesh(structure: Structure, size: float) -> Solid:
    """Mesh with tetrahedra of about `size` (m); what overlaps belongs to the later part.

    Raises:
        ValueError: where parts do not hang together.
    """
    return mesh_volumes(structure, (size,), _volumes)


def _volumes(structure: Structure) -> list[Volume]:
    """Add members and blocks to gmsh's model; return what they became."""
    import gmsh

    volumes: list[Volume] = []
    cuts: list[tuple[int, int]] = []

    def add_block(first: bool) -> None:
        for block in structure.blocks:
            if block.first == first:
                low, high = np.array(block.low), np.array(block.high)
                tag = (3, gmsh.model.occ.addBox(*low, *(high - low)))
                if block.material:
                    volumes.append((block.name, block.material, tag))
                else:
                    cuts.append(tag)

    add_block(True)
    for member in structure.members:
        own = member_volume(structure, member)
        volumes += [(member.name, member.material, tag) for tag in own]
    add_block(False)
    if cuts:
        kept = []
        for name, material, tag in volumes:
            left, _ = gmsh.model.occ.cut([tag], cuts, removeTool=False)
            kept += [(name, material, piece) for piece in left]
        gmsh.model.occ.remove(cuts, recursive=True)
        volumes = kept
    return volumes


def mesh_volumes(
    structure: Structure,
    sizes: Sequence[float],
    add: Callable[[Structure], list[Volume]],
    most: float = np.inf,
    finer: Mapping[str, float] | None = None,
) -> Solid:
    """Mesh the volumes that `add` makes in gmsh's model; what overlaps belongs to the later one.

    Arguments:
        sizes: of tetrahedra, m, falling; taken is the last with few cells, or else the first.
        most: few cells.
        finer: largest size in some parts, m, by name.
    """
    import gmsh

    gmsh.initialize(["-v", "1"], readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        gmsh.model.add(structure.name)
        volumes = add(structure)
        tags = [tag for *_, tag in volumes]
        _, pieces = gmsh.model.occ.fragment(tags[:1], tags[1:]) if len(tags) > 1 else (None, [tags])
        gmsh.model.occ.synchronize()
        owner: dict[int, int] = {}
        for number, own in enumerate(pieces):
            owner |= {tag: number for _, tag in own}
        local: dict[tuple[int, int], float] = {}
        for tag, number in owner.items():
            if size := (finer or {}).get(volumes[number][0]):
                sides = gmsh.model.getBoundary([(3, tag)], oriented=False, recursive=False)
                edges = gmsh.model.getBoundary(sides, combined=False, oriented=False)
                local |= dict.fromkeys([(3, tag), *sides, *edges], size)
        if local:
            gmsh.model.mesh.setSizeCallback(
                lambda dim, tag, x, y, z, lc: min(lc, local.get((dim, tag), lc))
            )
        points, cells, which = _mesh(sizes[0], owner, len(sizes) == 1, not local)
        for size in sizes[1:]:
            try:
                smaller = _mesh(size, owner, False, not local)
            except Exception as error:  # where one size leaves gmsh no mesh of a face
                if type(error) is not Exception:  # and it raises nothing narrower
                    raise
                continue
            if smaller[1].shape[1] > most:
                break
            points, cells, which = smaller
    finally:
        gmsh.finalize()
    names = tuple(dict.fromkeys(name for name, *_ in volumes))
    used, compact = np.unique(cells, return_inverse=True)
    made = [structure.materials[material] for _, material, _ in volumes]
    return Solid(
        points=points[:, used],
        cells=compact.reshape(4, -1),
        part=np.array([names.index(name) for name, *_ in volumes])[which],
        parts=names,
        modulus=np.array([m.E for m in made])[which],
        poisson=np.array([m.nu for m in made])[which],
        density=np.array([m.rho for m in made])[which],
    )


def _mesh(
    size: float, owner: dict[int, int], polished: bool, even: bool = True
) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return points (3, n), corners of cells (4, m) and which volume each lies in, (m,)."""
    import gmsh

    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size * 0.7 if even else 0.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.model.mesh.generate(3)
    if polished:  # which makes smaller tetrahedra
        gmsh.model.mesh.optimize("Netgen")
    node, coordinates, _ = gmsh.model.mesh.getNodes()
    index = np.zeros(int(node.max()) + 1, dtype=np.int64)
    index[node.astype(np.int64)] = np.arange(len(node))
    cells, part = [], []
    for _, tag in gmsh.model.getEntities(3):
        _, corners = gmsh.model.mesh.getElementsByType(TETRAHEDRON, tag)
        cells.append(index[corners.astype(np.int64)].reshape(-1, 4))
        part.append(np.full(len(cells[-1]), owner[tag]))
    return coordinates.reshape(-1, 3).T, np.concatenate(cells).T, np.concatenate(part)
