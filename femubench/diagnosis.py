"""The diagnosis as a step of a strategy: examine data, and what came out of it."""

from femubench.core.diagnosis.diagnose import extended_by
from femubench.core.diagnosis.tables import causes_in
from femubench.core.inference.examine import Examination, examine
from femubench.core.inference.posterior import Explanation
from femubench.core.plugin.loader import registered_effects

__all__ = [
    "Examination",
    "Explanation",
    "causes_in",
    "examine",
    "extended_by",
    "registered_effects",
]
