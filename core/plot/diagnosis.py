"""A diagnosis as drawings: residuals against the band of noise, evidence on the structure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from femubench.core.case.case import Case
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_to_json
from femubench.core.drawing.findings import Finding, causes_found, lacks_found
from femubench.core.drawing.places import DrawnPlace, PlacedWireframe
from femubench.core.errors import InputError
from femubench.core.inference.settings import settings
from femubench.core.plot.findings import draw_findings, draw_found, lines_of
from femubench.core.plot.structure import (
    View,
    draw_lines,
    draw_names,
    draw_sensors,
    draw_structure,
    frame_axes,
    view_of,
)
from femubench.core.plot.style import AFTER, BEFORE, COLOURS, PAGE, SERIES, SOFT, name_of, own_axes
from femubench.core.schema.validation import read_plain
from femubench.core.score.responses import rms

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Data = Mapping[str, Any]
Kind = Literal["frequency", "shape"]

BAND = 2.0  # sigmas within which 19 of 20 data of pure noise lie
MOST_ROWS = 60
_PLAIN = 8.0  # up to here the axis is the same everywhere
_FARTHEST = 1e12
_ALONE = {"lost": "gone", "new": "new"}
_LEVELS = 5
_MOST_SPOTS, _LEAST = 14, 0.005  # what two decimals show


@dataclass(frozen=True)
class ResidualDot:
    """A dot before and a dot after, in standard deviations; None where nothing pairs."""

    name: str
    before: float | None
    after: float | None
    one_sided: bool = False

    @property
    def text(self) -> str:
        """Return both values."""
        return " → ".join(
            "–" if v is None else format(v, ".2g" if self.one_sided else _signed(v))
            for v in (self.before, self.after)
        )


@dataclass(frozen=True)
class Spot:
    """A place with a value 0..1 and, where it is a cause, its numbers in the list of causes."""

    place: str
    value: float
    causes: str = ""

    @property
    def level(self) -> int:
        """Return the step 1..5 of the scale."""
        return min(_LEVELS, max(1, math.ceil(self.value * _LEVELS)))


def _data(diagnosis: Diagnosis | Data, case: Case | None = None) -> Data:
    if isinstance(diagnosis, Diagnosis):
        return diagnosis_to_json(diagnosis, case=diagnosis.extended if case is None else case)
    if isinstance(diagnosis, Mapping) and {"residuals", "locations", "causes"} <= set(diagnosis):
        return diagnosis
    what = f"{type(diagnosis).__name__} is no diagnosis"
    raise InputError(what, expected="a Diagnosis, or its JSON as a mapping")


def residual_dots(diagnosis: Diagnosis | Data, kind: Kind) -> list[ResidualDot]:
    """Return what `residuals` draws: every frequency and the mass, or every mode's shape.

    Arguments:
        diagnosis: or its JSON as plain data.
        kind: ``shape`` for the root mean square of every mode over its sensors.

    Raises:
        InputError: for what is no diagnosis, or no such kind.

    Examples:
        >>> [dot.name for dot in plot.residual_dots(found, "frequency")]
        ['1: 226.8 Hz', '2: 275.2 Hz', '3: 537.4 Hz']
    """
    rows = _data(diagnosis)["residuals"]
    if kind == "frequency":
        named = {"frequency": "{mode}: {measured:.6g} Hz", "mass": "mass {measured:.6g} kg"}
        return [
            ResidualDot(
                text.format(mode=row["mode"], measured=row["measured"] or math.nan),
                row["before"],
                row["after"],
            )
            for name, text in named.items()
            for row in rows
            if row["kind"] == name
        ]
    if kind != "shape":
        raise InputError(f"no residuals of kind {kind!r}", expected="frequency or shape")
    modes: dict[Any, list[Data]] = {}
    for row in rows:
        if row["kind"] == "shape":
            modes.setdefault(row["mode"], []).append(row)
    return [
        ResidualDot(f"{mode}: {len(own)} sensors", _rms(own, "before"), _rms(own, "after"), True)
        for mode, own in modes.items()
    ]


def _signed(value: float) -> str:
    return "+.1f" if abs(value) < 1e4 else "+.2e"


def _near(value: float) -> float:
    return float(np.clip(value, -_FARTHEST, _FARTHEST))


def _rms(rows: Sequence[Data], key: str) -> float | None:
    known = [_near(row[key]) for row in rows if row[key] is not None]
    return rms(known) if known else None


def residuals(
    diagnosis: Diagnosis | Data, *, kind: Kind = "frequency", ax: Axes | None = None
) -> Axes:
    """Draw residuals before (hollow circles) and after (diamonds) in standard deviations.

    The band of two sigmas is shaded: 19 of 20 data of pure noise lie in it. Beyond 8 the axis goes
    on with the logarithm outside of the band. At most 60 rows are drawn.

    Arguments:
        diagnosis: or its JSON as plain data.
        kind: ``frequency`` (and the mass), or ``shape``: root mean squares over the sensors.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there are no residuals of that kind.

    Examples:
        >>> plot.residuals(found).get_xlabel()
        'standard deviations of the measurement'
    """
    dots = residual_dots(diagnosis, kind)[:MOST_ROWS]
    if not dots:
        raise InputError(f"the diagnosis has no residuals of kind {kind!r}")
    ax = own_axes(ax, (5.2, 1.0 + 0.27 * len(dots)))
    one_sided = dots[0].one_sided
    ax.axvspan(0.0 if one_sided else -BAND, BAND, color=COLOURS["band"], linewidth=0.0)
    rows = range(len(dots))
    for row, dot in zip(rows, dots, strict=True):
        pair = [_near(v) for v in (dot.before, dot.after) if v is not None]
        if len(pair) == 2:
            ax.plot(pair, [row, row], color=SOFT, linewidth=0.9, linestyle=(0, (2, 2)))
    for name, face, edge, mark in (("before", "none", BEFORE, "o"), ("after", AFTER, PAGE, "D")):
        known = [(_near(v), k) for k in rows if (v := getattr(dots[k], name)) is not None]
        across, down = zip(*known, strict=True) if known else ((), ())
        look: dict[str, Any] = {"markerfacecolor": face, "markeredgecolor": edge, "markersize": 7.0}
        ax.plot(
            across, down, linestyle="none", marker=mark,
            markeredgewidth=1.6 if mark == "o" else 0.6, label=name, **look,
        )  # fmt: skip
    _residual_axis(ax, dots, one_sided)
    _two_sided(ax, [name_of(dot.name, 24) for dot in dots], [dot.text for dot in dots])
    ax.set_xlabel("standard deviations of the measurement")
    ax.annotate(
        "before → after", (1.0, 1.0), xycoords="axes fraction", xytext=(4.0, 3.0),
        textcoords="offset points", fontsize=8.5, color=SOFT,
    )  # fmt: skip
    return ax


def state_changes(states: Data, *, ax: Axes | None = None) -> Axes:
    """Draw how the frequency of each mode changed, as arrows from the reference to the present.

    Two standard deviations of both states are shaded; a mode that only one state has is a cross.
    At most 60 modes are drawn.

    Arguments:
        states: of the JSON of a diagnosis with a reference.
        ax: to draw on; None for axes of a new figure.

    Examples:
        >>> changes = {"change_percent": 4.3, "std_percent": 0.2, "deviations": 21.0}
        >>> row = {"mode": 3, "reference_hz": 44.0, "mac": 0.98, "shape_p": 0.4, **changes}
        >>> plot.state_changes({"modes": [row], "lost": [], "new": []}).get_xlabel()
        'change of the frequency, %'
    """
    rows = states["modes"][:MOST_ROWS]
    alone = [(m, word) for key, word in _ALONE.items() for m in states[key]]
    alone = alone[: MOST_ROWS - len(rows)]
    ax = own_axes(ax, (4.4, 0.9 + 0.27 * (len(rows) + len(alone))))
    left, right = [], []
    for k, row in enumerate(rows):
        left.append(f"{row['mode']}: {row['reference_hz'] or math.nan:.4g} Hz")
        change, std = (row[key] or 0.0 for key in ("change_percent", "std_percent"))
        ax.barh(k, 2.0 * BAND * std, left=-BAND * std, height=0.8, color=COLOURS["band"])
        ax.plot([0.0, change], [k, k], color=AFTER, linewidth=2.0)
        ax.plot(change, k, marker=">" if change > 0.0 else "<", markersize=6.0, color=AFTER)
        turned = row["shape_p"] is not None and row["shape_p"] < settings.noise_p
        right.append(f"{change:+.2g} %" + f", MAC {row['mac'] or 0.0:.2f}" * turned)
    for k, (row, word) in enumerate(alone, len(rows)):
        left.append(f"{row['mode']}: {row['hz'] or math.nan:.4g} Hz")
        ax.plot(0.0, k, marker="x", markersize=7.0, markeredgewidth=2.0, color=BEFORE)
        right.append(word)
    ax.axvline(0.0, color=SOFT, linewidth=0.9)
    ax.margins(x=0.08)
    _two_sided(ax, left, right)
    ax.set_xlabel("change of the frequency, %")
    return ax


def error_budget(
    diagnosis: Diagnosis | Data, *, by: Literal["mode", "place"] = "mode", ax: Axes | None = None
) -> Axes:
    """Draw what the drawing lacks: of every mode a bar of classes that reaches its error.

    What makes a mode higher than drawn is stacked up, what makes it lower down; what stays
    unexplained is hatched, and the error of the drawing a line across. Modes that had no part in
    the budget stand apart on the right. At most 60 modes are drawn.

    Arguments:
        diagnosis: or its JSON as plain data.
        by: ``place`` for the structure with the classes where they sit, blue where it is drawn too
            soft or too heavy, purple where too stiff or too light.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when it has no budget, or no structure to draw it on.

    Examples:
        >>> plot.error_budget(found).get_ylabel()
        'ln(measured / drawn), %'
    """
    data = _data(diagnosis)
    modes = sorted(data.get("budget_modes") or (), key=lambda m: not m["used"])[:MOST_ROWS]
    if not modes:
        raise InputError("the diagnosis has no budget of what the drawing lacks to draw")
    if by == "place":
        structure = _structure(data.get("structure"))
        return draw_found(structure, lacks_found(data, structure), ax)
    order = [data["budget_modes"].index(mode) for mode in modes]
    lines = [(f"{row['class']}{_at(row['place'])}", row["percent"]) for row in data["budget"]]
    shown, rest = lines[: len(SERIES)], lines[len(SERIES) :]
    shares = [(name, np.array(share)[order], colour, "") for (name, share), colour in
              zip(shown, SERIES, strict=False)]  # fmt: skip
    if rest:
        others = np.sum([share for _, share in rest], axis=0)[order]
        shares.append(("all others", others, COLOURS["grid"], ""))
    left = np.array([mode["left_percent"] for mode in modes])
    shares.append(("unexplained", left, PAGE, "////"))
    count = sum(mode["used"] for mode in modes)
    at = np.arange(len(modes)) + (np.arange(len(modes)) >= count) * 0.8
    ax = own_axes(ax, (6.4, 3.8))
    ends = {sign: np.zeros(len(modes)) for sign in (1.0, -1.0)}
    for name, share, colour, hatch in shares:
        for sign, end in ends.items():
            own = np.where(sign * share > 0.0, share, 0.0)
            ax.bar(at, own, 0.72, end, color=colour, hatch=hatch, edgecolor=SOFT, linewidth=0.4,
                   label=name if sign > 0.0 else None)  # fmt: skip
            end += own
    error = [mode["error_percent"] for mode in modes]
    ax.hlines(error, at - 0.42, at + 0.42, color=COLOURS["ink"], linewidth=2.2,
              label="error of the drawing")  # fmt: skip
    ax.axhline(0.0, color=SOFT, linewidth=0.9)
    ax.set_xticks(at, [str(mode["mode"]) for mode in modes])
    held = ", on the right held out" * (count < len(modes))
    ax.set_xlabel(f"mode{held}")
    ax.set_ylabel("ln(measured / drawn), %")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8.5)
    return ax


def _at(place: str) -> str:
    return "" if place == "all" else f" at {name_of(place, 16)}"


def _two_sided(ax: Axes, left: Sequence[str], right: Sequence[str]) -> None:
    """Write at both sides of rows, the first one above."""
    rows = list(range(len(left)))
    ax.set_yticks(rows, left)
    ax.set_ylim(len(rows) - 0.4, -0.6)
    other = ax.secondary_yaxis("right")
    other.set_yticks(rows, right)
    for side in (ax, other):
        side.tick_params(axis="y", length=0)
        side.spines[:].set_visible(False)


def _residual_axis(ax: Axes, dots: Sequence[ResidualDot], one_sided: bool) -> None:
    values = [abs(_near(v)) for dot in dots for v in (dot.before, dot.after) if v is not None]
    largest = 1.06 * max([1.4 * BAND, *values])
    sizes = [BAND * k for k in range(1, 5) if BAND * k <= largest]
    if largest > _PLAIN:
        ax.set_xscale("symlog", linthresh=BAND, linscale=0.7, subs=[])
        step = 1 if largest < 2e3 else 3
        sizes = [BAND, *(10.0**k for k in range(1, 13, step) if 10.0**k <= largest)]
    ticks = sizes if one_sided else [*(-size for size in reversed(sizes)), 0.0, *sizes]
    ticks = [0.0, *ticks] if one_sided else ticks
    signed = "{:g}" if one_sided else "{:+g}"
    texts = [signed.format(t).replace("-", "\N{MINUS SIGN}") if t else "0" for t in ticks]
    ax.set_xticks(ticks, texts)
    ax.set_xticks([], minor=True)
    # A whole dot inside of the axes.
    far = largest * (1.6 if largest > _PLAIN else 1.06)
    ax.set_xlim(-0.08 * BAND if one_sided else -far, far)
    ax.grid(axis="x", color=COLOURS["grid"], linewidth=0.7)
    ax.axvline(0.0, color=SOFT, linewidth=0.8)
    ax.set_axisbelow(True)


def strongest_places(diagnosis: Diagnosis | Data, indicator: str = "evidence") -> list[Spot]:
    """Return what `evidence` draws: places with their values, strongest first.

    Places of causes are numbered, and in the list of the evidence however weak they are; of
    another indicator elements and joints are kept alone where it tells them, as they say more than
    the member that holds them.

    Arguments:
        diagnosis: or its JSON as plain data.
        indicator: ``evidence``, or one of the classical indicators.

    Examples:
        >>> plot.strongest_places(found)[0].place
        'all'
    """
    data = _data(diagnosis)
    values = {
        row["place"]: min(1.0, max(0.0, row["value"] or 0.0))
        for row in data["locations"]
        if row["indicator"] == indicator
    }
    ranked = sorted(values, key=lambda place: -values[place])
    if indicator != "evidence":
        known = [Spot(place, values[place]) for place in ranked if values[place] >= _LEAST]
        joints = {joint["name"] for joint in (data.get("structure") or {}).get("joints", ())}
        fine = [spot for spot in known if "/" in spot.place or spot.place in joints]
        return fine if any("/" in spot.place for spot in known) else known
    if data["verdict"] == "none":
        return []
    causes: dict[str, list[str]] = {}
    for number, cause in enumerate(data["causes"], 1):
        if cause.get("side", "model") != "model":
            continue  # a fault of the data sits nowhere on the structure
        causes.setdefault(cause["place"], []).append(str(number))
        values.setdefault(cause["place"], 0.0)
    kept = [place for place in ranked[:_MOST_SPOTS] if values[place] >= _LEAST]
    kept += [place for place in causes if place not in kept]
    return [Spot(place, values[place], ", ".join(causes.get(place, ()))) for place in kept]


def evidence(
    diagnosis: Diagnosis | Data,
    *,
    case: Case | None = None,
    indicator: str = "evidence",
    names: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Draw the structure with the places where something is missing: the thicker, the more likely.

    A planar structure is drawn in its plane, any other one in a parallel projection from above a
    corner. Causes stand where they sit, by what they are (a ring is a spring, a square a mass, a
    cross a fault of a sensor, a coloured member is another one) and with their numbers, and are
    listed below; several that cover everything take turns along the members. Shades are the
    evidence of all explanations together, not the probability of a cause's place; a halo is
    evidence for something everywhere.

    Arguments:
        diagnosis: or its JSON as plain data, which holds the structure.
        case: what was diagnosed, for its sensors; else the extended model is drawn.
        indicator: ``evidence`` (probability of a cause at each place, 1 at the largest), or one of
            the classical indicators.
        names: whether joints, members, sensors and causes are drawn.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there is no structure, or none with an extent.

    Examples:
        >>> plot.evidence(found, case=case).get_figure().savefig("evidence.svg")
    """
    data = _data(diagnosis, case)
    structure = _structure(data.get("structure"))
    spots = strongest_places(data, indicator)
    found = causes_found(data, structure) if indicator == "evidence" else ()
    return draw_spots(own_axes(ax, (6.0, 4.6)), structure, spots, found, names=names)


