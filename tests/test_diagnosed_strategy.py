"""`diagnosed`: what the drawing lacks goes into the model, the used frequencies are met last."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import run_jobs

from femubench import (
    Case,
    Measurement,
    Model,
    Sensors,
    UpdateResult,
    read_case,
    solve_modes,
)
from femubench.core.plugin.loader import load_plugins
from femubench.core.score.leaderboard import leaderboard
from femubench.fem import Frame, GroundSpring, Place, Preload
from femubench.modal import rigid_modes_of
from femubench.plugins.strategies.diagnosed import Diagnosed
from femubench.results import RunData
from femubench.scenarios import HERE
from femubench.update import with_measured_frequencies
from tests.simulated import modes_at

FrameBuilder = Callable[..., Frame]
USED, ALL = (1, 2, 3), (1, 2, 3, 4, 5, 6, 7, 8)
NO_SENSORS = Sensors((), np.zeros((0, 3)), ())


def measured(truth: Frame, numbers: tuple[int, ...] = USED, deviation: float = 2.5e-3) -> Any:
    """Return the lowest elastic modes of a frame, read at its joints across their plane."""
    model = Model.of(truth)
    direction = "x" if truth.plane == "in-plane" else "z"
    xyz = np.array([joint.xyz for joint in truth.joints])
    sensors = Sensors(tuple(j.name for j in truth.joints), xyz, (direction,) * len(xyz))
    found = modes_at(model, sensors, len(numbers), hertz_std=deviation)
    return replace(found, numbers=numbers)


def update(model: Model, measurement: Measurement, seed: int = 0, **options: Any) -> UpdateResult:
    return Diagnosed(**options).update(model, measurement, np.random.default_rng(seed))


def frequencies(model: Model, count: int) -> Any:
    return solve_modes(model).elastic.natural_frequencies[:count]


@pytest.fixture(scope="module")
def truth(ladder: FrameBuilder) -> Frame:
    """A ladder with shear, rotary inertia and Bredt's torsion constant on a finer mesh."""
    return ladder("timoshenko", polar=False, elements=6)


@pytest.fixture(scope="module")
def nominal(ladder: FrameBuilder) -> Model:
    """The ladder as its paper has it, with the polar moment for the torsion constant."""
    return Model.of(ladder(elements=2))


@pytest.fixture(scope="module")
def result(nominal: Model, truth: Frame) -> UpdateResult:
    return update(nominal, measured(truth))


def test_what_handbooks_give_is_no_parameter_and_the_rest_is_small(result: UpdateResult) -> None:
    kinds = {item.name.partition(" all")[0].partition(":")[0] for item in result.parameters}
    assert {"E", "GJ", "density"} < kinds
    assert not {"torsion-constant", "shear-deformation", "rotary-inertia"} & kinds
    assert result.parameter_count == len(result.parameters)
    assert all(abs(item.after) < 2.0 * item.std for item in result.parameters)
    figures = result.diagnostics
    assert figures["examined"] == 1.0
    assert figures["error_percent"] > 5.0 > 0.1 > figures["left_percent"]


def test_uncertainty_meets_what_is_measured_and_grows_beyond(
    result: UpdateResult, truth: Frame
) -> None:
    spread = result.uncertainty
    assert spread is not None
    assert spread.discrepancy_std == 0.005
    hertz = np.array([frequencies(sample, 8) for sample in spread.samples])
    assert len(hertz) >= 16
    np.testing.assert_allclose(hertz[:, :3], hertz[0, :3] * np.ones((len(hertz), 1)), rtol=1e-8)
    wanted = measured(truth, ALL).frequencies[3:]
    std = hertz[:, 3:].std(axis=0)
    assert (std > 0.005 * wanted).all()
    assert (np.abs(frequencies(result.model, 8)[3:] - wanted) < 1.645 * std).all()


def test_modes_that_were_not_given_are_predicted(
    result: UpdateResult, nominal: Model, truth: Frame
) -> None:
    wanted = measured(truth, ALL).frequencies[3:]
    before = np.abs(frequencies(nominal, 8)[3:] / wanted - 1.0)
    after = np.abs(frequencies(result.model, 8)[3:] / wanted - 1.0)
    assert np.median(after) < 0.25 * np.median(before)


def test_meeting_the_frequencies_moves_nothing_else(
    result: UpdateResult, nominal: Model, truth: Frame
) -> None:
    m = measured(truth)
    plain = update(nominal, m, seed=7, meet_frequencies=False)
    assert plain.parameters == result.parameters  # the same whatever the random numbers are
    assert plain.model.stiffness_change is None
    before, after = solve_modes(plain.model), solve_modes(result.model)
    assert np.abs(frequencies(plain.model, 3) / m.frequencies - 1.0).max() > 1e-6
    np.testing.assert_allclose(frequencies(result.model, 3), m.frequencies, rtol=1e-9)
    rest = slice(6, 20)
    np.testing.assert_allclose(after.eigenvalues[rest], before.eigenvalues[rest], rtol=1e-9)
    same = before.shapes[:, 3:6].T @ plain.model.mass_times(after.shapes[:, 3:6])
    np.testing.assert_allclose(np.abs(same), np.eye(3), atol=1e-6)
    assert int(after.rigid.sum()) == 3
    assert after.eigenvalues[0] >= 0.0


def test_a_model_that_lacks_nothing_stays_within_what_is_stated(ladder: FrameBuilder) -> None:
    same = ladder("timoshenko", polar=False, elements=3)
    model, m = Model.of(same), measured(same)
    found = update(model, m)
    assert found.diagnostics["error_percent"] < 0.05
    assert all(abs(item.after) < item.std for item in found.parameters)
    assert found.uncertainty is not None
    std = np.std([frequencies(sample, 8) for sample in found.uncertainty.samples], axis=0)
    moved = frequencies(found.model, 8) - frequencies(model, 8)
    assert (np.abs(moved) < np.maximum(std, 1e-3)).all()


