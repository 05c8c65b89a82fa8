"""Figures drawn as SVG text: told apart without colour, the same text for the same data."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.fem import FloatArray
from femubench.reproduction import Bars, Curves, Figure, MatrixImage, StructureMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

WIDTH = 7.3  # inch: 700 px at 96 px an inch
# Okabe & Ito (2008): told apart with any kind of colour vision.
BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY = (
    "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9",
)  # fmt: skip
GREY = "#666666"
STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": "black", "linewidth": 2.2, "linestyle": "-"},
    "predicted": {"color": VERMILLION, "linewidth": 1.6, "linestyle": (0, (5, 2))},
    "nominal": {"color": BLUE, "linewidth": 1.1, "linestyle": (0, (1, 1.6))},
    "other": {"color": GREEN, "linewidth": 1.4, "linestyle": (0, (6, 1.5, 1, 1.5))},
}
# Further curves of one role take the next colour and a marker.
_COLOURS = (VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLUE)
_MARKERS = ("", "o", "s", "^", "D", "v")
_FILLS = (
    *(("#FFFFFF", "////"), (ORANGE, ""), (SKY, "||||")),
    *((GREEN, "\\\\\\\\"), (PURPLE, "xxxx"), (BLUE, "..")),
)
_MOST_LABELLED = 24  # bars with their value above them; more have no room
_DECADES = 4
_TITLE = 85  # characters on a line
# DejaVu is wide: what is laid out for it has room for the others.
_FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SETTINGS: dict[str, Any] = {
    "font.size": 10.0,
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "svg.fonttype": "none",
    "hatch.linewidth": 0.7,
}


def drawn(figure: Figure) -> str:
    """Return a figure as one ``<svg>`` element that needs no other file.

    Arguments:
        figure: what it shows.
    """
    text = io.StringIO()
    with _settings(figure.name):
        metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure_canvas(figure).savefig(text, format="svg", metadata=metadata)
    return _element(text.getvalue(), figure)


def figure_canvas(figure: Figure) -> Canvas:
    """Return a figure as matplotlib holds it, e.g. to be written in another format.

    Arguments:
        figure: what it shows.
    """
    from matplotlib.figure import Figure as Canvas

    with _settings(figure.name):
        canvas = Canvas(layout="constrained")
        axes = canvas.subplots()
        canvas.suptitle(fill(figure.title, _TITLE), x=0.01, ha="left", fontsize=11.0)
        painters: dict[type, Callable[[Any, Canvas, Axes], None]] = {
            Curves: _curves,
            MatrixImage: _matrix,
            StructureMap: _structure,
            Bars: _bars,
        }
        painters[type(figure)](figure, canvas, axes)
    return canvas


@contextmanager
def _settings(name: str) -> Iterator[None]:
    """Set what figures look like for as long as one is drawn, whatever the user has set."""
    from matplotlib import rc_context, rcdefaults, rcParams

    wanted: Any = {**_SETTINGS, "svg.hashsalt": name}
    with rc_context():
        rcdefaults()
        rcParams.update(wanted)
        yield


def _element(text: str, figure: Figure) -> str:
    """Return the root element alone, titled, with no id that another figure of a page has too."""
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    linked = set(re.findall(r'(?:url\(|href=")#([^")]+)', text))
    text = text.replace("'DejaVu Sans'", _FONTS)
    slug = re.sub(r"\W+", "-", figure.name)

    def renamed(found: re.Match[str]) -> str:
        return f' id="{slug}-{found[1]}"' if found[1] in linked else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    text = re.sub(r'(url\(|href=")#([^")]+)', rf"\g<1>#{slug}-\g<2>", text)
    head, body = text.split(">", 1)
    named = (
        f'{head} role="img" aria-labelledby="{slug}-title {slug}-desc" '
        'style="stroke-linejoin: round; stroke-linecap: butt; max-width: 100%; height: auto">\n'
        f' <title id="{slug}-title">{escape(figure.title)}</title>\n'
        f' <desc id="{slug}-desc">{escape(figure.caption)}</desc>'
    )
    return f"{named}{body}\n"


def _curves(figure: Curves, canvas: Canvas, axes: Axes) -> None:
    canvas.set_size_inches(WIDTH, 4.4)
    seen: dict[str, int] = {}
    for curve in figure.curves:
        rank = seen.setdefault(curve.role, 0)
        seen[curve.role] += 1
        style = dict(STYLES[curve.role])
        if rank:
            style["color"] = _COLOURS[rank % len(_COLOURS)]
            style["marker"], style["markersize"] = _MARKERS[rank % len(_MARKERS)], 4.5
            style["markevery"] = max(1, len(curve.x) // 12)
        axes.plot(curve.x, curve.y, label=curve.label, **style)
    if figure.log_y:
        axes.set_yscale("log")
    axes.set_xlabel(figure.x_label)
    axes.set_ylabel(figure.y_label)
    axes.margins(x=0.01)
    axes.grid(color="0.88", linewidth=0.6)
    canvas.legend(loc="outside lower center", ncols=min(len(figure.curves), 3), handlelength=3.6)


def _matrix(figure: MatrixImage, canvas: Canvas, axes: Axes) -> None:
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter

    rows, columns = figure.matrix.shape
    canvas.set_size_inches(WIDTH, min(9.0, 1.1 + 5.3 * rows / columns))
    size = np.abs(figure.matrix)
    top = float(size.max()) or 1.0
    image = axes.imshow(
        np.ma.masked_less_equal(size, 0.0),
        norm=LogNorm(top / 10.0**_DECADES, top),
        cmap="Blues",
        interpolation="nearest",
        extent=(0.5, columns + 0.5, rows + 0.5, 0.5),
    )
    for index in figure.separators:
        axes.axhline(index + 0.5, color="black", linewidth=0.5)
        axes.axvline(index + 0.5, color="black", linewidth=0.5)
    axes.set_xlabel(figure.column_label)
    axes.set_ylabel(figure.row_label)
    beside = axes.inset_axes((1.03, 0.0, 0.035, 1.0))
    bar = canvas.colorbar(image, cax=beside, extend="min", format=FuncFormatter(_power))
    bar.set_label(figure.value_label)


def _power(value: float, position: int | None) -> str:
    exponent = round(np.log10(value))
    return "10" + str(exponent).translate(_RAISED)


def _structure(figure: StructureMap, canvas: Canvas, axes: Axes) -> None:
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap

    ends = np.concatenate([figure.starts, figure.stops])
    span = np.ptp(ends, axis=0)
    canvas.set_size_inches(WIDTH, min(8.0, max(3.2, 1.7 + 6.0 * span[1] / max(span[0], 1e-12))))
    top = float(figure.values.max()) or 1.0
    segments = np.stack([figure.starts, figure.stops], axis=1)
    # The lightest fifth would not be seen on white.
    dark = ListedColormap(colormaps["cividis"](np.linspace(0.8, 0.0, 256)))
    lines = LineCollection(list(segments), cmap=dark, capstyle="butt")
    lines.set_array(figure.values)
    lines.set_clim(0.0, top)
    lines.set_linewidth(list(1.5 + 10.0 * figure.values / top))
    axes.add_collection(lines)
    _element_values(figure, axes)
    for label, x, y in figure.joints:
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "black"}
        axes.text(x, y, label, ha="center", va="center", fontsize=9.5, bbox=box, zorder=4)
    pad = 0.11 * span.max()
    low, high = ends.min(axis=0) - pad, ends.max(axis=0) + pad
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel(figure.x_label)
    axes.set_ylabel(figure.y_label)
    bar = canvas.colorbar(lines, ax=axes, location="bottom", shrink=0.7, aspect=40)
    bar.set_label(f"{figure.value_label} (colour and width)")


def _element_values(figure: StructureMap, axes: Axes) -> None:
    """Print the value of every element beside it, away from the middle of the structure."""
    middle = 0.25 * (figure.starts + figure.stops).min(axis=0)
    middle = middle + 0.25 * (figure.starts + figure.stops).max(axis=0)
    for start, stop, value in zip(figure.starts, figure.stops, figure.values, strict=True):
        level = abs(stop[0] - start[0]) >= abs(stop[1] - start[1])
        centre = 0.5 * (start + stop)
        out = 1.0 if centre[int(level)] >= middle[int(level)] - 1e-9 else -1.0
        axes.annotate(
            _short(value),
            centre,
            xytext=(0.0, 8.0 * out) if level else (8.0 * out, 0.0),
            textcoords="offset points",
            ha="center" if level else ("left" if out > 0 else "right"),
            va=("bottom" if out > 0 else "top") if level else "center",
            fontsize=9.0,
        )


def _short(value: float) -> str:
    return f"{value:.2f}" if value >= 0.0995 else f"{value:.3f}"


def _bars(figure: Bars, canvas: Canvas, axes: Axes) -> None:
    canvas.set_size_inches(WIDTH, 4.6)
    count = len(figure.series)
    width = 0.86 / count
    where: FloatArray = np.arange(len(figure.groups), dtype=float)
    for rank, (label, values) in enumerate(figure.series):
        fill, hatch = _FILLS[rank % len(_FILLS)]
        place = where + (rank - 0.5 * (count - 1)) * width
        bars = axes.bar(
            place, values, 0.92 * width,
            label=label, color=fill, hatch=hatch, edgecolor="black", linewidth=0.8,
        )  # fmt: skip
        texts = [f"{value:.1f}".replace("-", "−") for value in values]
        if count * len(figure.groups) <= _MOST_LABELLED:
            axes.bar_label(bars, texts, padding=2.0, fontsize=9.0)
    for rank, (label, value) in enumerate(figure.lines):
        style = ("--", ":", "-.")[rank % 3]
        axes.axhline(value, color=GREY, linewidth=1.2, linestyle=style, label=label, zorder=0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_xticks(where, list(figure.groups))
    axes.set_xlabel(figure.group_label)
    axes.set_ylabel(figure.value_label)
    axes.margins(x=0.01, y=0.1)
    handles, labels = axes.get_legend_handles_labels()
    order = [*range(len(figure.lines), len(labels)), *range(len(figure.lines))]
    canvas.legend(
        [handles[i] for i in order],
        [labels[i] for i in order],
        loc="outside lower center",
        ncols=2,
    )
