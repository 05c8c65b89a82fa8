"""What drawings share: axes of their own, colours, line styles, names that do not overlap."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.errors import InputError, harmless
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# By role, as the style sheet of a page names them; a page in the dark has others.
COLOURS = {
    "ink": "#1b1b1b", "soft": "#565656", "page": "#ffffff", "grid": "#dcdfe3", "band": "#e4ecd9",
    "member": "#8a9099", "halo": "#cfe3f5", "before": "#b34700", "after": "#0072b2",
    "cause": "#8f2468",
    "e1": "#a9cbe8", "e2": "#79aeda", "e3": "#4a8fc6", "e4": "#1d6fae", "e5": "#08407a",
}  # fmt: skip
INK, SOFT, PAGE, MEMBER, CAUSE = (
    COLOURS[role] for role in ("ink", "soft", "page", "member", "cause")
)
BEFORE, AFTER = COLOURS["before"], COLOURS["after"]
# Okabe & Ito (2008): distinguished with any kind of colour vision.
BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY = (
    "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9",
)  # fmt: skip
STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": "black", "linewidth": 2.2, "linestyle": "-"},
    "predicted": {"color": VERMILLION, "linewidth": 1.6, "linestyle": (0, (5, 2))},
    "nominal": {"color": BLUE, "linewidth": 1.1, "linestyle": (0, (1, 1.6))},
    "other": {"color": GREEN, "linewidth": 1.4, "linestyle": (0, (6, 1.5, 1, 1.5))},
}
# Further curves of one role take the next colour and a marker.
SERIES = (VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLUE)
_MARKERS = ("", "o", "s", "^", "D", "v")
_SETTINGS: dict[str, Any] = {
    **dict.fromkeys(("font.size", "axes.labelsize"), 10.0),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 9.5),
    **dict.fromkeys(("text.color", "axes.labelcolor"), INK),
    **dict.fromkeys(("xtick.labelcolor", "ytick.labelcolor"), INK),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), SOFT),
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "svg.fonttype": "none",
    "hatch.linewidth": 0.7,
}
_LONGEST = 22  # letters of a name next to a point
_WIDTH, _HEIGHT = 0.31, 0.62  # half of a letter, of its size
_SIDES = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4.0])


def own_axes(ax: Axes | None, size: tuple[float, float] = (6.4, 4.4)) -> Axes:
    """Return axes as given, or those of a new figure that no global state knows.

    Arguments:
        size: of a new figure in inch.
    """
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=size, layout="constrained").subplots()


def check_kind(value: object, kinds: tuple[type, ...], what: str) -> None:
    """Check that a caller brought something that can be drawn.

    Arguments:
        what: it has to have, for the message.

    Raises:
        InputError: when it is none of these kinds.
    """
    if not isinstance(value, kinds):
        expected = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(f"{type(value).__name__} has no {what}", expected=expected)


def figure_of(ax: Axes) -> Figure:
    """Return the figure that axes lie in."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return figure


@contextmanager
def report_style(name: str) -> Iterator[None]:
    """Set what the drawings of reports look like, whatever the user has set.

    Arguments:
        name: of the drawing, from which the ids in it follow.
    """
    from matplotlib import rc_context, rcdefaults, rcParams

    wanted: Any = {**_SETTINGS, "svg.hashsalt": name}
    with rc_context():
        rcdefaults()
        rcParams.update(wanted)
        yield


def curve_style(role: str, rank: int, points: int) -> dict[str, Any]:
    """Return the look of a curve, distinguished from others without colour.

    Arguments:
        role: a key of `STYLES`.
        rank: how many of that role there are before.
    """
    style = dict(STYLES[role])
    if rank:
        style["color"] = SERIES[rank % len(SERIES)]
        style["marker"], style["markersize"] = _MARKERS[rank % len(_MARKERS)], 4.5
        style["markevery"] = max(1, points // 12)
    return style


def draw_curves(ax: Axes, curves: Iterable[tuple[str, str, Any, Any]]) -> None:
    """Draw curves over a grid.

    Arguments:
        curves: label, role, x and y of each.
    """
    ranks: Counter[str] = Counter()
    for label, role, x, y in curves:
        ax.plot(x, y, label=label, **curve_style(role, ranks[role], len(x)))
        ranks[role] += 1
    ax.margins(x=0.01)
    ax.grid(color="0.88", linewidth=0.6)


def name_of(text: str, most: int = 40) -> str:
    """Return a name for a drawing: one short line of what can be shown."""
    line = harmless(text)
    return line if len(line) <= most else f"{line[: most - 1]}…"


def place_names(
    ax: Axes,
    points: FloatArray | Sequence[FloatArray],
    names: Sequence[str],
    *,
    avoid: FloatArray | None = None,
    size: float = 8.0,
    **look: Any,  # noqa: ANN401 - what matplotlib knows of a text
) -> FloatArray:
    """Write names next to points, off each other and off what is there, as far as there is room.

    Arguments:
        points: in the units of the axes, whose limits are final, (n, 2).
        names: one a point.
        avoid: further points that no name is to cover, (k, 2).
        size: of the letters in points.

    Returns what the next names have to avoid, (k + 8 n, 2).
    """
    ax.apply_aspect()
    scale = 72.0 / figure_of(ax).dpi
    at = scale * ax.transData.transform(np.reshape(points, (-1, 2)))
    blocked = at if avoid is None else np.vstack([at, scale * ax.transData.transform(avoid)])
    middle = at.mean(axis=0) if len(at) else 0.0
    corners = np.array([[0, 0], [-1, -1], [-1, 1], [1, -1], [1, 1], [-0.5, 0], [0.5, 0]])
    for point, here, name in zip(points, at, (name_of(n, _LONGEST) for n in names), strict=True):
        half = np.array([_WIDTH * len(name) + 0.2, _HEIGHT]) * size
        sides = _SIDES[np.argsort(-_SIDES @ (here - middle), kind="stable")]
        offsets = np.rint(sides) * half + 0.55 * size * sides
        inside = np.abs(blocked - here - offsets[:, None]) < half + 1.0
        offset = offsets[np.argmin(inside.all(axis=2).sum(axis=1))]
        ax.annotate(
            name, tuple(point), xytext=tuple(offset), textcoords="offset points",
            ha="center", va="center", fontsize=size, parse_math=False, **look,
        )  # fmt: skip
        blocked = np.vstack([blocked, here + offset + 0.9 * corners * half])
    return np.asarray(ax.transData.inverted().transform(blocked / scale))
