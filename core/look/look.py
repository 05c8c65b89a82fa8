"""A plain look at a model and its measurement, before any fit."""

from __future__ import annotations

from collections.abc import Iterable

from femubench.core.fem.model import Model
from femubench.core.look.freedom import look_at_freedom
from femubench.core.look.mesh import look_at_mesh
from femubench.core.look.modes import Seen
from femubench.core.look.readings import (
    look_at_band,
    look_at_deviations,
    look_at_sensors,
    look_at_units,
)
from femubench.core.look.theory import look_at_materials, look_at_slenderness
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import LookWarning


def look(
    model: Model,
    measurement: Measurement,
    band: tuple[float, float] | None = None,
    effects: Iterable[Effect] = (),
) -> tuple[LookWarning, ...]:
    """Return what is odd in a model or its measurement at first sight.

    Each warning comes with the changes of the elastic frequencies in the measured range, were it
    corrected, where that can be said.

    Arguments:
        model: the nominal one; a pair of matrices is only weighed and compared with the sensors.
        measurement: the used modes.
        band: in Hz, where the measurement holds every mode of the structure inside it.
        effects: whose own looks come first, in their order.

    Raises:
        ModelError: when the model has no modes.
    """
    seen = Seen(model, measurement)
    found: list[LookWarning] = []
    for effect in effects:
        own = getattr(effect, "look", None)
        found += own(seen) if callable(own) else ()
    if model.structure is not None:
        for part in (look_at_slenderness, look_at_materials):
            found += part(seen)
    for part in (look_at_mesh, look_at_freedom, look_at_units, look_at_deviations, look_at_sensors):
        found += part(seen)
    if band is not None:
        found += look_at_band(seen, band)
    return tuple(found)
