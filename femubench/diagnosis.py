"""The diagnosis as a step of a strategy: examine data, and what came out of it."""

from femubench.core.diagnosis.budget import Budget as Budget, budget_of_modes as budget_of_modes
from femubench.core.diagnosis.proof import extend_by as extend_by
from femubench.core.diagnosis.tables import causes_in as causes_in
from femubench.core.inference.examine import Examination as Examination, examine as examine
from femubench.core.inference.posterior import Explanation as Explanation
from femubench.core.plugin.loader import list_effects as list_effects

__all__ = [name for name in dir() if not name.startswith("_")]
