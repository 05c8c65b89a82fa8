"""The frame paper's errors taken apart, and its figures: what must hold whatever comes out."""

from __future__ import annotations

import numpy as np
import pytest

from femubench.core.case.reader import read_case
from femubench.core.fem.frame import GroundSpring
from femubench.core.modal.eigen import solve_modes
from femubench.core.plugin.loader import load_plugins
from femubench.fem import Place
from femubench.papers import PAPERS
from femubench.papers.frame.causes import CAUSES, JOINTS, TORSION, Ladder, best_factor, shares_of
from femubench.papers.frame.changes import (
    SOLUTIONS,
    recover_change,
)
from femubench.papers.frame.receptances import (
    bundles,
)
from femubench.reproduction import Workbench
from femubench.results import stiffness_difference
from femubench.scenarios import HERE
from femubench.update import ElementFamily


@pytest.fixture(scope="module")
def bench() -> Workbench:
    cases = {name: read_case(HERE / name, name) for name in PAPERS["frame"]}
    return Workbench(load_plugins().strategies, cases)


@pytest.fixture(scope="module")
def ladder(bench: Workbench) -> Ladder:
    return Ladder.of(bench)


def worst(ladder: Ladder, causes: tuple[str, ...], factor: float = 1.0, **options: object) -> float:
    found = ladder.frequencies(ladder.frame(causes, **options))  # type: ignore[arg-type]
    scale = best_factor(found, ladder.measured) if factor == 0.0 else factor
    return float(np.abs(ladder.errors(scale * found)).max())


@pytest.mark.parametrize("accelerometer", [True, False])
def test_textbook_beams_meet_the_test_with_nothing_tuned(
    ladder: Ladder, accelerometer: bool
) -> None:
    options = {"young": 70e9, "accelerometer": accelerometer}
    assert worst(ladder, CAUSES[:2], **options) < 4.0
    assert worst(ladder, CAUSES[:2], factor=0.0, **options) < 2.0
    assert worst(ladder, (), **options) > 12.0
    assert worst(ladder, (), factor=0.0, **options) > 5.0


def test_rebuilt_textbook_frequencies(ladder: Ladder) -> None:
    found = ladder.frequencies(ladder.frame(CAUSES[:2], young=70e9, accelerometer=False))
    np.testing.assert_allclose(found, [235.3, 279.7, 556.8, 884.8, 1011.7], rtol=2e-3)


def test_steps_add_up_to_the_whole_error(ladder: Ladder) -> None:
    shares = shares_of(ladder)
    causes = sum(shares.mean[c] for c in CAUSES)
    np.testing.assert_allclose(causes + shares.complete, shares.whole, atol=1e-9)
    rest = shares.accelerometer + shares.young + shares.rest
    np.testing.assert_allclose(causes + rest, shares.whole, atol=1e-9)
    # All but mesh and mass matrix is then the beam model that meets the test.
    assert np.abs(shares.rest).max() < 0.1


def test_torsion_is_the_largest_cause_of_mode_1_in_both_orders(ladder: Ladder) -> None:
    shares = shares_of(ladder)
    for order in (shares.first, shares.last, shares.mean):
        assert order[TORSION][0] > 0.8 * shares.whole[0]
        assert order[TORSION][0] > 2.0 * max(order[c][0] for c in CAUSES if c != TORSION)
    # Flexible joints take over part of what torsion does, so a cause weighs less as the last.
    assert shares.last[JOINTS][0] < shares.mean[JOINTS][0] < shares.first[JOINTS][0]


def test_difference_matrix_is_symmetric_and_in_one_unit(bench: Workbench) -> None:
    model = bench.cases["frame"].model
    updated = bench.update("frame", "baruch").model
    change = stiffness_difference(model, updated)
    np.testing.assert_allclose(change, change.T, atol=1e-9 * np.abs(change).max())
    assert updated.stiffness_change is not None
    length = model.frame_structure.properties.length.mean()
    turns = np.array([d.startswith("r") for d in model.dofs.direction])
    scale = np.where(turns, 1.0 / length, 1.0)
    dense = updated.stiffness_change.toarray() * np.outer(scale, scale)
    assert np.linalg.norm(change) == pytest.approx(np.linalg.norm(dense), rel=1e-6)
    assert np.linalg.matrix_rank(change, tol=1e-8 * np.linalg.norm(change)) == 3


@pytest.mark.parametrize("words", SOLUTIONS.values())
def test_element_matrices_are_recovered_from_the_parameters(bench: Workbench, words: str) -> None:

    model = bench.cases["frame"].model
    structure = model.frame_structure
    result = bench.update("frame", words)
    family = ElementFamily.generic(structure, tied=words == "generic-adjusted")
    assembled = structure.plan.assemble(recover_change(family, result))
    expected = result.model.stiffness - model.stiffness
    assert abs(assembled - expected).max() < 1e-9 * abs(expected).max()


def test_stand_in_resonates_where_the_test_does(bench: Workbench) -> None:
    before, after = bundles(bench)
    case = bench.cases["frame-beam"]
    np.testing.assert_allclose(
        before.test.resonances[:5], bench.cases["frame"].measurement.frequencies, rtol=2e-4
    )
    stored = case.modifications[0].measurement.frequencies
    np.testing.assert_allclose(after.test.resonances[: len(stored)], stored, rtol=1e-5)


def test_antiresonances_are_those_of_the_held_structure(bench: Workbench) -> None:
    model = bench.cases["frame-beam"].model
    place = Place(member="front-left", s=0.5)
    held = solve_modes(model.attach((), (GroundSpring(place, "z", 1e13),))).natural_frequencies
    found = bundles(bench)[0].nominal.antiresonances[:4]
    assert all(np.abs(held / f - 1.0).min() < 1e-4 for f in found)
