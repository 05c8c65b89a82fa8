"""The third generator: frames meet a closed form, contact a linear test, cases their files."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from femubench import read_case
from femubench.core.challenge.truth_file import read_truth
from truths.posing import SHEAR, SHEAR_STRUCTURES
from truths.shear_bumpers import Bumper, identify
from truths.shear_cases import draws, files_of, healthy, structure_files
from truths.shear_frames import MASS, STIFFNESS, Frame, drawn, modes, plans

DRAWS = {draw.name: draw for draw in draws()}


@pytest.mark.parametrize("hangs", [True, False])
@pytest.mark.parametrize("storeys", [3, 8])
def test_without_coupling_a_uniform_frame_is_a_chain(hangs: bool, storeys: int) -> None:
    count = storeys + hangs
    frame = Frame(
        hangs,
        np.full(count, MASS),
        np.full(storeys, STIFFNESS),
        columns=np.zeros(storeys),
        girders=np.inf,
        pieces=1,
    )
    r = np.arange(1, storeys + 1)
    angle = r / (2.0 * count) if hangs else (2.0 * r - 1.0) / (4.0 * storeys + 2.0)
    chain = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin(np.pi * angle)
    np.testing.assert_allclose(modes(frame)[0][-storeys:], chain, rtol=1e-6)


@pytest.mark.parametrize("plan", plans(), ids=lambda plan: plan.name)
def test_a_frame_is_as_stored_and_its_drawing_some_percent_off(plan) -> None:  # noqa: ANN001
    for name, text in structure_files(plan).items():
        assert (SHEAR_STRUCTURES / plan.name / name).read_text(encoding="utf-8") == text
    case = read_case(SHEAR_STRUCTURES / plan.name)
    assert len(case.model.groups) == plan.storeys
    assert case.model.total_mass == pytest.approx(drawn(plan)[0].sum(), rel=1e-9)
    found = np.linalg.eigvals(
        np.linalg.solve(case.model.mass.toarray(), case.model.stiffness.toarray())
    )
    hertz = np.sort(np.sqrt(np.abs(found)))[plan.hangs :] / (2.0 * np.pi)
    error = hertz[: plan.used] / healthy(plan).frequencies[: plan.used] - 1.0
    assert 0.002 < np.abs(error).max() < 0.06


def test_the_committed_cases_are_those_that_are_drawn() -> None:
    assert {file.parent.name for file in SHEAR.glob("*/truth.toml")} == set(DRAWS)
    assert Counter(read_truth(SHEAR / name).kind for name in DRAWS) == {"defect": 24, "clean": 6}
    for name, draw in DRAWS.items():
        truth = read_truth(SHEAR / name)
        assert (truth.structure, truth.seed) == (draw.plan.name, draw.seed)
        assert truth.held is (plans().index(draw.plan) >= 5)
        causes = [] if draw.fault is None else [draw.fault.cause.what]
        assert [cause.what for cause in truth.causes] == causes


def test_the_generator_gives_a_stored_state_again() -> None:
    draw = next(draw for draw in DRAWS.values() if "storey" in draw.name)
    for name, text in files_of(draw).items():
        assert (SHEAR / draw.name / name).read_text(encoding="utf-8") == text


@pytest.mark.nightly
def test_a_bumper_out_of_reach_leaves_the_modes_of_the_frame() -> None:
    draw = next(draw for draw in DRAWS.values() if draw.fault and draw.fault.bumper)
    assert draw.fault is not None
    omega, shapes = identify(draw.frame, Bumper(1, 2, STIFFNESS, gap=20.0), 2, seed=1)
    own = modes(draw.frame)
    elastic = own[0] > 0.0
    np.testing.assert_allclose(omega, own[0][elastic][:2], rtol=1e-5)
    for one, other in zip(shapes, own[1][elastic], strict=False):
        assert abs(one @ other) / np.linalg.norm(one) / np.linalg.norm(other) > 1.0 - 1e-4
