"""The MAC of mode shapes as a matrix with numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.modal import correlation
from femubench.core.modal.eigen import Modes, modes_of
from femubench.core.modal.measurement import Measurement
from femubench.core.plot.style import own_axes
from femubench.core.typing import FloatArray
from femubench.core.update.strategy import UpdateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ABOVE = 1.2  # modes of a model up to this times the highest measured frequency are shown
_MOST_NUMBERED = 400  # cells with their number; more have no room

Shapes = Case | Measurement | Modes | FloatArray
Named = tuple[FloatArray, list[str], str]


def mac(
    first: Shapes, second: Shapes | Model | UpdateResult | None = None, *, ax: Axes | None = None
) -> Axes:
    """Draw the MAC of every pair of shapes, 0 white to 1 dark, with the number in every cell.

    A mode without any measured shape has a dash.

    Arguments:
        first: in the rows: measured modes of a case or a measurement, modes of a model, or shapes
            as an array, (n, m).
        second: in the columns, at the same sensors or dofs: the same, or a model or an updated
            one, whose elastic modes up to 1.2 times the highest measured frequency are taken. None
            for the nominal model of a case, else for `first` itself.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when two things cannot be compared.

    Source: Allemang & Brown 1982, A correlation coefficient for modal vector analysis.

    Examples:
        >>> plot.mac(case).get_ylabel()
        'measured mode: frequency, Hz'
    """
    if second is None:
        second = first.model if isinstance(first, Case) else first
    data = first.measurement if isinstance(first, Case) else first
    rows, row_names, row_label = _shapes(first, "first")
    if isinstance(second, Model | UpdateResult):
        if not isinstance(data, Measurement):
            expected = "a Case or a Measurement as first"
            raise InputError(
                "a model has no shapes at sensors that are not known", expected=expected
            )
        model = second if isinstance(second, Model) else second.model
        top = _ABOVE * float(data.frequencies.max(initial=0.0))
        elastic = modes_of(model).elastic
        shown = np.flatnonzero(elastic.natural_frequencies <= top)
        shown = shown if len(shown) else np.arange(min(1, len(elastic)))
        columns = np.asarray(model.observe(data.sensors) @ elastic.shapes[:, shown])
        names = [f"{k + 1}: {elastic.natural_frequencies[k]:.4g}" for k in shown]
        label = "mode of the model: frequency, Hz"
    else:
        columns, names, label = _shapes(second, "second")
    if len(rows) != len(columns):
        what = f"shapes at {len(rows)} and at {len(columns)} points cannot be compared"
        raise InputError(what, expected="the same sensors or dofs")
    values = correlation.mac(rows, columns)
    values[~np.isfinite(rows).any(axis=0)] = np.nan
    values[:, ~np.isfinite(columns).any(axis=0)] = np.nan
    ax = own_axes(ax, (2.2 + 0.55 * len(names), 1.6 + 0.4 * len(row_names)))
    ax.imshow(values, vmin=0.0, vmax=1.0, cmap="Blues", aspect="auto", interpolation="nearest")
    ax.set_xticks(range(len(names)), names, rotation=90 if max(map(len, names)) > 4 else 0)
    ax.set_yticks(range(len(row_names)), row_names)
    ax.set(xlabel=label, ylabel=row_label)
    ax.set_title("MAC", fontsize=10.0)
    if values.size <= _MOST_NUMBERED:
        for (i, j), value in np.ndenumerate(values):
            colour = "white" if value > 0.6 else "black"
            text = f"{value:.2f}" if np.isfinite(value) else "–"
            ax.text(j, i, text, ha="center", va="center", fontsize=8.0, color=colour)
    return ax


def _shapes(source: Any, key: str) -> Named:  # noqa: ANN401 - whatever a caller brings
    """Return shapes, a name for each, and the label of their axis."""
    if isinstance(source, Case):
        tested = source.measurement.select((*source.used, *source.held_out))
        return _shapes(tested, key)
    if isinstance(source, Measurement):
        pairs = zip(source.numbers, source.frequencies, strict=True)
        return source.shapes, [f"{n}: {hz:.4g}" for n, hz in pairs], "measured mode: frequency, Hz"
    if isinstance(source, Modes):
        hz = [f"{value:.4g}" for value in source.natural_frequencies]
        return source.shapes, hz, "mode at frequency, Hz"
    if isinstance(source, np.ndarray) and source.ndim == 2 and source.size:
        return source, [str(k + 1) for k in range(source.shape[1])], "shape"
    expected = "a Case, a Measurement, Modes or an array (n, m)"
    raise InputError(f"{type(source).__name__} has no shapes", key=key, expected=expected)
