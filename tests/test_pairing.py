"""MAC, modal scale factor and the pairing of measured with predicted modes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from femubench.core.modal.correlation import mac, modal_scale_factor
from femubench.core.modal.pairing import pair_modes
from femubench.core.typing import FloatArray

RNG = np.random.default_rng(20)
SHAPES = np.linalg.qr(RNG.standard_normal((12, 6)))[0]  # orthonormal: MAC between them is 0
FREQUENCIES = np.array([100.0, 140.0, 200.0, 290.0, 400.0, 560.0])


def noisy(shapes: FloatArray, size: float = 0.02, seed: int = 1) -> FloatArray:
    rng = np.random.default_rng(seed)
    scale = rng.uniform(-3.0, 3.0, shapes.shape[1])
    return (shapes + size * rng.standard_normal(shapes.shape)) * scale


def test_mac_is_one_for_a_scaled_shape_and_zero_for_an_orthogonal_one() -> None:
    assert mac(-7.0 * SHAPES, SHAPES) == pytest.approx(np.eye(6), abs=1e-14)
    assert mac(*2 * (SHAPES[:, 0] + SHAPES[:, 1],)) == pytest.approx(np.ones((1, 1)))


def test_mac_ignores_the_phase_of_complex_shapes() -> None:
    turned = SHAPES * np.exp(1j * np.linspace(0.1, 3.0, 6))
    assert mac(turned, SHAPES) == pytest.approx(np.eye(6), abs=1e-14)
    # Without the conjugate this pair would be orthogonal.
    a = np.array([[1.0], [1.0j]])
    assert mac(a, a) == pytest.approx(1.0)


def test_mac_compares_at_the_sensors_that_both_have() -> None:
    a, b = SHAPES.copy(), SHAPES.copy()
    a[0, 0], b[3, 1] = np.nan, np.nan
    left = [i for i in range(12) if i != 0]
    both = [i for i in range(12) if i not in (0, 3)]
    direct = mac(SHAPES[left, :1], SHAPES[left, 2:3])
    assert mac(a, b)[0, 2] == pytest.approx(direct[0, 0], rel=1e-12)
    direct = mac(SHAPES[both, :1], SHAPES[both, 1:2])
    assert mac(a, b)[0, 1] == pytest.approx(direct[0, 0], rel=1e-12)


def test_degenerate_shapes_score_zero() -> None:
    a = np.zeros((4, 3))
    a[:, 1], a[:, 2] = np.nan, [1.0, 2.0, 3.0, 4.0]
    assert mac(a, np.ones((4, 1)))[:2].tolist() == [[0.0], [0.0]]
    assert mac(np.full((4, 1), 1e-200), np.ones((4, 1))) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="4 and at 5 sensors"):
        mac(a, np.ones((5, 1)))


def test_scale_factor_of_complex_shapes_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(4)
    m, p = rng.standard_normal((2, 7)) + 1j * rng.standard_normal((2, 7))
    reference = np.linalg.lstsq(p[:, None], m, rcond=None)[0][0]
    assert modal_scale_factor(m, p)[0] == pytest.approx(reference, rel=1e-12)
    assert modal_scale_factor(1j * p, p)[0] == pytest.approx(1j)


def test_swapped_modes_are_found_by_shape() -> None:
    order = [0, 2, 1, 3, 5, 4]
    pairing = pair_modes(FREQUENCIES, noisy(SHAPES), FREQUENCIES, SHAPES[:, order])
    assert pairing.index.tolist() == [0, 2, 1, 3, 5, 4]
    assert pairing.mac.min() > 0.95


def test_a_mode_that_the_model_lacks_stays_alone() -> None:
    kept = [0, 1, 3, 4, 5]
    pairing = pair_modes(FREQUENCIES, noisy(SHAPES), FREQUENCIES[kept], SHAPES[:, kept])
    assert pairing.index.tolist() == [0, 1, -1, 2, 3, 4]
    assert np.isnan(pairing.mac[2])


def test_a_rigid_mode_turned_elastic_takes_nobody() -> None:
    rigid = np.ones((12, 1)) / np.sqrt(12.0)
    shapes = np.hstack([rigid, SHAPES - rigid @ (rigid.T @ SHAPES)])
    pairing = pair_modes(FREQUENCIES, noisy(shapes[:, 1:]), np.r_[120.0, FREQUENCIES], shapes)
    assert pairing.index.tolist() == [1, 2, 3, 4, 5, 6]


def test_shapes_alike_at_the_sensors_are_set_apart_by_frequency() -> None:
    shapes = np.column_stack([SHAPES[:, 0], SHAPES[:, 0]])
    pairing = pair_modes(np.array([300.0, 210.0]), shapes, np.array([200.0, 310.0]), shapes)
    assert pairing.index.tolist() == [1, 0]


@pytest.mark.parametrize(("apart", "partner"), [(0.3, 0), (0.5, 1)])
def test_one_point_of_mac_is_worth_four_of_the_logarithm_of_frequencies(
    apart: float, partner: int
) -> None:
    """A MAC of 1 at exp(apart) times the frequency, against one of 0.9 at the frequency itself.

    0.1 points of MAC are worth 0.4 of the logarithm: the exact shape wins at 0.3, not at 0.5.
    """
    other = np.sqrt(0.9) * SHAPES[:, 0] + np.sqrt(0.1) * SHAPES[:, 1]
    predicted = np.array([100.0 * np.exp(apart), 100.0])
    shapes = np.column_stack([SHAPES[:, 0], other])
    pairing = pair_modes(np.array([100.0]), SHAPES[:, :1], predicted, shapes)
    assert pairing.index.tolist() == [partner]


def test_no_pair_below_the_least_mac_or_outside_the_window() -> None:
    half = SHAPES[:, :1] + 1.05 * SHAPES[:, 1:2]  # MAC 0.476 with the first shape
    lone = pair_modes(np.array([100.0]), half, np.array([100.0]), SHAPES[:, :1])
    assert lone.index.tolist() == [-1]
    for ratio, partner in ((1.99, 0), (2.01, -1), (0.501, 0), (0.499, -1)):
        found = pair_modes(np.array([100.0]), SHAPES[:, :1], np.array([100 * ratio]), SHAPES[:, :1])
        assert found.index.tolist() == [partner]


def test_an_imaginary_frequency_pairs_by_shape_but_gives_way_to_a_real_one() -> None:
    only = pair_modes(FREQUENCIES[:1], SHAPES[:, :1], np.array([-80.0]), SHAPES[:, :1])
    assert only.index.tolist() == [0]
    shapes = np.column_stack([SHAPES[:, 0], SHAPES[:, 0] + 0.2 * SHAPES[:, 1]])
    both = pair_modes(FREQUENCIES[:1], SHAPES[:, :1], np.array([-100.0, 110.0]), shapes)
    assert both.index.tolist() == [1]
    nothing = np.full((12, 1), np.nan)
    alone = pair_modes(FREQUENCIES[:1], nothing, np.array([-100.0]), SHAPES[:, :1])
    assert alone.index.tolist() == [-1]


def test_a_frequency_alone_pairs_with_what_shapes_leave() -> None:
    shapes = noisy(SHAPES[:, :3])
    shapes[:, 1] = np.nan
    # The lone frequency of 140 Hz lies on the model's 141 Hz, which has the shape of mode 1.
    predicted = np.array([141.0, 150.0, 205.0])
    pairing = pair_modes(FREQUENCIES[:3], shapes, predicted, SHAPES[:, :3])
    assert pairing.index.tolist() == [0, 1, 2]
    assert np.isnan(pairing.mac[1])
    assert np.isfinite(pairing.mac[[0, 2]]).all()


def test_a_frequency_alone_never_moves_a_shape_to_a_worse_partner() -> None:
    poor = SHAPES[:, 0] + 0.9 * SHAPES[:, 1]
    shapes = np.column_stack([SHAPES[:, 0], np.full(12, np.nan)])
    predicted = np.array([100.0, 190.0])
    pairing = pair_modes(
        np.array([100.0, 100.0]), shapes, predicted, np.column_stack([SHAPES[:, 0], poor])
    )
    assert pairing.index.tolist() == [0, -1]


def test_a_frequency_alone_takes_no_partner_from_a_shape_however_poor() -> None:
    """One predicted mode: a shape with a MAC of 0.52 at twice its frequency, and its frequency."""
    poor = np.sqrt(0.52) * SHAPES[:, 0] + np.sqrt(0.48) * SHAPES[:, 1]
    shapes = np.column_stack([poor, np.full(12, np.nan)])
    measured = np.array([190.0, 100.0])
    pairing = pair_modes(measured, shapes, np.array([100.0]), SHAPES[:, :1])
    assert pairing.index.tolist() == [0, -1]


def test_frequencies_alone_do_not_chain_over_a_missing_mode() -> None:
    nothing = np.full((12, 3), np.nan)
    pairing = pair_modes(
        np.array([100.0, 200.0, 300.0]), nothing, np.array([101.0, 303.0]), SHAPES[:, :2]
    )
    assert pairing.index.tolist() == [0, -1, 1]


@pytest.mark.parametrize("sensors", [0, 1, 2])
def test_few_sensors_leave_it_to_the_frequencies(sensors: int) -> None:
    # At one sensor every MAC is 1; at two the wrong one may well be the higher.
    measured = np.array([[1.0, 1.0], [1.0, -1.0]])[:sensors]
    pairing = pair_modes(np.array([100.0, 150.0]), measured, np.array([148.0, 103.0]), measured)
    assert pairing.index.tolist() == [1, 0]
    assert np.isnan(pairing.mac).all()


def test_nothing_measured_or_predicted() -> None:
    assert len(pair_modes(np.zeros(0), np.zeros((12, 0)), FREQUENCIES, SHAPES)) == 0
    pairing = pair_modes(FREQUENCIES, SHAPES, np.zeros(0), np.zeros((12, 0)))
    assert pairing.index.tolist() == [-1] * 6


@given(st.permutations(range(6)), st.permutations(range(6)), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_the_order_of_either_side_is_without_meaning(
    rows: list[int], columns: list[int], seed: int
) -> None:
    shift = np.random.default_rng(seed).uniform(0.8, 1.25, 6)
    shapes, predicted = noisy(SHAPES, 0.05, seed), FREQUENCIES * shift
    pairing = pair_modes(FREQUENCIES[rows], shapes[:, rows], predicted[columns], SHAPES[:, columns])
    assert [columns[k] for k in pairing.index] == list(rows)
