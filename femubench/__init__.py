"""femubench: which finite element model updating strategies hold up.

Everything that a plugin author needs is a name of this module; names are imported on first use,
so that ``import femubench`` costs nothing.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if not os.path.isdir(os.path.join(os.path.dirname(__file__), "core")):
    raise ImportError(
        "femubench/core is no link to the folder core: clone once more with "
        "`git clone -c core.symlinks=true` (on Windows, in developer mode)"
    )

__version__ = "0.1.0"

# Module -> the names that it gives.
_NAMES = {
    "case.case": "Case Modification",
    "case.reader": "read_case",
    "diagnosis.diagnose": "diagnose extended_by",
    "diagnosis.result": "Diagnosis",
    "diagnosis.tables": "causes_in",
    "drawing.element_change": "element_norms stiffness_difference",
    "drawing.wireframe": "Wireframe wireframe_of",
    "effect.attachments": (
        "directed_places directed_point elastic_band elongation_row "
        "free_translations mass_term once_for point_in "
        "point_motion total_mass translation_rows with_extra"
    ),
    "effect.change": (
        "Change ElementOperator MatrixOperator Operator "
        "RowOperator Term barycentric chebyshev_nodes "
        "proportional sparse_term"
    ),
    "effect.flexible_ends": "end_arm flexible_ends_change rate_nodes",
    "effect.frame_effect": "EffectParameter FrameEffect",
    "effect.places": (
        "branch_places element_labels elements_of end_places "
        "ends_of joint_types joints_of joints_with_members "
        "member_labels member_length pair_of point_of "
        "point_places split_direction type_place type_places"
    ),
    "effect.sizes": "Site Size",
    "effect.words": "Reading",
    "errors": (
        "Diverged FemubenchError InputError ModelError "
        "NotApplicable PluginError SelfCheckFailed StrategyFailure"
    ),
    "fem.beam": (
        "BeamProperties coupling_matrices eccentric_mass_parts mass_matrices stiffness_matrices"
    ),
    "fem.frame": (
        "ACTIVE Brace Coupling Eccentricity "
        "Factor Frame GroundSpring Joint "
        "JointSpring Material Member Oscillator "
        "Place PointMass Preload RigidEnd "
        "Support"
    ),
    "fem.joints": (
        "JointGroup all_elements available_length flexible_ends "
        "groups_within half_depth joint_groups spring_estimates "
        "with_joint_springs with_rigid_ends"
    ),
    "fem.model": "LowRank Model",
    "fem.parameters": "Parameter",
    "fem.preload": "preload_stiffness preload_stiffnesses redundant_members",
    "fem.sections": "Section bredt constant_kappa rectangular_tube round_tube solid_rectangle",
    "fem.sensors": "Sensors",
    "fem.structure": "Structure",
    "inference.examine": "Examination examine",
    "inference.posterior": "Explanation",
    "look.modes": "Seen",
    "modal.complex_modes": "real_modes",
    "modal.correlation": "auto_mac mac modal_scale_factor",
    "modal.eigen": "Modes solve_modes",
    "modal.expansion": "expand_by_dynamics expand_by_rotation expand_by_serep",
    "modal.frf": "receptance",
    "modal.measurement": "Measurement",
    "modal.pairing": "Pairing pair_modes",
    "modal.rigid": "rigid_body_vectors rigid_modes_of",
    "modal.sensitivity": "eigenvalue_sensitivities frequency_sensitivities shape_sensitivities",
    "plot.figure": "Bars Curve Curves Figure MatrixImage StructureMap",
    "plugin.loader": "registered_effects",
    "plugin.markers": "hookimpl",
    "plugin.roles": "Effect Reader Reporter Scenario",
    "reproduction.cell": "Cell Page",
    "reproduction.study": "Extra Study verdict_counts",
    "reproduction.workbench": "Workbench",
    "run.frames": "modes_frame results_frame run_from_json run_to_json",
    "run.runner": "run_jobs",
    "run.store": "Store",
    "schema.diagnosis": "LookWarning",
    "schema.results": "Block JobResult PairedMode Run",
    "score.leaderboard": "leaderboard",
    "score.ranking": "OFFSET_PERCENT SCORE_OF_FAILURE TIE rank_results ranked",
    "score.scoring": "frequency_error predict_block score_model",
    "score.statistics": "METHOD tell_apart",
    "typing": "FloatArray IntArray SparseArray",
    "update.dynamic": "expand_measured_shapes",
    "update.element_families": (
        "ElementFamily generic_family nobari_family physical_family Symmetry"
    ),
    "update.element_strategy": "ElementStrategy",
    "update.entries": "update_entries",
    "update.equation_error": "update_by_equation_error",
    "update.low_rank": "with_measured_frequencies total_change",
    "update.promise": "check_used_modes force_scale",
    "update.quasi": "ITERATIONS QuasiModes quasi_measured_modes",
    "update.sensitivity_update": "sensitivity_update",
    "update.strategy": "ParameterEstimate Strategy UpdateResult",
    "update.unknowns": "carried_by global_stiffness joint_stiffness Unknown UpdateOptions",
}
_HOME = {
    name: f"femubench.core.{module}" for module, names in _NAMES.items() for name in names.split()
}

if TYPE_CHECKING:
    from femubench.core.case.case import Case as Case, Modification as Modification
    from femubench.core.case.reader import read_case as read_case
    from femubench.core.diagnosis.diagnose import (
        diagnose as diagnose,
        extended_by as extended_by,
    )
    from femubench.core.diagnosis.result import Diagnosis as Diagnosis
    from femubench.core.diagnosis.tables import causes_in as causes_in
    from femubench.core.drawing.element_change import (
        element_norms as element_norms,
        stiffness_difference as stiffness_difference,
    )
    from femubench.core.drawing.wireframe import (
        Wireframe as Wireframe,
        wireframe_of as wireframe_of,
    )
    from femubench.core.effect.attachments import (
        directed_places as directed_places,
        directed_point as directed_point,
        elastic_band as elastic_band,
        elongation_row as elongation_row,
        free_translations as free_translations,
        mass_term as mass_term,
        once_for as once_for,
        point_in as point_in,
        point_motion as point_motion,
        total_mass as total_mass,
        translation_rows as translation_rows,
        with_extra as with_extra,
    )
    from femubench.core.effect.change import (
        Change as Change,
        ElementOperator as ElementOperator,
        MatrixOperator as MatrixOperator,
        Operator as Operator,
        RowOperator as RowOperator,
        Term as Term,
        barycentric as barycentric,
        chebyshev_nodes as chebyshev_nodes,
        proportional as proportional,
        sparse_term as sparse_term,
    )
    from femubench.core.effect.flexible_ends import (
        end_arm as end_arm,
        flexible_ends_change as flexible_ends_change,
        rate_nodes as rate_nodes,
    )
    from femubench.core.effect.frame_effect import (
        EffectParameter as EffectParameter,
        FrameEffect as FrameEffect,
    )
    from femubench.core.effect.places import (
        branch_places as branch_places,
        element_labels as element_labels,
        elements_of as elements_of,
        end_places as end_places,
        ends_of as ends_of,
        joint_types as joint_types,
        joints_of as joints_of,
        joints_with_members as joints_with_members,
        member_labels as member_labels,
        member_length as member_length,
        pair_of as pair_of,
        point_of as point_of,
        point_places as point_places,
        split_direction as split_direction,
        type_place as type_place,
        type_places as type_places,
    )
    from femubench.core.effect.sizes import Site as Site, Size as Size
    from femubench.core.effect.words import Reading as Reading
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
    from femubench.core.fem.beam import (
        BeamProperties as BeamProperties,
        coupling_matrices as coupling_matrices,
        eccentric_mass_parts as eccentric_mass_parts,
        mass_matrices as mass_matrices,
        stiffness_matrices as stiffness_matrices,
    )
    from femubench.core.fem.frame import (
        ACTIVE as ACTIVE,
        Brace as Brace,
        Coupling as Coupling,
        Eccentricity as Eccentricity,
        Factor as Factor,
        Frame as Frame,
        GroundSpring as GroundSpring,
        Joint as Joint,
        JointSpring as JointSpring,
        Material as Material,
        Member as Member,
        Oscillator as Oscillator,
        Place as Place,
        PointMass as PointMass,
        Preload as Preload,
        RigidEnd as RigidEnd,
        Support as Support,
    )
    from femubench.core.fem.joints import (
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
    from femubench.core.fem.model import LowRank as LowRank, Model as Model
    from femubench.core.fem.parameters import Parameter as Parameter
    from femubench.core.fem.preload import (
        preload_stiffness as preload_stiffness,
        preload_stiffnesses as preload_stiffnesses,
        redundant_members as redundant_members,
    )
    from femubench.core.fem.sections import (
        Section as Section,
        bredt as bredt,
        constant_kappa as constant_kappa,
        rectangular_tube as rectangular_tube,
        round_tube as round_tube,
        solid_rectangle as solid_rectangle,
    )
    from femubench.core.fem.sensors import Sensors as Sensors
    from femubench.core.fem.structure import Structure as Structure
    from femubench.core.inference.examine import Examination as Examination, examine as examine
    from femubench.core.inference.posterior import Explanation as Explanation
    from femubench.core.look.modes import Seen as Seen
    from femubench.core.modal.complex_modes import real_modes as real_modes
    from femubench.core.modal.correlation import (
        auto_mac as auto_mac,
        mac as mac,
        modal_scale_factor as modal_scale_factor,
    )
    from femubench.core.modal.eigen import Modes as Modes, solve_modes as solve_modes
    from femubench.core.modal.expansion import (
        expand_by_dynamics as expand_by_dynamics,
        expand_by_rotation as expand_by_rotation,
        expand_by_serep as expand_by_serep,
    )
    from femubench.core.modal.frf import receptance as receptance
    from femubench.core.modal.measurement import Measurement as Measurement
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
    from femubench.core.plot.figure import (
        Bars as Bars,
        Curve as Curve,
        Curves as Curves,
        Figure as Figure,
        MatrixImage as MatrixImage,
        StructureMap as StructureMap,
    )
    from femubench.core.plugin.loader import registered_effects as registered_effects
    from femubench.core.plugin.markers import hookimpl as hookimpl
    from femubench.core.plugin.roles import (
        Effect as Effect,
        Reader as Reader,
        Reporter as Reporter,
        Scenario as Scenario,
    )
    from femubench.core.reproduction.cell import Cell as Cell, Page as Page
    from femubench.core.reproduction.study import (
        Extra as Extra,
        Study as Study,
        verdict_counts as verdict_counts,
    )
    from femubench.core.reproduction.workbench import Workbench as Workbench
    from femubench.core.run.frames import (
        modes_frame as modes_frame,
        results_frame as results_frame,
        run_from_json as run_from_json,
        run_to_json as run_to_json,
    )
    from femubench.core.run.runner import run_jobs as run_jobs
    from femubench.core.run.store import Store as Store
    from femubench.core.schema.diagnosis import LookWarning as LookWarning
    from femubench.core.schema.results import (
        Block as Block,
        JobResult as JobResult,
        PairedMode as PairedMode,
        Run as Run,
    )
    from femubench.core.score.leaderboard import leaderboard as leaderboard
    from femubench.core.score.ranking import (
        OFFSET_PERCENT as OFFSET_PERCENT,
        SCORE_OF_FAILURE as SCORE_OF_FAILURE,
        TIE as TIE,
        rank_results as rank_results,
        ranked as ranked,
    )
    from femubench.core.score.scoring import (
        frequency_error as frequency_error,
        predict_block as predict_block,
        score_model as score_model,
    )
    from femubench.core.score.statistics import METHOD as METHOD, tell_apart as tell_apart
    from femubench.core.typing import (
        FloatArray as FloatArray,
        IntArray as IntArray,
        SparseArray as SparseArray,
    )
    from femubench.core.update.dynamic import expand_measured_shapes as expand_measured_shapes
    from femubench.core.update.element_families import (
        ElementFamily as ElementFamily,
        Symmetry as Symmetry,
        generic_family as generic_family,
        nobari_family as nobari_family,
        physical_family as physical_family,
    )
    from femubench.core.update.element_strategy import ElementStrategy as ElementStrategy
    from femubench.core.update.entries import update_entries as update_entries
    from femubench.core.update.equation_error import (
        update_by_equation_error as update_by_equation_error,
    )
    from femubench.core.update.low_rank import (
        total_change as total_change,
        with_measured_frequencies as with_measured_frequencies,
    )
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
    from femubench.core.update.strategy import (
        ParameterEstimate as ParameterEstimate,
        Strategy as Strategy,
        UpdateResult as UpdateResult,
    )
    from femubench.core.update.unknowns import (
        Unknown as Unknown,
        UpdateOptions as UpdateOptions,
        carried_by as carried_by,
        global_stiffness as global_stiffness,
        joint_stiffness as joint_stiffness,
    )


def __getattr__(name: str) -> Any:  # noqa: ANN401 - one door for every name
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module 'femubench' has no attribute {name!r}")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
