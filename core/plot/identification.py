"""What an identification rests on: poles over orders, synthesised responses, shapes at sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.drawing.wireframe import DrawnSensor, Wireframe, to_point
from femubench.core.errors import InputError
from femubench.core.identify.identification import Identification
from femubench.core.plot.structure import frame_axes, view_of
from femubench.core.plot.style import (
    AFTER,
    BEFORE,
    COLOURS,
    INK,
    MEMBER,
    SOFT,
    check_kind,
    own_axes,
)
from femubench.core.typing import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_UNITS = {
    "receptance": "m/N",
    "mobility": "m/(s N)",
    "accelerance": "m/(s² N)",
    "free decay": "one",
}
_CURVES: tuple[tuple[str, str, float, Any], ...] = (
    ("measured", INK, 2.2, "-"),
    ("synthesised", BEFORE, 1.6, (0, (5, 2))),
    ("difference", AFTER, 0.8, (0, (1, 1.6))),
)
_NEAR = 0.01  # relative distance of a pole to the mode that it stands for
_MOST_DAMPING = 0.2
_MOST_POINTS = 1500  # of a curve


def stabilisation(found: Identification, *, ax: Axes | None = None) -> Axes:
    """Draw the poles of all model orders over frequency, on what was measured.

    Filled dots lie at an identified mode, open ones at none; lines are the modes.

    Arguments:
        found: modes and all poles.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: for anything else.

    Examples:
        >>> plot.stabilisation(identified).get_ylabel()
        'poles of the model'
    """
    check_kind(found, (Identification,), "poles")
    ax = own_axes(ax, (8.4, 4.2))
    _background(found, ax)
    poles = found.poles
    hz, low, high = poles.frequencies, *found.band
    keep = (poles.damping > 0.0) & (poles.damping < _MOST_DAMPING) & (hz >= low) & (hz <= high)
    own = 2.0 * np.pi * found.frequencies
    modes = own * (-found.damping + 1j * np.sqrt(1.0 - np.square(found.damping)))
    apart = np.abs(found.poles.values[:, None] - modes) / np.abs(modes)
    near = np.asarray(apart.min(axis=1, initial=np.inf) < _NEAR)
    for at_mode in (False, True):
        some = keep & (near == at_mode)
        ax.scatter(
            hz[some],
            poles.orders[some],
            s=11.0 if at_mode else 7.0,
            linewidths=0.7,
            facecolors=AFTER if at_mode else "none",
            edgecolors=AFTER if at_mode else SOFT,
            label="at a mode" if at_mode else "at no mode",
        )
    for frequency in found.frequencies:
        ax.axvline(frequency, color=BEFORE, linewidth=0.7, zorder=0.5)
    ax.set(xlim=found.band, xlabel="frequency, Hz", ylabel="poles of the model")
    ax.legend(fontsize=8.5, loc="upper left", bbox_to_anchor=(0.0, 1.13), ncols=2, frameon=False)
    return ax


def _background(found: Identification, ax: Axes) -> None:
    """Draw the level of what was measured, on a scale of its own."""
    if found.measured is not None:
        hz, values = found.measured.frequencies, found.measured.values
        # The mean over all channels, each at a level of one.
        power = np.square(np.abs(values)).reshape(len(values), -1)
        power = power[:, np.isfinite(power).all(axis=0)]
        mean = power.mean(axis=0)
        levels = _decibels(np.sqrt((power[:, mean > 0.0] / mean[mean > 0.0]).mean(axis=1)))
    elif found.spectrum is not None:
        hz, levels = found.spectrum.T
    else:
        return
    behind = ax.twinx()
    behind.plot(*_thinned(hz, levels), color=MEMBER, linewidth=0.8)
    behind.set_axis_off()
    ax.set_zorder(behind.get_zorder() + 1)
    ax.patch.set_visible(False)


def _decibels(values: FloatArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(values), np.finfo(float).tiny)))


def _thinned(hz: FloatArray, levels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve with as many points as one can see, peaks kept."""
    block = -(-len(hz) // _MOST_POINTS)
    if block < 2:
        return hz, levels
    starts = np.arange(0, len(hz), block)
    best = [int(a + np.argmax(levels[a : a + block])) for a in starts]
    return hz[best], levels[best]


def draw_identified(found: Identification, mode: int, reach: float, ax: Axes | None) -> Axes:
    """Draw the real parts of an identified shape as arrows at its sensors.

    Arguments:
        mode: its number, from 1.
        reach: of the largest arrow, in the longest side of the structure.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: where there is no such mode, or the sensors have no extent.
    """
    if not 1 <= mode <= len(found):
        raise InputError(f"there is no mode {mode}", expected=f"1 to {len(found)}")
    moves = np.array(["r" not in name for name in found.sensors.directions], dtype=bool)
    xyz, places = np.unique(found.sensors.xyz[moves], axis=0, return_inverse=True)
    motion = np.zeros_like(xyz)
    readings = np.nan_to_num(np.real(found.shapes[moves, mode - 1]))
    np.add.at(motion, places.ravel(), readings[:, None] * found.sensors.axes[moves, :3])
    sensors = tuple(DrawnSensor(str(k), to_point(at)) for k, at in enumerate(xyz))
    wireframe = Wireframe("matrices", (), (), sensors)
    view = view_of(wireframe, oblique=True)
    ax = own_axes(ax, (4.0, 3.2))
    largest = float(np.linalg.norm(motion, axis=1).max()) or 1.0
    arrows = reach * float(np.ptp(xyz, axis=0).max()) / largest * motion
    starts, ways = view.flat(xyz), view.flat(arrows)
    ax.plot(*starts.T, linestyle="none", marker="o", markersize=2.5, color=MEMBER)
    ax.quiver(
        *starts.T, *ways.T, angles="xy", scale_units="xy", scale=1.0, width=0.006, headwidth=4.0,
        color=AFTER, zorder=3,
    )  # fmt: skip
    frame_axes(ax, view, np.vstack([starts, starts + ways]), pad=0.06, scales=False)
    return ax


def synthesis(
    found: Identification, channel: tuple[int, int] | None = None, *, ax: Axes | None = None
) -> Axes:
    """Draw the responses of the fit over the measured ones, in dB.

    Arguments:
        found: identified from frequency responses.
        channel: positions of response and force; None for the mean over all channels, each at a
            level of one.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when no frequency responses were measured, or there is no such channel.

    Examples:
        >>> plot.synthesis(identified, (0, 0)).get_ylabel()
        'receptance, dB re 1 m/N'
    """
    check_kind(found, (Identification,), "responses")
    if found.measured is None or found.synthesised is None:
        raise InputError("nothing to draw", expected="an identification from frequency responses")
    measured, model = found.measured.values, found.synthesised
    drawn = measured, model, measured - model
    if channel is None:
        power = np.square(np.abs(measured)).mean(axis=0)
        seen = np.isfinite(power) & (power > 0.0)
        scale = np.sqrt(power[seen])
        label = "mean of all channels, dB"
        levels = [
            _decibels(np.sqrt(np.square(np.abs(v[:, seen] / scale)).mean(axis=1))) for v in drawn
        ]
    else:
        o, i = channel
        shape = measured.shape[1:]
        if not (0 <= o < shape[0] and 0 <= i < shape[1]) or not np.isfinite(measured[0, o, i]):
            raise InputError(f"no channel {channel}", expected=f"one of {shape[0]} x {shape[1]}")
        label = f"{found.measured.quantity}, dB re 1 {_UNITS[found.measured.quantity]}"
        levels = [_decibels(v[:, o, i]) for v in drawn]
    ax = own_axes(ax, (7.0, 3.6))
    hz = found.measured.frequencies
    for (name, colour, width, dashes), values in zip(_CURVES, levels, strict=True):
        x, y = _thinned(hz, values)
        ax.plot(x, y, color=colour, linewidth=width, linestyle=dashes, label=name)
    ax.grid(color=COLOURS["grid"], linewidth=0.6)
    ax.set(xlim=found.band, xlabel="frequency, Hz", ylabel=label)
    ax.legend(fontsize=8.5, loc="upper left", bbox_to_anchor=(0.0, 1.15), ncols=3, frameon=False)
    return ax
