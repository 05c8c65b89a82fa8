"""A frame on fewer elements, for what takes all of its modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.fem.model import Model
from femubench.core.typing import IntArray


def coarsen_mesh(model: Model, most: int, least: int) -> Model:
    """Return a frame with as many elements a member as leave it small, or with the fewest.

    What names an element by its number stays where it is: such a member keeps its elements.

    Arguments:
        most: degrees of freedom.
        least: elements of a member, whatever that makes of them.
    """
    structure, frame = model.frame_structure, model.frame_structure.frame
    places = [place for factor in frame.factors for place in factor.at]
    places += [place for changed, _ in structure.changes for place in changed.places]
    kept = {place.partition("/")[0] for place in places if "/" in place}
    cut = np.array([m.elements for m in frame.members if m.name not in kept])
    count = int(cut.max(initial=0))
    while count > least and _size_with(model, cut, count) > most:
        count -= 1
    members = (
        m if m.name in kept else replace(m, elements=min(m.elements, count)) for m in frame.members
    )
    return Model.of(structure.rebuilt(replace(frame, members=tuple(members))))


def _size_with(model: Model, cut: IntArray, count: int) -> int:
    """Return the degrees of freedom of a frame of which members have so many elements at most."""
    fewer = np.maximum(cut - count, 0).sum()
    return model.size - len(model.frame_structure.frame.active) * int(fewer)