def _structure(data: Data | None) -> PlacedWireframe:
    if data is None:
        raise InputError("the diagnosis holds no structure to draw")
    return read_plain(PlacedWireframe, data, key="structure")


def draw_spots(
    ax: Axes,
    structure: PlacedWireframe,
    spots: Sequence[Spot],
    findings: Sequence[Finding] = (),
    *,
    names: bool = True,
) -> Axes:
    """Draw a structure with places of different strength.

    Arguments:
        spots: strongest first.
        findings: drawn above them, and listed below the structure.
        names: whether joints, members, sensors and findings are drawn.

    Raises:
        InputError: when the structure has no extent.
    """
    from matplotlib.lines import Line2D

    view = view_of(structure)
    places = [structure.place(spot.place) for spot in spots]
    shades: list[Any] = []
    if any(place.kind != "all" for place in places):
        label = "evidence by place, of all explanations"
        shades.append(Line2D([], [], label=label, color=COLOURS["e3"], linewidth=6.0))
    if any(place.kind == "all" for place in places):
        halo = "evidence for something everywhere"
        shades.append(Line2D([], [], label=halo, color=COLOURS["halo"], linewidth=9.0))
        lines = view.flat(structure.lines)
        draw_lines(ax, lines, colors=COLOURS["halo"], linewidths=11.0, gid="everywhere-1",
                   label=f"_{halo}")  # fmt: skip
    draw_structure(ax, structure, view)
    # Weak ones first, so that strong ones lie on top.
    for number in reversed(range(len(spots))):
        _draw_spot(ax, structure, view, spots[number], places[number], number)
    room = 0.15 if names else 0.06
    frame_axes(ax, view, view.flat(structure.points), pad=room, scales=False, directions=names)
    if names:
        draw_sensors(ax, structure, view)
        names_at = draw_names(ax, structure, view)
        draw_findings(ax, structure, view, findings, names_at, shades)
    return ax


def _draw_spot(
    ax: Axes, structure: PlacedWireframe, view: View, spot: Spot, place: DrawnPlace, number: int
) -> None:
    colour, width = COLOURS[f"e{spot.level}"], 2.2 + 1.5 * spot.level
    said: dict[str, Any] = {
        "gid": f"at-{number}",
        "label": f"_{name_of(spot.place)}: {spot.value:.2f}",
    }
    lines = lines_of(structure, view, place)
    if len(lines) and place.kind != "all":
        dashed = {"linestyles": (0, (1.2, 0.8)), "capstyle": "butt"}
        more: dict[str, Any] = dashed if place.kind == "pair" else {}
        draw_lines(ax, lines, colors=colour, linewidths=width, zorder=2.5, **said, **more)
    if place.points and place.kind not in ("pair", "outline"):
        ax.plot(
            *view.flat(place.points).T, linestyle="none", marker="o",
            markersize=4.0 + 2.4 * spot.level, markerfacecolor=colour,
            markeredgecolor=PAGE, markeredgewidth=0.8, zorder=2.6, **said,
        )  # fmt: skip
