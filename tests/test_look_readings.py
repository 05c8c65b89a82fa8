"""The plain look at a measurement: deviations, sensors, modes that were missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from look_checks import look, measured, midpoints, texts

from femubench.core.fem.frame import Factor, Frame, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors

FrameBuilder = Callable[..., Frame]


@pytest.fixture
def clean(ladder: FrameBuilder) -> Frame:
    """Return a slender ladder with nothing to complain of: shear, rotary inertia, Bredt's J."""
    return ladder("timoshenko", polar=False, elements=8)


@pytest.mark.parametrize("relative", [1e-7, 0.4, np.nan])
def test_absurd_deviations_are_found(clean: Frame, relative: float) -> None:
    model = Model.of(clean)
    data = measured(model)
    std = data.frequency_std.copy()
    std[2] = relative * data.frequencies[2]
    found = texts(look(model, replace(data, frequency_std=std)), "of mode 3 ")
    assert len(found) == 1


def test_two_sensors_at_one_place(clean: Frame) -> None:
    model = Model.of(clean)
    s = midpoints(clean)
    twice = Sensors(
        (*s.labels, "again"), np.vstack([s.xyz, s.xyz[3]]), (*s.directions[:-1], "z", "-z")
    )
    (warning,) = texts(look(model, measured(model, sensors=twice)), "same motion")
    assert warning.where == "again"
    assert "s3" in warning.what


@pytest.mark.parametrize(("sensor", "gain"), [(0, -1.0), (5, 0.3), (12, 10.0)])
def test_a_sensor_with_another_gain_is_found(
    asymmetric_ladder: FrameBuilder, sensor: int, gain: float
) -> None:
    model = Model.of(asymmetric_ladder(polar=False))
    truth = Model.of(asymmetric_ladder(softness=2.0, elements=8))  # also the wrong torsion constant
    data = measured(truth).with_noise(np.random.default_rng(0))
    data.shapes[sensor] *= gain
    (warning,) = texts(look(model, data), "other sensors")
    assert warning.where == f"s{sensor}"


@pytest.mark.parametrize("seed", range(4))
def test_no_sensor_is_blamed_for_an_error_of_the_model(ladder: FrameBuilder, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = ladder(polar=bool(seed % 2), elements=8)
    member = truth.members[rng.integers(7)].name
    soft = Factor("E", (f"{member}/{rng.integers(1, 9)}",), 0.5)
    lump = PointMass(Place(joint="ABCDEF"[rng.integers(6)]), 0.2)
    truth = replace(truth, factors=(soft,), masses=(*truth.masses, lump))
    data = measured(Model.of(truth)).with_noise(rng)
    assert not texts(look(Model.of(ladder()), data), "other sensors")


def test_more_modes_in_the_band_than_were_found(clean: Frame) -> None:
    model = Model.of(clean)
    data = measured(model, 5)
    band = (50.0, 1.1 * float(data.frequencies[-1]))
    assert not texts(look(model, data, band), "inside the band")
    (warning,) = texts(look(model, data.select([1, 2, 4, 5]), band), "inside the band")
    assert "mode 3 at" in warning.what
