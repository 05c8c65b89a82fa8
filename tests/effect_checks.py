"""What any effect must keep: the fast path through its `change` agrees with its `extend`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femubench import Model, Sensors, solve_modes
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.change.tabulated import change_of
from femubench.core.fem.frame import ACTIVE
from femubench.core.fem.model import Dofs
from femubench.core.modal.eigen import solve_dense
from femubench.core.roles import Effect
from femubench.effect import Change, once_for
from femubench.fem import FloatArray


@dataclass(frozen=True)
class Agreement:
    """Largest differences of the lowest elastic modes between `change` and `extend`.

    Arguments:
        frequency: relative.
        reading: of mass-normalised shapes at all joints, in the largest reading of the mode.
        effect: largest relative change of a frequency that the effect makes; tells that a small
            difference means something.
    """

    frequency: float
    reading: float
    effect: float


def changed_matrices(
    model: Model, change: Change, values: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """Return mass and stiffness with a change added, dense, (n + extra, n + extra) each."""
    size = model.size + change.extra
    matrices = {"mass": np.zeros((size, size)), "stiffness": np.zeros((size, size))}
    matrices["mass"][: model.size, : model.size] = model.mass.toarray()
    matrices["stiffness"][: model.size, : model.size] = model.stiffness.toarray()
    factors = change.coefficients(np.array([values, values], dtype=float))
    assert factors.shape == (2, len(change.terms))
    assert (factors[0] == factors[1]).all()
    unit = np.eye(size)
    for factor, term in zip(factors[0], change.terms, strict=True):
        applied = term.operator.apply(unit)
        scale = np.abs(applied).max(initial=1e-300)
        assert np.abs(applied - term.operator.project(unit)).max(initial=0.0) <= 1e-12 * scale
        matrices[term.matrix] += factor * applied
    return matrices["mass"], matrices["stiffness"]


def as_matrices(model: Model) -> Model:
    """Return the model as it would come from files, without its frame."""
    joints = len(model.frame_structure.frame.joints)
    names = tuple(f"n{i}" for i in range(int(model.dofs.node.max()) + 1))
    assert joints <= len(names)
    dofs = Dofs(model.dofs.node, model.dofs.direction, model.dofs.xyz)
    return Model(model.mass, model.stiffness, dofs, MatrixGeometry(names, dofs))


def joint_sensors(model: Model) -> Sensors:
    """Return sensors in every translation of the plane at every joint."""
    frame = model.frame_structure.frame
    rows = [(j, d) for j in frame.joints for d in ACTIVE[frame.plane] if d in ("x", "y", "z")]
    return Sensors(
        tuple(f"{joint.name}{direction}" for joint, direction in rows),
        np.array([joint.xyz for joint, _ in rows]),
        tuple(direction for _, direction in rows),
    )


def compare(
    effect: Effect, model: Model, place: str, values: Sequence[float], count: int = 10
) -> Agreement:
    """Return how well the two ways through an effect agree on the lowest elastic modes."""
    nominal = once_for(model, "elastic modes", lambda: solve_modes(model).elastic)
    floor = 1e-4 * nominal.eigenvalues[0]
    sensors = joint_sensors(model)
    change = change_of(effect, model, place)
    eigenvalues, shapes = solve_dense(*changed_matrices(model, change, values))
    elastic = np.abs(eigenvalues) > floor
    eigenvalues, shapes = eigenvalues[elastic][:count], shapes[:, elastic][:, :count]
    extended = effect.extend(model, place, values)
    other = solve_modes(extended)
    elastic = np.abs(other.eigenvalues) > floor
    reference = other.eigenvalues[elastic][:count]
    mine = model.observe(sensors) @ shapes[: model.size]
    theirs = extended.observe(sensors) @ other.shapes[:, elastic][:, :count]
    theirs = theirs * np.sign(np.sum(mine * theirs, axis=0))
    count = min(count, len(nominal))
    return Agreement(
        float(np.abs(np.sqrt(np.abs(eigenvalues / reference)) - 1.0).max()),
        float((np.abs(mine - theirs).max(axis=0) / np.abs(theirs).max(axis=0)).max()),
        float(np.abs(np.sqrt(np.abs(reference[:count] / nominal.eigenvalues[:count])) - 1.0).max()),
    )


def check_exact(
    effect: Effect, model: Model, place: str, values: Sequence[float], tolerance: float = 1e-9
) -> None:
    """Check that `change` is `extend`, for effects whose terms are exact."""
    found = compare(effect, model, place, values)
    assert found.frequency < tolerance, (place, values, found)
    assert found.reading < 1e4 * tolerance, (place, values, found)


def check_neutral(effect: Effect, model: Model, place: str) -> None:
    """Check that both ways leave the model as it is at the neutral values."""
    neutral = [p.neutral for p in effect.parameters(model, place)]
    mass, stiffness = changed_matrices(model, change_of(effect, model, place), neutral)
    extended = effect.extend(model, place, neutral)
    for own, changed, rebuilt in (
        (model.mass, mass, extended.mass),
        (model.stiffness, stiffness, extended.stiffness),
    ):
        own = own.toarray()
        roundoff = 1e-12 * np.abs(own).max()
        np.testing.assert_allclose(changed, own, rtol=0, atol=roundoff)
        np.testing.assert_allclose(rebuilt.toarray(), own, rtol=0, atol=roundoff)
