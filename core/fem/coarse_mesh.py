"""A frame on fewer elements, for what takes all of its modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.fem.model import Model


def coarsen_mesh(model: Model, most: int, least: int) -> Model:
    """Return a frame with as many elements a member as leave it so small; itself where none do.

    What names an element by its number stays where it is: such a member keeps its elements.

    Arguments:
        model: a frame.
        most: degrees of freedom.
        least: elements of a member.
    """
    structure, frame = model.frame_structure, model.frame_structure.frame
    places = [place for factor in frame.factors for place in factor.at]
    places += [place for changed, _ in structure.changes for place in changed.places]
    kept = {place.partition("/")[0] for place in places if "/" in place}
    cut = np.array([m.elements for m in frame.members if m.name not in kept])
    for count in range(int(cut.max(initial=0)) - 1, least - 1, -1):
        if model.size - len(frame.active) * np.maximum(cut - count, 0).sum() <= most:
            members = (
                m if m.name in kept else replace(m, elements=min(m.elements, count))
                for m in frame.members
            )
            return Model.of(structure.rebuilt(replace(frame, members=tuple(members))))
    return model
