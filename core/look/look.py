"""A plain look at a model and its measurement, before any fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.effect.attachments import total_mass
from femubench.core.fem.frame import Factor
from femubench.core.fem.model import Model
from femubench.core.inference.mesh_error import mesh_bias
from femubench.core.look.mesh import look_at_mesh
from femubench.core.look.modes import Seen, percent
from femubench.core.look.readings import look_at_band, look_at_deviations, look_at_sensors
from femubench.core.look.sections import look_at_sections
from femubench.core.look.theory import look_at_materials, look_at_theory
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import FloatArray

_SURE = 3.0  # standard deviations of the weighed mass


def look(
    model: Model, measurement: Measurement, band: tuple[float, float] | None = None
) -> tuple[LookWarning, ...]:
    """Return what is odd in a model or its measurement at first sight.

    Each warning comes with the changes of the elastic frequencies in the measured range, were it
    mended, where that can be said.

    Arguments:
        model: the nominal one; a pair of matrices is only weighed and compared with the sensors.
        measurement: the used modes.
        band: in Hz, where the measurement holds every mode of the structure inside it.

    Raises:
        ModelError: when the model has no modes.
    """
    seen = Seen(model, measurement)
    found: list[LookWarning] = []
    if model.structure is not None:
        for part in (look_at_sections, look_at_theory, look_at_mesh, look_at_materials):
            found += part(seen)
    found += _look_at_mass(seen) + look_at_deviations(seen) + look_at_sensors(seen)
    if band is not None:
        found += look_at_band(seen, band)
    return tuple(found)


def _look_at_mass(seen: Seen) -> list[LookWarning]:
    """Return whether the model weighs what the structure weighs."""
    if seen.measurement.total_mass is None:
        return []
    weighed, std = seen.measurement.total_mass
    mass = total_mass(seen.model)
    if not abs(mass - weighed) > _SURE * std:
        return []
    changes = _lighter(seen, mass, weighed)
    what = (
        f"The model has {mass:.4g} kg, the structure {weighed:.4g} kg on the scales, "
        f"{abs(mass - weighed) / std if std > 0.0 else np.inf:.3g} standard deviations apart."
    )
    return [
        LookWarning(what, "all", "density", () if changes is None else percent(changes)),
    ]


def _lighter(seen: Seen, mass: float, weighed: float) -> FloatArray | None:
    """Return the changes with the density that gives the weighed mass, (count,)."""
    if seen.model.structure is None:
        return np.full(seen.count, np.sqrt(mass / weighed) - 1.0)
    frame = seen.model.structure.frame
    lumps = sum(m.mass for m in frame.masses) + sum(o.mass for o in frame.oscillators)
    factor = (weighed - lumps) / (mass - lumps) if mass > lumps else 0.0
    if factor <= 0.0:
        return None
    return seen.changes(
        replace(frame, factors=(*frame.factors, Factor("density", ("all",), factor)))
    )


__all__ = ["look", "mesh_bias"]
