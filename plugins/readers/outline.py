"""The edges that draw a mesh of solids and shells: where its surface ends or turns."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from femubench.fem import FloatArray, IntArray
from femubench.plugins.readers.shells import ALIKE

# Corners of the faces by the number of corners of an element and whether it is a solid.
_FACES = {
    (4, True): ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    (6, True): ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2)),
    (8, True): (
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6)),
        (0, 4, 7, 3),
    ),
    (3, False): ((0, 1, 2),),
    (4, False): ((0, 1, 2, 3),),
}


def find_outline(elements: Iterable[tuple[bool, IntArray]], xyz: FloatArray) -> IntArray:
    """Return the edges at which the surface of a body ends or turns by `ALIKE`, (e, 2).

    Arguments:
        elements: whether solids, and the corners of some of one kind, (n, 3), (n, 4), (n, 6) or
            (n, 8) rows of `xyz`.
        xyz: of the nodes, (k, 3).
    """
    faces = [
        np.pad(corners[:, own], ((0, 0), (0, 4 - len(own))), mode="wrap")
        for solid, corners in elements
        for own in _FACES[corners.shape[1], solid]
    ]
    if not faces:
        return np.empty((0, 2), dtype=np.int64)
    whole = np.vstack(faces)
    _, first, count = np.unique(
        np.sort(whole, axis=1), axis=0, return_index=True, return_counts=True
    )
    surface = whole[first[count == 1]]
    normals = np.cross(
        xyz[surface[:, 1]] - xyz[surface[:, 0]], xyz[surface[:, 2]] - xyz[surface[:, 0]]
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    ends = np.stack([surface, np.roll(surface, -1, axis=1)], axis=2).reshape(-1, 2)
    face = np.repeat(np.arange(len(surface)), 4)
    proper = ends[:, 0] != ends[:, 1]  # the fourth edge of a triangle is a point
    edges, at = np.unique(np.sort(ends[proper], axis=1), axis=0, return_inverse=True)
    order = np.argsort(at, kind="stable")
    own = face[proper][order]
    starts = np.searchsorted(at[order], np.arange(len(edges)))
    number = np.diff(np.append(starts, len(own)))
    other = own[np.minimum(starts + 1, len(own) - 1)]
    along = np.abs(np.einsum("ij,ij->i", normals[own[starts]], normals[other]))
    return np.asarray(edges[(number != 2) | (along < ALIKE)])
