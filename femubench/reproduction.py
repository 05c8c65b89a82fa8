"""What the study of a paper is made of: cells, pages, grounds, figures, verdicts."""

from femubench.core.plot.figure import Bars, Curve, Curves, Figure, MatrixImage, StructureMap
from femubench.core.reproduction.cell import Cell, Page
from femubench.core.reproduction.convention import Choice, Convention, under
from femubench.core.reproduction.equation import Equation
from femubench.core.reproduction.ground import VERDICTS, Ground, Verdict
from femubench.core.reproduction.printed_table import (
    Entry,
    Grid,
    PrintedTable,
    as_printed,
    places_of,
)
from femubench.core.reproduction.study import FIGURES, Extra, Study, verdict_counts
from femubench.core.reproduction.workbench import Workbench
from femubench.core.roles import Paper

__all__ = [
    "FIGURES",
    "VERDICTS",
    "Bars",
    "Cell",
    "Choice",
    "Convention",
    "Curve",
    "Curves",
    "Entry",
    "Equation",
    "Extra",
    "Figure",
    "Grid",
    "Ground",
    "MatrixImage",
    "Page",
    "Paper",
    "PrintedTable",
    "StructureMap",
    "Study",
    "Verdict",
    "Workbench",
    "as_printed",
    "places_of",
    "under",
    "verdict_counts",
]
