"""Drawings with matplotlib: functions that take axes, or make some, and return them.

No function touches pyplot: ``ax.get_figure().savefig("mode.svg")`` writes what was drawn. Every
function raises `InputError` for what it cannot draw.
"""

from femubench.core.drawing.wireframe import wireframe_of as wireframe_of
from femubench.core.plot.calibration import calibration as calibration
from femubench.core.plot.chart import Axis as Axis, Chart as Chart, Mark as Mark, Series as Series
from femubench.core.plot.cost import error_against_cost as error_against_cost
from femubench.core.plot.diagnosis import (
    MOST_ROWS as MOST_ROWS,
    error_budget as error_budget,
    evidence as evidence,
    residual_dots as residual_dots,
    residuals as residuals,
    state_changes as state_changes,
    strongest_places as strongest_places,
)
from femubench.core.plot.findings import changes as changes
from femubench.core.plot.heat_map import heat_map as heat_map
from femubench.core.plot.identification import (
    stabilisation as stabilisation,
    synthesis as synthesis,
)
from femubench.core.plot.mac import mac as mac
from femubench.core.plot.matching import matching as matching
from femubench.core.plot.mode_shape import mode_shape as mode_shape
from femubench.core.plot.receptance import receptance as receptance
from femubench.core.plot.svg import svg as svg
from femubench.core.plot.updating import convergence as convergence, parameters as parameters

__all__ = [name for name in dir() if not name.startswith("_")]
