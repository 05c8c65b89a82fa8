"""Residuals of a diagnosis as dots: every mode before and after against the band of two sigmas."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from femubench.reports.cells import NOTHING
from femubench.reports.diagnosis_svg import drawing, label, line, tag
from femubench.reports.figures import figure, rms, signed

Data = Mapping[str, Any]

BAND = 2.0  # sigmas within which 19 of 20 data of pure noise lie
MOST_ROWS = 60
_PLAIN = 8.0  # up to here the axis is the same everywhere
_FARTHEST = 1e12
_WIDTH, _LEFT, _RIGHT, _ROW, _TOP, _FOOT = 380.0, 92.0, 96.0, 26.0, 26.0, 40.0


@dataclass(frozen=True)
class Row:
    """A dot before and a dot after, in standard deviations; None where nothing pairs."""

    name: str
    before: float | None
    after: float | None


def frequency_rows(data: Data) -> list[Row]:
    """Return the frequency of every mode, and the weighed mass."""
    rows = [
        Row(f"{row['mode']}: {figure(row['measured'])} Hz", row["before"], row["after"])
        for row in data["residuals"]
        if row["kind"] == "frequency"
    ]
    mass = [
        Row(f"mass {figure(row['measured'])} kg", row["before"], row["after"])
        for row in data["residuals"]
        if row["kind"] == "mass"
    ]
    return [*rows, *mass]


def shape_rows(data: Data) -> list[Row]:
    """Return the root mean square of every mode's shape over its sensors."""
    found: dict[int | None, list[Data]] = {}
    for row in data["residuals"]:
        if row["kind"] == "shape":
            found.setdefault(row["mode"], []).append(row)
    return [
        Row(f"{mode}: {len(rows)} sensors", *(_rms(rows, key) for key in ("before", "after")))
        for mode, rows in found.items()
    ]


def _rms(rows: Sequence[Data], key: str) -> float | None:
    """Return the root mean square of numbers of any size."""
    known = [min(abs(row[key]), _FARTHEST) for row in rows if row[key] is not None]
    return rms(known)


def dots(rows: Sequence[Row], *, one_sided: bool, name: str, anchor: str) -> Markup:
    """Return a drawing of rows of dots: hollow before, full after, the band of two sigmas shaded.

    Arguments:
        rows: at most `MOST_ROWS` of them are drawn.
        one_sided: whether all values are >= 0.
        name: of the drawing.
        anchor: an id of its own.
    """
    rows = rows[:MOST_ROWS]
    at, ticks = _axis(rows, one_sided)
    bottom = _TOP + _ROW * len(rows)
    left = at(0.0 if one_sided else -BAND)
    band = tag("rect", x=left, y=_TOP, width=at(BAND) - left, height=bottom - _TOP, class_="band")
    parts = [band]
    for tick in ticks:
        kind = "zero" if tick == 0.0 else "grid"
        parts += [
            line((at(tick), _TOP), (at(tick), bottom), kind),
            label(
                at(tick),
                bottom + 14.0,
                f"{tick:+g}" if tick and not one_sided else f"{tick:g}",
                "tick",
                "middle",
            ),
        ]
    middle = (_LEFT + _WIDTH - _RIGHT) / 2.0
    parts += [
        label(middle, bottom + 31.0, "standard deviations of the measurement", "axis", "middle"),
        label(_WIDTH, _TOP - 9.0, "before → after", "tick", "end"),
    ]
    for i, row in enumerate(rows):
        parts.append(_row(row, _TOP + _ROW * (i + 0.5), at, one_sided))
    said = "; ".join(f"{row.name} {_pair(row, one_sided)}" for row in rows[:12])
    return drawing(
        parts, width=_WIDTH, height=bottom + _FOOT, name=name, says=f"{said}.", anchor=anchor
    )


def _axis(rows: Sequence[Row], one_sided: bool) -> tuple[Callable[[float], float], list[float]]:
    """Return from a value to its place on the axis, and the ticks.

    Where a value is beyond 8 the axis goes on with the logarithm outside of the band, smoothly.
    """
    values = [
        min(abs(v), _FARTHEST) for row in rows for v in (row.before, row.after) if v is not None
    ]
    largest = max([1.4 * BAND, *values]) * 1.06
    bent = largest > _PLAIN

    def height(value: float) -> float:
        size = min(abs(value), largest)
        if bent and size > BAND:
            return math.copysign(1.0 + math.log(size / BAND), value)
        return math.copysign(size / BAND, value)

    start, end = _LEFT + 8.0, _WIDTH - _RIGHT - 8.0
    low, high = (0.0 if one_sided else -height(largest)), height(largest)

    def at(value: float) -> float:
        return start + (height(value) - low) / (high - low) * (end - start)

    decades = [10.0**k for k in range(1, 13, 1 if largest < 2e3 else 3) if 10.0**k <= largest]
    sizes = [BAND, *decades] if bent else [BAND * k for k in range(1, 5) if BAND * k <= largest]
    negative = [] if one_sided else [-size for size in reversed(sizes)]
    return at, [*negative, 0.0, *sizes]


def _row(row: Row, y: float, at: Callable[[float], float], one_sided: bool) -> Markup:
    parts = [tag("title", f"{row.name}: {_pair(row, one_sided)} standard deviations")]
    parts.append(tag("text", row.name, x=_LEFT - 4.0, y=y + 4.0, text_anchor="end"))
    if row.before is not None and row.after is not None:
        parts.append(line((at(row.before), y), (at(row.after), y), "way"))
    if row.before is not None:
        parts.append(tag("circle", cx=at(row.before), cy=y, r=5.0, class_="before"))
    if row.after is not None:
        x = at(row.after)
        corners = f"{x:.1f},{y - 6:.1f} {x + 6:.1f},{y:.1f} {x:.1f},{y + 6:.1f} {x - 6:.1f},{y:.1f}"
        parts.append(tag("polygon", points=corners, class_="after"))
    parts.append(
        tag("text", _pair(row, one_sided), x=_WIDTH, y=y + 4.0, text_anchor="end", class_="number")
    )
    return tag("g", *parts, class_="row")


def _pair(row: Row, one_sided: bool) -> str:
    return " → ".join(_short(value, one_sided) for value in (row.before, row.after))


def _short(value: float | None, one_sided: bool) -> str:
    if value is None:
        return NOTHING
    return figure(value, 2) if one_sided else signed(value)
