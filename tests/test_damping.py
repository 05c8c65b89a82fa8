"""Damping of a model, in its receptances and in the score, against direct solutions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from response_problems import simulate, simulated_case

from femubench import InputError, Model, read_case
from femubench.core.case.writing import write_case
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.score.responses import score_responses
from femubench.fem import Damping
from femubench.update import Changes

OWN = Damping(alpha=4.0, beta=2e-6, eta=0.015)


def damped(model: Model, damping: Damping = OWN) -> Model:
    """Return the model of a frame with damping of its own."""
    assert model.structure is not None
    return Model.of(replace(model.structure.frame, damping=damping))


def test_receptances_are_those_of_direct_solutions() -> None:
    model, test = simulate(np.ones(3), lines=9)
    model = damped(model)
    answer = PredictedResponses.of(model, test)
    readings, forces = (rows.toarray() for rows in answer.at[:2])
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    for hertz, found in zip(answer.at[2], answer.receptances, strict=True):
        w = 2.0 * np.pi * hertz
        viscous = OWN.alpha * mass + OWN.beta * stiffness
        dynamic = (1.0 + 1j * OWN.eta) * stiffness - w**2 * mass + 1j * w * viscous
        exact = readings @ np.linalg.solve(dynamic, forces.T)
        assert found == pytest.approx(exact, rel=1e-8, abs=1e-9 * np.abs(exact).max())


def test_their_slopes_are_those_of_differences() -> None:
    model, test = simulate(np.ones(3), lines=9)
    parametric, step = Changes(damped(model)).parameterise("members"), 1e-5
    x = np.log([1.1, 0.9, 1.0])
    there = parametric.at(x)
    slopes = PredictedResponses.of(there, test).slopes(parametric.slopes(x, there))
    for p, each in enumerate(np.eye(3)):
        low, high = (
            PredictedResponses.of(parametric.at(x + sign * step * each), test).receptances
            for sign in (-1.0, 1.0)
        )
        rise = (high - low) / (2.0 * step)
        own = slopes[..., p] * parametric.steps(x)[p]
        assert own == pytest.approx(rise, rel=1e-5, abs=1e-5 * np.abs(rise).max())


def test_a_case_states_it_and_the_score_judges_by_it(tmp_path: Path) -> None:
    case = simulated_case(np.ones(3), noise=1e-4)
    plain = score_responses(case, case.model)
    write_case(tmp_path / "case", replace(case, model=damped(case.model, Damping(eta=0.2))))
    back = read_case(tmp_path / "case")
    assert back.model.damping == Damping(eta=0.2)
    own = score_responses(back, back.model)
    assert plain is not None
    assert own is not None
    assert own.rms_db > 10.0 * plain.rms_db
    file = tmp_path / "case" / "case.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("eta = 0.2", "eta = -0.2"), encoding="utf-8")
    with pytest.raises(InputError, match="the loss factor") as refused:
        read_case(tmp_path / "case")
    assert "\n" not in str(refused.value)
