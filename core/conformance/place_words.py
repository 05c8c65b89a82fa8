"""Whether a word names a place of a model, by the grammar of docs/effects.md."""

from __future__ import annotations

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.effect.interfaces import node_pairs
from femubench.core.effect.places import (
    bare_place,
    elements_of,
    joints_of,
    pair_of,
    point_of,
    split_direction,
    supports_of,
)
from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import group_places
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure


def has_place(model: Model, place: str) -> bool:
    """Tell whether a place, without its direction or role, is in a model."""
    bare = split_direction(bare_place(place).removesuffix(":branch"))[0]
    if model.structure is not None:
        words = (bare, place)
        return any(_in_frame(model.structure, w) for w in words) or _is_interface(model, bare)
    known = {"all", *group_places(model, "stiffness"), *group_places(model, "mass")}
    if isinstance(model.geometry, MatrixGeometry):
        known |= set(model.geometry.names)
    return place in known or bare in known or _is_interface(model, bare)


def _is_interface(model: Model, place: str) -> bool:
    try:
        return bool(node_pairs(model, place))
    except ModelError:
        return False


def _in_frame(structure: Structure, place: str) -> bool:
    frame = structure.frame
    if joints_of(frame, place):
        return True
    reads = (
        lambda: elements_of(structure, place),
        lambda: point_of(frame, place),
        lambda: pair_of(frame, place),
        lambda: supports_of(frame, place),
    )
    for read in reads:
        try:
            read()
        except ModelError:
            continue
        return True
    return False
