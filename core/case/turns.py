"""Axes with which the shapes of a test are like the model's, where the stated ones are not."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.faults import Remedy
from femubench.core.case.frames import site_of
from femubench.core.case.matching import Alignment, frame_text, signed_axes, size_of
from femubench.core.errors import ModelError
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.sensors import DIRECTIONS, Sensors
from femubench.core.modal.correlation import find_seen_modes, mac
from femubench.core.modal.eigen import Modes, solve_modes
from femubench.core.typing import FloatArray

_FEWEST_SENSORS, _FEWEST_MODES = 6, 3
_ALIKE, _LEFT = 0.85, 0.3  # of the mean MAC by other axes, and of what then lacks to 1
_WINDOW = 2.0  # of frequency, within which a mode may be the measured one


def propose_axes(case: Case, stated: Alignment) -> str:
    """Return what to say where other axes fit the shapes far better than the stated ones.

    The 24 turns are tried of the whole test, where its sensors lie on the structure then, and of
    the directions alone. The sign of all sensors at once is not seen: no mirrored ones are needed.

    Arguments:
        case: with a place for every sensor of the test.

    Raises:
        ModelError: when the model has no modes.
    """
    measured, site = case.measurement, site_of(case.whole or case.model)
    sensors, known = measured.sensors, {match.sensor: match for match in case.matches}
    few = len(sensors) < _FEWEST_SENSORS or len(measured) < _FEWEST_MODES
    if few or not set(sensors.labels) <= set(known):
        return ""
    modes = solve_modes(case.model, min(3 * len(measured) + 10, case.model.size)).elastic
    apart = np.abs(np.log(modes.natural_frequencies[:, None] / measured.frequencies))
    points = np.array([known[label].measured for label in sensors.labels]) - stated.origin
    before = _motions(case, modes, np.array([known[label].xyz for label in sensors.labels]))
    size = size_of(site.points)
    corners = np.array([site.points.min(axis=0), site.points.max(axis=0)])
    tried = []
    for turn in list(signed_axes())[:24]:
        turned, ways = points @ turn.T + stated.origin, {"directions": before}
        limit = max(stated.tolerance * size, ON_MEMBER)
        if np.abs(turned - turned.clip(*corners)).max() <= limit:
            feet = np.array([foot for _, foot in site.nearest(turned)])
            if np.linalg.norm(feet - turned, axis=1).max() <= limit:
                ways["frame"] = _motions(case, modes, feet)  # axes
        for key, moved in ways.items():
            readings = np.einsum("sd,dsm->sm", sensors.axes @ np.kron(np.eye(2), turn).T, moved)
            readings = np.where(find_seen_modes(readings), readings, 0.0)
            alike = np.where(apart < np.log(_WINDOW), mac(readings, measured.shapes), 0.0)
            own = stated.directions if key == "directions" else stated.turn
            text = frame_text(turn @ (stated.turn if own is None else own))
            tried.append((round(float(alike.max(axis=0).mean()), 3), np.trace(turn), key, text))
    now = max(likeness for likeness, trace, *_ in tried if trace == 3.0)
    best, _, key, text = max(tried)
    if best < _ALIKE or 1.0 - best >= _LEFT * (1.0 - now):
        return ""
    return f"shapes are like the model's with {Remedy({key: text})}: mean MAC {best:g}, not {now:g}"


def _motions(case: Case, modes: Modes, places: FloatArray) -> FloatArray:
    """Return how the places of all sensors move along and about the axes, (6, n_sensors, m)."""
    found = np.zeros((6, len(places), len(modes.eigenvalues)))
    for k, direction in enumerate(DIRECTIONS):
        with suppress(ModelError):  # it is not there
            own = Sensors(case.measurement.sensors.labels, places, (direction,) * len(places))
            found[k] = case.model.observe(own) @ modes.shapes
    return found
