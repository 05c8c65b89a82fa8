"""What the study of a paper is made of: cells, pages, grounds, figures, verdicts."""

from femubench.core.plot.figure import (
    Bars as Bars,
    Curve as Curve,
    Curves as Curves,
    Figure as Figure,
    MatrixImage as MatrixImage,
    StructureMap as StructureMap,
)
from femubench.core.reproduction.cell import Cell as Cell, Page as Page
from femubench.core.reproduction.convention import Choice as Choice, Convention as Convention
from femubench.core.reproduction.equation import Equation as Equation
from femubench.core.reproduction.ground import Ground as Ground, Verdict as Verdict
from femubench.core.reproduction.printed_table import (
    Entry as Entry,
    Grid as Grid,
    PrintedTable as PrintedTable,
)
from femubench.core.reproduction.study import Extra as Extra, Study as Study
from femubench.core.reproduction.workbench import Workbench as Workbench

__all__ = [name for name in dir() if not name.startswith("_")]
