"""A chart as plain data: drawn by matplotlib here, and by the pages from the same JSON.

The script of the pages (`bench.draw`) keeps the same rules for axes, so that both show the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeGuard

import numpy as np

from femubench.core.errors import InputError
from femubench.core.plot.style import (
    COLOURS,
    INK,
    SOFT,
    curve_style,
    figure_of,
    name_of,
    own_axes,
    place_names,
)
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis as MatplotlibAxis

Kind = Literal["line", "steps", "calibration", "scatter", "bars", "interval", "cells"]
KINDS: tuple[Kind, ...] = ("line", "steps", "calibration", "scatter", "bars", "interval", "cells")
Role = Literal["measured", "predicted", "nominal", "other"]

_LINES = ("line", "steps", "calibration")
_FAR = 4.0  # an axis leaves out what lies farther away than so many times the spread of the rest
_FEWEST = 5  # values from which one can be called far off
_MOST_NAMED = 60
_NARROW = 5.0  # in, of a figure whose legend has room for one name in a line
_NUMBERED = 200  # cells of a matrix with their number; more have no room
_MOST_TICKS = 7  # of a logarithmic axis
_MARKERS = ("o", "s", "^", "D", "X", "P", "v", "*")
_HATCHES = ("", "///", "\\\\\\", "...", "xxx", "|||")


@dataclass(frozen=True)
class Axis:
    """What an axis shows.

    Arguments:
        label, unit: its name and unit; the unit of a share or a count is empty.
        log: whether it is logarithmic.
        low, high: its ends; None for those of the values without what is far off the rest.
        names: its values in order where they are names.
    """

    label: str
    unit: str = ""
    log: bool = False
    low: float | None = None
    high: float | None = None
    names: tuple[str, ...] | None = None

    @property
    def title(self) -> str:
        """Return label and unit."""
        return f"{self.label}, {self.unit}" if self.label and self.unit else self.label


@dataclass(frozen=True)
class Series:
    """Points of one kind.

    Arguments:
        name: in the legend.
        x, y: of the points, (n,); names where the axis has names. None: not known.
        low, high: ends of intervals, (n,) or empty; along x where y has names, else along y.
        names: of the points, (n,) or empty.
        role: what is measured and what the nominal model says look the same everywhere.
    """

    name: str
    x: Sequence[float | str | None]
    y: Sequence[float | str | None]
    low: Sequence[float | None] = ()
    high: Sequence[float | None] = ()
    names: Sequence[str] = ()
    role: Role = "predicted"

    def __post_init__(self) -> None:
        """Refuse lists of different length."""
        for key in ("x", "y", "low", "high", "names"):
            values = getattr(self, key)
            plain = values.tolist() if isinstance(values, np.ndarray) else values
            object.__setattr__(self, key, tuple(plain))
            if len(getattr(self, key)) not in ({len(self.x)} if key == "y" else {0, len(self.x)}):
                raise InputError(
                    f"{name_of(self.name)} has {len(self.x)} x and {len(getattr(self, key))} {key}",
                    key=key,
                    expected="as many",
                )


@dataclass(frozen=True)
class Mark:
    """A line across a chart."""

    axis: Literal["x", "y"]
    value: float
    label: str


@dataclass(frozen=True)
class Chart:
    """A chart: line, steps, calibration (with the diagonal), scatter, bars, interval, cells.

    An axis that was given no ends leaves out the few values that lie farther away than four times
    the spread of the rest; each of them stands at the edge with an arrow, the farthest with their
    number.

    Arguments:
        kind: one of `KINDS`.
        title, note: a line, and what else is to be said.
        x, y: the axes; `names` on y for interval and cells, on x for cells.
        series: of all kinds but cells.
        marks: lines across it.
        values: of cells, a row for each name of y and a column for each of x; None: no cell.
        value: what the cells are.

    Raises:
        InputError: for another kind, or cells that do not fit the names.

    Examples:
        >>> ratio = plot.Axis("ratio of the errors", log=True)
        >>> found = plot.Series("B over A", [0.5, 1.2], ["one", "other"], [0.4, 0.9], [0.7, 1.5])
        >>> chart = plot.Chart("interval", "B over A", ratio, plot.Axis("strategy"), (found,))
        >>> chart.draw().get_xlabel()
        'ratio of the errors'
        >>> chart.to_json()["series"][0]["high"]
        [0.7, 1.5]
    """

    kind: Kind
    title: str
    x: Axis
    y: Axis
    series: tuple[Series, ...] = ()
    marks: tuple[Mark, ...] = ()
    values: Sequence[Sequence[float | None]] = ()
    value: Axis | None = None
    note: str = ""

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn; take the names of a named axis from the points."""
        if self.kind not in KINDS:
            raise InputError(f"no kind of chart: {self.kind!r}", expected=" or ".join(KINDS))
        if self.kind == "cells":
            shape = [len(row) for row in self.values]
            if self.value is None or shape != [len(self.x.names or ())] * len(self.y.names or ()):
                raise InputError("cells without names", expected="a name for each row and column")
        named = {"bars": "x", "interval": "y"}.get(self.kind)
        if named and getattr(self, named).names is None:
            names = dict.fromkeys(str(v) for s in self.series for v in getattr(s, named))
            object.__setattr__(self, named, replace(getattr(self, named), names=tuple(names)))

    @property
    def size(self) -> tuple[float, float]:
        """Return width and height of a drawing of its own in inch."""
        rows = len(self.y.names or ()) if self.kind in ("interval", "cells") else 0
        return 7.3, 1.4 + 0.26 * rows if rows else 4.0

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data, as pages draw it."""
        return {key: v for key, v in _plain(asdict(self)).items() if v not in (None, "", [])}

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draw it with matplotlib.

        Arguments:
            ax: to draw on; None for axes of a new figure.
        """
        ax = own_axes(ax, self.size)
        if self.kind == "cells":
            return _cells(self, ax)
        for key in ("x", "y"):
            _lay_out(self, key, ax)
        for rank, series in enumerate(self.series):
            _DRAWERS.get(self.kind, _curve)(self, series, rank, ax)
        if self.kind == "calibration":
            ax.plot([0.0, 1.0], [0.0, 1.0], color=SOFT, linewidth=0.8, zorder=0)
        for mark in self.marks:
            look: dict[str, Any] = {"color": SOFT, "zorder": 0}
            name: dict[str, Any] = {"color": SOFT, "fontsize": 8.0, "ha": "right"}
            if mark.axis == "x":
                ax.axvline(mark.value, linewidth=1.0, linestyle=(0, (4, 2)), **look)
                place, name = ax.get_xaxis_transform(), {**name, "ha": "center", "va": "bottom"}
                ax.text(mark.value, 1.01, name_of(mark.label), transform=place, **name)
            else:
                ax.axhline(mark.value, linewidth=1.0, linestyle=(0, (4, 2)), **look)
                place, name = ax.get_yaxis_transform(), {**name, "va": "bottom"}
                ax.text(0.99, mark.value, name_of(mark.label), transform=place, **name)
        if len(self.series) > 1:
            columns = 3 if figure_of(ax).get_figwidth() > _NARROW else 1
            figure_of(ax).legend(
                loc="outside lower center", ncols=columns, fontsize=8.5, frameon=False
            )
        return ax


