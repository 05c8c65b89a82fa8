"""Drawings with matplotlib: functions that take axes, or make some, and return them.

No function touches pyplot: ``ax.get_figure().savefig("mode.svg")`` writes what was drawn. Every
function raises `InputError` for what it cannot draw.
"""

from femubench.core.drawing.wireframe import Wireframe, wireframe_of
from femubench.core.plot.calibration import calibration
from femubench.core.plot.chart import Axis, Chart, Mark, Series
from femubench.core.plot.cost import error_against_cost
from femubench.core.plot.diagnosis import (
    MOST_ROWS,
    ResidualDot,
    Spot,
    evidence,
    residual_dots,
    residuals,
    strongest_places,
)
from femubench.core.plot.findings import changes
from femubench.core.plot.heat_map import heat_map
from femubench.core.plot.identification import stabilisation, synthesis
from femubench.core.plot.mac import mac
from femubench.core.plot.matching import matching
from femubench.core.plot.mode_shape import mode_shape
from femubench.core.plot.receptance import receptance
from femubench.core.plot.svg import svg
from femubench.core.plot.updating import convergence, parameters

__all__ = [
    "MOST_ROWS",
    "Axis",
    "Chart",
    "Mark",
    "ResidualDot",
    "Series",
    "Spot",
    "Wireframe",
    "calibration",
    "changes",
    "convergence",
    "error_against_cost",
    "evidence",
    "heat_map",
    "mac",
    "matching",
    "mode_shape",
    "parameters",
    "receptance",
    "residual_dots",
    "residuals",
    "stabilisation",
    "strongest_places",
    "svg",
    "synthesis",
    "wireframe_of",
]
