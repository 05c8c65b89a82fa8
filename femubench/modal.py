"""Modal analysis: pairing and correlation of modes, expansion, sensitivities, receptances."""

from femubench.core.modal.complex_modes import real_modes
from femubench.core.modal.correlated_errors import shrunk_correlation
from femubench.core.modal.correlation import auto_mac, mac, modal_scale_factor
from femubench.core.modal.expansion import expand_by_dynamics, expand_by_rotation, expand_by_serep
from femubench.core.modal.frf import FrequencyResponses, receptance
from femubench.core.modal.generalised_mass import mass_normalised
from femubench.core.modal.group_prior import group_prior_std, support_groups
from femubench.core.modal.many_changes import modes_of_changes
from femubench.core.modal.pairing import Pairing, pair_measured, pair_modes
from femubench.core.modal.rigid import rigid_body_vectors, rigid_modes_of
from femubench.core.modal.sensitivity import (
    eigenvalue_sensitivities,
    frequency_sensitivities,
    shape_sensitivities,
)
from femubench.core.modal.signals import TimeSignals

__all__ = [
    "FrequencyResponses",
    "Pairing",
    "TimeSignals",
    "auto_mac",
    "eigenvalue_sensitivities",
    "expand_by_dynamics",
    "expand_by_rotation",
    "expand_by_serep",
    "frequency_sensitivities",
    "group_prior_std",
    "mac",
    "mass_normalised",
    "modal_scale_factor",
    "modes_of_changes",
    "pair_measured",
    "pair_modes",
    "real_modes",
    "receptance",
    "rigid_body_vectors",
    "rigid_modes_of",
    "shape_sensitivities",
    "shrunk_correlation",
    "support_groups",
]
