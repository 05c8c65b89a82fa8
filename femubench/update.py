"""Steps that updating strategies share: unknowns, element families, joints, expansion, promises."""

from femubench.core.change.change import (
    scale_property as scale_property,
    set_property as set_property,
)
from femubench.core.change.parametric_model import ParametricModel as ParametricModel
from femubench.core.errors import SelfCheckFailed as SelfCheckFailed
from femubench.core.fem.joints import (
    JointGroup as JointGroup,
    Joints as Joints,
    all_elements as all_elements,
)
from femubench.core.fem.model import total_change as total_change
from femubench.core.fit.discrepancy import Discrepancy as Discrepancy
from femubench.core.update.change_lists import (
    OWN as OWN,
    list_changes as list_changes,
    parameterise as parameterise,
    scale_all_stiffness as scale_all_stiffness,
    scale_groups as scale_groups,
    scale_groups_within as scale_groups_within,
    scale_joint as scale_joint,
    select_determined as select_determined,
)
from femubench.core.update.dynamic import expand_measured_shapes as expand_measured_shapes
from femubench.core.update.element_families import (
    ElementFamily as ElementFamily,
    Family as Family,
    Symmetry as Symmetry,
    generic_family as generic_family,
    group_family as group_family,
    nobari_family as nobari_family,
    physical_family as physical_family,
)
from femubench.core.update.element_strategy import ElementStrategy as ElementStrategy
from femubench.core.update.entries import update_entries as update_entries
from femubench.core.update.l_curve import l_curve_corner as l_curve_corner, tikhonov as tikhonov
from femubench.core.update.lasso import lasso as lasso
from femubench.core.update.low_rank import (
    with_measured_frequencies as with_measured_frequencies,
    with_stiffness_step as with_stiffness_step,
)
from femubench.core.update.modal_space import (
    ModalSpace as ModalSpace,
    fit_bounded as fit_bounded,
    modal_space as modal_space,
    parametric_result as parametric_result,
)
from femubench.core.update.parametric_strategy import ParametricStrategy as ParametricStrategy
from femubench.core.update.posterior_sampling import sample_posterior as sample_posterior
from femubench.core.update.promise import (
    check_used_modes as check_used_modes,
    force_scale as force_scale,
)
from femubench.core.update.quasi import (
    ITERATIONS as ITERATIONS,
    QuasiModes as QuasiModes,
    quasi_measured_modes as quasi_measured_modes,
)
from femubench.core.update.sensitivity_strategy import SensitivityStrategy as SensitivityStrategy
from femubench.core.update.sensitivity_update import (
    UpdateOptions as UpdateOptions,
    sensitivity_update as sensitivity_update,
)
from femubench.core.update.uncertainty import Uncertainty as Uncertainty

__all__ = [name for name in dir() if not name.startswith("_")]
