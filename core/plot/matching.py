"""Where the sensors of a test were taken to sit on the structure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femubench.core.case.case import Case
from femubench.core.drawing.wireframe import wireframe_of
from femubench.core.errors import InputError
from femubench.core.plot.structure import draw_lines, frame_axes, view_of
from femubench.core.plot.style import AFTER, BEFORE, MEMBER, SOFT, own_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def matching(case: Case, *, ax: Axes | None = None) -> Axes:
    """Draw the structure (grey), the test's points (circles) and the places they were given.

    Arguments:
        case: whose sensors came with coordinates.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when no sensor was matched.

    Examples:
        >>> plot.matching(case).get_figure().savefig("matches.png")
    """
    if not case.matches:
        raise InputError("no sensor came with coordinates", expected="a case with Case.matches")
    frame = wireframe_of(case)
    view = view_of(frame)
    ax = own_axes(ax, (7.3, 5.2))
    nodes = np.array(frame.nodes or [joint.xyz for joint in frame.joints], dtype=float)
    if len(frame.lines):
        draw_lines(ax, view.flat(frame.lines), linewidths=1.6, colors=MEMBER, label="model")
    else:
        ax.plot(*view.flat(nodes).T, ".", markersize=2.5, color=MEMBER, label="nodes of the model")
    drawn = [view.flat(nodes)]
    if case.lines is not None and len(case.lines):
        lines = view.flat(case.lines)
        draw_lines(ax, lines, linewidths=0.8, colors=SOFT, label="lines of the test")
        drawn.append(lines.reshape(-1, 2))
    measured = view.flat(np.array([match.measured for match in case.matches]))
    placed = view.flat(np.array([match.xyz for match in case.matches]))
    links = np.stack([measured, placed], axis=1)
    draw_lines(ax, links, linewidths=1.4, colors=BEFORE)
    ax.plot(*placed.T, "x", markersize=5.0, color=AFTER, label="where it was taken to sit")
    ax.plot(
        *measured.T, "o", markersize=7.0, markerfacecolor="none", color=BEFORE,
        label="sensor of the test",
    )  # fmt: skip
    frame_axes(ax, view, np.vstack([*drawn, measured]), pad=0.06)
    far = max(case.matches, key=lambda match: match.distance)
    count = len({match.sensor.rpartition(":")[0] or match.sensor for match in case.matches})
    ax.set_title(
        f"{count} measured points, at most {far.distance:.2g} m from their place ({far.sensor})",
        fontsize=10.0,
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8.5, frameon=False)
    return ax
