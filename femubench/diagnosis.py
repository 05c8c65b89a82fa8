"""The diagnosis as a step of a strategy: the budget of what a drawing lacks."""

from femubench.core.diagnosis.budget import Budget as Budget, budget_of_modes as budget_of_modes
from femubench.core.plugin.loader import list_effects as list_effects

__all__ = [name for name in dir() if not name.startswith("_")]
