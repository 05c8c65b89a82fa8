"""Updating by frequency responses: factors of a known truth, refusals, where it starts."""

from __future__ import annotations

import json
import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distributions import install_module
from response_problems import DAMPING, simulate, simulated_case

import femubench
from femubench import NotApplicable
from femubench.core.case.writing import write_case
from femubench.core.library.rank import plan_run
from femubench.core.plugin.loader import load_plugins
from femubench.core.run.jobs import Job, execute
from femubench.core.schema.records import run_from_json, run_to_json
from femubench.core.schema.run_options import RunKeywords
from femubench.core.score.responses import score_responses
from femubench.core.update.response_residuals import ResponseTargets
from femubench.core.update.sensitivity_update import Iteration
from femubench.fem import Place, PointMass
from femubench.plugins.strategies.bayesian_responses import BayesianResponses
from femubench.plugins.strategies.response_function import ResponseFunction
from femubench.reports.runs import TerminalReporter
from femubench.update import Changes, UpdateOptions
from tests.command import call_bench

FACTORS = np.array([1.12, 0.9, 1.05])
RNG = np.random.default_rng(0)


def deviations_off(draws: range) -> np.ndarray:  # type: ignore[type-arg]
    """Return how far the factors are off in their stated deviations, (draws, 3)."""
    model, test = simulate(FACTORS)
    found = []
    for draw in draws:
        noisy = test.with_noise(np.random.default_rng(draw))
        parameters = ResponseFunction().update(model, noisy, RNG).parameters
        after, std = np.array([(p.after, p.std) for p in parameters], dtype=float).T
        found.append((after - FACTORS) / std)
    return np.array(found)


def test_factors_lie_within_two_stated_deviations() -> None:
    off = deviations_off(range(20))
    assert (np.abs(off) < 2.0).all(axis=1).sum() >= 17
    assert 0.7 < off.std() < 1.3  # nor are they wider than the noise


@pytest.mark.nightly
def test_factors_lie_within_two_stated_deviations_in_ninety_of_a_hundred_draws() -> None:
    off = np.abs(deviations_off(range(100))) < 2.0
    assert off.all(axis=1).sum() >= 90
    assert (off.sum(axis=0) >= 93).all()


def test_far_factors_are_found_from_where_the_frequencies_lead() -> None:
    """Responses alone stay at a wrong resonance."""
    far = np.array([2.0, 0.5, 1.0])
    model, test = simulate(far)
    noisy = test.with_noise(np.random.default_rng(1))
    found = [p.after for p in ResponseFunction().update(model, noisy, RNG).parameters]
    assert found == pytest.approx(far, rel=0.01)
    parametric = Changes(model).parameterise("members")
    alone = Iteration(parametric, ResponseTargets(noisy), ResponseFunction().options).run()
    assert np.abs(np.exp(alone.q) / far - 1.0).max() > 0.3


def test_what_no_factor_follows_widens_the_deviations() -> None:
    model, test = simulate(FACTORS)
    responses = test.responses
    assert responses is not None
    heavy = model.attach([PointMass(Place(joint="B"), 0.05)], [])
    stated = [
        np.array([p.std for p in ResponseFunction().update(m, test, RNG).parameters], dtype=float)
        for m in (model, heavy)
    ]
    assert (stated[1] > 2.0 * stated[0]).all()


def test_a_channel_that_was_not_measured_says_nothing() -> None:
    model, test = simulate(FACTORS)
    responses = test.responses
    assert responses is not None
    values = responses.values.copy()
    values[:, 2] = np.nan  # what the prior pulls is a millionth
    holed = replace(test, responses=replace(responses, values=values))
    found = ResponseFunction().update(model, holed, RNG)
    assert [p.after for p in found.parameters] == pytest.approx(FACTORS, rel=1e-5)


def test_without_responses_it_is_not_applicable() -> None:
    case = femubench.cases["frame"]
    parts = (ResponseFunction(), case.model, case.used_measurement())
    outcome = execute(Job(*map(pickle.dumps, parts), words=(1,)))
    assert (outcome.status, outcome.reason) == (
        "not-applicable",
        "needs frequency responses: declare frfs and responses in [measurement] of the case",
    )
    with pytest.raises(NotApplicable, match="no frequency responses"):
        femubench.strategies["bayesian"](responses=True).update(
            case.model, case.used_measurement(), RNG
        )


