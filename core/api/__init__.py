"""femubench: which finite element model updating strategies hold up.

Everything that a plugin author needs is a name of this module; names are imported on first use,
so that ``import femubench`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "mac": "femubench.core.modal.correlation",
    "auto_mac": "femubench.core.modal.correlation",
    "modal_scale_factor": "femubench.core.modal.correlation",
    "Pairing": "femubench.core.modal.pairing",
    "pair_modes": "femubench.core.modal.pairing",
    "run_jobs": "femubench.core.harness.runner",
    "Store": "femubench.core.harness.store",
    "run_from_json": "femubench.core.harness.frames",
    "predict_block": "femubench.core.harness.scoring",
    "score_model": "femubench.core.harness.scoring",
    "rank_results": "femubench.core.harness.ranking",
    "real_modes": "femubench.core.modal.complex_modes",
    "read_case": "femubench.core.case.reader",
    "Modification": "femubench.core.case.case",
    "Case": "femubench.core.case.case",
    "Block": "femubench.core.harness.results",
    "Diverged": "femubench.core.errors",
    "Effect": "femubench.core.plugin.roles",
    "FemubenchError": "femubench.core.errors",
    "Frame": "femubench.core.fem.frame",
    "GroundSpring": "femubench.core.fem.frame",
    "InputError": "femubench.core.errors",
    "JobResult": "femubench.core.harness.results",
    "Joint": "femubench.core.fem.frame",
    "JointSpring": "femubench.core.fem.frame",
    "LowRank": "femubench.core.model",
    "Material": "femubench.core.fem.frame",
    "Measurement": "femubench.core.measurement",
    "Member": "femubench.core.fem.frame",
    "Model": "femubench.core.model",
    "ModelError": "femubench.core.errors",
    "Modes": "femubench.core.modal.eigen",
    "NotApplicable": "femubench.core.errors",
    "PairedMode": "femubench.core.harness.results",
    "Parameter": "femubench.core.fem.parameters",
    "ParameterEstimate": "femubench.core.strategy",
    "Place": "femubench.core.fem.frame",
    "PluginError": "femubench.core.errors",
    "PointMass": "femubench.core.fem.frame",
    "Reader": "femubench.core.plugin.roles",
    "Reporter": "femubench.core.plugin.roles",
    "RigidEnd": "femubench.core.fem.frame",
    "Run": "femubench.core.harness.results",
    "Scenario": "femubench.core.plugin.roles",
    "Section": "femubench.core.fem.sections",
    "SelfCheckFailed": "femubench.core.errors",
    "Sensors": "femubench.core.measurement",
    "Strategy": "femubench.core.strategy",
    "StrategyFailure": "femubench.core.errors",
    "Structure": "femubench.core.fem.structure",
    "Support": "femubench.core.fem.frame",
    "UpdateResult": "femubench.core.strategy",
    "frequency_error": "femubench.core.harness.scoring",
    "hookimpl": "femubench.core.plugin.markers",
    "leaderboard": "femubench.core.harness.leaderboard",
    "modes_frame": "femubench.core.harness.frames",
    "results_frame": "femubench.core.harness.frames",
    "run_to_json": "femubench.core.harness.frames",
    "rectangular_tube": "femubench.core.fem.sections",
    "solve_modes": "femubench.core.modal.eigen",
    "ITERATIONS": "femubench.core.update.quasi",
    "QuasiModes": "femubench.core.update.quasi",
    "quasi_measured_modes": "femubench.core.update.quasi",
    "FloatArray": "femubench.core.typing",
    "check_used_modes": "femubench.core.update.promise",
    "force_scale": "femubench.core.update.promise",
    "total_change": "femubench.core.update.lowrank",
    "expand_measured_shapes": "femubench.core.update.dynamic",
    "rigid_modes_of": "femubench.core.modal.rigid",
    "carried_by": "femubench.core.update.choices",
    "global_stiffness": "femubench.core.update.choices",
    "joint_stiffness": "femubench.core.update.choices",
    "JointGroup": "femubench.core.update.joints",
    "all_elements": "femubench.core.update.joints",
    "available_length": "femubench.core.update.joints",
    "flexible_ends": "femubench.core.update.joints",
    "groups_within": "femubench.core.update.joints",
    "half_depth": "femubench.core.update.joints",
    "joint_groups": "femubench.core.update.joints",
    "spring_estimates": "femubench.core.update.joints",
    "with_joint_springs": "femubench.core.update.joints",
    "with_rigid_ends": "femubench.core.update.joints",
    "Unknown": "femubench.core.update.unknowns",
    "UpdateOptions": "femubench.core.update.unknowns",
    "sensitivity_update": "femubench.core.update.sensitivity_update",
    "update_entries": "femubench.core.update.entries",
    "Symmetry": "femubench.core.update.element_symmetry",
    "ElementFamily": "femubench.core.update.element_families",
    "generic_family": "femubench.core.update.element_families",
    "nobari_family": "femubench.core.update.element_families",
    "physical_family": "femubench.core.update.element_families",
    "update_by_equation_error": "femubench.core.update.equation_error",
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
    from femubench.core.modal.pairing import Pairing as Pairing, pair_modes as pair_modes
    from femubench.core.modal.rigid import rigid_modes_of as rigid_modes_of
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
