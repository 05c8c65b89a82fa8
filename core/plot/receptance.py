"""Receptances over frequency: of the measured modes, of the nominal model and of updated ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.drawing.prediction import (
    drive_sensor,
    frequency_axis,
    list_receptances,
    receptances,
)
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.plot.style import check_kind, draw_curves, name_of, own_axes
from femubench.core.update.strategy import UpdateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Updated = Model | UpdateResult


def receptance(
    case: Case,
    models: Updated | Mapping[str, Updated] | None = None,
    *,
    sensor: str | None = None,
    modification: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw displacement over force at one sensor, force at the same place, in dB re 1 m/N.

    The measured curve is that of the case's frequency responses. Where it has none there, it is
    made of the measured modes; a test of shapes without scale gives no modal masses, so that
    those of the nominal model stand in, as do its rigid-body and higher modes.

    Arguments:
        case: its measured modes and its nominal model are drawn.
        models: updated models of the case, by name.
        sensor: label of a sensor of a displacement; None for the one that sees all used modes best.
        modification: name of a known change of the structure; None for the structure as tested.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there is no such sensor or modification, or no measured shape.

    Examples:
        >>> plot.receptance(case, {scaled.name: result}).get_ylabel()
        'receptance at 9Z, dB re 1 m/N'
    """
    check_kind(case, (Case,), "receptance")
    sensors = case.measurement.sensors
    pairs = zip(sensors.labels, sensors.directions, strict=True)
    moving = [label for label, direction in pairs if "r" not in direction]
    if sensor is not None and sensor not in moving:
        expected = f"one of {', '.join(moving)}"
        raise InputError(f"there is no displacement sensor {sensor!r}", expected=expected)
    label = sensor or drive_sensor(case)
    if label is None:
        raise InputError("the case has no measured shape", expected="a sensor that sees a mode")
    names = [change.name for change in case.modifications]
    if modification is not None and modification not in names:
        expected = ", ".join(names) or "none: the case has no modifications"
        raise InputError(f"there is no modification {modification!r}", expected=expected)
    change = modification or ""
    named = models if isinstance(models, Mapping) else {} if models is None else {"updated": models}
    measured = list_receptances(case, label)["measured"].get(change)
    named_so = "measured" if case.frfs is not None and not change else "measured modes"
    known = np.asarray(measured if measured is not None else [], dtype=float)
    curves: list[tuple[str, str, Any]] = [(named_so, "measured", known)] if len(known) else []
    curves.append(("nominal model", "nominal", receptances(case, case.model, label)[change]))
    for name, item in named.items():
        check_kind(item, (Model, UpdateResult), "receptance")
        model = item.model if isinstance(item, UpdateResult) else item
        curves.append((name_of(name), "predicted", receptances(case, model, label)[change]))
    ax = own_axes(ax, (7.0, 4.0))
    hz = frequency_axis(case)
    draw_curves(ax, ((name, role, hz, levels) for name, role, levels in curves))
    ax.set(xlabel="frequency, Hz", ylabel=f"receptance at {name_of(label)}, dB re 1 m/N")
    ax.legend(fontsize=8.5, handlelength=3.6)
    return ax
