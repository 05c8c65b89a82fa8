"""Whether a structure that is said to hang free does so in the model."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.effect.model_places import elastic_band
from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.schema.diagnosis import LookWarning


def look_at_freedom(seen: Seen) -> list[LookWarning]:
    """Return whether springs, or stiffness to ground, hold what is said to hang free."""
    model = seen.model
    if not model.free:
        return []
    rigid = rigid_body_vectors(model.dofs)
    if model.structure is None:  # a lumped model may not turn as a body
        rigid = model.dofs.motions[:, :3]
        rigid = rigid[:, rigid.any(axis=0)]
    energy, inertia = rigid.T @ model.stiffness_times(rigid), rigid.T @ model.mass_times(rigid)
    highest = float(la.eigh(energy, inertia, eigvals_only=True)[-1])
    carried, first = np.sqrt(max(highest, 0.0)) / (2.0 * np.pi), float(elastic_band(model)[0])
    if carried <= settings.soft_suspension * first:
        return []
    what = (
        f"The structure is said to hang free, yet the model is held: as a rigid body it moves at "
        f"up to {carried:.3g} Hz, with its first elastic mode at {first:.3g} Hz. Either `free` or "
        "what holds it is wrong."
    )
    return [LookWarning(what, "all", "")]
