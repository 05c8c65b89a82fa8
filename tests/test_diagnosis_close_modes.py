"""Repeated modes: only the space that they span is measured, whatever shapes a test gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import (
    case_of,
    catalogue,
    coordinates,
    effects_named,
    measured,
    part_at,
    problem_of,
)

from femubench import Measurement, Model, diagnose, solve_modes
from femubench.core.fit.modal_fit import state_at
from femubench.fem import Frame, Joint, Material, Member, Section

CORNERS = {"A": (0.0, 0.0, 0.0), "B": (1.0, 0.0, 0.0), "C": (1.0, 1.0, 0.0), "D": (0.0, 1.0, 0.0)}
TUBE, ALUMINIUM = Section.rectangular_tube(0.03, 0.03, 0.003), Material(7e10, 0.33, 2700.0)
FRAME = Frame(
    "out-of-plane",
    "euler-bernoulli",
    tuple(Joint(name, xyz, "L") for name, xyz in CORNERS.items()),
    tuple(Member(a + b, (a, b), 4, TUBE, ALUMINIUM) for a, b in ("AB", "BC", "CD", "DA")),
)
MODEL = Model.of(FRAME)
NAMES = ("youngs-modulus", "density", "torsion-constant", "member-stiffness", "added-mass")
PAIR = [2, 3]


def turned(test: Measurement, angle: float) -> Measurement:
    """Return a test that found other shapes of the same pair."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shapes = test.shapes.copy()
    shapes[:, PAIR] = shapes[:, PAIR] @ turn
    return replace(test, shapes=shapes)


def test_the_square_has_a_pair_of_one_frequency() -> None:
    hertz = solve_modes(MODEL).elastic.natural_frequencies
    assert hertz[PAIR[0]] == pytest.approx(hertz[PAIR[1]], rel=1e-9)


@pytest.mark.parametrize(("angle", "tolerance"), [(0.0, 0.0), (0.65, 0.005)])
def test_a_modulus_that_is_low_is_named_whatever_shapes_the_pair_has(
    angle: float, tolerance: float
) -> None:
    truth = catalogue()["youngs-modulus"].extend(MODEL, "all", (-0.1,))
    test = measured(truth, FRAME, count=5, shapes=5, rng=np.random.default_rng(1))
    case = replace(case_of(MODEL, turned(test, angle), 5), tolerance=tolerance)
    found = diagnose(case, effects_named(*NAMES), pairs=False)
    assert found.verdict == "named"
    assert [cause.effect for cause in found.causes] == ["youngs-modulus"]
    assert found.adequacy_p > 0.05


@pytest.mark.parametrize("angle", [0.0, 0.65])
def test_what_splits_the_pair_is_seen_in_its_shapes(angle: float) -> None:
    """A softer member fixes the shapes of both: turned ones are then wrong."""
    truth = catalogue()["member-stiffness"].extend(MODEL, "AB", (-0.25,))
    test = turned(measured(truth, FRAME, count=5, shapes=5), angle)
    problem = problem_of(MODEL, test, effects_named("member-stiffness"))
    part = part_at(problem, "member-stiffness", "AB")
    chi2 = state_at(problem, (part,), coordinates(part, (-0.25,))).chi2
    assert (chi2 < 1.0) is (angle == 0.0)


def test_the_slopes_are_those_of_what_is_predicted() -> None:
    """A uniform change turns nothing; a mass that splits the pair moves its frequencies."""
    test = turned(measured(MODEL, FRAME, count=5, shapes=5), 0.4)
    problem = problem_of(MODEL, test, effects_named("youngs-modulus", "torsion-constant"))
    for name in ("youngs-modulus", "torsion-constant"):
        part = part_at(problem, name, "all")
        x = np.array([0.1])
        slope = state_at(problem, (part,), x).jacobian[:, 0]
        ends = [state_at(problem, (part,), x + s * 1e-4).residual for s in (1.0, -1.0)]
        assert slope == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=1e-3, abs=0.02)
