"""Runs and their results: jobs, scores, ranking, data frames, the store, reports on them."""

from femubench.core.drawing.element_change import element_norms, stiffness_difference
from femubench.core.roles import Reporter
from femubench.core.run.frames import modes_frame, results_frame, run_from_json, run_to_json
from femubench.core.run.runner import run_jobs
from femubench.core.run.store import Store, note_missing_jobs
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult, Run
from femubench.core.score import predictive
from femubench.core.score.counting import block_weights, counted_blocks
from femubench.core.score.leaderboard import (
    FLOORS,
    interval_kind,
    is_test,
    leaderboard,
    ranks_by_floor,
    scored_on,
)
from femubench.core.score.ranking import OFFSET_PERCENT, SCORE_OF_FAILURE, TIE, rank_results, ranked
from femubench.core.score.repeatability import unsteady
from femubench.core.score.scoring import frequency_error, predict_block, score_model
from femubench.core.score.statistics import (
    FEWEST,
    METHOD,
    interval_tail,
    structures_of,
    tell_apart,
)
from femubench.core.score.twin_skill import TwinSkill, twin_skills
from femubench.core.study.axes import StudyAxes
from femubench.core.study.skill import skill_by

__all__ = [
    "Block",
    "FEWEST",
    "FLOORS",
    "JobResult",
    "METHOD",
    "OFFSET_PERCENT",
    "PairedMode",
    "Reporter",
    "Run",
    "SCORE_OF_FAILURE",
    "Store",
    "StudyAxes",
    "TIE",
    "TwinSkill",
    "block_weights",
    "counted_blocks",
    "element_norms",
    "frequency_error",
    "interval_kind",
    "interval_tail",
    "is_test",
    "leaderboard",
    "modes_frame",
    "note_missing_jobs",
    "predict_block",
    "predictive",
    "rank_results",
    "ranked",
    "ranks_by_floor",
    "results_frame",
    "run_from_json",
    "run_jobs",
    "run_to_json",
    "score_model",
    "scored_on",
    "skill_by",
    "stiffness_difference",
    "structures_of",
    "tell_apart",
    "twin_skills",
    "unsteady",
]
