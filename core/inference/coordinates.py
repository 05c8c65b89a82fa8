"""The coordinates in which a diagnosis tries every cause: all modes of a model.

There a cause of any size acts as in the model itself. A large model is made small before that:
matrices in groups when they are read, a frame by fewer elements a member.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fit.modal_basis import nominal_space, rigid_first
from femubench.core.fit.modal_fit import Problem
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.fit.residuals import Data
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import Modes, all_modes, once_for


def modes_for(model: Model) -> Modes:
    """Return all modes of a model, rigid-body modes first.

    Raises:
        NotApplicable: for a model that has too many.
        ModelError: when the model has no modes.
    """
    if model.size > settings.most_dofs:
        frame = model.structure is not None
        fewest = ", with as few elements a member as it can have" if frame else ""
        draw = "draw members that lie in line as one, or give " if frame else ""
        raise NotApplicable(
            f"the model has {model.size} degrees of freedom{fewest}; a diagnosis takes "
            f"{settings.most_dofs} at most: {draw}matrices with [[model.groups]], which are reduced"
        )
    return once_for(model, "rigid first", lambda: rigid_first(all_modes(model)))


def place_data(model: Model, data: Data, noise: Noise, hypotheses: Sequence[Hypothesis]) -> Problem:
    """Return data in the coordinates of a model, with what may be missing in it.

    Raises:
        NotApplicable, ModelError: as `modes_for`.
    """
    sensors = data.measurement.sensors
    # Data are examined as they are and as they may be, next to one cause and next to several.
    last: list[Any] = once_for(model, place_data, list)
    if not last or last[0] is not sensors or not _are(hypotheses, last[1].projections):
        last[:] = sensors, nominal_space(model, modes_for(model), sensors, hypotheses), data, {}
    if not data.is_as(last[2]):
        last[2:] = data, {}
    return Problem(model, last[1], last[2], noise, kept=last[3])


def _are(hypotheses: Sequence[Hypothesis], projections: Sequence[Projection]) -> bool:
    """Tell whether projections are those of just these hypotheses."""
    pairs = zip(hypotheses, projections, strict=False)
    return len(hypotheses) == len(projections) and all(h is p.hypothesis for h, p in pairs)
