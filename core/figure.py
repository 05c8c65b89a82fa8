"""What a figure shows, without how it is drawn: curves, matrices, maps of a structure, bars."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from femubench.core.typing import FloatArray

Role = Literal["measured", "predicted", "nominal", "other"]


@dataclass(frozen=True)
class Curve:
    """One line of a plot.

    Arguments:
        label: in the legend.
        x, y: in the units of the axes, (n,).
        role: decides the line's style, so that curves are told apart without colour.
    """

    label: str
    x: FloatArray
    y: FloatArray
    role: Role = "predicted"


@dataclass(frozen=True)
class Curves:
    """Lines over one pair of axes.

    Arguments:
        name: slug, the stem of the file.
        title, caption: a line, and what it shows and where it comes from.
        x_label, y_label: with units.
        curves: the lines.
        log_y: whether the y axis is logarithmic.
    """

    name: str
    title: str
    caption: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    log_y: bool = False


@dataclass(frozen=True)
class MatrixImage:
    """Size of the entries of a matrix.

    Arguments:
        matrix: (n, m); drawn by absolute value on a logarithmic scale.
        row_label, column_label, value_label: with units.
        separators: indices before which a thin line is drawn, e.g. where a member ends.
    """

    name: str
    title: str
    caption: str
    matrix: FloatArray
    row_label: str
    column_label: str
    value_label: str
    separators: tuple[int, ...] = ()


@dataclass(frozen=True)
class StructureMap:
    """A value for every element, drawn on the structure.

    Arguments:
        starts, stops: ends of the elements in the plane of the drawing in m, (n, 2).
        values: one an element, >= 0, (n,); printed beside the element too.
        x_label, y_label, value_label: with units.
        joints: named points, label -> (x, y) in m.
    """

    name: str
    title: str
    caption: str
    starts: FloatArray
    stops: FloatArray
    values: FloatArray
    x_label: str
    y_label: str
    value_label: str
    joints: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Bars:
    """Groups of bars.

    Arguments:
        groups: labels along the axis, (n,).
        series: label and values, (n,) each; told apart by hatching.
        value_label: with unit.
        lines: horizontal marks, label and value.
    """

    name: str
    title: str
    caption: str
    groups: tuple[str, ...]
    series: tuple[tuple[str, tuple[float, ...]], ...]
    group_label: str
    value_label: str
    lines: tuple[tuple[str, float], ...] = ()


Figure = Curves | MatrixImage | StructureMap | Bars
