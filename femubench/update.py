"""Steps that updating strategies share: unknowns, element families, joints, expansion, promises."""

from typing import TYPE_CHECKING

from femubench.core.plugin.door import open_door

if TYPE_CHECKING:
    from femubench.core.change.parametric_model import ParametricModel as ParametricModel
    from femubench.core.errors import SelfCheckFailed as SelfCheckFailed
    from femubench.core.fem.joints import (
        JointGroup as JointGroup,
        Joints as Joints,
    )
    from femubench.core.update.change_lists import Changes as Changes
    from femubench.core.update.dynamic import expand_measured_shapes as expand_measured_shapes
    from femubench.core.update.element_families import (
        ElementFamily as ElementFamily,
        Symmetry as Symmetry,
    )
    from femubench.core.update.element_strategy import ElementStrategy as ElementStrategy
    from femubench.core.update.entries import update_entries as update_entries
    from femubench.core.update.low_rank import (
        with_measured_frequencies as with_measured_frequencies,
        with_stiffness_step as with_stiffness_step,
    )
    from femubench.core.update.modal_space import ModalSpace as ModalSpace
    from femubench.core.update.parametric_strategy import ParametricStrategy as ParametricStrategy
    from femubench.core.update.posterior_sampling import sample_posterior as sample_posterior
    from femubench.core.update.promise import check_used_modes as check_used_modes
    from femubench.core.update.quasi import QuasiModes as QuasiModes
    from femubench.core.update.sensitivity_strategy import (
        SensitivityStrategy as SensitivityStrategy,
    )
    from femubench.core.update.sensitivity_update import (
        UpdateOptions as UpdateOptions,
        sensitivity_update as sensitivity_update,
    )
    from femubench.core.update.uncertainty import Uncertainty as Uncertainty
else:
    __all__, __getattr__, __dir__ = open_door(__name__, __file__)
