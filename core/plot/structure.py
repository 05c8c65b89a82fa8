"""A structure as lines: the view, members, joints, supports, sensors, a value for every element."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.drawing.wireframe import Wireframe
from femubench.core.errors import InputError
from femubench.core.plot.style import INK, MEMBER, PAGE, SOFT, figure_of, name_of, place_names
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TURN, _TILT = math.radians(-52.0), math.radians(24.0)
_MOST_NAMES, _MOST_SENSORS = 30, 400
_TRIANGLE: Any = [(0, 0), (-0.6, -1), (0.6, -1), (0, 0)]
_ZIGZAG: Any = [(0, 0), (0, -0.3), (0.4, -0.5), (-0.4, -0.7), (0, -0.9), (0, -1.2)]
_PLANES = {"in-plane": (0, 2), "out-of-plane": (0, 1)}


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Arguments:
        matrix: from x, y, z to across and up, (3, 2).
        names: of the two axes of a plan or an elevation; None for a view from above a corner.
    """

    matrix: FloatArray
    names: tuple[str, str] | None

    def flat(self, points: Any) -> FloatArray:  # noqa: ANN401 - what makes an array
        """Return points on the page in m, (..., 2), from (..., 3)."""
        return np.asarray(np.asarray(points, dtype=float) @ self.matrix)


def view_of(wireframe: Wireframe, *, oblique: bool = False) -> View:
    """Return the plan or elevation of what lies in a plane, else a view from above a corner.

    The corner is the one from which the structure is wider, so that fewer members hide each other;
    it is seen from 24 degrees above.

    Arguments:
        oblique: from above a corner in any case, e.g. to show motion out of a plane.

    Raises:
        InputError: when there is nothing to see: no points, or all of them at one place.
    """
    points = wireframe.points
    with np.errstate(over="ignore", invalid="ignore"):
        sides = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    if not np.isfinite(sides).all() or not sides.max() > 0.0:
        raise InputError("the structure has no extent to draw", expected="points with distances")
    thin = sides <= 1e-6 * sides.max()
    pair = _PLANES.get(wireframe.plane)
    if pair is None and thin.any():
        away = 2 if thin[2] else int(np.argmax(thin))
        pair = next(p for p in ((0, 1), (0, 2), (1, 2)) if away not in p)
    if pair is not None and not oblique:
        return View(np.eye(3)[:, list(pair)], ("xyz"[pair[0]], "xyz"[pair[1]]))
    views = []
    for s in (math.sin(_TURN), -math.sin(_TURN)):
        c, up = math.cos(_TURN), math.sin(_TILT)
        views.append(np.array([[c, -up * s], [s, up * c], [0.0, math.cos(_TILT)]]))
    wide = [float(np.ptp(points @ view[:, 0])) for view in views]
    return View(views[int(wide[1] > 1.01 * wide[0])], None)


