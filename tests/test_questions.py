"""Units, modes listed twice and frequencies in another order than shapes are asked for."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from response_problems import simulate

from femubench import InputError, cases
from femubench.core.modal.frf import DERIVATIVES, Motion
from femubench.core.modal.questions import question_measurement
from femubench.update import Changes

CASE = cases["frame"]
TEST = CASE.measurement


SLIPS = {
    1e-3: "as if they were in kHz",
    60.0: "as if they were in 1/min",
    2.0 * np.pi: "as if they were in rad/s",
    1e3: "as if E had been typed in MPa, where Pa is expected, or every length in mm",
    1e-6: "as if density had been typed in t/mm3",
    20.0: "a unit is wrong, or it is another structure",
}


# Frequencies alone, six times too high, find other partners.
@pytest.mark.parametrize(
    ("factor", "shapes"),
    [(k, shapes) for k in SLIPS for shapes in (True, False) if shapes or not 1.0 < k < 10.0],
)
def test_a_unit_that_would_explain_the_frequencies_is_said(factor: float, shapes: bool) -> None:
    test = replace(TEST, frequencies=factor * TEST.frequencies)
    test = test if shapes else replace(test, shapes=np.full_like(test.shapes, np.nan))
    (said,) = question_measurement(CASE.model, test)
    assert SLIPS[factor] in said


def test_one_mode_under_two_numbers_and_frequencies_in_another_order_are_said() -> None:
    rows = [*range(len(TEST)), 1]
    twice = replace(
        TEST,
        **{name: getattr(TEST, name)[rows] for name in ("frequencies", "frequency_std", "damping")},
        **{name: getattr(TEST, name)[:, rows] for name in ("shapes", "shape_std")},
        numbers=(*TEST.numbers, 99),
    )
    assert question_measurement(CASE.model, twice) == (
        f"modes {TEST.numbers[1]} and 99 are one mode: leave one out of the table",
    )
    turned = replace(TEST, frequencies=TEST.frequencies[::-1])
    (said,) = question_measurement(CASE.model, turned)
    assert "the rows of frequencies and shapes had different orders" in said


@pytest.mark.parametrize("name", [name for name in cases if not name.startswith("suite")])
def test_cases_that_come_along_make_nobody_ask(name: str) -> None:
    try:
        case = cases[name]
    except InputError as error:
        pytest.skip(str(error))
    assert question_measurement(case.model, case.measurement) == ()


KINDS: tuple[Motion, ...] = ("receptance", "mobility", "accelerance")


@pytest.mark.parametrize("draw", range(3))
def test_responses_of_another_kind_or_unit_are_said_and_no_wrong_model_is(draw: int) -> None:
    """Noise of 3 %, members of the structure and of the model 20 % wrong, each up or down."""
    rng = np.random.default_rng(draw)
    nominal, exact = simulate(np.exp(rng.choice([-0.2, 0.2], 3)), noise=0.03)
    model = Changes(nominal).parameterise("members").at(rng.choice([-0.2, 0.2], 3))
    test = exact.with_noise(rng)
    given = test.responses
    assert given is not None
    assert given.deviations is not None
    for actual, stated, unit in product(KINDS, KINDS, (1.0, 1e3, 1.0 / 9.80665)):
        # In g are accelerances alone; where a kind and 1000 cancel at the level, nothing is said.
        if (unit == 1e3 and actual != stated) or (unit < 1.0 and actual != "accelerance"):
            continue
        turn = unit * (2j * np.pi * given.frequencies[:, None, None]) ** DERIVATIVES[actual]
        sizes = {"values": turn * given.values, "deviations": np.abs(turn) * given.deviations}
        read = replace(given, **sizes, quantity=stated)
        keys = [f'quantity = "{actual}"'] if actual != stated else []
        keys += [f"factor = {1.0 / unit:.6g}"] if unit != 1.0 else []
        said = question_measurement(model, replace(test, responses=read))
        assert len(said) == bool(keys), (actual, stated, unit, said)
        assert not keys or f": {', '.join(keys)} in responses of [measurement]" in said[0]
        taken = replace(test, responses=read.taken_as(actual, 1.0 / unit))
        assert question_measurement(model, taken) == ()
