"""Two measurements of one structure are compared without a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from response_problems import simulate

from femubench.core.fem.sensors import Sensors
from femubench.core.look.states import compare_states
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import LoneMode

HZ = np.array([20.0, 31.0, 44.0, 60.0, 85.0, 120.0])
SHARE = 0.02
SHAPES = np.linalg.qr(np.random.default_rng(5).standard_normal((9, 6)))[0]


def measured(frequencies: np.ndarray = HZ, shapes: np.ndarray = SHAPES) -> Measurement:
    """Return modes with deviations of 0.3 %, and of a share of each one's largest reading."""
    count = len(frequencies)
    axes = np.tile([0.0, 0.0, 1.0], (9, 1))
    return Measurement(
        sensors=Sensors(tuple(f"S{i}" for i in range(9)), axes, tuple("z" * 9)),
        numbers=tuple(range(1, count + 1)),
        frequencies=frequencies,
        frequency_std=0.003 * frequencies,
        damping=np.full(count, np.nan),
        shapes=shapes,
        shape_std=np.full((9, 1), SHARE) * np.abs(shapes).max(axis=0),
    )


def test_noise_as_stated_agrees_as_often_as_it_should() -> None:
    rng = np.random.default_rng(1)
    drawn = [
        compare_states(measured().with_noise(rng), measured().with_noise(rng)) for _ in range(100)
    ]
    p = np.array([states.p for states in drawn])
    assert {states.verdict for states in drawn} == {"agrees"}
    assert [np.mean(p < level) for level in (0.1, 0.5)] == pytest.approx([0.1, 0.5], abs=0.1)
    assert {states.count for states in drawn} == {6 + 2 * 6}


def test_a_frequency_that_moved_is_said_in_the_deviations_of_both() -> None:
    states = compare_states(measured(HZ * [1, 1, 1.043, 1, 1, 1]), measured())
    row = states.modes[2]
    assert states.differs
    assert (row.mode, row.reference_mode, row.change_percent) == (3, 3, pytest.approx(4.3))
    assert row.deviations == pytest.approx(np.log(1.043) / (0.003 * np.sqrt(2.0)))
    assert states.chi2 == pytest.approx(row.deviations**2)


def test_frequencies_that_err_together_differ_by_what_is_left() -> None:
    whole = replace(measured(), frequency_correlation=np.full((6, 6), 0.99) + 0.01 * np.eye(6))
    together = compare_states(replace(whole, frequencies=HZ * 1.01), whole)
    assert not together.differs
    assert compare_states(measured(HZ * 1.01), measured()).chi2 > 4.0 * together.chi2


def test_a_shape_alone_can_differ_and_its_scale_and_order_cannot() -> None:
    changed = SHAPES.copy()
    changed[:, 1] += 0.3 * changed[:, 2]
    bent = compare_states(measured(shapes=changed), measured())
    assert bent.differs
    assert bent.modes[1].shape_p == min(row.shape_p or 1.0 for row in bent.modes) < 1e-6
    order = [3, 0, 1, 2, 5, 4]
    scale = np.array([1.0, -1.0, 1.5, 1.0, -2.0, 1.0])
    other = compare_states(measured(HZ[order], (SHAPES * scale)[:, order]), measured())
    assert other.p == pytest.approx(1.0)
    assert [row.reference_mode for row in other.modes] == [k + 1 for k in order]


def test_close_modes_may_turn_into_each_other() -> None:
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    turned = np.column_stack([SHAPES[:, :2] @ turn, SHAPES[:, 2:]])
    close = HZ * np.array([1.0, 20.02 / 31.0, 1, 1, 1, 1])
    assert compare_states(measured(close, turned), measured(close)).p > 0.99
    apart = close * [1, 1.005, 1, 1, 1, 1]
    for pair in (
        (measured(apart, turned), measured(close)),
        (measured(close), measured(apart, turned)),
    ):
        assert not compare_states(*pair).differs
    assert compare_states(measured(HZ, turned), measured()).differs


def test_a_hardly_seen_mode_is_not_absurdly_sharp() -> None:
    faint = SHAPES * [1, 1, 1, 1, 0.02, 1]
    other = faint.copy()
    other[:, 4] += 0.004 * np.cos(np.arange(9))
    hardly = compare_states(measured(shapes=other), measured(shapes=faint))
    assert not hardly.differs
    stated = replace(measured(shapes=faint), shape_std=np.linspace(4e-4, 6e-4, 54).reshape(9, 6))
    sharp = compare_states(replace(stated, shapes=other), stated).modes[4]
    assert (sharp.shape_p or 0.0) < 1e-3


def test_a_mode_that_is_missing_counts_in_the_common_band_and_proves_nothing_alone() -> None:
    reference = measured()
    inside = compare_states(reference.select([1, 2, 4, 5, 6]), reference)
    assert (inside.lost, inside.new) == ((LoneMode(3, 44.0),), ())
    assert not inside.differs
    assert inside.chi2 == pytest.approx(-2.0 * np.log(0.05))
    assert compare_states(reference, reference.select([2, 3, 4])).new == ()
    three = compare_states(reference.select([1, 6]), reference)
    assert len(three.lost) == 4
    assert three.p < inside.p


def test_the_weighed_mass_counts_where_both_have_it() -> None:
    weighed = replace(measured(), total_mass=(10.0, 0.03))
    heavier = replace(weighed, total_mass=(10.6, 0.04))
    states = compare_states(heavier, weighed)
    assert states.differs
    assert states.chi2 == pytest.approx(12.0**2)
    assert states.mass_change == pytest.approx((0.6, 0.05))
    assert compare_states(heavier, measured()).mass_change is None


def test_a_deviation_that_is_missing_takes_the_median_of_the_others() -> None:
    std = 0.003 * HZ * [1, 1, 0, np.nan, 1, 1]
    partly = replace(measured(), frequency_std=std)
    rows = compare_states(partly, partly).modes
    assert [row.std_percent for row in rows] == pytest.approx([0.3 * np.sqrt(2.0)] * 6)
    without = np.full((0, 6), np.nan)
    alone = Sensors((), np.zeros((0, 3)), ())
    bare = replace(measured(), sensors=alone, shapes=without, shape_std=without)
    states = compare_states(bare, bare)
    assert (states.count, states.modes[0].mac, states.modes[0].shape_p) == (6, None, None)


def test_antiresonances_that_moved_differ_where_modes_agree() -> None:
    """Responses of another structure with the same modes; noise as stated agrees."""
    _, before = simulate(np.ones(3), lines=300)
    _, other = simulate(np.array([1.0, 0.8, 1.0]), lines=300)
    rng = np.random.default_rng(4)
    quiet = [compare_states(before.with_noise(rng), before.with_noise(rng)) for _ in range(20)]
    assert {(states.verdict, len(states.zeros) > 4) for states in quiet} == {("agrees", True)}
    assert all((states.zeros_p or 0.0) > 0.01 for states in quiet)
    states = compare_states(replace(before, responses=other.responses), before)
    assert states.differs
    assert (
        compare_states(before, before).count
        == compare_states(replace(before, responses=None), before).count + 2
    )
    assert (states.zeros_p or 1.0) < 1e-6
    most = max(states.zeros, key=lambda zero: abs(zero.deviations))
    assert abs(most.deviations) > 5.0
    assert most.force == before.responses.references.labels[0]  # type: ignore[union-attr]
    ratio = most.present_hz / most.reference_hz
    assert most.change_percent == pytest.approx(100.0 * (ratio - 1.0))
