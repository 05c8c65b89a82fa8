"""femubench: which finite element model updating strategies hold up.

Everything that a plugin author needs is a name of this module; names are imported on first use,
so that ``import femubench`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "Block": "femubench.core.harness.results",
    "Case": "femubench.core.case.case",
    "Diverged": "femubench.core.errors",
    "Effect": "femubench.core.plugin.roles",
    "ElementFamily": "femubench.core.update.element_families",
    "ElementStrategy": "femubench.core.update.element_strategy",
    "FemubenchError": "femubench.core.errors",
    "FloatArray": "femubench.core.typing",
    "Frame": "femubench.core.fem.frame",
    "GroundSpring": "femubench.core.fem.frame",
    "ITERATIONS": "femubench.core.update.quasi",
    "InputError": "femubench.core.errors",
    "JobResult": "femubench.core.harness.results",
    "Joint": "femubench.core.fem.frame",
    "JointGroup": "femubench.core.update.joints",
    "JointSpring": "femubench.core.fem.frame",
    "LowRank": "femubench.core.model",
    "Material": "femubench.core.fem.frame",
    "Measurement": "femubench.core.measurement",
    "Member": "femubench.core.fem.frame",
    "Model": "femubench.core.model",
    "ModelError": "femubench.core.errors",
    "Modes": "femubench.core.modal.eigen",
    "Modification": "femubench.core.case.case",
    "NotApplicable": "femubench.core.errors",
    "PairedMode": "femubench.core.harness.results",
    "Pairing": "femubench.core.modal.pairing",
    "Parameter": "femubench.core.fem.parameters",
    "ParameterEstimate": "femubench.core.strategy",
    "Place": "femubench.core.fem.frame",
    "PluginError": "femubench.core.errors",
    "PointMass": "femubench.core.fem.frame",
    "QuasiModes": "femubench.core.update.quasi",
    "Reader": "femubench.core.plugin.roles",
    "Reporter": "femubench.core.plugin.roles",
    "RigidEnd": "femubench.core.fem.frame",
    "Run": "femubench.core.harness.results",
    "Scenario": "femubench.core.plugin.roles",
    "Section": "femubench.core.fem.sections",
    "SelfCheckFailed": "femubench.core.errors",
    "Sensors": "femubench.core.measurement",
    "Store": "femubench.core.harness.store",
    "Strategy": "femubench.core.strategy",
    "StrategyFailure": "femubench.core.errors",
    "Structure": "femubench.core.fem.structure",
    "Support": "femubench.core.fem.frame",
    "Symmetry": "femubench.core.update.element_symmetry",
    "Unknown": "femubench.core.update.unknowns",
    "UpdateOptions": "femubench.core.update.unknowns",
    "UpdateResult": "femubench.core.strategy",
    "all_elements": "femubench.core.update.joints",
    "auto_mac": "femubench.core.modal.correlation",
    "available_length": "femubench.core.update.joints",
    "carried_by": "femubench.core.update.choices",
    "check_used_modes": "femubench.core.update.promise",
    "eigenvalue_sensitivities": "femubench.core.modal.sensitivity",
    "expand_by_dynamics": "femubench.core.modal.expansion",
    "expand_by_rotation": "femubench.core.modal.expansion",
    "expand_by_serep": "femubench.core.modal.expansion",
    "expand_measured_shapes": "femubench.core.update.dynamic",
    "flexible_ends": "femubench.core.update.joints",
    "force_scale": "femubench.core.update.promise",
    "frequency_error": "femubench.core.harness.scoring",
    "frequency_sensitivities": "femubench.core.modal.sensitivity",
    "generic_family": "femubench.core.update.element_families",
    "global_stiffness": "femubench.core.update.choices",
    "groups_within": "femubench.core.update.joints",
    "half_depth": "femubench.core.update.joints",
    "hookimpl": "femubench.core.plugin.markers",
    "joint_groups": "femubench.core.update.joints",
    "joint_stiffness": "femubench.core.update.choices",
    "leaderboard": "femubench.core.harness.leaderboard",
    "mac": "femubench.core.modal.correlation",
    "modal_scale_factor": "femubench.core.modal.correlation",
    "modes_frame": "femubench.core.harness.frames",
    "nobari_family": "femubench.core.update.element_families",
    "pair_modes": "femubench.core.modal.pairing",
    "physical_family": "femubench.core.update.element_families",
    "predict_block": "femubench.core.harness.scoring",
    "quasi_measured_modes": "femubench.core.update.quasi",
    "rank_results": "femubench.core.harness.ranking",
    "read_case": "femubench.core.case.reader",
    "real_modes": "femubench.core.modal.complex_modes",
    "receptance": "femubench.core.modal.frf",
    "rectangular_tube": "femubench.core.fem.sections",
    "results_frame": "femubench.core.harness.frames",
    "rigid_body_vectors": "femubench.core.modal.rigid",
    "rigid_modes_of": "femubench.core.modal.rigid",
    "run_from_json": "femubench.core.harness.frames",
    "run_jobs": "femubench.core.harness.runner",
    "run_to_json": "femubench.core.harness.frames",
    "score_model": "femubench.core.harness.scoring",
    "sensitivity_update": "femubench.core.update.sensitivity_update",
    "shape_sensitivities": "femubench.core.modal.sensitivity",
    "solve_modes": "femubench.core.modal.eigen",
    "spring_estimates": "femubench.core.update.joints",
    "total_change": "femubench.core.update.lowrank",
    "update_by_equation_error": "femubench.core.update.equation_error",
    "update_entries": "femubench.core.update.entries",
    "with_joint_springs": "femubench.core.update.joints",
    "with_rigid_ends": "femubench.core.update.joints",
}

if TYPE_CHECKING:
    from femubench.core.case.case import Case as Case, Modification as Modification
    from femubench.core.case.reader import read_case as read_case
    from femubench.core.errors import (
        Diverged as Diverged,
        FemubenchError as FemubenchError,
        InputError as InputError,
        ModelError as ModelError,
        NotApplicable as NotApplicable,
        PluginError as PluginError,
        SelfCheckFailed as SelfCheckFailed,
        StrategyFailure as StrategyFailure,
    )
    from femubench.core.fem.frame import (
        Frame as Frame,
        GroundSpring as GroundSpring,
        Joint as Joint,
        JointSpring as JointSpring,
        Material as Material,
        Member as Member,
        Place as Place,
        PointMass as PointMass,
        RigidEnd as RigidEnd,
        Support as Support,
    )
    from femubench.core.fem.parameters import Parameter as Parameter
    from femubench.core.fem.sections import Section as Section, rectangular_tube as rectangular_tube
    from femubench.core.fem.structure import Structure as Structure
    from femubench.core.harness.frames import (
        modes_frame as modes_frame,
        results_frame as results_frame,
        run_from_json as run_from_json,
        run_to_json as run_to_json,
    )
    from femubench.core.harness.leaderboard import (
        leaderboard as leaderboard,
    )
    from femubench.core.harness.ranking import rank_results as rank_results
    from femubench.core.harness.results import (
        Block as Block,
        JobResult as JobResult,
        PairedMode as PairedMode,
        Run as Run,
    )
    from femubench.core.harness.runner import run_jobs as run_jobs
    from femubench.core.harness.scoring import (
        frequency_error as frequency_error,
        predict_block as predict_block,
        score_model as score_model,
    )
    from femubench.core.harness.store import Store as Store
    from femubench.core.measurement import (
        Measurement as Measurement,
        Sensors as Sensors,
    )
    from femubench.core.modal.complex_modes import real_modes as real_modes
    from femubench.core.modal.correlation import (
        auto_mac as auto_mac,
        mac as mac,
        modal_scale_factor as modal_scale_factor,
    )
    from femubench.core.modal.eigen import (
        Modes as Modes,
        solve_modes as solve_modes,
    )
    from femubench.core.modal.expansion import (
        expand_by_dynamics as expand_by_dynamics,
        expand_by_rotation as expand_by_rotation,
        expand_by_serep as expand_by_serep,
    )
    from femubench.core.modal.frf import (
        receptance as receptance,
    )
    from femubench.core.modal.pairing import Pairing as Pairing, pair_modes as pair_modes
    from femubench.core.modal.rigid import (
        rigid_body_vectors as rigid_body_vectors,
        rigid_modes_of as rigid_modes_of,
    )
    from femubench.core.modal.sensitivity import (
        eigenvalue_sensitivities as eigenvalue_sensitivities,
        frequency_sensitivities as frequency_sensitivities,
        shape_sensitivities as shape_sensitivities,
    )
    from femubench.core.model import (
        LowRank as LowRank,
        Model as Model,
    )
    from femubench.core.plugin.markers import hookimpl as hookimpl
    from femubench.core.plugin.roles import (
        Effect as Effect,
        Reader as Reader,
        Reporter as Reporter,
        Scenario as Scenario,
    )
    from femubench.core.strategy import (
        ParameterEstimate as ParameterEstimate,
        Strategy as Strategy,
        UpdateResult as UpdateResult,
    )
    from femubench.core.typing import FloatArray as FloatArray
    from femubench.core.update.choices import (
        carried_by as carried_by,
        global_stiffness as global_stiffness,
        joint_stiffness as joint_stiffness,
    )
    from femubench.core.update.dynamic import expand_measured_shapes as expand_measured_shapes
    from femubench.core.update.element_families import (
        ElementFamily as ElementFamily,
        generic_family as generic_family,
        nobari_family as nobari_family,
        physical_family as physical_family,
    )
    from femubench.core.update.element_strategy import ElementStrategy as ElementStrategy
    from femubench.core.update.element_symmetry import Symmetry as Symmetry
    from femubench.core.update.entries import (
        update_entries as update_entries,
    )
    from femubench.core.update.equation_error import (
        update_by_equation_error as update_by_equation_error,
    )
    from femubench.core.update.joints import (
        JointGroup as JointGroup,
        all_elements as all_elements,
        available_length as available_length,
        flexible_ends as flexible_ends,
        groups_within as groups_within,
        half_depth as half_depth,
        joint_groups as joint_groups,
        spring_estimates as spring_estimates,
        with_joint_springs as with_joint_springs,
        with_rigid_ends as with_rigid_ends,
    )
    from femubench.core.update.lowrank import total_change as total_change
    from femubench.core.update.promise import (
        check_used_modes as check_used_modes,
        force_scale as force_scale,
    )
    from femubench.core.update.quasi import (
        ITERATIONS as ITERATIONS,
        QuasiModes as QuasiModes,
        quasi_measured_modes as quasi_measured_modes,
    )
    from femubench.core.update.sensitivity_update import sensitivity_update as sensitivity_update
    from femubench.core.update.unknowns import (
        Unknown as Unknown,
        UpdateOptions as UpdateOptions,
    )


def __getattr__(name: str) -> Any:  # noqa: ANN401 - one door for every name
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module 'femubench' has no attribute {name!r}")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
