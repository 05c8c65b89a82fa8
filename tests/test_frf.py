"""Receptances against the inverse of the dynamic stiffness, and in their limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Place, Support
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.frf import receptance

FrameBuilder = Callable[..., Frame]
POINTS = Sensors(
    ("B", "E", "mid", "F"),
    np.array(
        [[0.2921, 0.0, 0.0], [0.2921, 0.2794, 0.0], [0.2921, 0.12, 0.0], [0.5842, 0.2794, 0.0]]
    ),
    ("z", "-z", "rx", "ry"),
)
FREQUENCIES = np.array([20.0, 150.0, 255.0, 400.0, 580.0, 1000.0, 3000.0])


@pytest.mark.parametrize(("held", "damping"), [(True, 0.0), (False, "each")])
def test_receptance_is_the_inverse_dynamic_stiffness(
    ladder: FrameBuilder, held: bool, damping: float | str
) -> None:
    frame = ladder("timoshenko", polar=False)
    if held:
        frame = replace(frame, supports=(Support(Place(joint="A"), ("z", "rx", "ry")),))
    model = Model.of(frame)
    modes = solve_modes(model)
    ratio = np.linspace(0.002, 0.05, len(modes)) if damping == "each" else damping
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    omega_r = np.sqrt(np.maximum(modes.eigenvalues, 0.0))
    weighted = mass @ modes.shapes
    viscous = weighted @ np.diag(2.0 * ratio * omega_r * np.ones(len(modes))) @ weighted.T
    rows = model.observe(POINTS)
    found = receptance(modes, rows, rows[:2], FREQUENCIES, ratio)
    assert found.shape == (7, 4, 2)
    for f, frequency in enumerate(FREQUENCIES):
        w = 2 * np.pi * frequency
        dynamic = stiffness - w**2 * mass + 1j * w * viscous
        expected = rows @ np.linalg.solve(dynamic, rows[:2].toarray().T)
        np.testing.assert_allclose(
            found[f], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
        )


def test_a_free_structure_tends_to_a_rigid_body(ladder: FrameBuilder) -> None:
    model = Model.of(ladder(accelerometer=False))
    modes = solve_modes(model)
    mass = float(np.sum(np.square(modes.shapes[:, :3].T @ model.mass @ up(model))))
    w = 2 * np.pi * 0.05
    corners = Sensors(
        tuple("ACDF"), np.array([j.xyz for j in model.frame_structure.frame.joints])[[0, 2, 3, 5]],
        ("z",) * 4,
    )  # fmt: skip
    # Equal forces at the four corners of a symmetric frame act at its centre of mass.
    rows = model.observe(corners)
    found = receptance(modes, rows, rows, np.array([0.05]), 0.01)[0].sum(axis=1) / 4
    np.testing.assert_allclose(found, -1.0 / (w**2 * mass), rtol=1e-5)
    length = 4 * 0.2921 + 3 * 0.2794
    assert mass == pytest.approx(219.15e-6 * 2700.0 * length, rel=1e-4)


def up(model: Model) -> np.ndarray:  # type: ignore[type-arg]
    return np.array([float(d == "z") for d in model.dofs.direction])


def test_zero_frequency_of_a_free_structure_is_refused(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    rows = model.observe(POINTS)
    with pytest.raises(ModelError, match="infinite"):
        receptance(solve_modes(model), rows, rows, np.array([0.0]))


def test_missing_damping_counts_as_none(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    modes, rows = solve_modes(model), model.observe(POINTS)
    some = np.full(len(modes), np.nan)
    found = receptance(modes, rows, rows, FREQUENCIES, some)
    np.testing.assert_array_equal(found, receptance(modes, rows, rows, FREQUENCIES))
