"""Modes too close for a test to tell apart are compared as a space."""

from __future__ import annotations

import numpy as np
import pytest

from femubench.core.modal.close_modes import align_close_modes, clusters_of
from femubench.core.modal.correlation import mac
from femubench.core.modal.pairing import pair_modes


def test_groups_are_within_the_closeness_of_their_first_mode() -> None:
    frequencies = np.array([100.0, 300.0, 100.4, 100.8, 200.0, -50.0, -50.1])
    groups = [sorted(group.tolist()) for group in clusters_of(frequencies, 0.005)]
    assert groups == [[5, 6], [0, 2]]
    assert clusters_of(np.array([]), 0.1) == []
    assert clusters_of(np.array([1.0, 2.0]), 0.0) == []


@pytest.fixture
def shapes() -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(3).standard_normal((20, 4)))[0]


def mixed(shapes: np.ndarray, angle: float = 0.8) -> np.ndarray:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.column_stack([shapes[:, :2] @ turn, shapes[:, 2:]])


@pytest.mark.parametrize("known", [1, 2])
def test_a_mixed_pair_is_turned_back(shapes: np.ndarray, known: int) -> None:
    frequencies = np.array([100.0, 100.05, 150.0, 150.9])
    model = mixed(shapes)
    measured = 3.0 * np.column_stack([shapes[:, :known], shapes[:, 2:]])
    assert np.diagonal(mac(model[:, :known], measured[:, :known])).max() < 0.6
    aligned = align_close_modes(frequencies, model, measured, 0.004)
    assert np.diagonal(mac(aligned[:, :2], shapes[:, :2])).min() > 1.0 - 1e-12
    np.testing.assert_array_equal(aligned[:, 2:], model[:, 2:])
    np.testing.assert_allclose(aligned.T @ aligned, np.eye(4), atol=1e-12)
    given = np.array([*[100.0, 100.05][:known], 150.0, 150.9])
    assert pair_modes(given, measured, frequencies, aligned).mac.min() > 0.999


def test_a_space_that_does_not_hold_the_measured_shape_gains_nothing(shapes: np.ndarray) -> None:
    other = np.linalg.qr(np.random.default_rng(4).standard_normal((20, 1)))[0]
    aligned = align_close_modes(np.array([100.0, 100.1]), shapes[:, :2], other, 0.01)
    assert mac(aligned, other).max() < 0.5


def test_missing_sensors_and_unseen_modes_do_no_harm(shapes: np.ndarray) -> None:
    measured = shapes[:, :2].copy()
    measured[3, 0] = np.nan
    aligned = align_close_modes(np.array([100.0, 100.1]), mixed(shapes)[:, :2], measured, 0.01)
    assert np.diagonal(mac(aligned, measured)).min() > 1.0 - 1e-12
    blind = np.zeros((20, 2))
    np.testing.assert_array_equal(
        align_close_modes(np.array([100.0, 100.1]), blind, measured, 0.01), blind
    )
