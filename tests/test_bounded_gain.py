"""The rule of the boards, by hand and on models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from femubench import InputError, Measurement
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.pairing import Pairing
from femubench.core.schema.paired_modes import ModeBefore, PartnerCandidate
from femubench.core.schema.results import Block
from femubench.core.score.bounded_gain import (
    MeasuredModes,
    ModelErrors,
    Rule,
    find_candidates,
    find_gain,
    find_tested_modes,
)
from femubench.results import PairedMode

RULE = Rule()


def mode(number: int, measured: float, predicted: float | None, **more: Any) -> PairedMode:
    return PairedMode(number, measured, predicted, None if predicted is None else 0.9, **more)


def blocks(**modes: tuple[PairedMode, ...]) -> dict[str, Block]:
    return {name: Block(0.0, None, listed) for name, listed in modes.items()}


# A tested structure of two modes, one given, and a modified one with one of them in the given band.
TEXTBOOK = blocks(
    used=(mode(1, 100.0, 104.0),),
    higher=(mode(2, 200.0, 220.0),),
    modified=(
        mode(1, 90.0, 95.0, modification="mass", before=ModeBefore(1, 0.99)),
        mode(2, 190.0, 200.0, modification="mass", before=ModeBefore(2, 0.95)),
    ),
)


def test_two_modes_by_hand() -> None:
    found = MeasuredModes.of(TEXTBOOK, RULE).errors(TEXTBOOK)
    assert found.error == pytest.approx((math.log(1.1) + math.log(200 / 190)) / 2, rel=1e-12)
    assert found.band == pytest.approx(math.log(95 / 90), rel=1e-12)
    changes = (math.log(95 / 104 / (90 / 100)), math.log(200 / 220 / (190 / 200)))
    assert found.change == pytest.approx(np.mean(np.abs(changes)), rel=1e-12)
    assert (found.shape, found.false_modes) == (pytest.approx(0.1), 0)
    better = blocks(
        used=(mode(1, 100.0, 100.0),),
        higher=(mode(2, 200.0, 210.0),),
        modified=(
            mode(1, 90.0, 90.0, modification="mass"),
            mode(2, 190.0, 199.5, modification="mass"),
        ),
    )
    own = MeasuredModes.of(TEXTBOOK, RULE).errors(better)
    assert own.error == pytest.approx(math.log(1.05), rel=1e-12)
    assert own.change == pytest.approx(0.0, abs=1e-12)
    gain = find_gain(own, found, RULE)
    left = 2 * math.log(1.05) / (math.log(1.1) + math.log(200 / 190))
    assert (gain.error, gain.change) == (pytest.approx(1 - left), pytest.approx(1.0))
    assert gain.gain == pytest.approx((2 - left) / 2)


@pytest.mark.parametrize(
    ("own", "textbook", "gain"),
    [
        (0.0, 0.08, 1.0),
        (0.08, 0.08, 0.0),
        (0.16, 0.08, -0.5),
        (0.08, 0.0, -1.0),
        (0.001, 0.0, -0.5),
    ],
)
def test_a_gain_is_bounded_and_does_not_jump_where_errors_are_small(
    own: float, textbook: float, gain: float
) -> None:
    pair = (ModelErrors(error, math.nan, 0.0, 0.0, 0) for error in (own, textbook))
    found = find_gain(*pair, RULE)
    assert found.error == found.gain == pytest.approx(gain)
    assert math.isnan(found.change)


def test_a_false_mode_next_to_a_partner_takes_part_by_what_sensors_see_of_it() -> None:
    def error(*others: PartnerCandidate) -> tuple[float, int]:
        own = {**TEXTBOOK, "higher": Block(0.0, None, (mode(2, 200.0, 200.0, candidates=others),))}
        found = MeasuredModes.of(TEXTBOOK, RULE).errors(own)
        return 2 * found.error - math.log(200 / 190), found.false_modes

    assert error() == (pytest.approx(0.0, abs=1e-12), 0)
    near = math.log(1.05)
    assert error(PartnerCandidate(210.0, 1.0, 0.9)) == (pytest.approx(near / 2), 1)
    assert error(PartnerCandidate(210.0, 0.05, 0.9)) == (pytest.approx(near * 0.05 / 1.05), 0)
    # Another shape, and a frequency that the test did not reach.
    assert error(PartnerCandidate(210.0, 1.0, 0.49)) == (pytest.approx(0.0, abs=1e-12), 0)
    assert error(PartnerCandidate(221.0, 1.0, 0.9)) == (pytest.approx(0.0, abs=1e-12), 0)
    # Two at either side of the truth are no better than one at it, nor than their centre.
    low, high = PartnerCandidate(190.0, 1.0, 0.9), PartnerCandidate(210.0, 1.0, 0.9)
    assert error(low, high)[0] > 0.03


@pytest.mark.parametrize("predicted", [None, -150.0, 100.0])
def test_no_prediction_costs_more_than_a_lost_mode(predicted: float | None) -> None:
    own = {**TEXTBOOK, "higher": Block(0.0, None, (mode(2, 200.0, predicted),))}
    found = MeasuredModes.of(TEXTBOOK, RULE).errors(own)
    assert 2 * found.error - math.log(200 / 190) == pytest.approx(math.log(1.4))
    assert found.change == pytest.approx((abs(math.log(95 / 104 / 0.9)) + RULE.change_cap) / 2)


def test_a_shift_of_all_frequencies_changes_no_change() -> None:
    def shifted(block: Block) -> Block:
        modes = (mode(m.number, m.measured_hz, 1.2 * (m.predicted_hz or 0.0),
                      modification=m.modification) for m in block.modes)  # fmt: skip
        return Block(0.0, None, tuple(modes))

    own = {name: shifted(block) for name, block in TEXTBOOK.items()}
    changes = [MeasuredModes.of(TEXTBOOK, RULE).errors(one).change for one in (own, TEXTBOOK)]
    assert changes[0] == pytest.approx(changes[1], rel=1e-12)


def test_what_a_case_lacks_does_not_count() -> None:
    alone = {name: TEXTBOOK[name] for name in ("used", "higher")}
    found = MeasuredModes.of(alone, RULE).errors(alone)
    assert found.error == pytest.approx(math.log(1.1))
    assert math.isnan(found.change)
    given = {"used": TEXTBOOK["used"]}
    assert MeasuredModes.of(given, RULE).errors(given).error == pytest.approx(math.log(1.04))


def test_weights_are_heights_of_peaks_in_a_filtered_response() -> None:
    sensors = Sensors(("a", "b", "c"), np.zeros((3, 3)), ("z",) * 3)
    shape = np.array([[1.0], [2.0], [3.0]])
    measurement = Measurement(
        sensors=sensors, numbers=(1,), frequencies=np.array([100.0]), shapes=shape,
        frequency_std=np.ones(1), shape_std=np.ones((3, 1)), damping=np.array([np.nan]),
    )  # fmt: skip
    # The partner, the same shape at half the height, one across, one out of the window.
    readings = np.hstack([shape, 0.5 * shape, np.array([[3.0], [0.0], [-1.0]]), shape])
    frequencies = np.array([100.0, 110.0, 120.0, 210.0])
    pairing = Pairing(np.array([0]), np.array([1.0]))
    (found,) = find_candidates(measurement, frequencies, readings, pairing)
    assert found == (PartnerCandidate(110.0, pytest.approx(0.25), pytest.approx(1.0)),)
    # What is a partner is no candidate, and without a shape there are none.
    alone = Pairing(np.array([0]), np.array([np.nan]))
    assert find_candidates(measurement, frequencies, readings, alone) == [()]


def test_tested_modes_are_found_by_shape_and_mutually() -> None:
    sensors = Sensors(("a", "b", "c"), np.zeros((3, 3)), ("z",) * 3)

    def measured(*columns: tuple[float, ...]) -> Measurement:
        shapes, m = np.array(columns).T, len(columns)
        return Measurement(
            sensors=sensors, numbers=tuple(range(1, m + 1)), frequencies=np.arange(1.0, m + 1),
            shapes=shapes, frequency_std=np.ones(m), shape_std=np.ones((3, m)),
            damping=np.full(m, np.nan),
        )  # fmt: skip

    tested = measured((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    found = find_tested_modes(tested, measured((0.0, 1.0, 0.1), (0.1, 1.0, 0.5), (1.0, 0.0, 0.0)))
    assert [None if one is None else one.number for one in found] == [2, None, 1]


@pytest.mark.parametrize(
    ("word", "says"),
    [("cpa=1", "no 'cpa'.*window, mac"), ("cap=much", "'much'"), ("mac=0.1", "from 0.3 to 1")],
)
def test_a_wrong_word_of_the_rule_is_one_line(word: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as fault:
        RULE.changed([word])
    assert len(str(fault.value).splitlines()) == 1


def test_a_rule_goes_to_json_and_back_with_what_was_varied() -> None:
    varied = RULE.changed(["cap=0.2", "mac=0.6"])
    plain: Mapping[str, Any] = varied.to_json()
    assert (plain["version"], RULE.to_json()["version"]) == ("1 mac cap", "1")
    assert Rule.of({"rule": plain}) == varied
    assert Rule.of({"run": "old"}) == RULE
    with pytest.raises(InputError, match=r"from 0\.3 to 1"):
        Rule.of({"rule": {**plain, "mac": 7.0}})
