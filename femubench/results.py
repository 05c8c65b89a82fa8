"""Runs and their results: jobs, scores, ranking, data frames, the store, reports on them."""

from femubench.core.drawing.element_change import (
    element_norms as element_norms,
    stiffness_difference as stiffness_difference,
)
from femubench.core.roles import Reporter as Reporter
from femubench.core.run.frames import (
    modes_frame as modes_frame,
    results_frame as results_frame,
    run_from_json as run_from_json,
    run_to_json as run_to_json,
)
from femubench.core.run.store import Store as Store, note_missing_jobs as note_missing_jobs
from femubench.core.schema.paired_modes import PairedMode as PairedMode
from femubench.core.schema.results import JobResult as JobResult, Run as Run
from femubench.core.score.bounded_gain import Rule as Rule
from femubench.core.score.leaderboard import (
    Standings as Standings,
    find_basis as find_basis,
    interval_kind as interval_kind,
    is_test as is_test,
    leaderboard as leaderboard,
    list_rows as list_rows,
)
from femubench.core.score.predictive import (
    Forecasts as Forecasts,
    PredictiveBoard as PredictiveBoard,
)
from femubench.core.score.ranking import (
    TIE as TIE,
    Scale as Scale,
    rank_items as rank_items,
    rank_results as rank_results,
)
from femubench.core.score.repeatability import unsteady as unsteady
from femubench.core.score.scoring import predict_block as predict_block
from femubench.core.score.statistics import (
    FEWEST as FEWEST,
    METHOD as METHOD,
    interval_tail as interval_tail,
    structures_of as structures_of,
)
from femubench.core.score.twin_gain import twin_gains as twin_gains
from femubench.core.study.axes import StudyAxes as StudyAxes
from femubench.core.study.gain import gain_by as gain_by

__all__ = [name for name in dir() if not name.startswith("_")]
