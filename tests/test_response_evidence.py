"""Diagnosis with antiresonances next to modes: their slopes, their density, what a case says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from response_problems import simulate, simulated_case
from scipy.integrate import quad

from femubench import InputError, read_case
from femubench.core.case.writing import write_case
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.fit.modal_fit import state_at
from femubench.core.inference.coordinates import modes_for
from femubench.core.inference.examine import Examination, examine, pose_problem
from femubench.core.inference.response_evidence import (
    JointEvidence,
    Witness,
    log_scaled_density,
    weigh_by_antiresonances,
)
from femubench.core.modal.measurement import Measurement
from femubench.update import Changes

FACTORS = np.array([1.0, 0.8, 1.0])


def test_slopes_to_every_element_are_those_of_differences() -> None:
    model, test = simulate(np.ones(3), lines=300, highest=700.0)
    problem, _ = pose_problem(model, replace(test, responses=None), (), 0.0)
    witness = Witness.of(model, state_at(problem, (), np.zeros(0)), test)
    assert witness is not None
    assert len(witness) > 4
    slopes = witness.slopes(modes_for(model))
    n, step = len(problem.data), 1e-4
    for word, name in (("elements", "element stiffness"), ("density", "density of everything")):
        parametric = Changes(model).parameterise(word)
        for column, each in zip(slopes[name][n:].T, np.eye(len(parametric)), strict=False):
            low, high = (witness.predicted(parametric.at(sign * step * each)) for sign in (-1, 1))
            rise = (high - low) / (2.0 * step) / witness.zeros.std
            rise = rise / parametric.growth(np.zeros(len(parametric)))[each > 0.0]
            assert column == pytest.approx(rise, rel=0.02, abs=0.02 * np.abs(rise).max())


def examined(test: Measurement, model: object) -> Examination:
    """Return what modes alone say, without scatter and model error."""
    return examine(model, replace(test, responses=None), (), tolerance=0.0)  # type: ignore[arg-type]


def test_their_density_is_that_given_the_frequencies() -> None:
    """An error of a measured frequency is one of the antiresonances too, by known shares."""
    model, test = simulate(np.array([1.01, 0.99, 1.0]), lines=300, highest=700.0)
    seen = examined(test, model)
    witness = Witness.of(model, seen.nominal, test)
    assert witness is not None
    joint = JointEvidence.of(seen, witness)
    (nothing,) = seen.posterior.explanations
    apart = witness.apart(witness.drawn)
    rest = apart - witness.rows.shares @ seen.nominal.raw[: len(test)]
    expected = log_scaled_density(float(rest @ rest), len(rest))
    assert joint.log_evidence(nothing) == pytest.approx(expected, rel=1e-9)
    assert (witness.rows.shares.sum(axis=1) > 0.0).all()
    weighed = weigh_by_antiresonances(seen, test.responses)
    assert weighed.antiresonances == len(witness)
    assert weighed.posterior.nothing.further == pytest.approx(expected)
    assert weigh_by_antiresonances(seen, None) is seen


def test_stated_deviations_may_all_be_too_small() -> None:
    """Against the integral over one factor s > 1 with p(s) ~ 1 / s."""
    for misfit, count in ((0.0, 3), (5.0, 8), (300.0, 400), (4640.0, 12)):
        half = 0.5 * misfit
        density, _ = quad(
            lambda u, h=half, k=count: 2.0 * np.exp(-h * u * u) * u ** (k - 1), 0.0, 1.0, epsabs=0.0
        )
        assert log_scaled_density(misfit, count) == pytest.approx(np.log(density), abs=1e-6)
    assert np.isfinite(log_scaled_density(0.0, 900))


def test_a_reference_has_responses_of_its_own(tmp_path: Path) -> None:
    case, (_, before) = simulated_case(FACTORS), simulate(np.ones(3))
    assert case.split is not None
    assert before.responses is not None
    whole = case.split.whole.given(before.responses)
    with_both = replace(
        case, reference=replace(before, responses=whole), reference_used=before.numbers
    )
    write_case(tmp_path / "case", with_both)
    back = read_case(tmp_path / "case")
    assert back.reference is not None
    assert back.reference.responses is not None
    assert np.array_equal(back.reference.responses.values, whole.values)
    notes = [note for note in diagnose(back).notes if "antiresonance" in note]
    assert len(notes) == 1
    file = tmp_path / "case" / "case.toml"
    text = file.read_text(encoding="utf-8")
    assert 'frfs = "reference-frfs.npz"' in text
    file.write_text(
        "\n".join(line for line in text.splitlines() if not line.startswith("responses")),
        encoding="utf-8",
    )
    with pytest.raises(InputError, match="no bands of the responses"):
        read_case(tmp_path / "case")