def frame_axes(
    ax: Axes,
    view: View,
    points: FloatArray,
    *,
    pad: float = 0.1,
    scales: bool = True,
    directions: bool = True,
) -> None:
    """Set the limits of axes around points, with equal scales in m, or the directions of x, y, z.

    Arguments:
        points: what has to be seen, on the page, (n, 2).
        pad: room around it, of the larger side.
        scales: whether a plan or an elevation has scales; other views have none.
        directions: whether small arrows tell x, y, z where there are no scales.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    room = pad * float((high - low).max())
    ax.set_xlim(low[0] - room, high[0] + room)
    ax.set_ylim(low[1] - room, high[1] + room)
    ax.set_aspect("equal")
    ax.spines[["top", "right"]].set_visible(False)
    if view.names is not None and scales:
        ax.set(xlabel=f"{view.names[0]}, m", ylabel=f"{view.names[1]}, m")
        return
    ax.set_axis_off()
    if not directions:
        return
    ax.set_ylim(low[1] - room - 0.17 * float((high - low).max()), high[1] + room)
    for name, (across, up) in zip("xyz", view.matrix, strict=True):
        if not abs(across) + abs(up) > 0.0:
            continue
        ax.annotate(
            name, (0.0, 0.0), xycoords="axes fraction", textcoords="offset points",
            xytext=(16.0 + 22.0 * across, 12.0 + 22.0 * up), ha="center", va="center",
            fontsize=8.0, color=SOFT,
        )  # fmt: skip
        ax.annotate(
            "", (16.0 + 15.0 * across, 12.0 + 15.0 * up), xycoords="axes points",
            xytext=(16.0, 12.0), textcoords="axes points",
            arrowprops={"arrowstyle": "->", "color": SOFT, "linewidth": 0.9, "shrinkA": 0,
                        "shrinkB": 0},
        )  # fmt: skip


def draw_lines(ax: Axes, segments: FloatArray, **look: Any) -> Any:  # noqa: ANN401
    """Draw straight lines on the page and return them as one artist.

    Arguments:
        segments: (n, 2, 2).
    """
    from matplotlib.collections import LineCollection

    lines = LineCollection(list(segments), **{"capstyle": "round", **look})
    ax.add_collection(lines)
    return lines


def draw_structure(
    ax: Axes,
    wireframe: Wireframe,
    view: View,
    *,
    width: float = 1.9,
    attached: bool = False,
    **look: Any,  # noqa: ANN401 - what matplotlib knows of lines
) -> None:
    """Draw members, joints and supports.

    Arguments:
        width: of the lines in points.
        attached: whether known masses (squares) and springs to ground (zigzags) are drawn.
    """
    width = min(width, 0.8) if wireframe.outlines else width
    draw_lines(ax, view.flat(wireframe.lines), linewidths=width, **{"colors": MEMBER, **look})
    if wireframe.outlines:
        return  # of the nodes of a mesh those next to sensors alone are known
    joints = view.flat([joint.xyz for joint in wireframe.joints] or np.empty((0, 3)))
    dot: dict[str, Any] = {"linestyle": "none", "markeredgecolor": PAGE, "markeredgewidth": 0.6}
    size = 4.5 if wireframe.members else 6.0
    ax.plot(*joints.T, marker="o", markersize=size, markerfacecolor=MEMBER, **dot)
    shown = [(f"held: {', '.join(s.fixed)}", s.xyz, _TRIANGLE) for s in wireframe.supports]
    if attached:
        shown += [(f"mass {mass.kg:.3g} kg", mass.xyz, "s") for mass in wireframe.masses]
        shown += [(f"spring {s.stiffness:.3g}", s.xyz, _ZIGZAG) for s in wireframe.springs]
    for k, (said, xyz, mark) in enumerate(shown):
        x, y = view.flat(xyz)
        small, face = (6, INK) if mark == "s" else (12, "none")
        ax.plot(
            [x], [y], linestyle="none", marker=mark, markersize=small, markerfacecolor=face,
            markeredgecolor=SOFT, markeredgewidth=1.1, label=f"_{said}", gid=f"attached-{k}",
        )  # fmt: skip


def draw_sensors(ax: Axes, wireframe: Wireframe, view: View) -> None:
    """Draw a triangle at every sensor, where there are few enough to tell them apart."""
    few = len(wireframe.sensors) <= _MOST_SENSORS
    for k, sensor in enumerate(wireframe.sensors if few else ()):
        x, y = view.flat(sensor.xyz)
        ax.plot(
            [x], [y], linestyle="none", marker="^", markersize=5.5, markerfacecolor=SOFT,
            markeredgecolor=PAGE, markeredgewidth=0.5, gid=f"sensor-{k}",
            label=f"_sensor {name_of(sensor.label)}, {sensor.direction}",
        )  # fmt: skip


def draw_names(ax: Axes, wireframe: Wireframe, view: View) -> FloatArray:
    """Write the names of joints and members next to them, where there are few enough to read.

    Returns the points that are taken, on the page, (n, 2).
    """
    lines = view.flat(wireframe.lines)
    along = np.linspace(0.0, 1.0, 24)[:, None, None]
    taken = ((1.0 - along) * lines[:, 0] + along * lines[:, 1]).reshape(-1, 2)
    if len(wireframe.joints) <= _MOST_NAMES and wireframe.joints:
        joints = view.flat([joint.xyz for joint in wireframe.joints])
        names = [joint.name for joint in wireframe.joints]
        taken = place_names(ax, joints, names, avoid=taken, size=10.0, color=INK)
    if len(wireframe.members) <= _MOST_NAMES and wireframe.members:
        # Next to the middle, where a cause may have its number.
        middles = 0.62 * lines[:, 0] + 0.38 * lines[:, 1]
        names = [member.name for member in wireframe.members]
        taken = place_names(ax, middles, names, avoid=taken, size=8.5, color=SOFT)
    return taken


def draw_element_values(ax: Axes, wireframe: Wireframe, values: FloatArray, label: str) -> None:
    """Draw a value for every element as colour and width, and write it next to the element.

    Arguments:
        values: >= 0, (n_elements,).

    Raises:
        InputError: when there is not one value an element.
    """
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    if not len(values) == len(wireframe.elements) > 0:
        what = f"{len(values)} values for {len(wireframe.elements)} elements"
        raise InputError(what, expected="one value for every element")
    view = view_of(wireframe)
    top = float(values.max()) or 1.0
    segments = view.flat(np.array(wireframe.nodes)[np.array(wireframe.elements)])
    # The lightest fifth would not be seen on white.
    dark = ListedColormap(colormaps["cividis"](np.linspace(0.8, 0.0, 256)))
    widths = list(1.5 + 10.0 * values / top)
    lines = draw_lines(ax, segments, cmap=dark, capstyle="butt", linewidths=widths)
    lines.set_array(values)
    lines.set_clim(0.0, top)
    frame_axes(ax, view, segments.reshape(-1, 2))
    middle = 0.5 * (segments.min(axis=(0, 1)) + segments.max(axis=(0, 1)))
    for (start, stop), value in zip(segments, values, strict=True):
        level = int(abs(stop[0] - start[0]) >= abs(stop[1] - start[1]))
        centre = 0.5 * (start + stop)
        out = 1.0 if centre[level] >= middle[level] - 1e-9 else -1.0
        ax.annotate(
            f"{value:.2f}" if value >= 0.0995 else f"{value:.3f}",
            tuple(centre),
            xytext=(0.0, 8.0 * out) if level else (8.0 * out, 0.0),
            textcoords="offset points",
            ha="center" if level else ("left" if out > 0 else "right"),
            va=("bottom" if out > 0 else "top") if level else "center",
            fontsize=9.0,
        )
    for joint in wireframe.joints:
        x, y = view.flat(joint.xyz)
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "black"}
        ax.text(x, y, name_of(joint.name), ha="center", va="center", fontsize=9.5, bbox=box,
                zorder=4, parse_math=False)  # fmt: skip
    bar = figure_of(ax).colorbar(lines, ax=ax, location="bottom", shrink=0.7, aspect=40)
    bar.set_label(f"{label} (colour and width)")
