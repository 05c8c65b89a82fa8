"""Identified modes as a table for the screen, and as one HTML page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from femubench import Identification, __version__
from femubench.plot import mode_shape, stabilisation, svg, synthesis
from femubench.reports.blocks import Cell, Column, Drawing, Items, Passage, Row, Table
from femubench.reports.cells import estimate, figure
from femubench.reports.terminal import to_terminal

_COLUMNS = (
    *(Column(head, 13) for head in ("mode", "frequency, Hz", "sd, Hz", "damping, %", "sd, %")),
    *(Column("MPC", 6, digits=4), Column("MPD, deg", 8, digits=2)),
)
_SHOWN = 4  # channels drawn, those that fit worst
_FEW, _MOST_SHAPES = 3, 12  # sensors that make a shape; shapes that are drawn
_OVERVIEW, _SMALL = (8.6, 4.2), (4.0, 2.8)  # inch


def identification_text(found: Identification) -> str:
    """Return the modes as plain text of 80 columns at most."""
    return to_terminal([Passage("", [_heading(found), *filter(None, [found.said]), _modes(found)])])


def identification_html(found: Identification, source: str = "") -> str:
    """Return a page on an identification that needs nothing but itself.

    Arguments:
        source: name of the file that it comes from.
    """
    from femubench.reports.html import to_html

    brand, heading = f"Identification of {source}" if source else "Identification", _heading(found)
    foot = f"femubench {__version__}. The numbers are those of modes.csv."
    return to_html(
        _sections(found),
        title=f"{brand}: {heading}",
        heading=heading,
        brand=brand,
        foot=foot,
        scripts=("figures.js",),
    )


def _heading(found: Identification) -> str:
    count = len(found)
    low, high = (figure(hz, 6) for hz in found.band)
    return f"{count} mode{'' if count == 1 else 's'} from {low} to {high} Hz"


def _modes(found: Identification) -> Table:
    columns = zip(
        *(found.frequencies, found.frequency_std, 100.0 * found.damping, 100.0 * found.damping_std),
        *(found.collinearity, found.phase_deviation),
        strict=True,
    )
    rows: list[list[Cell]] = [
        [str(k), *_pair(hz, hz_std), *_pair(ratio, ratio_std), float(mpc), float(mpd)]
        for k, (hz, hz_std, ratio, ratio_std, mpc, mpd) in enumerate(columns, 1)
    ]
    return Table(_COLUMNS, rows)


def _pair(value: float, std: float) -> tuple[str, str]:
    """Return a value and its standard deviation to the same digit."""
    text, _, spread = estimate(float(value), float(std)).partition(" ± ")
    return text, spread or figure(float(std), 2)


def _sections(found: Identification) -> Iterator[Passage]:
    said = (
        "Standard deviations are those of the fit to these data. MPC is 1 and MPD 0 for a real "
        "shape."
    )
    yield Passage("Modes", [said, _modes(found)])
    said = (
        "Every dot is a pole of a model of that size; filled dots lie at a mode, open ones at "
        "none. Vertical lines are the modes, the grey curve is what was measured."
    )
    title = "Poles over model orders"
    drawn = _drawing(found, "stabilisation", title, stabilisation, _OVERVIEW)
    yield Passage(title, [said, Row([drawn])])
    if shapes := list(_shapes(found)):
        said = "Real parts at the sensors, the largest of each mode drawn alike."
        yield Passage("Mode shapes", [said, Row(shapes)])
    if found.measured is not None:
        channels, title = int(_seen(found).sum()), "Synthesised over measured, all channels"
        said = f"Root mean square over {channels} channels, each at a level of one."
        drawn = _drawing(found, "synthesis", title, synthesis, _OVERVIEW)
        yield Passage(title, [said, Row([drawn])])
        worst = list(_worst(found))
        said = f"Of {channels} channels, by the share of the response that the modes leave."
        if worst:
            yield Passage("Channels that fit worst", [said, Row(worst)])
    yield Passage("How it was done", [Items(list(_facts(found)), look="parameters")])


def _facts(found: Identification) -> Iterator[tuple[str, str]]:
    """Yield what was measured and what was asked for."""
    yield "band", f"{figure(found.band[0], 6)} to {figure(found.band[1], 6)} Hz"
    if found.said:
        yield "records", found.said
    method = "stochastic subspaces, by pyOMA-2"
    if data := found.measured:
        lines, responses, forces = data.values.shape
        yield "measured", f"{data.quantity}, {responses} responses to {forces} forces"
        yield "lines", f"{lines}, {figure(float(np.diff(data.frequencies).mean()), 4)} Hz apart"
        method = "poly-reference LSCF, then a least-squares fit of all modes together"
    yield "method", method
    orders = found.poles.orders
    yield "models", f"{int(orders.min())} to {int(orders.max())} poles"
    yield "chance", "none: no seed, the same file gives the same modes"


def _seen(found: Identification) -> Any:  # noqa: ANN401 - a bool array
    assert found.measured is not None
    return np.isfinite(found.measured.values[0])


def _shapes(found: Identification) -> Iterator[Drawing]:
    """Yield the first shapes, where the sensors have places that are apart."""
    if len(found.sensors) < _FEW or not np.ptp(found.sensors.xyz, axis=0).max() > 0.0:
        return
    for mode in range(1, min(len(found), _MOST_SHAPES) + 1):
        title = f"{mode}: {figure(found.frequencies[mode - 1], 5)} Hz"
        yield _drawing(
            found, f"shape-{mode}", title, partial(mode_shape, mode=mode, scale=1.6), _SMALL
        )


def _worst(found: Identification) -> Iterator[Drawing]:
    """Yield the channels that fit worst, with the share of each that is left."""
    assert found.measured is not None
    assert found.synthesised is not None
    measured = found.measured.values
    left = np.sqrt(np.square(np.abs(measured - found.synthesised)).mean(axis=0))
    size = np.sqrt(np.square(np.abs(measured)).mean(axis=0))
    share = np.divide(left, size, out=np.zeros_like(left), where=size > 0.0)
    share = np.where(_seen(found), share, 0.0)
    sensors = found.measured.responses.labels, found.measured.references.labels
    for number, place in enumerate(np.argsort(-share, axis=None)[:_SHOWN]):
        response, force = map(int, np.unravel_index(place, share.shape))
        channel = response, force
        if share[channel] > 0.0:
            names = " to ".join(labels[k] for labels, k in zip(sensors, channel, strict=True))
            title = f"{names}: {100.0 * share[channel]:.2g} % left"
            draw = partial(synthesis, channel=channel)
            yield _drawing(found, f"channel-{number}", title, draw, _SMALL)


def _drawing(
    found: Identification,
    name: str,
    title: str,
    draw: Callable[..., object],
    size: tuple[float, float],
) -> Drawing:
    from markupsafe import Markup

    listed = ", ".join(figure(hz, 5) for hz in found.frequencies[:30])
    said = f"{title}. Modes at {listed} Hz."
    text = svg(partial(draw, found), name=name, title=title, caption=said, size=size, themed=True)
    return Drawing(title if size is _SMALL else "", "", Markup(text))
