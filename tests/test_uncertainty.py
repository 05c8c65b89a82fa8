"""What a strategy says of its model's error, from its result to coverage, CRPS and log score."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Sequence
from dataclasses import replace

import harness_toys as toys
import numpy as np
import pytest
from numpy.random import Generator
from scipy.integrate import quad
from scipy.stats import norm

import femubench
from femubench import Measurement, Model, Strategy, StrategyFailure, UpdateResult, solve_modes
from femubench.core.run.answers import pack_outcome, read_report, unpack_outcome
from femubench.core.run.jobs import Job, JobOutcome, execute, seed_words
from femubench.core.run.judging import judge_outcome
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult
from femubench.core.score import predictive
from femubench.core.score.predicted_spread import Spread
from femubench.core.score.scoring import judge, reference_of
from femubench.fem import FloatArray
from femubench.results import leaderboard
from femubench.update import Uncertainty

CASE = toys.tiny_case()


class Point(Strategy):
    name = "point"
    citation = "nobody"

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        elastic = solve_modes(model).elastic.natural_frequencies
        ratio = (measurement.frequencies / elastic[: len(measurement)]) ** 2
        return UpdateResult(
            replace(model, stiffness=float(ratio.mean()) * model.stiffness),
            parameter_count=1,
        )


class Sampled(Strategy):
    name = "sampled"
    citation = "nobody"

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        from femubench.update import Uncertainty

        elastic = solve_modes(model).elastic.natural_frequencies
        ratio = (measurement.frequencies / elastic[: len(measurement)]) ** 2
        samples = [replace(model, stiffness=float(r) * model.stiffness) for r in ratio]
        return UpdateResult(
            replace(model, stiffness=float(ratio.mean()) * model.stiffness),
            parameter_count=1,
            uncertainty=Uncertainty(samples),
        )


def lines(thing: object) -> int:
    """Count the lines that are not empty."""
    return sum(bool(line.strip()) for line in inspect.getsource(thing).splitlines())  # type: ignore[arg-type]


def test_samples_take_three_lines_more() -> None:
    assert lines(Sampled) - lines(Point) <= 3
    run = femubench.rank(CASE, [Point(), Sampled()])
    board = leaderboard(run).set_index("strategy")
    assert board["gain"].nunique() == 1
    assert board.notna()["coverage90"].to_dict() == {"sampled": True, "point": False}
    assert board.notna()["log_score"].to_dict() == {"sampled": True, "point": False}
    assert board["crps_percent"].notna().all()
    for result in run.results:
        stds = [m.predicted_std_hz for b in result.blocks.values() for m in b.modes]
        assert all((std is not None) == (result.strategy == "sampled") for std in stds)


def test_a_point_is_scored_by_its_absolute_error() -> None:
    (result,) = femubench.rank(CASE, [Point()], nominal="drawn").results
    unseen = [m for name in ("higher", "modified") for m in result.blocks[name].modes]
    errors = [abs(m.predicted_hz / m.measured_hz - 1.0) for m in unseen if m.predicted_hz]
    found = predictive.scores([result], {})
    assert found["crps_percent"] == pytest.approx(100.0 * np.mean(errors), rel=1e-12)
    assert np.isnan(found["coverage90"])
    assert np.isnan(found["log_score"])


def test_spread_is_that_of_samples_solved_in_full() -> None:
    """Elements that change one by one move and mix the modes, also of the modified structure."""
    case = femubench.cases["suite/portal"]
    model, structure = case.model, case.model.frame_structure
    labels = [label for label in structure.label_index if label][:6]
    rng = np.random.default_rng(3)
    parameters = [femubench.fem.Property(at, "E", (at,)) for at in labels]
    samples = tuple(
        Model.of(structure.with_values(parameters, np.exp(0.3 * rng.standard_normal(6))))
        for _ in range(8)
    )
    blocks = judge(case, model, reference_of(case), Spread(model, samples, 0.0)).blocks
    exact = [judge(case, sample, reference_of(case)).blocks for sample in samples]
    ratios = []
    for name, block in blocks.items():
        sigma = {change.name: change.measurement.frequency_std for change in case.modifications} | {
            None: case.measurement.frequency_std
        }
        for k, mode in enumerate(block.modes):
            moved = [found[name].modes[k].predicted_hz for found in exact]
            if mode.predicted_hz is None or None in moved:
                continue
            numbers = case.measurement.numbers
            if mode.modification is not None:
                (change,) = (c for c in case.modifications if c.name == mode.modification)
                numbers = change.measurement.numbers
            own = sigma[mode.modification][numbers.index(mode.number)]
            distance = np.array(moved, dtype=float) - mode.predicted_hz
            expected = np.sqrt(np.mean(np.square(distance)) + own**2)
            assert mode.predicted_std_hz is not None
            ratios.append(mode.predicted_std_hz / expected)
    assert len(ratios) >= 15
    off = np.sort(np.abs(np.array(ratios) - 1.0))
    assert off[len(off) // 2] < 1e-4
    # The rest are modes that come close to each other: the pairing may exchange them.
    assert off[int(0.8 * len(off))] < 0.01


def test_the_discrepancy_and_the_measured_deviation_add() -> None:
    model = CASE.model
    blocks = judge(CASE, model, reference_of(CASE), Spread(model, (model,), 0.03)).blocks
    for mode in (*blocks["used"].modes, *blocks["higher"].modes):
        assert mode.predicted_hz is not None
        expected = np.hypot(0.03 * mode.predicted_hz, 0.002 * mode.measured_hz)
        assert mode.predicted_std_hz == pytest.approx(expected, rel=1e-6)


def test_moments_of_drawn_samples_are_those_asked_for() -> None:
    covariance = np.array([[0.04, 0.01], [0.01, 0.02]])
    seen: list[FloatArray] = []

    def make(q: FloatArray) -> Model:
        seen.append(q)
        return CASE.model

    found = Uncertainty.draw(make, np.array([1.0, -1.0]), covariance)
    assert len(found.samples) == len(seen)
    assert np.mean(seen, axis=0) == pytest.approx([1.0, -1.0], abs=1e-12)
    assert np.cov(np.transpose(seen), bias=True) == pytest.approx(covariance, abs=1e-12)


@pytest.mark.parametrize(
    ("covariance", "says"),
    [
        (np.eye(3), "has shape (3, 3), expected (2, 2)"),
        (np.diag([1.0, np.nan]), "entries that are not finite"),
        # A wrong index is no rounding: that of a product of matrices is of 1e-15.
        (np.array([[1.0, 0.5 + 1e-6], [0.5, 1.0]]), "not symmetric"),
        (np.diag([1.0, -0.1]), "an eigenvalue of -0.1, expected none below 0"),
    ],
)
def test_a_covariance_that_is_none_is_refused(covariance: FloatArray, says: str) -> None:
    with pytest.raises(StrategyFailure) as caught:
        Uncertainty.draw(lambda q: CASE.model, np.zeros(2), covariance)
    assert says in str(caught.value)


def test_a_covariance_of_lower_rank_serves_in_spite_of_its_rounding() -> None:
    """Forty parameters of three causes: eigenvalues of -1e-16 are zeros, and samples span three."""
    causes = np.random.default_rng(2).standard_normal((40, 3))
    covariance = causes @ np.diag([1.0, 0.3, 0.1]) @ causes.T
    asymmetric = covariance * (1.0 + 1e-13 * np.triu(np.ones((40, 40)), 1))
    for given in (covariance, asymmetric):
        assert np.linalg.eigvalsh(given)[0] < 0.0
        seen: list[FloatArray] = []
        Uncertainty.draw(lambda q, seen=seen: seen.append(q) or CASE.model, np.zeros(40), given)  # type: ignore[misc]
        size = np.linalg.svdvals(np.array(seen))
        assert np.count_nonzero(size > 1e-6 * size[0]) == 3
        assert np.cov(np.transpose(seen), bias=True) == pytest.approx(covariance, abs=1e-9)


class Stating(Strategy):
    """Hand back the nominal model with any uncertainty."""

    name = "stating"
    citation = "nobody"

    def __init__(self, stated: object) -> None:
        self.stated = stated

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(model, uncertainty=self.stated)  # type: ignore[arg-type]


def outcome_of(stated: object) -> JobOutcome:
    parts = (pickle.dumps(part) for part in (Stating(stated), CASE.model, CASE.measurement))
    return execute(Job(*parts, seed_words("corner", "stating", 0)))


def spoiled(value: float) -> Model:
    stiffness = CASE.model.stiffness.copy()
    stiffness.data[1] = value
    return replace(CASE.model, stiffness=stiffness)


def other_size() -> Model:
    return Model.of(toys.frame(2, 70.0e9))


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        (Uncertainty((), float("nan")), "discrepancy_std is nan, expected a finite number >= 0"),
        (Uncertainty((), -0.01), "discrepancy_std is -0.01"),
        (Uncertainty((CASE.model,) * 65), "65 samples, allowed 64"),
        (Uncertainty((3.0,)), "sample 1 is float, expected Model"),  # type: ignore[arg-type]
        (Uncertainty((CASE.model, other_size())), "sample 2 has other degrees of freedom"),
        (Uncertainty((CASE.model, spoiled(float("nan")))), "sample 2: stiffness has 1 entries"),
        (Uncertainty((spoiled(1e12),)), "sample 1: stiffness is not symmetric"),
        ({"samples": ()}, "has no attribute 'samples'"),
    ],
)
def test_an_uncertainty_that_is_none_fails_in_one_line(stated: object, says: str) -> None:
    outcome = outcome_of(stated)
    if outcome.status == "ok":  # what only the judge looks into
        outcome = unpack_outcome(pack_outcome(outcome, CASE.model), CASE.model)
    result = judge_outcome(CASE, reference_of(CASE), ("stating", 0, "drawn"), outcome)
    assert result.status == "failed"
    assert says in result.reason
    assert "\n" not in result.reason


def test_samples_that_are_no_models_do_not_get_out_of_a_worker() -> None:
    forged = JobOutcome("ok", model=CASE.model, samples=(object(),), discrepancy_std=0.0)  # type: ignore[arg-type]
    sent = read_report(pack_outcome(forged, CASE.model))
    assert (sent.status, sent.reason[:31]) == ("failed", "the result cannot be sent back:")


@pytest.mark.parametrize(("error", "std"), [(0.0, 1.0), (2.5, 1.0), (-3.0, 0.7), (0.4, 5.0)])
def test_crps_is_the_integral_that_defines_it(error: float, std: float) -> None:
    def square(x: float) -> float:
        return float((norm.cdf(x, error, std) - (x >= 0.0)) ** 2)

    ends = min(error, 0.0) - 12.0 * std, max(error, 0.0) + 12.0 * std
    expected = quad(square, ends[0], 0.0)[0] + quad(square, 0.0, ends[1])[0]
    found = predictive.crps_normal(np.array([error]), np.array([std]))
    assert found[0] == pytest.approx(expected, rel=1e-7)


def test_log_score_is_bounded_and_that_of_the_mixture() -> None:
    error, std = np.array([0.0, 1.0, 90.0, 100.0]), np.array([1.0, 2.0, 0.1, np.nan])
    density = 0.99 * norm.pdf([0.0, 1.0], 0.0, [1.0, 2.0]) + 0.01 / 200.0
    worst = -np.log(0.01 / 200.0)
    expected = [*-np.log(density), worst, worst]
    assert predictive.log_score(error, std) == pytest.approx(expected, rel=1e-12)


def simulated(claimed: float, cases: Sequence[str], count: int = 2000) -> list[JobResult]:
    """Forecasts with errors of 1 % and a claimed standard deviation."""
    rng = np.random.default_rng(11)
    results = []
    for case in cases:
        modes = tuple(
            PairedMode(k, 100.0, 100.0 + rng.standard_normal(), 1.0, None, claimed)
            for k in range(count)
        )
        results.append(JobResult(case, "s", 0, "ok", blocks={"higher": Block(1.0, 1.0, modes)}))
    return results


def test_calibrated_forecasts_cover_nine_in_ten_and_others_do_not() -> None:
    found = {std: predictive.scores(simulated(std, "a"), {}) for std in (0.3, 1.0, 3.0)}
    assert found[1.0]["coverage90"] == pytest.approx(0.9, abs=0.02)
    assert found[0.3]["coverage90"] < 0.45
    assert found[3.0]["coverage90"] > 0.99
    for name in ("crps_percent", "log_score"):  # proper: the true distribution is the best
        assert found[1.0][name] < min(found[0.3][name], found[3.0][name])


def test_structures_weigh_alike_however_many_modes_they_have() -> None:
    many, few = simulated(1e9, "a", 50)[0], simulated(1e-9, "b", 2)[0]
    assert predictive.scores([many, few], {})["coverage90"] == pytest.approx(0.5)
    one = predictive.scores([many, few], {"a": "x", "b": "x"})
    assert one["coverage90"] == pytest.approx(50 / 52)


def test_a_lost_mode_is_covered_by_nothing_and_counts_a_hundred_percent() -> None:
    modes = (
        PairedMode(1, 100.0, 100.0, 1.0, None, 1.0),
        PairedMode(2, 200.0, None, None),
        PairedMode(3, 300.0, -5.0, 0.9),
    )
    result = JobResult("a", "s", 0, "ok", blocks={"higher": Block(1.0, 1.0, modes)})
    forecasts = predictive.Forecasts.of([result], {})
    assert forecasts.coverage() == pytest.approx(1 / 3)
    assert forecasts.coverage(1.0) == pytest.approx(1 / 3)
    own = predictive.crps_normal(np.zeros(1), np.ones(1))[0]
    assert predictive.scores([result], {})["crps_percent"] == pytest.approx((own + 200.0) / 3)


def test_a_built_in_strategy_says_how_sure_it_is() -> None:
    (result,) = femubench.rank(CASE, ["bayesian"], nominal="drawn").results
    assert result.status == "ok"
    stds = [m.predicted_std_hz for b in result.blocks.values() for m in b.modes]
    assert all(std is not None and std > 0.0 for std in stds)
