"""Runs and their results: jobs, scores, ranking, data frames, the store, reports on them."""

from femubench.core.drawing.element_change import (
    element_norms as element_norms,
    stiffness_difference as stiffness_difference,
)
from femubench.core.run.store import Store as Store
from femubench.core.schema.paired_modes import PairedMode as PairedMode
from femubench.core.schema.records import run_from_json as run_from_json, run_to_json as run_to_json
from femubench.core.schema.results import JobResult as JobResult, RunData as RunData
from femubench.core.score.bounded_gain import Rule as Rule
from femubench.core.score.leaderboard import Standings as Standings
from femubench.core.score.predictive import PredictiveBoard as PredictiveBoard
from femubench.core.score.repeatability import unsteady as unsteady
from femubench.core.score.scoring import predict_block as predict_block
from femubench.core.score.twin_gain import twin_gains as twin_gains
from femubench.core.study.axes import StudyAxes as StudyAxes

__all__ = [name for name in dir() if not name.startswith("_")]
