"""Meshes of tetrahedra by gmsh, for members that run at any angle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from truths.solid import Solid
from truths.structure import Member, Structure

Array = npt.NDArray[np.float64]
TETRAHEDRON = 4  # gmsh's number of the four-node element


def _occ_box(low: Array, size: Array, axes: Array, start: Array) -> tuple[int, int]:
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
        box = [_occ_box(low, size, axes, start)]
        body = [*body, *box] if solid else gmsh.model.occ.cut(body, box)[0]
    return list(body)


def tetrahedral_mesh(structure: Structure, size: float) -> Solid:
    """Mesh with tetrahedra of about `size` (m); what overlaps belongs to the later part.

    Raises:
        ValueError: where parts do not hang together.
    """
    import gmsh

    gmsh.initialize(["-v", "1"], readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        gmsh.model.add(structure.name)
        volumes: list[tuple[str, str, tuple[int, int]]] = []
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
        tags = [tag for *_, tag in volumes]
        _, pieces = gmsh.model.occ.fragment(tags[:1], tags[1:]) if len(tags) > 1 else (None, [tags])
        gmsh.model.occ.synchronize()
        owner: dict[int, int] = {}
        for number, own in enumerate(pieces):
            owner |= {tag: number for _, tag in own}
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size * 0.7)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("Netgen")
        node, coordinates, _ = gmsh.model.mesh.getNodes()
        index = np.zeros(int(node.max()) + 1, dtype=np.int64)
        index[node.astype(np.int64)] = np.arange(len(node))
        points = coordinates.reshape(-1, 3).T
        cells, part = [], []
        for _, tag in gmsh.model.getEntities(3):
            _, corners = gmsh.model.mesh.getElementsByType(TETRAHEDRON, tag)
            cells.append(index[corners.astype(np.int64)].reshape(-1, 4))
            part.append(np.full(len(cells[-1]), owner[tag]))
    finally:
        gmsh.finalize()
    names = tuple(dict.fromkeys(name for name, *_ in volumes))
    which = np.concatenate(part)
    used, compact = np.unique(np.concatenate(cells).T, return_inverse=True)
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