def test_held_out_responses_are_scored_in_decibels() -> None:
    """Against a plain sum over lines and sensors of what dense solutions give."""
    case = simulated_case(FACTORS)
    frfs = case.frfs
    assert frfs is not None
    assert frfs.deviations is not None
    modes, rows = femubench.solve_modes(case.model), case.model.observe(frfs.responses)
    ratio = np.full(len(modes), np.median(DAMPING))
    ratio[:4] = DAMPING  # the nominal model has its modes in the order of the measured ones
    mass = case.model.mass.toarray()
    weighted = mass @ modes.shapes
    viscous = (weighted * (2.0 * ratio * np.sqrt(modes.eigenvalues))) @ weighted.T
    pairs, noise, turned = [], [], []
    for f, hertz in enumerate(frfs.frequencies):
        w = 2.0 * np.pi * hertz
        dynamic = case.model.stiffness.toarray() - w**2 * mass + 1j * w * viscous
        found = rows @ np.linalg.solve(dynamic, rows[[0]].toarray()[0])
        for o, label in enumerate(frfs.responses.labels):
            known = hertz < 250.0 and label == frfs.responses.labels[-1]
            if known or hertz > 255.0:
                size = abs(frfs.values[f, o, 0])
                pairs.append((abs(found[o]), size))
                turned.append(abs(np.angle(found[o] / frfs.values[f, o, 0])))
                noise.append(20.0 / np.log(10.0) * min(frfs.deviations[f, o, 0] / size, 1.0))
    scored = score_responses(case, case.model)
    assert scored is not None
    assert scored.count == len(pairs)
    least = 1e-6 * max(size for _, size in pairs)  # 120 dB below the largest nothing is resolved
    errors = [20.0 * np.log10(np.hypot(a, least) / np.hypot(b, least)) for a, b in pairs]
    assert scored.rms_db == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-6)
    assert scored.floor_db == pytest.approx(np.sqrt(np.mean(np.square(noise))), rel=1e-6)
    assert scored.phase_deg == pytest.approx(np.degrees(np.sqrt(np.mean(np.square(turned)))))
    assert score_responses(replace(case, split=None), case.model) is None
    truth = Changes(case.model).parameterise("members").at(np.log(FACTORS))
    best = score_responses(case, truth)
    assert best is not None
    assert best.rms_db == pytest.approx(best.floor_db, rel=0.1)
    assert scored.rms_db > 3.0 * best.rms_db
    # What symmetry forbids was read as rounding: no model is wrong by hundreds of decibels there.
    still = replace(
        frfs, values=np.where(np.arange(frfs.values.shape[1])[:, None] == 1, 1e-30, frfs.values)
    )
    crossed = score_responses(replace(case, frfs=still), case.model)
    assert crossed is not None
    assert crossed.rms_db < 150.0


def test_unasked_it_runs_only_where_a_case_has_responses(tmp_path: Path) -> None:
    case, plugins = simulated_case(FACTORS), load_plugins()
    write_case(tmp_path / "with", case)
    write_case(tmp_path / "without", replace(case, split=None))
    ran = {}
    for name in ("with", "without"):
        plan = plan_run([tmp_path / name], (), plugins, {"nominal": "drawn"})
        ran[name] = [strategy.name for strategy in plan.strategies]
    assert ran["with"] == [n for n, s in plugins.strategies.items() if not s.on_request]
    own = {"response-function", "antiresonances", "bayesian-responses"}
    assert ran["without"] == [name for name in ran["with"] if name not in own]


@pytest.mark.slow(30)
def test_a_run_shows_responses_next_to_gains_that_are_as_without(tmp_path: Path) -> None:
    case = simulated_case(FACTORS)
    write_case(tmp_path / "with", case)
    write_case(tmp_path / "without", replace(case, split=None))
    given = RunKeywords(twins=0, nominal="drawn")
    run = femubench.rank(tmp_path / "with", ["unchanged", "response-function"], jobs=1, **given)
    frame = run.table.set_index("strategy")
    found = frame.loc["response-function"]
    assert found["responses_db"] == pytest.approx(found["responses_floor_db"], rel=0.1)
    assert frame.loc["unchanged", "responses_db"] > 3.0 * found["responses_db"]
    plain = femubench.rank(tmp_path / "without", ["unchanged"], jobs=1, **given)
    (one,), (other,) = plain.results, [r for r in run.results if r.strategy == "unchanged"]
    assert (one.blocks, one.gain, one.responses) == (other.blocks, other.gain, None)
    text = TerminalReporter().render(run)
    assert "resp." in text
    assert "resp." not in TerminalReporter().render(plain)
    again = run_from_json(run_to_json(run))
    assert [r.responses for r in again.results] == [r.responses for r in run.results]


