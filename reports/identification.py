"""Identified modes as a table for the screen, and as one HTML page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from femubench import Identification, __version__
from femubench.plot import stabilisation, svg, synthesis
from femubench.reports.blocks import Column, Section, Table, to_terminal
from femubench.reports.figures import estimate, figure
from femubench.reports.templating import asset, templates

HEADS = ("mode", "frequency, Hz", "sd, Hz", "damping, %", "sd, %", "MPC", "MPD, deg")
_SHOWN = 4  # channels drawn, those that fit worst
_OVERVIEW, _SMALL = (8.6, 4.2), (4.0, 2.8)  # inch


def identification_rows(found: Identification) -> list[list[str]]:
    """Return the cells of the table of modes, a row a mode, under `HEADS`."""
    columns = zip(
        found.frequencies,
        found.frequency_std,
        100.0 * found.damping,
        100.0 * found.damping_std,
        found.collinearity,
        found.phase_deviation,
        strict=True,
    )
    rows = []
    for k, (hz, hz_std, ratio, ratio_std, mpc, mpd) in enumerate(columns):
        value, std = _pair(hz, hz_std)
        share, share_std = _pair(ratio, ratio_std)
        rows.append([str(k + 1), value, std, share, share_std, f"{mpc:.4f}", f"{mpd:.2f}"])
    return rows


def _pair(value: float, std: float) -> tuple[str, str]:
    """Return a value and its standard deviation to the same digit."""
    text, _, spread = estimate(float(value), float(std)).partition(" ± ")
    return text, spread or figure(float(std), 2)


def identification_text(found: Identification) -> str:
    """Return the modes as plain text of 80 columns at most."""
    widths = (4, 13, 9, 10, 8, 6, 8)
    columns = [Column(head, width) for head, width in zip(HEADS, widths, strict=True)]
    return to_terminal([Section("", [Table(columns, identification_rows(found), _heading(found))])])


def identification_html(found: Identification, source: str = "") -> str:
    """Return a page on an identification that needs nothing but itself.

    Arguments:
        found: what was identified.
        source: name of the file that it comes from.
    """
    drawings = [
        _drawing(found, "stabilisation", "Poles over model orders", stabilisation, _OVERVIEW)
    ]
    worst: list[dict[str, Any]] = []
    if found.measured is not None:
        draw = synthesis
        title = "Synthesised over measured, all channels"
        drawings.append(_drawing(found, "synthesis", title, draw, _OVERVIEW))
        for number, (channel, share) in enumerate(_worst(found)):
            pair = found.measured.responses, found.measured.references
            names = [sensors.labels[k] for sensors, k in zip(pair, channel, strict=True)]
            title = f"{names[0]} to {names[1]}: {100.0 * share:.2g} % left"
            draw_one = partial(synthesis, channel=channel)
            worst.append(_drawing(found, f"channel-{number}", title, draw_one, _SMALL))
    return (
        templates()
        .get_template("identification.html")
        .render(
            heading=_heading(found),
            source=source,
            facts=_facts(found),
            heads=HEADS,
            rows=identification_rows(found),
            drawings=drawings,
            worst=worst,
            channels=0 if found.measured is None else _seen(found).sum(),
            version=__version__,
            style=Markup(asset("page.css") + asset("diagnosis.css")),
        )
    )


def _heading(found: Identification) -> str:
    low, high = (figure(hz, 6) for hz in found.band)
    count = len(found)
    return f"{count} mode{'' if count == 1 else 's'} from {low} to {high} Hz"


def _facts(found: Identification) -> Sequence[tuple[str, str]]:
    """Return what was measured and what was asked for."""
    facts = [("band", f"{figure(found.band[0], 6)} to {figure(found.band[1], 6)} Hz")]
    if found.measured is None:
        facts.append(("method", "stochastic subspaces, by pyOMA-2"))
    else:
        data = found.measured
        shape = data.values.shape
        facts += [
            ("measured", f"{data.quantity}, {shape[1]} responses to {shape[2]} forces"),
            ("lines", f"{shape[0]}, {figure(float(np.diff(data.frequencies).mean()), 4)} Hz apart"),
            ("method", "poly-reference LSCF, then a least-squares fit of all modes together"),
        ]
    orders = found.poles.orders
    facts.append(("models", f"{int(orders.min())} to {int(orders.max())} poles"))
    return [*facts, ("chance", "none: no seed, the same file gives the same modes")]


def _seen(found: Identification) -> Any:  # noqa: ANN401 - a bool array
    assert found.measured is not None
    return np.isfinite(found.measured.values[0])


def _worst(found: Identification) -> list[tuple[tuple[int, int], float]]:
    """Return the channels that fit worst, and the share of each that is left."""
    assert found.measured is not None
    assert found.synthesised is not None
    measured = found.measured.values
    left = np.sqrt(np.square(np.abs(measured - found.synthesised)).mean(axis=0))
    size = np.sqrt(np.square(np.abs(measured)).mean(axis=0))
    share = np.divide(left, size, out=np.zeros_like(left), where=size > 0.0)
    share = np.where(_seen(found), share, 0.0)
    order = np.argsort(-share, axis=None)[:_SHOWN]
    places = [np.unravel_index(k, share.shape) for k in order]
    return [((int(o), int(i)), float(share[o, i])) for o, i in places if share[o, i] > 0.0]


def _drawing(
    found: Identification,
    name: str,
    title: str,
    draw: Callable[..., object],
    size: tuple[float, float],
) -> dict[str, Any]:
    listed = ", ".join(figure(hz, 5) for hz in found.frequencies[:30])
    said = f"{title}. Modes at {listed} Hz."
    text = svg(partial(draw, found), name=name, title=title, caption=said, size=size, themed=True)
    return {"title": title, "svg": Markup(text)}
