"""The gain of a study against two of its axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.errors import InputError
from femubench.core.plot.style import INK, SOFT, check_kind, figure_of, name_of, own_axes
from femubench.core.schema.results import RunData
from femubench.core.study.axes import StudyAxes, Value
from femubench.core.study.gain import gain_by
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_MOST_NUMBERED = 150  # cells with their number; more have no room
_DARK = 0.5  # of the scale, beyond which the colour of a cell is too dark for black letters
_SCALES = (0.25, 0.5, 1.0)  # the gain with the darkest blue
_LONGEST_LABELS = 45  # letters of all labels of the columns that stand next to each other
_GREY = "0.85"


def heat_map(
    run: RunData, x: str | None = None, y: str | None = None, *, ax: Axes | None = None
) -> Axes:
    """Draw the gain of every cell, blue above the textbook model and red below it.

    White is 0, what the textbook model predicts without any measurement; the scale ends at 0.25,
    0.5 or 1 both ways, and what is less has its last red. Every cell has its number as far as there
    is room.
    Hatched: a job at least failed or is missing, which counts as the model that was given. Grey:
    the strategy is applicable to no job of the cell.

    Arguments:
        run: of a study, or any other.
        x, y: axes, see `Run.gain_by`; those of the study where they are left out.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: for an axis that the run does not have.

    Examples:
        >>> plot.heat_map(run, "strategy", "case").get_xlabel()
        'strategy'
    """
    check_kind(run, (RunData,), "gain by axes")
    known = StudyAxes.of(run)
    usual = [name for name in known.pictured if name not in (x, y)]
    x = x or usual.pop(0)
    y = y or usual.pop(0)
    if x == y:
        raise InputError(f"{x!r} is on both axes", key="y", expected="two axes")
    table = gain_by(run, x, y)
    columns, rows = known.values(x), known.values(y)
    ax = own_axes(ax, (2.6 + 0.62 * max(len(columns), 5), 1.7 + 0.42 * max(len(rows), 3)))
    figures = {
        name: _grid(table, name, x, y, columns, rows)
        for name in ("gain", "jobs", "failed", "missing", "not_applicable")
    }
    _paint(ax, figures["gain"])
    _mark(ax, figures)
    ax.set_xticks(range(len(columns)), [name_of(known.text_of(v), 22) for v in columns])
    ax.set_yticks(range(len(rows)), [name_of(known.text_of(v), 22) for v in rows])
    if sum(len(known.text_of(v)) for v in columns) > _LONGEST_LABELS:
        ax.tick_params(axis="x", rotation=30)
    ax.set(xlabel=known.title_of(x), ylabel=known.title_of(y))
    if known.title:
        ax.set_title(name_of(known.title, 60), fontsize=10.0)
    return ax


def _paint(ax: Axes, gain: FloatArray) -> None:
    """Draw the colours, the same distance from 0 both ways, and what they mean."""
    largest = float(np.nanmax(np.abs(gain), initial=0.0))
    end = next((step for step in _SCALES if largest <= step), _SCALES[-1])
    image = ax.imshow(
        gain, vmin=-end, vmax=end, cmap="RdBu", aspect="auto", interpolation="nearest",
        origin="lower",
    )  # fmt: skip
    rows, columns = gain.shape
    ax.set_xticks(np.arange(columns - 1) + 0.5, minor=True)
    ax.set_yticks(np.arange(rows - 1) + 0.5, minor=True)
    ax.grid(which="minor", color="white", linewidth=1.5)
    ax.tick_params(which="minor", length=0.0)
    below = bool(np.nanmin(gain, initial=0.0) < -end)
    bar = figure_of(ax).colorbar(image, ax=ax, extend="min" if below else "neither", pad=0.03)
    bar.set_label("gain (0: textbook model)")


def _grid(
    table: pd.DataFrame, figure: str, x: str, y: str, columns: list[Value], rows: list[Value]
) -> FloatArray:
    """Return a figure by rows and columns; nan where the study has no such cell."""
    found = np.full((len(rows), len(columns)), np.nan)
    for cell in table.to_dict("records"):
        if cell[x] in columns and cell[y] in rows:
            found[rows.index(cell[y]), columns.index(cell[x])] = float(cell[figure])
    return found


def _mark(ax: Axes, figures: Mapping[str, FloatArray]) -> None:
    """Write the gain into every cell, hatch those with failures, grey out what does not apply."""
    from matplotlib.patches import Rectangle

    gain = figures["gain"]
    low, high = ax.get_images()[0].get_clim()
    for (i, j), value in np.ndenumerate(gain):
        if not np.isfinite(figures["jobs"][i, j]):
            continue
        count = {name: int(found[i, j]) for name, found in figures.items() if name != "gain"}
        lost = [f"{count[name]} {name}" for name in ("failed", "missing") if count[name]]
        text = f"{value:.2f}".replace("-", "\N{MINUS SIGN}")
        dark = not low * _DARK <= value <= high * _DARK
        look: dict[str, Any] = {"fill": False, "linewidth": 0.0}
        if count["not_applicable"] == count["jobs"]:
            look, text, dark = {"facecolor": _GREY, "linewidth": 0.0}, "n/a", False
        if lost:
            look |= {"hatch": "///", "edgecolor": SOFT}
            text = "\n".join([text, *lost, f"of {count['jobs']}"])
        ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, **look))
        if gain.size <= _MOST_NUMBERED:
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0} if lost else None
            ax.text(
                j, i, text, ha="center", va="center", fontsize=8.5, bbox=box,
                color="white" if dark and not lost else INK,
            )  # fmt: skip
