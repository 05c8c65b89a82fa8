"""Whether a word names a place of a model, by the grammar of docs/effects.md."""

from __future__ import annotations

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.places import Places, bare_place, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.model import Model


def has_place(model: Model, place: str) -> bool:
    """Tell whether a place, without its direction or role, is in a model."""
    bare = split_direction(bare_place(place).removesuffix(":branch"))[0]
    if model.structure is not None:
        words = (bare, place)
        return any(_in_frame(model, w) for w in words) or _is_interface(model, bare)
    known = {"all", *Groups(model).places("stiffness"), *Groups(model).places("mass")}
    if isinstance(model.geometry, MatrixGeometry):
        known |= set(model.geometry.names)
    return place in known or bare in known or _is_interface(model, bare)


def _is_interface(model: Model, place: str) -> bool:
    try:
        return bool(ModelPlaces(model).node_pairs(place))
    except ModelError:
        return False


def _in_frame(model: Model, place: str) -> bool:
    words = Places(model.frame_structure.frame)
    if words.joints_of(place):
        return True
    reads = (
        lambda: ModelPlaces(model).elements(place),
        lambda: words.point(place),
        lambda: words.pair(place),
        lambda: words.supports_of(place),
    )
    for read in reads:
        try:
            read()
        except ModelError:
            continue
        return True
    return False
