"""Modal analysis: pairing and correlation of modes, expansion, sensitivities, receptances."""

from femubench.core.modal.complex_modes import real_modes as real_modes
from femubench.core.modal.correlation import mac as mac
from femubench.core.modal.expansion import (
    expand_by_dynamics as expand_by_dynamics,
    expand_by_serep as expand_by_serep,
)
from femubench.core.modal.frf import (
    FrequencyResponses as FrequencyResponses,
    Quantity as Quantity,
    receptance as receptance,
)
from femubench.core.modal.group_prior import GroupPriors as GroupPriors
from femubench.core.modal.many_changes import modes_of_changes as modes_of_changes
from femubench.core.modal.pairing import pair_measured as pair_measured, pair_modes as pair_modes
from femubench.core.modal.rigid import rigid_modes_of as rigid_modes_of
from femubench.core.modal.sensitivity import eigenvalue_sensitivities as eigenvalue_sensitivities
from femubench.core.modal.signals import TimeSignals as TimeSignals

__all__ = [name for name in dir() if not name.startswith("_")]
