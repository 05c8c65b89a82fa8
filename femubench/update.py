"""Steps that updating strategies share: unknowns, element families, joints, expansion, promises."""

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
from femubench.core.update.factor_strategy import FactorStrategy
from femubench.core.update.l_curve import l_curve_corner, tikhonov
from femubench.core.update.lasso import lasso
from femubench.core.update.low_rank import (
    total_change,
    with_measured_frequencies,
    with_stiffness_step,
)
from femubench.core.update.modal_space import (
    ModalFit,
    ModalSpace,
    bounded_fit,
    factor_result,
    modal_space,
)
from femubench.core.update.parameter_sets import (
    OWN,
    StiffnessParts,
    checked_set,
    element_sets,
    group_factors,
    groups_within_count,
    stiffness_factors,
    stiffness_parts,
)
from femubench.core.update.posterior_sampling import Discrepancy, sample_posterior
from femubench.core.update.promise import check_used_modes, force_scale
from femubench.core.update.quasi import ITERATIONS, QuasiModes, quasi_measured_modes
from femubench.core.update.sensitivity_update import sensitivity_update
from femubench.core.update.uncertainty import MOST_SAMPLES, Uncertainty
from femubench.core.update.unknowns import (
    Unknown,
    UpdateOptions,
    carried_by,
    global_stiffness,
    joint_stiffness,
)

__all__ = [
    "Discrepancy",
    "ElementFamily",
    "ElementStrategy",
    "Family",
    "FactorStrategy",
    "GroupFamily",
    "ITERATIONS",
    "JointGroup",
    "ModalFit",
    "ModalSpace",
    "OWN",
    "MOST_SAMPLES",
    "QuasiModes",
    "SelfCheckFailed",
    "StiffnessParts",
    "Symmetry",
    "Uncertainty",
    "Unknown",
    "UpdateOptions",
    "all_elements",
    "available_length",
    "bounded_fit",
    "carried_by",
    "check_used_modes",
    "checked_set",
    "element_sets",
    "expand_measured_shapes",
    "factor_result",
    "flexible_ends",
    "force_scale",
    "generic_family",
    "global_stiffness",
    "group_factors",
    "group_family",
    "groups_within",
    "groups_within_count",
    "half_depth",
    "joint_groups",
    "joint_stiffness",
    "l_curve_corner",
    "lasso",
    "modal_space",
    "nobari_family",
    "physical_family",
    "quasi_measured_modes",
    "sample_posterior",
    "sensitivity_update",
    "spring_estimates",
    "stiffness_factors",
    "stiffness_parts",
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
