"""Mode shapes on the structure: undeformed, deformed, and as measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femubench.core.case.case import Case
from femubench.core.drawing.prediction import node_motions, pair_modes
from femubench.core.drawing.wireframe import MOST_NODES, Wireframe, wireframe_of
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.identify.identification import Identification
from femubench.core.modal.correlation import modal_scale_factor
from femubench.core.modal.eigen import modes_of
from femubench.core.plot.identification import draw_identified
from femubench.core.plot.structure import View, draw_lines, draw_structure, frame_axes, view_of
from femubench.core.plot.style import INK, PAGE, check_kind, curve_style, own_axes
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_REACH = 0.12  # of the largest side of the structure, a largest motion at a scale of 1


def mode_shape(
    source: Case | Model | Identification,
    mode: int | Sequence[int] = 1,
    *,
    measured: bool = True,
    scale: float = 1.0,
    ax: Axes | None = None,
) -> Axes:
    """Draw the undeformed structure (thin), and elastic modes of a model, largest motion alike.

    What moves within its plane is drawn in that plane, everything else in a parallel projection
    from above a corner. Supports, known masses (squares) and springs to ground (zigzags) are shown.

    Arguments:
        source: a case, for the modes of its nominal model, a model, or an identification, whose
            shapes are arrows at its sensors, one at a time.
        mode: numbers of elastic modes in ascending order, from 1; several differ by line.
        measured: whether the measured mode that pairs with the first one is drawn, as an arrow at
            every sensor; needs a case with shapes.
        scale: of the motion; 1 draws the largest one as 12 % of the structure's largest side.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there is no such mode, or too many nodes to draw.

    Examples:
        >>> plot.mode_shape(case, 2).get_figure().savefig("mode-2.svg")
    """
    if isinstance(source, Identification) and isinstance(mode, int):
        return draw_identified(source, mode, scale * _REACH, ax)
    check_kind(source, (Case, Model), "mode shapes on a structure")
    assert not isinstance(source, Identification)
    model = source.model if isinstance(source, Case) else source
    wireframe = wireframe_of(source)
    if not wireframe.nodes:
        raise InputError(f"more than {MOST_NODES} nodes are no picture")
    elastic = modes_of(model).elastic
    numbers = [mode] if isinstance(mode, int) else list(mode)
    for number in numbers:
        if not 1 <= number <= len(elastic):
            expected = f"1 to {len(elastic)}"
            raise InputError(f"there is no elastic mode {number!r}", key="mode", expected=expected)
    view = view_of(wireframe, oblique=wireframe.plane != "in-plane")
    columns = [number - 1 for number in numbers]
    motion = node_motions(model, model, elastic.shapes[:, columns])
    reach = scale * _REACH * float(np.ptp(wireframe.points, axis=0).max())
    sizes = np.abs(motion).max(axis=(0, 1), initial=0.0)
    factors = reach / np.where(sizes > 0.0, sizes, 1.0)
    ax = own_axes(ax, (6.4, 4.8))
    draw_structure(ax, wireframe, view, width=0.9, attached=True)
    seen = [view.flat(wireframe.points)]
    for rank, number in enumerate(numbers):
        moved = np.array(wireframe.nodes) + factors[rank] * motion[..., rank]
        label = f"mode {number}, {elastic.natural_frequencies[number - 1]:.4g} Hz"
        _draw_moved(ax, wireframe, view, moved, rank, label)
        seen.append(view.flat(moved))
    title = ", ".join(map(str, numbers))
    if isinstance(source, Case) and measured and numbers:
        said, tips = _draw_measured(ax, source, numbers[0] - 1, factors[0], view)
        title, seen = title + said, [*seen, tips]
    frame_axes(ax, view, np.vstack(seen), pad=0.06)
    ax.set_title(f"Mode{'s' * (len(numbers) > 1)} {title}", fontsize=10.0)
    below = (0.5, -0.12 if view.names else 0.0)
    ax.legend(loc="upper center", bbox_to_anchor=below, ncols=3, fontsize=8.5, frameon=False)
    return ax


def _draw_moved(
    ax: Axes, wireframe: Wireframe, view: View, moved: FloatArray, rank: int, label: str
) -> None:
    style = curve_style("predicted", rank, 1)
    flat = view.flat(moved)
    if not wireframe.elements:
        nodes = view.flat(wireframe.nodes)
        draw_lines(ax, np.stack([nodes, flat], axis=1), colors=style["color"], linewidths=1.0)
        ax.plot(*flat.T, linestyle="none", marker="os^D"[rank % 4], markersize=4.5,
                color=style["color"], label=label)  # fmt: skip
        return
    line = {"colors": style["color"], "linewidths": 2.4, "capstyle": "butt"}
    line["linestyles"] = ("solid", "dashed", "dashdot", "dotted")[rank % 4]
    draw_lines(ax, flat[np.array(wireframe.elements)], label=label, **line)


def _draw_measured(
    ax: Axes, case: Case, column: int, factor: float, view: View
) -> tuple[str, FloatArray]:
    """Draw the measured partner of a mode as arrows; return words on it and the arrows' tips."""
    data = case.measurement
    _, at_sensors, pairing = pair_modes(case.model, data)
    found = np.flatnonzero(pairing.index == column)
    nothing = np.empty((0, 2))
    if not len(found):
        return ", no measured mode belongs to it", nothing
    row = int(found[0])
    said = f", measured mode {data.numbers[row]} at {data.frequencies[row]:.4g} Hz"
    shape = data.shapes[:, row]
    moves = np.array(["r" not in name for name in data.sensors.directions], dtype=bool)
    there = np.isfinite(shape) & moves
    if not there.any():
        return said, nothing
    size = float(modal_scale_factor(at_sensors[there, column], shape[there]).item())
    arrows = factor * size * shape[there, None] * data.sensors.axes[there, :3]
    starts, ways = view.flat(data.sensors.xyz[there]), view.flat(arrows)
    ax.quiver(
        *starts.T, *ways.T, angles="xy", scale_units="xy", scale=1.0, width=0.004, headwidth=4.5,
        color=INK, edgecolor=PAGE, linewidth=0.3, zorder=4, label="measured",
    )  # fmt: skip
    return f"{said}, MAC {pairing.mac[row]:.3f}", starts + ways
