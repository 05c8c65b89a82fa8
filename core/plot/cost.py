"""The error that strategies leave against the time that they take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femubench.core.errors import InputError
from femubench.core.plot.style import BEFORE, BLUE, INK, check_kind, own_axes, place_names
from femubench.core.schema.results import RunData
from femubench.core.score.leaderboard import leaderboard

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABELS = {
    "error_percent": "error out of the given band, %",
    "used_percent": "rms error of the used modes, %",
    "higher_percent": "rms error of the higher modes, %",
    "modified_percent": "rms error of the modified structures, %",
}


def error_against_cost(
    run: RunData, *, error: str = "error_percent", ax: Axes | None = None
) -> Axes:
    """Draw every strategy of a run by error and wall time, medians over the cases.

    Hollow squares are models that lost rigid-body modes or have negative eigenvalues.

    Arguments:
        run: with results.
        error: ``error_percent``, out of the given band, or ``used_percent``, ``higher_percent``,
            ``modified_percent`` as in the leaderboard.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there is no such error, or no strategy with an error and a time.

    Examples:
        >>> plot.error_against_cost(run).get_xlabel()
        'wall time of the strategy, s (median over cases)'
    """
    check_kind(run, (RunData,), "strategies")
    if error not in _LABELS:
        raise InputError(f"there is no error {error!r}", expected=", ".join(_LABELS))
    board = leaderboard(run)
    seconds, errors = (board[key].to_numpy(dtype=float) for key in ("seconds", error))
    kept = board[np.isfinite(seconds) & np.isfinite(errors) & (seconds > 0.0) & (errors > 0.0)]
    if not len(kept):
        raise InputError(f"no strategy has a time and {error}", expected="results that are ok")
    ax = own_axes(ax, (6.8, 4.6))
    for flag, mark in ((False, "o"), (True, "s")):
        own = kept[(kept["unphysical"] > 0) == flag]
        if not len(own):
            continue
        ax.plot(
            own["seconds"], own[error], linestyle="none", marker=mark, markersize=7.0,
            markerfacecolor="none" if flag else BLUE, markeredgecolor=BEFORE if flag else BLUE,
            markeredgewidth=1.5, label="unphysical" if flag else "physical",
        )  # fmt: skip
    ax.set(xscale="log", yscale="log", ylabel=_LABELS[error])
    ax.set_xlabel("wall time of the strategy, s (median over cases)")
    ax.margins(0.16)
    ax.grid(color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    place_names(ax, kept[["seconds", error]].to_numpy(float), list(kept["strategy"]), color=INK)
    ax.legend(fontsize=8.5)
    return ax
