"""What the study of a paper is made of: cells, pages, grounds, figures, verdicts."""

from femubench.core.plot.figure import Bars, Curve, Curves, Figure, MatrixImage, StructureMap
from femubench.core.reproduction.cell import Cell, Page
from femubench.core.reproduction.ground import VERDICTS, Ground, Verdict
from femubench.core.reproduction.study import Extra, Study, verdict_counts
from femubench.core.reproduction.workbench import Workbench

__all__ = [
    "VERDICTS",
    "Bars",
    "Cell",
    "Curve",
    "Curves",
    "Extra",
    "Figure",
    "Ground",
    "MatrixImage",
    "Page",
    "StructureMap",
    "Study",
    "Verdict",
    "Workbench",
    "verdict_counts",
]