def test_a_free_structure_stays_free(ladder: FrameBuilder) -> None:
    same = ladder("timoshenko", polar=False, elements=3)
    held = replace(same, springs=(GroundSpring(Place(joint="C"), "z", 2e5),))
    found = update(Model.of(same), measured(held, (1, 2, 3, 4)))  # a spring to ground is the truth
    assert rigid_modes_of(found.model).shape[1] == 3
    assert solve_modes(found.model).eigenvalues[0] >= -1e-3


def test_frequencies_alone_and_deviations_in_part(nominal: Model, truth: Frame) -> None:
    """One mode takes part in the naming, all three are met."""
    m = measured(truth)
    std = np.where(np.arange(3) == 1, m.frequency_std, np.nan)
    nothing = np.zeros((0, 3))
    bare = replace(m, sensors=NO_SENSORS, shapes=nothing, shape_std=nothing, frequency_std=std)
    found = update(nominal, bare)
    assert found.diagnostics["examined"] == 1.0
    assert found.diagnostics["left_percent"] < 0.5 < found.diagnostics["error_percent"]
    np.testing.assert_allclose(frequencies(found.model, 3), m.frequencies, rtol=1e-9)


def test_without_deviations_nothing_is_named(nominal: Model, truth: Frame) -> None:
    m = measured(truth)
    found = update(nominal, replace(m, frequency_std=np.full(3, np.nan)))
    assert found.diagnostics == {"examined": 0.0}
    assert found.parameters == ()
    assert found.model.stiffness is nominal.stiffness
    np.testing.assert_allclose(frequencies(found.model, 3), m.frequencies, rtol=1e-9)


def test_matrices_keep_their_dofs(nominal: Model, truth: Frame) -> None:
    m = measured(truth)
    found = update(replace(nominal, structure=None), m)
    assert found.model.structure is None
    assert found.model.size == nominal.size
    assert found.diagnostics == {"examined": 0.0}
    modes = solve_modes(found.model)
    assert int(modes.rigid.sum()) == 3
    assert modes.eigenvalues[0] >= -1e-6 * modes.elastic.eigenvalues[0]
    np.testing.assert_allclose(modes.elastic.natural_frequencies[:3], m.frequencies, rtol=1e-9)


def test_a_mode_that_matches_nothing_is_left_alone(nominal: Model, truth: Frame) -> None:
    m = measured(truth)
    strange = replace(m, frequencies=np.array([*m.frequencies[:2], 1e5]))
    met = with_measured_frequencies(nominal, strange)
    assert met.stiffness_change is not None
    assert len(met.stiffness_change.core) == 2
    alone = with_measured_frequencies(nominal, strange.select([3]))
    assert alone is nominal


def test_a_model_with_a_preload_can_leave_its_worker(nominal: Model) -> None:
    """The statics behind a preload are kept with the structure, and cannot be pickled."""
    frame = nominal.frame_structure.frame
    model = Model.of(replace(frame, preloads=(Preload("AB", 500.0),)))
    assert "statics" in model.frame_structure.kept
    again = pickle.loads(pickle.dumps(model))
    assert abs(again.stiffness - model.stiffness).max() == 0.0
    rebuilt = Model.of(again.structure)
    np.testing.assert_allclose(rebuilt.stiffness.toarray(), model.stiffness.toarray())


def _case(name: str, nominal: Model, measurement: Measurement) -> Case:
    return Case(name, name, "", Path(), nominal, measurement, USED, (4, 5, 6, 7, 8))


@pytest.fixture(scope="module")
def harness_run(nominal: Model, truth: Frame) -> RunData:
    """Two cases that differ in what is held out, and a solid twin, run in a worker process."""
    honest = measured(truth, ALL)
    scrambled = replace(
        honest,
        frequencies=np.array([*honest.frequencies[:3], *(0.7 * honest.frequencies[3:])]),
        shapes=np.hstack([honest.shapes[:, :3], honest.shapes[:, :2:-1]]),
    )
    cases = [
        _case("honest", nominal, honest),
        _case("scrambled", nominal, scrambled),
        read_case(HERE / "frame-solid", "frame-solid"),
    ]
    known = load_plugins().strategies
    names = ("berman", "baruch", "bayesian", "local", "diagnosed")
    return run_jobs(cases, [known[name] for name in names], jobs=1)


def test_held_out_modes_cannot_influence_it(harness_run: RunData) -> None:
    """Other held-out data, the same answer to the last digit; other predictions would be right."""
    found = {r.case: r for r in harness_run.results if r.strategy == "diagnosed"}
    one, two = found["honest"], found["scrambled"]
    assert (one.status, two.status) == ("ok", "ok"), one.reason + two.reason
    assert one.parameters == two.parameters
    assert one.diagnostics == two.diagnostics
    assert one.blocks["used"] == two.blocks["used"]
    assert one.blocks["higher"].rms_percent < 5.0 < two.blocks["higher"].rms_percent


def test_the_solid_twin_is_predicted_where_others_are_not(harness_run: RunData) -> None:
    chosen = [r for r in harness_run.results if r.case == "frame-solid"]
    errors = harness_run.meta["reference"]["frame-solid"]
    meta = {**harness_run.meta, "reference": {"frame-solid": errors}}
    board = leaderboard(RunData(meta, tuple(chosen))).set_index("strategy")
    assert board.index[0] == "diagnosed"
    assert board["gain"].idxmax() == "diagnosed"
    assert not board["unphysical"]["diagnosed"]
