"""Pairs of nodes that face each other, between which a model may have no spring or another one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.effect.attachments import free_translations
from femubench.core.effect.places import split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Place
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import cache_by_model
from femubench.core.typing import FloatArray

_MOST = 300  # pairs
Pair = tuple[str, str]


def _nodes(model: Model) -> dict[str, FloatArray]:
    """Return where joints of a frame, or nodes of matrices, are in m."""
    if model.structure is not None:
        frame = model.structure.frame
        return {joint.name: np.array(joint.xyz) for joint in frame.joints}
    return model.geometry.places if isinstance(model.geometry, MatrixGeometry) else {}


@cache_by_model
def facing_nodes(model: Model) -> tuple[Pair, ...]:
    """Return the pairs of joints or nodes that share a place, 300 at most.

    Of more than two at one place each pairs with the next.

    Examples:
        >>> effect.facing_nodes(model)
        ()
    """
    at: dict[tuple[float, ...], list[str]] = {}
    for name, xyz in _nodes(model).items():
        at.setdefault(tuple(np.round(xyz / ON_MEMBER).tolist()), []).append(name)
    pairs = [pair for names in at.values() for pair in pairwise(names)]
    return tuple(pairs[:_MOST])


def node_pairs(model: Model, place: str) -> tuple[Pair, ...]:
    """Return the pairs of ``A-B``, or of ``A+B-C+D``, where A faces C and B faces D.

    A direction is left out; names with a dash or a plus of their own are understood.

    Raises:
        ModelError: when there are no such nodes, or more on one side than on the other.

    Examples:
        >>> effect.node_pairs(model, "J1+J3-J7+J9")
        (('J1', 'J7'), ('J3', 'J9'))
    """
    known = _nodes(model)
    words = split_direction(place)[0].split("-")
    for cut in range(1, len(words)):
        sides = [_names("-".join(part), known) for part in (words[:cut], words[cut:])]
        if sides[0] and len(sides[0]) == len(sides[1]) and not set(sides[0]) & set(sides[1]):
            return tuple(zip(*sides, strict=True))
    raise ModelError(f"there is no pair of nodes {place!r}")


def _names(word: str, known: dict[str, FloatArray]) -> list[str]:
    """Return the nodes of ``A+B``; nothing where one is unknown."""
    if word in known:
        return [word]
    parts = word.split("+")
    for cut in range(1, len(parts)):
        first, rest = "+".join(parts[:cut]), _names("+".join(parts[cut:]), known)
        if first in known and rest:
            return [first, *rest]
    return []


def interface_directions(model: Model, place: str) -> tuple[str, ...]:
    """Return the direction of a place, or all translations that its nodes can move in.

    Raises:
        ModelError: when there are no such nodes, or they cannot move that way.

    Examples:
        >>> effect.interface_directions(model, "J1-J7")
        ('z',)
    """
    names = [name for pair in node_pairs(model, place) for name in pair]
    free = [free_translations(model, Place(joint=name)) for name in names]
    shared = tuple(d for d in free[0] if all(d in other for other in free))
    direction = split_direction(place)[1]
    found = shared if direction is None else tuple(d for d in shared if d == direction)
    if not found:
        raise ModelError(f"the nodes of {place!r} do not move that way")
    return found


def interface_places(model: Model, pairs: Sequence[Pair]) -> tuple[str, ...]:
    """Return the words of pairs of nodes, of each direction, and of all of them together.

    Examples:
        >>> effect.interface_places(model, [("J1", "J7"), ("J3", "J9")])
        ('J1+J3-J7+J9', 'J1-J7', 'J3-J9')
    """
    words = [f"{first}-{last}" for first, last in pairs]
    if len(pairs) > 1:
        sides = ("+".join(names) for names in zip(*pairs, strict=True))
        words.insert(0, "-".join(sides))
    found = []
    for word in words:
        try:
            directions = interface_directions(model, word)
        except ModelError:
            continue
        found.append(word)
        found += [f"{word}:{d}" for d in directions] if len(directions) > 1 else []
    return tuple(found)
