"""A frame without symmetry: one half side 4 % longer, one joint softer; no method may be lucky."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from femubench.core.fem.frame import Frame, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.correlation import mac
from femubench.core.modal.eigen import Modes, solve_modes
from femubench.core.modal.expansion import expand_by_rotation, procrustes_rotation, same_length
from femubench.core.modal.pairing import pair_modes
from femubench.core.typing import FloatArray

FrameBuilder = Callable[..., Frame]
COUNT = 6
Data = tuple[Modes, FloatArray, Model]


def readings(model: Model, modes: Modes) -> FloatArray:
    """Return z at the joints and at the midpoints of all segments, (13, m)."""
    frame = model.frame_structure.frame
    ends = [[np.array(frame.joint(name).xyz) for name in member.ends] for member in frame.members]
    points = np.array([j.xyz for j in frame.joints] + [0.5 * (a + b) for a, b in ends])
    sensors = Sensors(tuple(f"s{i}" for i in range(13)), points, ("z",) * 13)
    return np.asarray(model.observe(sensors) @ modes.shapes)


@pytest.fixture(scope="module")
def nominal(ladder: FrameBuilder) -> Data:
    model = Model.of(ladder(accelerometer=False))
    modes = solve_modes(model).elastic.take(np.arange(COUNT))
    return modes, readings(model, modes), model


@pytest.fixture(scope="module")
def truth(asymmetric_ladder: FrameBuilder) -> Data:
    model = Model.of(asymmetric_ladder(accelerometer=False))
    modes = solve_modes(model).elastic.take(np.arange(COUNT))
    return modes, readings(model, modes), model


def test_the_longer_half_side_and_the_softer_joint_are_there(truth: Data) -> None:
    structure = truth[2].frame_structure
    lengths = {
        member.name: np.linalg.norm(
            np.subtract(*(structure.frame.joint(name).xyz for name in member.ends))
        )
        for member in structure.frame.members
    }
    assert lengths["EF"] == pytest.approx(1.04 * lengths["DE"])
    assert lengths["CF"] > lengths["AD"]
    assert set(structure.spring_labels) == {"EF@F:rx", "EF@F:ry", "CF@F:rx", "CF@F:ry"}


def test_every_frequency_differs_from_the_nominal_one(nominal: Data, truth: Data) -> None:
    ratio = truth[0].natural_frequencies / nominal[0].natural_frequencies
    assert (np.abs(ratio - 1.0) > 3e-3).all()


def test_a_softer_joint_lowers_every_frequency(asymmetric_ladder: FrameBuilder) -> None:
    found = [
        solve_modes(Model.of(asymmetric_ladder(softness))).elastic.natural_frequencies[:COUNT]
        for softness in (0.01, 1.0, 5.0)
    ]
    assert (found[0] > found[1]).all()
    assert (found[1] > found[2]).all()


def test_the_rotation_is_not_the_identity_and_not_symmetric(nominal: Data, truth: Data) -> None:
    measured = same_length(truth[1][:, :3], nominal[1][:, :3])
    rotation = procrustes_rotation(measured, nominal[1][:, :3])
    assert np.abs(rotation - np.eye(3)).max() > 0.05
    assert np.abs(rotation - rotation.T).max() > 0.05
    misfit = np.linalg.norm(measured @ rotation - nominal[1][:, :3])
    assert misfit < 0.9 * np.linalg.norm(measured - nominal[1][:, :3])
    assert misfit < 0.6 * np.linalg.norm(measured @ rotation.T - nominal[1][:, :3])


def test_expanded_shapes_come_nearer_to_the_truth_than_the_nominal_ones(
    nominal: Data, truth: Data
) -> None:
    full, _ = expand_by_rotation(truth[1][:, :3], nominal[1][:, :3], nominal[0].shapes[:, :3])
    expanded = readings(nominal[2], replace(nominal[0], shapes=full))
    before, after = (np.diag(mac(truth[1][:, :3], s)) for s in (nominal[1][:, :3], expanded))
    assert (after > before).sum() >= 2
    assert after.mean() > before.mean()


def test_pairing_follows_the_shapes(nominal: Data, truth: Data) -> None:
    order = np.array([3, 0, 5, 1, 4, 2])
    shuffled = truth[1][:, order] * np.array([-1.0, 3.0, 0.1, -7.0, 1.0, 2.0])
    paired = pair_modes(
        truth[0].natural_frequencies[order], shuffled, nominal[0].natural_frequencies, nominal[1]
    )
    np.testing.assert_array_equal(paired.index, order)
    assert (paired.mac > 0.9).all()


def test_pairing_follows_modes_that_change_places(nominal: Data, truth: Data) -> None:
    # A torsion constant 1.4 times too large lifts the first mode above the second.
    structure = nominal[2].frame_structure
    everywhere = tuple(dict.fromkeys(label for label in structure.labels if label))
    stiff = Model.of(structure.with_values([Property("GJ", "GJ", everywhere)], [1.4]))
    modes = solve_modes(stiff).elastic.take(np.arange(COUNT))
    shapes = readings(stiff, modes)
    paired = pair_modes(truth[0].natural_frequencies, truth[1], modes.natural_frequencies, shapes)
    np.testing.assert_array_equal(paired.index[:2], [1, 0])
    assert (paired.mac[:3] > 0.9).all()


def test_mirror_images_are_told_apart_by_shapes_alone(ladder: FrameBuilder) -> None:
    # A mass at one corner or at its mirror image: equal frequencies, different shapes.
    found = []
    for corner in "AC":
        frame = replace(ladder(accelerometer=False), masses=(PointMass(Place(joint=corner), 0.1),))
        model = Model.of(frame)
        modes = solve_modes(model).elastic.take(np.arange(COUNT))
        found.append((modes.natural_frequencies, readings(model, modes)))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-8)
    assert np.diag(mac(found[0][1], found[1][1])).min() < 0.95
