"""Steps that updating strategies share: unknowns, element families, joints, expansion, promises."""

from femubench.core.change.change import scale_property, set_property
from femubench.core.change.parametric_model import ParametricModel
from femubench.core.errors import SelfCheckFailed
from femubench.core.fem.joints import (
    JointGroup,
    all_elements,
    available_length,
    flexible_ends,
    groups_within,
    half_depth,
    joint_groups,
    spring_estimates,
    with_joint_springs,
    with_rigid_ends,
)
from femubench.core.fem.model import total_change
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.update.change_lists import (
    OWN,
    carried_by,
    check_changes,
    element_sets,
    list_changes,
    parameterise,
    scale_all_stiffness,
    scale_groups,
    scale_groups_within,
    scale_joint,
    scale_parts,
)
from femubench.core.update.dynamic import expand_measured_shapes
from femubench.core.update.element_families import (
    ElementFamily,
    Family,
    GroupFamily,
    Symmetry,
    generic_family,
    group_family,
    nobari_family,
    physical_family,
    tied,
)
from femubench.core.update.element_strategy import ElementStrategy
from femubench.core.update.entries import update_entries
from femubench.core.update.equation_error import update_by_equation_error
from femubench.core.update.l_curve import l_curve_corner, tikhonov
from femubench.core.update.lasso import lasso
from femubench.core.update.low_rank import (
    with_measured_frequencies,
    with_stiffness_step,
)
from femubench.core.update.modal_space import (
    ModalFit,
    ModalSpace,
    bounded_fit,
    modal_space,
    parametric_result,
)
from femubench.core.update.parametric_strategy import ParametricStrategy
from femubench.core.update.posterior_sampling import sample_posterior
from femubench.core.update.promise import check_used_modes, force_scale
from femubench.core.update.quasi import ITERATIONS, QuasiModes, quasi_measured_modes
from femubench.core.update.sensitivity_strategy import SensitivityStrategy
from femubench.core.update.sensitivity_update import UpdateOptions, sensitivity_update
from femubench.core.update.uncertainty import MOST_SAMPLES, Uncertainty

__all__ = [
    "Discrepancy",
    "ElementFamily",
    "ElementStrategy",
    "Family",
    "ParametricStrategy",
    "GroupFamily",
    "ITERATIONS",
    "JointGroup",
    "ModalFit",
    "ModalSpace",
    "OWN",
    "MOST_SAMPLES",
    "QuasiModes",
    "SelfCheckFailed",
    "ParametricModel",
    "Symmetry",
    "Uncertainty",
    "SensitivityStrategy",
    "list_changes",
    "scale_property",
    "set_property",
    "UpdateOptions",
    "all_elements",
    "available_length",
    "bounded_fit",
    "carried_by",
    "check_used_modes",
    "check_changes",
    "element_sets",
    "expand_measured_shapes",
    "parametric_result",
    "flexible_ends",
    "force_scale",
    "generic_family",
    "scale_all_stiffness",
    "scale_groups",
    "group_family",
    "groups_within",
    "scale_groups_within",
    "half_depth",
    "joint_groups",
    "scale_joint",
    "l_curve_corner",
    "lasso",
    "modal_space",
    "nobari_family",
    "physical_family",
    "quasi_measured_modes",
    "sample_posterior",
    "sensitivity_update",
    "spring_estimates",
    "scale_parts",
    "parameterise",
    "tikhonov",
    "tied",
    "total_change",
    "update_by_equation_error",
    "update_entries",
    "with_joint_springs",
    "with_measured_frequencies",
    "with_stiffness_step",
    "with_rigid_ends",
]