def ends_of(
    values: Iterable[float | None], axis: Axis, *, pad: float, few: int, zero: bool = False
) -> tuple[float, float]:
    """Return the ends of an axis, without the few values that lie far off the rest.

    Arguments:
        values: that it has to show; what is not finite, or not positive where the axis is
            logarithmic, counts for nothing.
        pad: added on both sides, of the range.
        few: values on each side that may be left out.
        zero: whether bars start at 0.
    """
    known = sorted(math.log10(v) if axis.log else v for v in values if _usable(v, axis))
    known = known or ([-1.0, 0.0] if axis.log else [0.0, 1.0])
    low, high = known[0], known[-1]
    if len(known) >= _FEWEST:
        first, last = known[few], known[-1 - few]
        spread = _FAR * (last - first)
        high = last if spread > 0.0 and high - last > spread else high
        low = first if spread > 0.0 and first - low > spread else low
    if zero and not axis.log:
        low, high = min(low, 0.0), max(high, 0.0)
    grow = (high - low) * pad if high > low else 0.3 if axis.log else abs(low) * 0.1 or 1.0
    low -= 0.0 if zero and low == 0.0 else grow
    high += 0.0 if zero and high == 0.0 else grow
    ends = (10.0**low, 10.0**high) if axis.log else (low, high)
    return (ends[0] if axis.low is None else axis.low, ends[1] if axis.high is None else axis.high)


