"""A structure with a mass at one of many points, or held there: natural frequencies of all at once.

A change at a point moves the modes within the lowest ones and the static response of the higher
ones to a force there, so that every point costs an eigensolution of a few dozen unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from femubench.core.advise.prediction import Outlook, Points, Predicted
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.fem.alteration import Alteration
from femubench.core.fem.frame import GroundSpring, Place, Support
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.fit.modal_fit import signed_hz
from femubench.core.inference.settings import settings
from femubench.core.typing import FloatArray


def points_of(model: Model) -> Points:
    """Return joints and the middles of members, at most 48 spread over the model."""
    chosen = _chosen(model)
    chosen = chosen[:: -(-len(chosen) // settings.points)] if chosen else chosen
    pairs = [(label, ModelPlaces(model).free(ModelPlaces(model).point(label))) for label in chosen]
    moving = [(label, free) for label, free in pairs if free]
    return Points(tuple(label for label, _ in moving), tuple(free for _, free in moving))


def list_supports(model: Model, sensors: Sensors) -> Iterator[tuple[str, Alteration, float]]:
    """Yield ways to hold a structure otherwise, in words, and what share of the change is unsure.

    Its supports are taken away one at a time; one that hangs free is held at points near sensors.
    Of matrices, supports are the groups that are said to be some: what is held has no rows there.
    """
    frame, free = model.structure and model.structure.frame, model.free
    if frame:
        parts: tuple[Support | GroundSpring, ...] = (*frame.supports, *frame.springs)
        free = not parts
        for at in dict.fromkeys(part.at for part in parts if part.at.joint):  # no soil along piles
            own = tuple(part for part in parts if part.at == at)
            away = "take away the support" if len(own) < len(parts) else "hang it free, not held"
            yield f"{away} at {at}", Alteration(removed=own), 0.0
    elif model.dofs.internal.any():
        return  # reduced, without the shapes of a structure that is held otherwise
    for name in (name for name, kind in model.group_kinds.items() if kind == "support"):
        yield f"take away the support at group:{name}", Alteration(groups=(name,)), 0.0
    nodes = {at: xyz for at, xyz in ModelPlaces(model).nodes.items() if np.isfinite(xyz).all()}
    if free and nodes:
        gap = np.linalg.norm(sensors.xyz[:, None] - list(nodes.values()), axis=2)
        for i in dict.fromkeys(gap.argmin(axis=1).tolist()):
            place = Place(list(nodes)[i])
            fixed = ModelPlaces(model).free(place)
            held = Alteration((Support(place, fixed),))
            yield f"hold {place} in {', '.join(fixed)}", held, settings.idealisation_error


def _chosen(model: Model) -> list[str]:
    """Return joints, and of every member the point nearest to its middle."""
    places = ModelPlaces(model).points()
    if model.structure is None:
        return list(places)
    joints = model.structure.frame.joint_index
    middle: dict[str, tuple[float, str]] = {}
    for place in places:
        if place not in joints:
            member, _, station = place.rpartition("@")
            middle[member] = min((abs(float(station) - 0.5), place), middle.get(member, (1.0, "")))
    return [*(p for p in places if p in joints), *(place for _, place in middle.values())]


def _ritz(values: FloatArray, rows: FloatArray, low: int) -> FloatArray:
    """Return orthonormal vectors that carry the change at every point, (n_points, N, r).

    Arguments:
        values: all eigenvalues, (N,).
        rows: displacements of the points from modes, (n_points, p, N).
        low: number of lowest modes to keep.
    """
    count, _, size = rows.shape
    more = min(rows.shape[1], size - low)
    basis = np.zeros((count, size, low + more))
    basis[:, range(low), range(low)] = 1.0
    if more:
        response = np.swapaxes(rows[:, :, low:] / values[low:], 1, 2)
        basis[:, low:, low:] = np.linalg.qr(response)[0]
    return basis


def _low(outlook: Outlook) -> int:
    state = outlook.state
    return min(len(state.eigenvalues), int(state.partner.max()) + 1 + settings.spare_modes)


def predict_loaded_frequencies(outlook: Outlook, points: Points, mass: float) -> list[Predicted]:
    """Return the frequencies of the measured modes with a mass at each of the points, in Hz.

    Arguments:
        mass: in kg; it acts in all directions of the plane.
    """
    values, tracked = outlook.state.eigenvalues, np.sort(outlook.state.partner)
    counts = points.counts
    seen = np.zeros((len(counts), max(counts), len(values)))
    seen[np.arange(max(counts)) < np.array(counts)[:, None]] = outlook.seen
    basis = _ritz(values, seen, _low(outlook))
    across = np.swapaxes(basis, 1, 2)
    inner = across @ (values[:, None] * basis)
    near = seen @ basis
    heavy = np.eye(basis.shape[2]) + mass * (np.swapaxes(near, 1, 2) @ near)
    back = np.swapaxes(np.linalg.inv(np.linalg.cholesky(heavy)), 1, 2)
    eigenvalues, vectors = np.linalg.eigh(np.swapaxes(back, 1, 2) @ inner @ back)
    vectors = basis @ (back @ vectors[:, :, tracked])
    frequencies, spread = outlook.hertz(eigenvalues[:, tracked], vectors)
    return [Predicted(f, s) for f, s in zip(frequencies, spread, strict=True)]


def antiresonances(outlook: Outlook) -> list[Predicted]:
    """Return the antiresonances of the point receptance at every point and direction, in Hz.

    They are the natural frequencies of the structure held there (Wahl, Schmidt & Forrai 1999);
    those that a resonance hides are left out. In the order of `Points.sensors`.
    """
    values = outlook.state.eigenvalues
    seen, low = outlook.seen[:, None, :], _low(outlook)
    basis = _ritz(values, seen, low)
    # All but the first column are orthogonal to what the point sees.
    still = np.linalg.qr(np.swapaxes(seen @ basis, 1, 2), mode="complete")[0][:, :, 1:]
    basis = basis @ still
    inner = np.swapaxes(basis, 1, 2) @ (values[:, None] * basis)
    eigenvalues, vectors = np.linalg.eigh(inner)
    kept = min(low - 1, eigenvalues.shape[1])
    frequencies, spread = outlook.hertz(eigenvalues[:, :kept], basis @ vectors[:, :, :kept])
    poles, zero = signed_hz(values), outlook.zero
    gap = np.abs(frequencies[..., None] - poles).min(axis=-1)
    hidden = settings.notable_deviations * settings.reachable_antiresonance_std
    shown = (frequencies > zero) & (gap > hidden * frequencies)
    return [Predicted(f[i], s[i]) for f, s, i in zip(frequencies, spread, shown, strict=True)]


def nearest(first: float, second: Predicted, within: Sequence[float]) -> Predicted | None:
    """Return the value of `second` nearest to that of `first`, None where none is in reach.

    Arguments:
        within: lowest and highest ratio of the two.
    """
    if not len(second.values):
        return None
    i = int(np.abs(second.values - first).argmin())
    low, high = within
    return second.take([i]) if low * first <= second.values[i] <= high * first else None
