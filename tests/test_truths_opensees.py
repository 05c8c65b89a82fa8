"""The second generator: its cases are as drawn, posable, and right in the words of the effects."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from femubench import read_case
from femubench.core.challenge.truth_file import read_truth
from femubench.core.fit.extended_model import raw_residual
from femubench.core.inference.examine import pose_problem
from femubench.core.plugin.loader import load_plugins
from truths.opensees_cases import (
    COUNTS,
    SCATTER,
    SHAPE_SCATTER,
    Observed,
    case_text,
    draws,
    files_of,
    mass_of,
    observed,
    recorded,
    with_faults,
)
from truths.opensees_frames import FREE, cut, plans
from truths.opensees_modes import environment
from truths.posing import OPENSEES, STRUCTURES, pose

pytestmark = pytest.mark.slow(20)

FOLDERS = sorted(file.parent for file in OPENSEES.glob("*/truth.toml"))
SHOWN = [folder for folder in FOLDERS if not read_truth(folder).held]
DRAWS = {draw.name: draw for draw in draws()}


def test_the_committed_cases_are_those_that_are_drawn() -> None:
    assert {folder.name for folder in FOLDERS} == set(DRAWS)
    assert Counter(draw.kind for draw in DRAWS.values()) == COUNTS
    for name, draw in DRAWS.items():
        truth = read_truth(OPENSEES / name)
        assert (truth.kind, truth.structure, truth.seed) == (draw.kind, draw.plan.name, draw.seed)
        for stated, fault in zip(truth.causes, draw.faults, strict=True):
            assert stated.size == (None if fault.size is None else pytest.approx(fault.size, 1e-3))
            for word in ("what", "effect", "place", "also", "unit"):
                assert getattr(stated, word) == getattr(fault, word)
    assert 8 <= len(SHOWN) <= 16


@pytest.mark.parametrize("name", sorted(plans()))
def test_structures_are_as_drawn(name: str) -> None:
    plan = plans()[name]
    assert (STRUCTURES / name / "case.toml").read_text(encoding="utf-8") == case_text(plan)
    case = read_case(STRUCTURES / name)
    assert case.model.total_mass == pytest.approx(plan.mass, rel=1e-6)
    assert mass_of(cut(plan)) == pytest.approx(plan.mass, rel=1e-9)
    assert len(case.used) == plan.used
    assert len(case.held_out) == plan.held_out


@pytest.mark.parametrize("folder", SHOWN, ids=lambda folder: folder.name)
def test_what_is_wrong_explains_the_data_by_the_effects_of_the_catalogue(
    folder: Path, tmp_path: Path
) -> None:
    """Two programs and two meshes: what the named effects of the stated sizes leave is noise."""
    truth, effects = read_truth(folder), load_plugins().effects
    if not all(cause.effect for cause in truth.causes):
        pytest.skip("no effect describes it")
    pose(folder, tmp_path / "case", suite=STRUCTURES)
    case = read_case(tmp_path / "case")
    problem, _ = pose_problem(case.model, case.used_measurement(), (), 0.0)
    model, before = case.model, raw_residual(problem, case.model)
    for cause in truth.causes:
        effect = effects[cause.effect]
        assert cause.place in effect.places(model)
        values = [
            cause.size if p.unit == cause.unit else None
            for p in effect.parameters(model, cause.place)
        ]
        if None in values:
            pytest.skip("it has a parameter that the truth takes as rigid")
        model = effect.extend(model, cause.place, [float(value or 0.0) for value in values])
    after = raw_residual(problem, model)
    assert truth.chi2 is not None
    # A spring behind half the depth of a tube is not quite one at the joint.
    assert after @ after < 1.6 * len(after)
    if truth.chi2 > 100.0:
        assert after @ after < before @ before


def test_a_recording_scatters_as_it_says() -> None:
    plan = plans()["arm-tower"]
    rng = np.random.default_rng(1)

    state = Observed(np.linspace(10.0, 100.0, 200), rng.standard_normal((200, len(plan.labels))))
    table = pd.read_csv(StringIO(recorded(plan.labels, state, 5)))
    drift = table["frequency"].to_numpy() / state.frequencies - 1.0
    assert drift.std() == pytest.approx(SCATTER, rel=0.15)
    assert (table["frequency_std"] / table["frequency"]).mean() == pytest.approx(SCATTER, rel=0.02)
    shapes = table[[label for label, *_ in plan.labels]].to_numpy()
    largest = np.take_along_axis(state.shapes, np.abs(state.shapes).argmax(1)[:, None], 1)
    true = state.shapes / largest
    scale = (shapes * true).sum(axis=1) / (true**2).sum(axis=1)
    assert (shapes - scale[:, None] * true).std() == pytest.approx(SHAPE_SCATTER, rel=0.15)


@pytest.fixture(scope="module")
def solver() -> None:
    around = environment()
    if around is None:
        pytest.skip("openseespy is not installed on this machine")
    command = [sys.executable, "-c", "import openseespy.opensees"]
    if subprocess.run(command, env=around, capture_output=True, check=False).returncode:
        pytest.skip("openseespy cannot be imported")


@pytest.mark.nightly
@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("name", sorted(plans()))
def test_an_end_on_rigid_springs_is_no_change_and_on_soft_ones_a_hinge(name: str) -> None:
    plan = plans()[name]
    sound = observed(cut(plan)).frequencies
    turns = [d for d in FREE[plan.plane] if d > 3]
    for joint in (plan.clamped[0], plan.bars[0].ends[1]):
        stiff, soft = cut(plan), cut(plan)
        for beams, stiffness in ((stiff, 1e10), (soft, 1.0)):
            springs = {str(d): stiffness for d in turns}
            beams.hinges.append((*beams.part(plan.bars[0].name, joint), springs))
        assert observed(stiff).frequencies == pytest.approx(sound, rel=1e-4)
        assert observed(soft).frequencies[0] < 0.999 * sound[0]


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("folder", SHOWN[:1], ids=lambda folder: folder.name)
def test_a_case_is_computed_again(folder: Path) -> None:
    files = files_of(DRAWS[folder.name])
    for name in ("modes.csv", "healthy.csv"):
        again, kept = pd.read_csv(StringIO(files[name])), pd.read_csv(folder / name)
        assert again["frequency"].to_numpy() == pytest.approx(kept["frequency"], rel=2e-6)
    assert mass_of(with_faults(DRAWS[folder.name])) > 0.0
    assert (
        files["truth.toml"].split("[visible]")[0]
        == ((folder / "truth.toml").read_text(encoding="utf-8").split("[visible]")[0])
    )