def _usable(value: object, axis: Axis) -> TypeGuard[float]:
    """Tell whether a value has a place on an axis."""
    return isinstance(value, int | float) and math.isfinite(value) and (value > 0.0 or not axis.log)


def _plain(value: Any) -> Any:  # noqa: ANN401 - JSON data of any form
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _lay_out(chart: Chart, key: Literal["x", "y"], ax: Axes) -> None:
    """Set scale, ends, ticks and name of an axis."""
    axis: Axis = getattr(chart, key)
    settings: dict[str, Any] = {f"{key}label": axis.title}
    if axis.names is None:
        values = [v for s in chart.series for v in getattr(s, key) if not isinstance(v, str)]
        few = 1 if chart.kind in _LINES else max(1, len(values) // 10)
        if (key == "x") == (chart.y.names is not None):
            spread = [v for s in chart.series for v in (*s.low, *s.high)]
            values, few = values + spread, few * (3 if any(_usable(v, axis) for v in spread) else 1)
        wide = 0.0 if chart.kind in _LINES and key == "x" else 0.05
        pad, zero = 0.12 if chart.kind == "scatter" else wide, chart.kind == "bars" and key == "y"
        reach = ends_of(values, axis, pad=pad, few=few, zero=zero)
        settings |= {f"{key}scale": "log" if axis.log else "linear", f"{key}lim": reach}
        ax.grid(axis=key, color=COLOURS["grid"], linewidth=0.6)
    else:
        reach = (-0.5, len(axis.names) - 0.5)
        settings |= {f"{key}lim": reach if key == "x" else reach[::-1]}
        settings |= {f"{key}ticks": range(len(axis.names))}
        # Most of the figure is left for the data.
        letters = min(30, max(12, int(5.4 * figure_of(ax).get_figwidth())))
        settings |= {f"{key}ticklabels": [name_of(name, letters) for name in axis.names]}
    ax.set(**settings)
    ax.set_axisbelow(True)
    if axis.log:
        _round_ticks(ax.xaxis if key == "x" else ax.yaxis, *reach)


def _round_ticks(axis: MatplotlibAxis, low: float, high: float) -> None:
    """Set the ticks of a logarithmic axis to few round numbers, written out."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    lists = [
        [digit * 10.0**power for power in decades for digit in digits]
        for digits in (range(1, 10), (1, 2, 5), (1,))
    ]
    inside = [[v for v in ticks if low <= v <= high] for ticks in lists]
    found = next((ticks for ticks in inside if len(ticks) <= _MOST_TICKS), inside[-1])
    if len(found) < 3 and high < 20.0 * low:
        found = [v for v in MaxNLocator(_MOST_TICKS).tick_values(low, high) if low <= v <= high]
    axis.set_major_locator(FixedLocator(found))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axis.set_minor_locator(NullLocator())


def _points(chart: Chart, series: Series, ax: Axes) -> Iterator[tuple[int, float, float]]:
    """Give index and place of what can be drawn; tell at the edge what lies beyond it."""
    stated: dict[str, tuple[float, tuple[float, float]]] = {}
    (left, right), (bottom, top) = ax.get_xlim(), sorted(ax.get_ylim())
    for index, pair in enumerate(zip(series.x, series.y, strict=True)):
        if not all(
            (axis.names is not None and v in axis.names) or _usable(v, axis)
            for v, axis in zip(pair, (chart.x, chart.y), strict=True)
        ):
            continue
        x, y = (
            float(axis.names.index(v) if axis.names is not None else v)  # type: ignore[arg-type]
            for v, axis in zip(pair, (chart.x, chart.y), strict=True)
        )
        at = min(max(x, left), right), min(max(y, bottom), top)
        arrow = (
            "▲" if y > top else "▼" if y < bottom else "▶" if x > right else "◀" if x < left else ""
        )
        value = y if arrow in "▲▼" else x
        if arrow and (arrow not in stated or abs(value) > abs(stated[arrow][0])):
            stated[arrow] = (value, at)
        yield index, *at
    for arrow, (value, at) in stated.items():
        side = "right" if at[0] > 0.5 * (left + right) else "left"
        ax.annotate(
            f"{arrow} {value:.3g}", at, xytext=(6.0 if side == "left" else -6.0, 0.0),
            textcoords="offset points", ha=side, va="center", fontsize=8.0, color=INK,
            annotation_clip=False,
        )  # fmt: skip


def _curve(chart: Chart, series: Series, rank: int, ax: Axes) -> None:
    same = [s.role for s in chart.series[:rank]].count(series.role)
    style = curve_style(series.role, same, len(series.x))
    x = [v if _usable(v, chart.x) else math.nan for v in series.x]
    y = [v if _usable(v, chart.y) else math.nan for v in series.y]
    if chart.kind == "steps":
        style["drawstyle"] = "steps-post"
    ax.plot(x, y, label=name_of(series.name), **style)
    if series.low:
        low, high = (np.array(end, dtype=float) for end in (series.low, series.high))
        ax.fill_between(x, low, high, color=style["color"], alpha=0.15, linewidth=0.0)
    list(_points(chart, series, ax))


def _scatter(chart: Chart, series: Series, rank: int, ax: Axes) -> None:
    points = list(_points(chart, series, ax))
    at = np.array([point[1:] for point in points]).reshape(-1, 2)
    _dots(ax, at, series, rank)
    names = [series.names[i] if series.names else series.name for i, _, _ in points]
    if sum(len(s.x) for s in chart.series) <= _MOST_NAMED:
        place_names(ax, at, names, color=INK)


def _bars(chart: Chart, series: Series, rank: int, ax: Axes) -> None:
    wide = 0.8 / len(chart.series)
    points = list(_points(chart, series, ax))
    base = ax.get_ylim()[0] if chart.y.log or ax.get_ylim()[0] > 0.0 else 0.0
    where = [x + (rank - (len(chart.series) - 1) / 2) * wide for _, x, _ in points]
    ax.bar(
        where, [y - base for _, _, y in points], 0.9 * wide, base, label=name_of(series.name),
        color=curve_style(series.role, rank, 1)["color"], hatch=_HATCHES[rank % len(_HATCHES)],
        edgecolor=INK, linewidth=0.6,
    )  # fmt: skip


def _interval(chart: Chart, series: Series, rank: int, ax: Axes) -> None:
    colour = curve_style(series.role, rank, 1)["color"]
    points = list(_points(chart, series, ax))
    for index, _, y in points:
        low, high = (end[index] if end else None for end in (series.low, series.high))
        if low is not None and high is not None:
            ax.plot([low, high], [y, y], color=colour, linewidth=2.2, alpha=0.6)
    _dots(ax, np.array([point[1:] for point in points]).reshape(-1, 2), series, rank)


def _dots(ax: Axes, at: FloatArray, series: Series, rank: int) -> None:
    ax.scatter(
        at[:, 0], at[:, 1], 34.0, curve_style(series.role, rank, 1)["color"],
        marker=_MARKERS[rank % len(_MARKERS)], label=name_of(series.name), zorder=3, clip_on=False,
    )  # fmt: skip


_DRAWERS = {"scatter": _scatter, "bars": _bars, "interval": _interval}


def _cells(chart: Chart, ax: Axes) -> Axes:
    from matplotlib.colors import LogNorm, Normalize

    assert chart.value is not None
    grid = np.array([
        [v if _usable(v, chart.value) else math.nan for v in row] for row in chart.values
    ], dtype=float).reshape(len(chart.values), -1)  # fmt: skip
    few = max(1, grid.size // 10)
    low, high = ends_of(grid.ravel().tolist(), chart.value, pad=0.0, few=few)
    scale = LogNorm(low, high) if chart.value.log else Normalize(low, high)
    image = ax.imshow(grid, norm=scale, cmap="viridis_r", aspect="auto", interpolation="nearest")
    ax.set_xticks(range(grid.shape[1]), [name_of(n, 18) for n in chart.x.names or ()], rotation=45)
    ax.set_yticks(range(grid.shape[0]), [name_of(n, 30) for n in chart.y.names or ()])
    ax.set(xlabel=chart.x.title, ylabel=chart.y.title)
    if grid.size <= _NUMBERED:
        for (i, j), v in np.ndenumerate(grid):
            dark = math.isfinite(v) and float(scale(v)) > 0.5
            text, colour = f"{v:.2g}" if math.isfinite(v) else "–", "white" if dark else "black"
            ax.text(j, i, text, ha="center", va="center", fontsize=8.0, color=colour)
    beyond = grid[np.isfinite(grid)]
    extends = ("neither", "max"), ("min", "both")
    extend = extends[int((beyond < low).any())][int((beyond > high).any())]
    figure_of(ax).colorbar(image, ax=ax, extend=extend).set_label(chart.value.title)
    return ax
