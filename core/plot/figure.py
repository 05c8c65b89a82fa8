"""Figures of papers: what they show (curves, matrices, maps of a structure, bars), and as SVG."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING, Literal

import numpy as np

from femubench.core.drawing.wireframe import Wireframe
from femubench.core.plot.structure import draw_element_values
from femubench.core.plot.style import BLUE, GREEN, ORANGE, PURPLE, SKY, SOFT, draw_curves, figure_of
from femubench.core.plot.svg import svg
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 7.3  # inch: 700 px at 96 px an inch
_FILLS = (
    *(("#FFFFFF", "////"), (ORANGE, ""), (SKY, "||||")),
    *((GREEN, "\\\\\\\\"), (PURPLE, "xxxx"), (BLUE, "..")),
)
_MOST_LABELLED = 24  # bars with their value above them; more have no room
_DECADES = 4
_TITLE = 85  # characters on a line
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Role = Literal["measured", "predicted", "nominal", "other"]


@dataclass(frozen=True)
class Curve:
    """One line of a plot.

    Arguments:
        label: in the legend.
        x, y: in the units of the axes, (n,).
        role: decides the line's style, so that curves are distinguished without colour.
    """

    label: str
    x: FloatArray
    y: FloatArray
    role: Role = "predicted"


@dataclass(frozen=True)
class Figure(ABC):
    """What every figure has.

    Arguments:
        name: slug, the stem of the file.
        title, caption: a line, and what it shows and where it comes from.
    """

    name: str
    title: str
    caption: str

    @abstractmethod
    def draw(self, ax: Axes) -> None:
        """Draw on axes and size their figure."""


@dataclass(frozen=True)
class Curves(Figure):
    """Lines over one pair of axes.

    Arguments:
        x_label, y_label: with units.
        curves: the lines.
        log_y: whether the y axis is logarithmic.
    """

    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    log_y: bool = False

    def draw(self, ax: Axes) -> None:
        """Draw on axes and size their figure."""
        figure_of(ax).set_size_inches(WIDTH, 4.4)
        draw_curves(ax, ((curve.label, curve.role, curve.x, curve.y) for curve in self.curves))
        if self.log_y:
            ax.set_yscale("log")
        ax.set(xlabel=self.x_label, ylabel=self.y_label)
        columns = min(len(self.curves), 3)
        figure_of(ax).legend(loc="outside lower center", ncols=columns, handlelength=3.6)


@dataclass(frozen=True)
class MatrixImage(Figure):
    """Size of the entries of a matrix.

    Arguments:
        matrix: (n, m); drawn by absolute value on a logarithmic scale.
        row_label, column_label, value_label: with units.
        separators: indices before which a thin line is drawn, e.g. where a member ends.
    """

    matrix: FloatArray
    row_label: str
    column_label: str
    value_label: str
    separators: tuple[int, ...] = ()

    def draw(self, ax: Axes) -> None:
        """Draw on axes and size their figure."""
        from matplotlib.colors import LogNorm
        from matplotlib.ticker import FuncFormatter

        rows, columns = self.matrix.shape
        figure_of(ax).set_size_inches(WIDTH, min(9.0, 1.1 + 5.3 * rows / columns))
        size = np.abs(self.matrix)
        top = float(size.max()) or 1.0
        image = ax.imshow(
            np.ma.masked_less_equal(size, 0.0),
            norm=LogNorm(top / 10.0**_DECADES, top),
            cmap="Blues",
            interpolation="nearest",
            extent=(0.5, columns + 0.5, rows + 0.5, 0.5),
        )
        for index in self.separators:
            ax.axhline(index + 0.5, color="black", linewidth=0.5)
            ax.axvline(index + 0.5, color="black", linewidth=0.5)
        ax.set(xlabel=self.column_label, ylabel=self.row_label)
        scale = ax.inset_axes((1.03, 0.0, 0.035, 1.0))
        bar = figure_of(ax).colorbar(image, cax=scale, extend="min", format=FuncFormatter(_power))
        bar.set_label(self.value_label)


@dataclass(frozen=True)
class StructureMap(Figure):
    """A value for every element, drawn on the structure.

    Arguments:
        structure: with its mesh.
        values: one an element, >= 0, (n,); printed next to the element too.
        value_label: with unit.
    """

    structure: Wireframe
    values: FloatArray
    value_label: str

    def draw(self, ax: Axes) -> None:
        """Draw on axes and size their figure."""
        draw_element_values(ax, self.structure, self.values, self.value_label)
        wide, tall = np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())
        figure_of(ax).set_size_inches(WIDTH, min(8.0, max(3.2, 1.7 + 6.0 * tall / wide)))


@dataclass(frozen=True)
class Bars(Figure):
    """Groups of bars.

    Arguments:
        groups: labels along the axis, (n,).
        series: label and values, (n,) each; distinguished by hatching.
        value_label: with unit.
        lines: horizontal marks, label and value.
    """

    groups: tuple[str, ...]
    series: tuple[tuple[str, tuple[float, ...]], ...]
    group_label: str
    value_label: str
    lines: tuple[tuple[str, float], ...] = ()

    def draw(self, ax: Axes) -> None:
        """Draw on axes and size their figure."""
        figure_of(ax).set_size_inches(WIDTH, 4.6)
        count = len(self.series)
        width = 0.86 / count
        where: FloatArray = np.arange(len(self.groups), dtype=float)
        for rank, (label, values) in enumerate(self.series):
            colour, hatch = _FILLS[rank % len(_FILLS)]
            place = where + (rank - 0.5 * (count - 1)) * width
            bars = ax.bar(
                place, values, 0.92 * width,
                label=label, color=colour, hatch=hatch, edgecolor="black", linewidth=0.8,
            )  # fmt: skip
            texts = [f"{value:.1f}".replace("-", "−") for value in values]
            if count * len(self.groups) <= _MOST_LABELLED:
                ax.bar_label(bars, texts, padding=2.0, fontsize=9.0)
        for rank, (label, value) in enumerate(self.lines):
            style = ("--", ":", "-.")[rank % 3]
            ax.axhline(value, color=SOFT, linewidth=1.2, linestyle=style, label=label, zorder=0)
        ax.axhline(0.0, color="black", linewidth=0.8)
        ax.set_xticks(where, list(self.groups))
        ax.set(xlabel=self.group_label, ylabel=self.value_label)
        ax.margins(x=0.01, y=0.1)
        handles, labels = ax.get_legend_handles_labels()
        order = [*range(len(self.lines), len(labels)), *range(len(self.lines))]
        figure_of(ax).legend(
            [handles[i] for i in order], [labels[i] for i in order],
            loc="outside lower center", ncols=2,
        )  # fmt: skip


def _power(value: float, position: int | None) -> str:
    exponent = round(np.log10(value))
    return "10" + str(exponent).translate(_RAISED)


def render_figure(figure: Figure) -> str:
    """Return a figure as one ``<svg>`` element that needs no other file."""
    draw = partial(draw_figure, figure)
    return svg(draw, name=figure.name, title=figure.title, caption=figure.caption)


def draw_figure(figure: Figure, ax: Axes) -> None:
    """Draw a figure on axes, and set title and size of the figure that they lie in."""
    title = fill(figure.title, _TITLE)
    figure_of(ax).suptitle(title, x=0.01, ha="left", fontsize=11.0, parse_math=False)
    figure.draw(ax)
