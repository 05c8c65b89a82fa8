"""What was found on a structure: causes and changes at their places, each with a sign and words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.drawing.findings import Finding, Symbol, changes_found
from femubench.core.drawing.places import DrawnPlace
from femubench.core.drawing.wireframe import Wireframe, wireframe_of
from femubench.core.errors import InputError
from femubench.core.fem.joints import place_words
from femubench.core.plot.structure import (
    View,
    draw_lines,
    draw_names,
    draw_structure,
    frame_axes,
    view_of,
)
from femubench.core.plot.style import (
    AFTER,
    BEFORE,
    CAUSE,
    INK,
    PAGE,
    SOFT,
    name_of,
    own_axes,
    place_names,
)
from femubench.core.typing import FloatArray
from femubench.core.update.strategy import UpdateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKS: dict[Symbol, str] = {"change": "D", "spring": "o", "mass": "s", "fault": "X"}
_MOST_BADGES = 4  # of one finding
_MOST_LISTED, _LONGEST = 8, 72
_EVERYWHERE = (CAUSE, AFTER, BEFORE, SOFT)  # causes that cover everything take turns
_DASH = 3.0  # line widths
_ROBUST = 3.0  # medians at which the colours of changes end


def changes(case: Case, result: UpdateResult, *, ax: Axes | None = None) -> Axes:
    """Draw what an update changed, as it reports it: parameters at their places.

    Blue is stiffer (or more), purple is softer (or less), the darker, the more. One outlier does
    not make the rest pale: the scale ends at three times the median.

    Arguments:
        case: what was updated.
        result: of a strategy, whose parameters have places.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when no parameter has a place, or the structure no extent.

    Examples:
        >>> plot.changes(case, result).get_figure().savefig("changes.svg")
    """
    frame = result.model.structure
    stated = [{**vars(p), "places": place_words(frame, p.places)} for p in result.parameters]
    found = changes_found(case, stated)
    if not any(finding.kind != "elsewhere" for finding in found):
        raise InputError("no parameter that changed has a place on the structure")
    return draw_found(wireframe_of(case), found, ax)


def draw_found(wireframe: Wireframe, found: Sequence[Finding], ax: Axes | None) -> Axes:
    """Draw a structure with findings, on axes or on those of a new figure."""
    view = view_of(wireframe)
    ax = own_axes(ax, (6.0, 4.6))
    draw_structure(ax, wireframe, view)
    frame_axes(ax, view, view.flat(wireframe.points), pad=0.15, scales=False)
    draw_findings(ax, wireframe, view, found, draw_names(ax, wireframe, view))
    return ax


def scale_end(values: Sequence[float]) -> float:
    """Return the change at which colours end: the largest, or three medians where that is less."""
    sizes = np.abs(np.array(values, dtype=float))
    sizes = sizes[sizes > 0.0]
    return float(min(sizes.max(), _ROBUST * np.median(sizes))) if len(sizes) else 1.0


def lines_of(wireframe: Wireframe, view: View, place: DrawnPlace) -> FloatArray:
    """Return the lines of a place on the page, (n, 2, 2)."""
    members = view.flat(wireframe.lines)
    if place.kind == "all":
        return members
    if place.kind == "outline" or (place.kind == "pair" and len(place.points) == 2):
        return view.flat(np.reshape(place.points, (-1, 2, 3)))
    found = [
        [(1.0 - s) * members[span.member, 0] + s * members[span.member, 1] for s in ends]
        for span in place.spans
        for ends in ((span.start, span.end),)
    ]
    return np.array(found).reshape(-1, 2, 2)


def draw_findings(
    ax: Axes,
    wireframe: Wireframe,
    view: View,
    findings: Sequence[Finding],
    taken: FloatArray | None = None,
    further: Sequence[Any] = (),
) -> None:
    """Draw findings at their places, numbered where they are causes, and list them below.

    Arguments:
        taken: points on the page that numbers are to avoid, (n, 2).
    """
    from matplotlib.lines import Line2D

    changed = [f.value for f in findings if f.symbol == "change" and f.value is not None]
    end = scale_end(changed)
    handles: list[Any] = []
    badges: list[tuple[FloatArray, str]] = []
    covering = [f for f in findings if f.number and f.kind == "all" and f.symbol == "change"]
    # What covers everything lies below what has a place.
    for finding in sorted(findings, key=lambda finding: finding.kind != "all"):
        look = _look(finding, end)
        if len(covering) > 1 and finding in covering:
            # Several lines along the same members show each in its turn.
            place = covering.index(finding)
            dashes = (-_DASH * place, (_DASH, _DASH * (len(covering) - 1)))
            look |= {"color": _EVERYWHERE[place % len(_EVERYWHERE)], "linestyle": dashes}
        lines = lines_of(wireframe, view, finding)
        gid = f"finding-{len(handles)}"
        at = lines.mean(axis=1) if len(lines) and finding.kind != "all" else np.empty((0, 2))
        if len(lines) and (finding.symbol == "change" or finding.kind == "pair"):
            dashed = {"linestyle": "dashed"} if finding.kind == "pair" else {}
            draw_lines(ax, lines, **look, **dashed, gid=gid, zorder=2.7,
                       label=f"_{name_of(finding.label)}")  # fmt: skip
        elif len(at):
            ax.plot(*at.T, gid=gid, **_mark(finding, look))
        if len(finding.points) and finding.kind not in ("pair", "outline"):
            at = view.flat(finding.points)
            ax.plot(*at.T, gid=gid, **_mark(finding, look))
        handles.append(_handle(finding, look))
        if finding.number:
            few = 1 if finding.kind == "outline" else _MOST_BADGES
            badges += [(point, str(finding.number)) for point in at[:few]]
    badge = {"boxstyle": "round,pad=0.25,rounding_size=0.7", "facecolor": INK, "edgecolor": PAGE}
    at_badges = np.array([point for point, _ in badges]).reshape(-1, 2)
    place_names(ax, at_badges, [number for _, number in badges], avoid=taken, size=8.5,
                color=PAGE, weight="bold", bbox=badge, zorder=5)  # fmt: skip
    more = len(handles) - _MOST_LISTED
    listed = list(handles[:_MOST_LISTED])
    if more > 0:
        listed.append(Line2D([], [], linestyle="none", label=f"and {more} more"))
    listed += further
    if listed:
        ax.legend(
            handles=listed, loc="upper center", bbox_to_anchor=(0.5, 0.0), frameon=False,
            fontsize=8.5, labelcolor=INK, handlelength=1.6,
        )  # fmt: skip


def _look(finding: Finding, end: float) -> dict[str, Any]:
    """Return colour and width: one colour for a cause, of a change its sign and size."""
    from matplotlib import colormaps

    if finding.number or finding.value is None:
        return {"color": CAUSE, "linewidth": 3.0}
    share = min(abs(finding.value) / end, 1.0)
    colours = colormaps["Blues" if finding.value > 0.0 else "Purples"]
    return {"color": colours(0.45 + 0.55 * share), "linewidth": 2.6 + 4.0 * share}


def _mark(finding: Finding, look: dict[str, Any]) -> dict[str, Any]:
    hollow = finding.symbol == "spring"
    return {
        "linestyle": "none",
        "marker": _MARKS[finding.symbol],
        "markersize": 9.0,
        "markerfacecolor": PAGE if hollow else look["color"],
        "markeredgecolor": look["color"] if hollow else PAGE,
        "markeredgewidth": 2.4 if hollow else 0.8,
        "label": f"_{name_of(finding.label)}",
        "zorder": 4,
    }


def _handle(finding: Finding, look: dict[str, Any]) -> Any:  # noqa: ANN401 - an artist
    from matplotlib.lines import Line2D

    where = {"all": "everywhere", "elsewhere": ""}.get(finding.kind, finding.place)
    # A parameter of an update has its place in its name.
    where = f" ({name_of(where, 24)})" if finding.number and where else ""
    text = f"{finding.number or ''} {finding.label}{where}".strip()
    shown: dict[str, Any] = {**_mark(finding, look), "label": name_of(text, _LONGEST)}
    if finding.symbol == "change" and (finding.kind == "outline" or not finding.points):
        shown = {**look, "linestyle": "solid", "label": shown["label"]}
    return Line2D([], [], **shown)
