"""What a beam can know: shear, rotary inertia, a spring at each joint, one factor on E."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from femubench import Case, Measurement, Model, solve_modes
from femubench.effect import Change
from femubench.fem import FloatArray
from femubench.modal import pair_measured
from femubench.update import (
    Joints,
    UpdateOptions,
    sensitivity_update,
)

ARM = 0.02  # m, from the column's axis to its face
_START = 3e5  # N m/rad
_ENDS = ("horizontal@T1", "horizontal@T2")


@dataclass(frozen=True)
class TimoshenkoFit:
    """A Timoshenko model with two fitted numbers.

    Arguments:
        model: fitted to the five used frequencies.
        joint_stiffness: of each T joint in N m/rad.
        young: factor on E.
    """

    model: Model
    joint_stiffness: float
    young: float


def physical_model(case: Case) -> TimoshenkoFit:
    """Return the frame with textbook shear and rotary inertia, fitted by k_theta and E.

    The springs sit at the column's face, behind rigid arms; all frequencies count alike.
    """
    structure = case.model.frame_structure
    frame = replace(structure.frame, beam="timoshenko", bending_mass="cubic")  # of the time
    sprung = Joints(structure.rebuilt(frame)).with_springs(
        {end: {"ry": _START} for end in _ENDS}, arm=ARM, arm_factor=None
    )
    places = tuple(f"{end}:ry" for end in _ENDS)
    changes = [
        Change.set_property("k_theta", "spring", places, _START, 1e2, 1e9, unit="N m/rad"),
        Change.scale_property("E", "E", sprung.elements),
    ]
    options = UpdateOptions(residual="relative-eigenvalue")
    result = sensitivity_update(sprung, changes, case.used_measurement(0), options)
    spring, young = (parameter.after for parameter in result.parameters)
    return TimoshenkoFit(result.model, spring, young)


def in_plane(case: Case) -> Measurement:
    """Return the measured modes that the model can have: used, then held out."""
    return case.measurement.select((*case.used, *case.held_out))


def shape_paired_errors(case: Case, model: Model) -> FloatArray:
    """Return the errors of a model on used and held-out modes in percent, paired by shape, (7,).

    A mode without a partner is nan.
    """
    data = in_plane(case)
    modes = solve_modes(model)
    partner = pair_measured(data, modes, model.observe(data.sensors) @ modes.shapes).index
    errors = 100.0 * (modes.natural_frequencies[partner] / data.frequencies - 1.0)
    return np.where(partner >= 0, errors, np.nan)
