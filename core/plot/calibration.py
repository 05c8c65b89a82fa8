"""How often what was measured lies in predicted intervals, against how often it should."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from femubench.core.errors import InputError
from femubench.core.plot.style import SOFT, check_kind, draw_curves, name_of, own_axes
from femubench.core.schema.results import RunData
from femubench.core.score.bounded_gain import MeasuredModes, Rule
from femubench.core.score.predictive import Forecasts
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEVELS = np.linspace(0.0, 0.99, 100)


def calibration(run: RunData, *, ax: Axes | None = None) -> Axes:
    """Draw the coverage of central intervals of every level, a line a strategy with uncertainty.

    Over the unseen modes of all jobs that are ok and make the ranks, every structure with the same
    weight. Below the diagonal a strategy is surer than it may be, above it less sure than it could
    be.

    Arguments:
        run: with results.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when no strategy gave an uncertainty.

    Examples:
        >>> from femubench.plugins.strategies.bayesian import Bayesian
        >>> plot.calibration(femubench.rank(case, [Bayesian()])).get_xlabel()
        'level of the interval'
    """
    check_kind(run, (RunData,), "strategies")
    structures = run.structures
    reached: dict[str, dict[str, list[FloatArray]]] = defaultdict(lambda: defaultdict(list))
    for result in (result for result in run.ranked if result.status == "ok"):
        found = Forecasts.of(MeasuredModes.of(result.blocks, Rule()), result.blocks)
        if found.stated:
            own = (found.level(found.std)[:, None] <= _LEVELS).mean(axis=0)
            reached[result.strategy][structures.get(result.case, result.case)].append(own)
    if not reached:
        raise InputError(
            "no strategy of the run says how sure it is", expected="results with an uncertainty"
        )
    ax = own_axes(ax, (5.4, 5.0))
    ax.plot([0.0, 1.0], [0.0, 1.0], color=SOFT, linewidth=0.8, label="calibrated")
    means = {n: [np.mean(one, axis=0) for one in own.values()] for n, own in reached.items()}
    curves = [(name_of(n), "predicted", _LEVELS, np.mean(m, axis=0)) for n, m in means.items()]
    draw_curves(ax, curves)
    ax.set(xlabel="level of the interval", ylabel="share of unseen modes in it", ylim=(-0.02, 1.02))
    ax.legend(fontsize=8.5)
    return ax