@pytest.mark.slow(20)
def test_a_method_of_the_docs_passes_the_checks_and_is_ranked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As printed, in a package of its own; it finds the factors by another residual than ours."""
    text = (Path(__file__).parents[1] / "docs" / "plugins.md").read_text(encoding="utf-8")
    (source,) = re.findall(r"```python\n# my_responses\.py\n(.*?)```", text, re.DOTALL)
    assert len(source.splitlines()) <= 60
    install_module(tmp_path, "my_responses", source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    done = call_bench("plugins", "check", "line-by-line")
    assert ", 0 failed, 0 warnings" in done.output
    write_case(tmp_path / "case", simulated_case(FACTORS))
    words = ["line-by-line", "unchanged"]
    options = [word for name in words for word in ("-s", name)]
    call_bench("run", "case", *options, "-q", "--json", "run.json")
    found = {r["strategy"]: r for r in json.loads(Path("run.json").read_text())["results"]}
    after = [p["after"] for p in found["line-by-line"]["parameters"]]
    assert after == pytest.approx(FACTORS, rel=0.04)
    levels = [found[name]["responses"]["rms_db"] for name in words]
    assert levels[0] < 0.3 * levels[1]


def unknown_noise_off(draws: range) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Return how far factors are off in their stated deviations, and these over those known."""
    model, test = simulate(FACTORS)
    responses, off, wider = test.responses, [], []
    assert responses is not None
    assert responses.deviations is not None
    share = np.linspace(0.2, 5.0, responses.deviations.shape[1])[:, None]
    claimed = replace(responses, deviations=responses.deviations * share)
    for draw in draws:
        noisy = test.with_noise(np.random.default_rng(draw))
        assert noisy.responses is not None
        values = replace(claimed, values=noisy.responses.values)
        stated = []
        for own in (values, noisy.responses):
            found = BayesianResponses(changes="members").update(
                model, replace(noisy, responses=own), RNG
            )
            stated.append(np.array([(p.after, p.std) for p in found.parameters], dtype=float).T)
        off.append((stated[0][0] - FACTORS) / stated[0][1])
        wider.append(stated[0][1] / stated[1][1])
    return np.array(off), np.array(wider)


@pytest.mark.slow(20)
def test_noise_that_was_stated_wrongly_is_found_with_the_factors() -> None:
    """A channel was said to be five times as noisy as another is: answers are as with the truth."""
    off, wider = unknown_noise_off(range(10))
    assert (np.abs(off) < 2.0).all(axis=1).sum() >= 8
    assert wider == pytest.approx(np.ones_like(wider), rel=1e-3)
    with pytest.raises(ValueError, match="needs responses=true"):
        UpdateOptions(unknown_noise=True)


def test_what_unknown_noise_takes_is_the_curvature_of_the_sum_of_logarithms() -> None:
    """Of a linear model, with the factors of the channels at their best everywhere."""
    _, test = simulate(FACTORS, lines=4)
    responses, rng = test.responses, np.random.default_rng(0)
    assert responses is not None
    data = ResponseTargets(test)
    jacobian = rng.standard_normal((2 * responses.values.size, 2))
    values = data.weigh(responses.with_noise(rng).values - responses.values)
    channel = np.tile(np.arange(responses.values.size) % responses.values[0].size, 2)
    scale = np.sqrt([np.square(values[channel == c]).mean() for c in range(channel.max() + 1)])
    residual, jacobian = values / scale[channel], jacobian / scale[channel, None]

    def cost(x: np.ndarray) -> float:  # type: ignore[type-arg]
        left = np.square(residual - jacobian @ x)
        return 4.0 * sum(np.log(left[channel == c].sum()) for c in range(len(scale)))

    step = 1e-3 * np.eye(2)
    curvature = [
        [cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b) for a in step] for b in step
    ]
    expected = jacobian.T @ jacobian - data.conceded(jacobian, residual)
    assert np.array(curvature) / 4e-6 == pytest.approx(expected, rel=1e-4)


@pytest.mark.nightly
def test_deviations_of_unknown_noise_are_those_of_the_factors() -> None:
    """Of exact ones 95 in 100 draws lie within two of a factor, and 91, so correlated, of all."""
    off, _ = unknown_noise_off(range(100))
    within = np.abs(off) < 2.0
    assert (within.sum(axis=0) >= 91).all()
    assert within.all(axis=1).sum() >= 85
    assert np.sqrt(np.mean(np.square(off), axis=0)) == pytest.approx(np.ones(3), abs=0.15)
