"""Mirror images: places that a symmetry of the structure carries into each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import permutations, product

import numpy as np
from scipy.spatial import cKDTree

from femubench.core.drawing.places import PlacedWireframe, find_wireframe
from femubench.core.fem.model import Model
from femubench.core.inference.settings import settings
from femubench.core.typing import FloatArray


def symmetries(model: Model) -> tuple[FloatArray, ...]:
    """Return the turns and reflections that leave a model as it is, (3, 3) each.

    Those that exchange the axes or their signs about the middle of the structure: they must carry
    every dof onto a dof, and mass and stiffness onto themselves.

    Arguments:
        model: any model whose dofs have positions; one with changes of low rank has none.
    """
    changed = model.stiffness_change is not None or model.mass_change is not None
    if changed or not np.isfinite(model.dofs.xyz).all():
        return ()
    return tuple(turn for turn in _turns() if _leaves(model, turn))


def mirror_places(model: Model, place: str, others: Iterable[str]) -> tuple[str, ...]:
    """Return those of some places that are images of one place."""
    words = tuple(others)
    wireframe = find_wireframe(model, (place, *words))
    extents = {word: _extent(wireframe, word) for word in (place, *words)}
    middle, size = _middle(model.dofs.xyz)
    own = extents[place] - middle
    images = [own @ turn.T + middle for turn in symmetries(model)] if len(own) else []
    return tuple(
        word for word in words if any(_same(image, extents[word], size) for image in images)
    )


def _turns() -> Iterator[FloatArray]:
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.diag(signs)[list(order)]
            if not np.array_equal(turn, np.eye(3)):
                yield turn


def _middle(xyz: FloatArray) -> tuple[FloatArray, float]:
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    return 0.5 * (low + high), float(np.linalg.norm(high - low)) or 1.0


def _leaves(model: Model, turn: FloatArray) -> bool:
    """Tell whether a model that is turned is the same model."""
    dofs = model.dofs
    middle, size = _middle(dofs.xyz)
    at, motions = (dofs.xyz - middle) / size, dofs.motions
    # Rotations are pseudovectors: a reflection turns them the other way.
    turned = np.hstack([motions[:, :3] @ turn.T, np.linalg.det(turn) * motions[:, 3:] @ turn.T])
    known, wanted = (np.hstack([x, np.abs(m)]) for x, m in ((at, motions), (at @ turn.T, turned)))
    gap, image = cKDTree(known).query(wanted)
    if (gap > settings.negligible).any() or len(np.unique(image)) < len(dofs):
        return False
    sign = np.einsum("ij,ij->i", turned, motions[image])
    if (np.abs(np.abs(sign) - 1.0) > settings.negligible).any():
        return False
    for matrix in (model.stiffness, model.mass):
        moved = matrix.tocsr()[image][:, image].multiply(sign[:, None]).multiply(sign[None])
        if not abs(moved - matrix).max() <= settings.negligible * abs(matrix).max():
            return False
    return True


def _extent(wireframe: PlacedWireframe, word: str) -> FloatArray:
    """Return the lines and points that a place covers by their two ends, (k, 2, 3)."""
    place = wireframe.place(word)
    rows = [(point, point) for point in place.points]
    for span in place.spans:
        start, end = (wireframe.joints[k].xyz for k in wireframe.members[span.member].ends)
        ends = np.array([start, end])
        rows += [tuple((1.0 - s) * ends[0] + s * ends[1] for s in (span.start, span.end))]
    return np.array(rows, dtype=float).reshape(-1, 2, 3)


def _same(one: FloatArray, other: FloatArray, size: float) -> bool:
    if len(one) != len(other):
        return False
    gaps = (other, other[:, ::-1])
    gap = np.min([np.abs(one[:, None] - o[None]).max(axis=(2, 3)) for o in gaps], axis=0)
    # Coordinates of drawings are rounded to nine decimals.
    return bool((gap.min(axis=1) <= settings.negligible * size + 1e-8).all())
