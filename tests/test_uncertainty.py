"""What a strategy says of its model's error, from its result to the predictive board."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
from msgspec import structs
from numpy.random import Generator
from scipy.integrate import quad
from scipy.stats import norm

import femubench
from femubench import Measurement, Model, Strategy, StrategyFailure, UpdateResult, solve_modes
from femubench.core.run.answers import pack_outcome, read_report, unpack_outcome
from femubench.core.run.jobs import Job, JobOutcome, execute, seed_words
from femubench.core.run.judging import judge_outcome
from femubench.core.schema.paired_modes import PairedMode, PartnerCandidate
from femubench.core.schema.results import Block, JobResult, RunData
from femubench.core.score.leaderboard import GainTable, leaderboard
from femubench.core.score.predicted_spread import Spread
from femubench.core.score.predictive import (
    Forecasts,
    PredictiveBoard,
    crps_normal,
    learn_deviations,
)
from femubench.core.score.ranking import list_models
from femubench.core.score.scoring import judge, reference_of
from femubench.fem import FloatArray
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
    rows = {row["strategy"]: row for row in PredictiveBoard.of(run).rows}
    assert {name: row["stated"] for name, row in rows.items()} == {"sampled": 1, "point": 0}
    # One structure teaches no common deviation, and has no interval.
    assert np.isfinite(rows["sampled"]["above_crps_percent"])
    assert np.isnan([rows["point"]["above_crps_percent"], rows["sampled"]["above_skill"]]).all()
    for result in run.results:
        stds = [m.predicted_std_hz for b in result.blocks.values() for m in b.modes]
        assert all((std is not None) == (result.strategy == "sampled") for std in stds)


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
    found = crps_normal(np.array([error]), np.array([std]))
    assert found[0] == pytest.approx(expected, rel=1e-7)


Modes = list[PairedMode]
COUNT = 8  # structures


def modes(errors: Iterable[float], std: float | None = None) -> Modes:
    """Return modes from 200 Hz on with errors of ln f, above a given one of 100 Hz."""
    hz = [(200.0 + k, (200.0 + k) * np.exp(e)) for k, e in enumerate(errors)]
    return [PairedMode(k, m, p, 1.0, None, std and std * p) for k, (m, p) in enumerate(hz)]


def drawn(sigma: float, std: float | None = None, count: int = 400, seed: int = 3) -> list[Modes]:
    rng = np.random.default_rng(seed)
    return [modes(sigma * rng.standard_normal(count), std) for _ in range(COUNT)]


def run_with(textbook: list[Modes], **strategies: list[Modes | None]) -> RunData:
    """Return a run on a structure for each list of modes; None stands for a failure."""
    used = Block(0.0, 1.0, (PairedMode(0, 100.0, 100.0, 1.0),))
    named = {f"s{k}": {"used": used, "higher": Block(1.0, 1.0, tuple(m))}
             for k, m in enumerate(textbook)}  # fmt: skip
    models = list_models({case: {"drawn": blocks} for case, blocks in named.items()})
    results = [
        JobResult(case, name, 0, "failed", "no model")
        if own is None
        else JobResult(case, name, 0, "ok", blocks={"used": used, "higher": Block(1, 1, (*own,))})
        for name, listed in strategies.items()
        for case, own in zip(named, listed, strict=True)
    ]
    return RunData({"models": models, "seeds": [0], "strategies": [*strategies]}, tuple(results))


def board_of(run: RunData) -> dict[str, dict[str, Any]]:
    return {row["strategy"]: row for row in PredictiveBoard.of(run).rows}


def test_calibrated_forecasts_cover_nine_in_ten_and_others_do_not() -> None:
    stds = {"narrow": 0.003, "right": 0.01, "wide": 0.03}
    found = board_of(run_with(drawn(0.1), **{n: drawn(0.01, std) for n, std in stds.items()}))
    assert found["right"]["above_coverage90"] == pytest.approx(0.9, abs=0.02)
    assert found["narrow"]["above_coverage90"] < 0.45
    assert found["wide"]["above_coverage90"] > 0.99
    # Proper: the true distribution is the best.
    scores = {name: row["above_crps_percent"] for name, row in found.items()}
    assert min(scores, key=lambda name: scores[name]) == "right"
    assert scores["right"] == pytest.approx(1.0 / np.sqrt(np.pi), rel=0.05)
    assert next(iter(found)) == "right"


def test_who_states_nothing_gets_the_deviation_of_the_textbook_models_elsewhere() -> None:
    textbook, points = drawn(0.05), drawn(0.05, seed=4)
    textbook[0] = modes(0.2 * np.ones(50))
    run = run_with(textbook, point=points, lost=[None] * COUNT)
    table = GainTable.of(run, (), "drawn")
    known = {
        case: Forecasts.of(table.scale.modes[case], table.scale.blocks[case])
        for case in table.cases
    }
    found = learn_deviations(table, known)[:, 0]
    assert found[0] == pytest.approx(0.05, rel=0.08)  # its own errors have no part in it
    assert (found[1:] > found[0]).all()
    rows = board_of(run)
    assert rows["point"]["stated"] == 0
    inside = 2.0 * norm.cdf(norm.ppf(0.95) * found / 0.05) - 1.0
    assert rows["point"]["above_coverage90"] == pytest.approx(inside.mean(), abs=0.01)
    # A job without a model counts as the textbook model with that deviation.
    assert [rows["lost"][f"above_{key}"] for key in ("skill", "low", "high")] == [0.0, 0.0, 0.0]
    first, std = known["s0"], np.full(50, found[0])
    assert rows["lost"]["above_crps_percent"] > rows["point"]["above_crps_percent"]
    own = crps_normal(first.error, std)
    assert first.figures(np.full(2, found[0]))[0].tolist() == pytest.approx([own.mean(), 0.0])
    few = board_of(run_with(textbook[:5], point=points[:5]))["point"]
    assert np.isnan([few[f"above_{key}"] for key in ("crps_percent", "coverage90", "skill")]).all()


def test_structures_weigh_alike_however_many_modes_they_have() -> None:
    own = [modes([0.0] * 50, 0.1), *[modes([0.1] * 2, 1e-6)] * (COUNT - 1)]
    run = run_with(drawn(0.1), sure=own)
    assert board_of(run)["sure"]["above_coverage90"] == pytest.approx(1.0 / COUNT)
    run.meta["structures"] = {f"s{k}": "one" for k in range(COUNT - 1)}
    assert board_of(run)["sure"]["above_coverage90"] == pytest.approx(0.5 / (COUNT - 1))


def test_a_lost_mode_costs_the_cap_and_no_mode_costs_more() -> None:
    lost = [PairedMode(2, 210.0, None, None), PairedMode(3, 220.0, -5.0, 0.9)]
    (far,) = modes([0.6], 0.01)
    run = run_with(drawn(0.1), own=[[*modes([0.0], 0.01), *lost, far]] * COUNT)
    row, cap = board_of(run)["own"], np.log(1.4)
    exact = crps_normal(np.zeros(1), np.full(1, 0.01))[0]
    assert row["above_crps_percent"] == pytest.approx(25.0 * (exact + 3.0 * cap))
    assert row["above_coverage90"] == pytest.approx(0.25)


def test_what_else_may_stand_for_a_mode_shares_its_score() -> None:
    """A second mode that the sensors see as well, ten percent off, halves what the first earns."""
    (one,) = modes([0.0], 0.01)
    two = structs.replace(one, candidates=(PartnerCandidate(200.0 * np.exp(0.1), 1.0, 1.0),))
    textbook = [[*m, PairedMode(9999, 900.0, 900.0, 1.0)] for m in drawn(0.1)]
    found = board_of(run_with(textbook, one=[[one]] * COUNT, two=[[two]] * COUNT))
    parts = crps_normal(np.array([0.0, 0.1]), np.full(2, 0.01))
    for name, expected in (("one", parts[0]), ("two", parts.mean())):
        assert found[name]["above_crps_percent"] == pytest.approx(100.0 * expected)
        assert found[name]["above_coverage90"] == 1.0


def test_modified_modes_in_the_given_band_stand_apart() -> None:
    run = run_with(drawn(0.1), own=drawn(0.01, 0.01))
    for k in range(COUNT):
        below = {"mode": 1, "measured_hz": 90.0, "predicted_hz": 91.8, "mac": 1.0}
        block = {"rms_percent": 2.0, "modes": [{**below, "modification": "mass"}]}
        run.meta["models"][f"s{k}"]["drawn"]["modified"] = block
        better = PairedMode(1, 90.0, 90.0, 1.0, "mass", 0.09)
        run.results[k].blocks["modified"] = Block(0.0, 1.0, (better,))  # type: ignore[index]
    row = board_of(run)["own"]
    exact = crps_normal(np.zeros(1), np.full(1, 0.001))[0]
    assert row["band_crps_percent"] == pytest.approx(100.0 * exact)
    bar = board_of(run_with(drawn(0.1), own=drawn(0.01, 0.01)))["own"]
    assert row["above_crps_percent"] == bar["above_crps_percent"]
    assert row["band_skill"] > 0.9


def test_a_built_in_strategy_says_how_sure_it_is() -> None:
    (result,) = femubench.rank(CASE, ["bayesian"], nominal="drawn").results
    assert result.status == "ok"
    stds = [m.predicted_std_hz for b in result.blocks.values() for m in b.modes]
    assert all(std is not None and std > 0.0 for std in stds)


def test_samples_of_a_model_in_groups_hold_the_whole_alone() -> None:
    """Groups are as large as the whole each: of 64 samples they took gigabytes."""
    model = replace(CASE.model, structure=None, groups={"all": CASE.model.stiffness})

    def softer(q: femubench.fem.FloatArray) -> Model:
        own = np.exp(q[0]) * model.stiffness
        return replace(model, stiffness=own, groups={"all": own})

    found = Uncertainty.draw(softer, np.zeros(1), np.array([[0.01]]))
    assert not any(sample.groups for sample in found.samples)
    ratios = [solve_modes(s).eigenvalues[-1] for s in found.samples]
    assert np.log(ratios).std() == pytest.approx(0.1, rel=1e-6)
