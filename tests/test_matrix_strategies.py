"""Baruch, Berman and Kabe keep what they promise, on clean and on unpleasant cases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from femubench import (
    InputError,
    Measurement,
    Model,
    NotApplicable,
    Sensors,
    StrategyFailure,
    UpdateResult,
    solve_modes,
)
from femubench.core.modal.eigen import dense_matrices
from femubench.core.update import entries as entry_update
from femubench.core.update.dynamic import expand_measured_shapes, expand_one_by_dynamics
from femubench.core.update.entries import (
    EntryPattern,
    least_squares_change,
    null_space,
    smallest_change,
)
from femubench.core.update.promise import check_used_modes, measure_residuals
from femubench.fem import FloatArray, Frame, JointSpring, Place, Support
from femubench.modal import expand_by_dynamics, mac, pair_modes, rigid_modes_of
from femubench.plugins.strategies import baruch
from femubench.plugins.strategies.baruch import Baruch
from femubench.plugins.strategies.berman import Berman
from femubench.plugins.strategies.kabe import Kabe, KabeRigid
from femubench.update import QuasiModes, SelfCheckFailed
from tests.simulated import modes_at

PAPER = np.array([226.8, 275.2, 537.4])  # Hz, measured modes 1-3 of the paper's ladder
FrameBuilder = Callable[..., Frame]
Case = tuple[Model, Measurement]


def sensors_of(frame: Frame) -> Sensors:
    """Return one sensor a joint and one a member's middle, across the structure."""
    labels, points, directions = [], [], []
    places = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    lines = {m.name: places[m.ends[1]] - places[m.ends[0]] for m in frame.members}
    middles = {m.name: places[m.ends[0]] + 0.5 * lines[m.name] for m in frame.members}
    for name, point in (places | middles).items():
        flat = name in lines and abs(lines[name][2]) < 1e-9
        labels.append(name)
        points.append(point)
        directions.append("z" if frame.plane == "out-of-plane" or flat else "x")
    return Sensors(tuple(labels), np.array(points), tuple(directions))


def measured(truth: Frame, count: int, frequencies: Any = None) -> Measurement:
    """Return the lowest modes of a truth model at its sensors."""
    return modes_at(Model.of(truth), sensors_of(truth), count, hertz=frequencies)


@pytest.fixture(scope="module")
def frame_case(ladder: FrameBuilder) -> Case:
    """The paper's frame: printed frequencies, shapes of a Timoshenko model of the bare frame."""
    truth = ladder("timoshenko", polar=False, elements=12, E=71e9, accelerometer=False)
    return Model.of(ladder()), measured(truth, 3, PAPER)


@pytest.fixture(scope="module")
def cases(
    frame_case: Case, ladder: FrameBuilder, hframe: FrameBuilder, asymmetric_ladder: FrameBuilder
) -> dict[str, Case]:
    stiff: dict[str, Any] = {"polar": False, "elements": 12, "E": 71e9}
    truth = ladder("timoshenko", **stiff)
    model, data = frame_case
    gaps = data.shapes.copy()
    gaps[[2, 7, 9], [0, 1, 2]] = np.nan
    rng = np.random.default_rng(3)
    noise = 0.05 * np.abs(data.shapes).max(axis=0) * rng.standard_normal(data.shapes.shape)
    held = (Support(Place(joint="A"), ("z", "rx", "ry")),)
    soft = tuple(JointSpring(j, "horizontal", {"ry": 2.85e5}, 0.02) for j in ("T1", "T2"))
    arms = tuple(
        JointSpring(j, "horizontal", {"x": 3.3e9, "z": 4.48e9, "ry": 3.02e6}, 0.02, 5.0)
        for j in ("T1", "T2")
    )
    h_data = measured(hframe(joint_springs=soft), 5)
    return {
        "frame": frame_case,
        "two modes": (model, data.select([1, 2])),
        "noise": (model, replace(data, shapes=data.shapes + noise)),
        "gaps": (model, replace(data, shapes=gaps)),
        "timoshenko": (Model.of(ladder("timoshenko")), measured(truth, 3, PAPER)),
        "asymmetric": (
            Model.of(ladder(stretch=1.04)),
            measured(asymmetric_ladder(1.0, beam="timoshenko", **stiff), 3),
        ),
        "supported": (
            Model.of(replace(ladder(), supports=held)),
            measured(replace(truth, supports=held), 3),
        ),
        "hframe": (Model.of(hframe()), h_data),
        "massless dofs": (Model.of(hframe(joint_springs=arms)), h_data),
    }


ON_FRAMES = ("frame", "two modes", "noise", "gaps", "timoshenko", "asymmetric", "supported")
EVERYWHERE = (*ON_FRAMES, "hframe", "massless dofs")


def update(strategy: Any, case: Case) -> UpdateResult:
    result: UpdateResult = strategy().update(*case, np.random.default_rng(0))
    return result


def has_used_modes(model: Model, data: Measurement) -> None:
    """Assert that measured modes are modes of a model, found anew and paired by shape."""
    modes = solve_modes(model)
    at_sensors = model.observe(data.sensors) @ modes.shapes
    found = modes.natural_frequencies
    pairs = pair_modes(data.frequencies, data.shapes, found, np.asarray(at_sensors))
    assert (pairs.index >= 0).all()
    np.testing.assert_allclose(found[pairs.index], data.frequencies, rtol=1e-9)


def same_rigid_modes(before: Model, after: Model) -> None:
    rigid = rigid_modes_of(before)
    if rigid.shape[1]:
        force = after.stiffness_times(rigid)
        gross = np.abs(before.stiffness) @ np.abs(rigid)
        assert np.abs(force).max() <= 1e-12 * gross.max()
        np.testing.assert_allclose(after.mass_times(rigid), before.mass_times(rigid), atol=1e-12)
    modes = solve_modes(after)
    assert modes.rigid.sum() == rigid.shape[1]
    assert (modes.eigenvalues >= 0.0).all()
    assert np.count_nonzero(modes.eigenvalues == 0.0) == rigid.shape[1]


@pytest.mark.parametrize("name", EVERYWHERE)
def test_baruch_promises(cases: dict[str, Case], name: str) -> None:
    model, data = cases[name]
    result = update(Baruch, (model, data))
    assert result.diagnostics["residual"] <= 1e-8
    has_used_modes(result.model, data)
    same_rigid_modes(model, result.model)
    assert result.model.stiffness is model.stiffness
    assert result.model.mass_change is None
    assert result.model.stiffness_change is not None
    assert result.model.stiffness_change.basis.shape == (model.size, len(data))
    # All other modes are left alone.
    quasi = QuasiModes.of(model, data)
    after = solve_modes(result.model)
    others = np.delete(quasi.modes.natural_frequencies, quasi.partners)
    expected = np.sort(np.concatenate([others, data.frequencies]))
    np.testing.assert_allclose(after.natural_frequencies[:20], expected[:20], rtol=1e-8)


def test_baruch_change_is_equation_18_for_any_orthonormal_shapes(frame_case: Case) -> None:
    model, data = frame_case
    quasi = QuasiModes.of(model, data)
    rng = np.random.default_rng(5)
    shapes = quasi.modes.shapes[:, 3:12] @ np.linalg.qr(rng.standard_normal((9, 3)))[0]
    for given in (quasi.shapes, shapes):
        mass, stiffness = dense_matrices(model)
        inner = mass @ given @ np.diag(data.eigenvalues) - stiffness @ given
        delta = (np.eye(model.size) - mass @ given @ given.T / 2) @ inner @ given.T @ mass
        change = baruch.stiffness_change(model, replace(quasi, shapes=given)).toarray()
        # Both sides carry the rounding error of K Phi.
        gross = np.abs(stiffness).max() * np.abs(given).max() ** 2
        np.testing.assert_allclose(change, delta + delta.T, rtol=0, atol=1e-13 * gross)


@pytest.mark.parametrize("name", ["frame", "noise", "gaps", "supported", "massless dofs"])
def test_berman_promises(cases: dict[str, Case], name: str) -> None:
    model, data = cases[name]
    result = update(Berman, (model, data))
    assert result.diagnostics["residual"] <= 1e-8
    has_used_modes(result.model, data)
    same_rigid_modes(model, result.model)
    assert result.model.mass_change is not None
    assert result.model.stiffness_change is not None
    assert result.model.mass_change.basis.shape[1] <= len(data)
    assert result.model.stiffness_change.basis.shape[1] <= 2 * len(data)


def test_berman_corrects_the_mass_first_and_uses_it(frame_case: Case) -> None:
    model, data = frame_case
    result = update(Berman, frame_case)
    assert result.diagnostics["largest_off_diagonal_mass"] > 0.01
    mass, stiffness = dense_matrices(result.model)
    rigid = rigid_modes_of(model)
    free = expand_measured_shapes(model, data, rigid)
    shapes = free / np.sqrt(np.einsum("ij,ij->j", free, mass @ free))
    np.testing.assert_allclose(shapes.T @ mass @ shapes, np.eye(3), atol=1e-10)
    inertia = mass @ shapes * data.eigenvalues
    np.testing.assert_allclose(
        stiffness @ shapes, inertia, rtol=0, atol=1e-8 * np.abs(inertia).max()
    )
    # With the nominal mass the same shapes are no modes: the second step saw the corrected one.
    off = stiffness @ shapes - model.mass @ shapes * data.eigenvalues
    assert np.abs(off).max() > 1e-3 * np.abs(inertia).max()
    assert np.linalg.eigvalsh(mass)[0] > 0.0


@pytest.mark.parametrize("limit", [500, 50])
def test_berman_meets_every_reading_and_has_no_momentum(
    frame_case: Case, limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("femubench.core.update.dynamic.DENSE_LIMIT", limit)
    model, data = frame_case
    rigid = rigid_modes_of(model)
    shapes = expand_measured_shapes(model, data, rigid)
    readings = data.shapes / np.abs(data.shapes).max(axis=0)
    np.testing.assert_allclose(model.observe(data.sensors) @ shapes, readings, atol=1e-7)
    assert np.abs(rigid.T @ (model.mass @ shapes)).max() < 1e-8
    updated = update(Berman, frame_case).model
    modes = solve_modes(updated).elastic
    for j, frequency in enumerate(data.frequencies):
        found = int(np.abs(modes.natural_frequencies - frequency).argmin())
        seen = model.observe(data.sensors) @ modes.shapes[:, found]
        assert mac(seen, data.shapes[:, j])[0, 0] > 1.0 - 1e-6


def test_dynamic_expansion_agrees_sparse_and_dense(cases: dict[str, Case]) -> None:
    for name in ("frame", "massless dofs", "supported"):
        model, data = cases[name]
        rows = model.observe(data.sensors)
        dense = expand_by_dynamics(model, rows, data.shapes, data.eigenvalues)
        for j, eigenvalue in enumerate(data.eigenvalues):
            one = expand_one_by_dynamics(model, rows, data.shapes[:, j], float(eigenvalue))
            scale = 1e-6 * np.abs(dense[:, j]).max()
            np.testing.assert_allclose(one, dense[:, j], rtol=0, atol=scale)
            np.testing.assert_allclose(
                rows @ one, data.shapes[:, j], rtol=0, atol=1e-9 * np.abs(data.shapes).max()
            )


def same_pattern(before: Model, after: Model) -> None:
    old, new = sp.csc_array(before.stiffness), sp.csc_array(after.stiffness)
    old.eliminate_zeros()
    new.sort_indices()
    old.sort_indices()
    np.testing.assert_array_equal(old.indptr, new.indptr)
    np.testing.assert_array_equal(old.indices, new.indices)
    assert abs(new - new.T).max() == 0.0
    assert after.stiffness_change is None


@pytest.mark.parametrize("strategy", [Kabe, KabeRigid])
@pytest.mark.parametrize("name", ["frame", "noise", "gaps", "timoshenko", "supported"])
def test_kabe_promises(cases: dict[str, Case], name: str, strategy: Any) -> None:
    model, data = cases[name]
    result = update(strategy, (model, data))
    assert result.diagnostics["residual"] <= 1e-8
    has_used_modes(result.model, data)
    same_pattern(model, result.model)
    assert result.model.mass is model.mass
    assert len(result.history) >= 5


@pytest.mark.parametrize("name", ["frame", "noise", "gaps", "timoshenko", "asymmetric"])
def test_kabe_rigid_keeps_the_rigid_modes(cases: dict[str, Case], name: str) -> None:
    model, data = cases[name]
    result = update(KabeRigid, (model, data))
    same_rigid_modes(model, result.model)
    if name != "asymmetric":  # 28 elements of four parameters less 23 ties between them
        assert result.parameter_count == 28 * 4 - 23


def test_kabe_rigid_equals_kabe_on_a_structure_without_rigid_modes(cases: dict[str, Case]) -> None:
    one, other = (update(s, cases["supported"]).model.stiffness for s in (Kabe, KabeRigid))
    assert abs(one - other).max() == 0.0


def test_kabe_takes_the_smallest_change_there_is(frame_case: Case) -> None:
    """Any direction that changes no equation only makes the relative changes larger."""
    model, data = frame_case
    pattern = EntryPattern.of(model)
    quasi = QuasiModes.of(model, data)
    equations = entry_update.equations_of(pattern, model, quasi)
    change, _ = smallest_change(equations, np.eye(len(pattern)))
    stacked = np.vstack([equations.exact, equations.fitted.toarray()])
    _, singular, right = np.linalg.svd(stacked)
    idle = right[np.sum(singular > 1e-10 * singular[0]) :]
    assert len(idle) >= 5
    assert np.abs(idle @ change).max() <= 1e-9 * np.linalg.norm(change)
    np.testing.assert_allclose(equations.exact @ change, equations.exact_right, atol=1e-9)
    # What is left of the equations of motion cannot be lessened but along singular values below
    # the cutoff.
    rest = equations.fitted @ null_space(equations.exact)
    left, singular, _ = np.linalg.svd(rest, full_matrices=False)
    misfit = equations.fitted @ change - equations.fitted_right
    shown = left[:, singular > entry_update.CUTOFF]
    assert np.abs(shown.T @ misfit).max() <= 1e-9 * np.linalg.norm(equations.fitted_right)


def test_pattern_knows_no_stored_zeros(frame_case: Case) -> None:
    model, _ = frame_case
    size = (model.size, model.size)
    zeros = sp.coo_array(([0.0, 0.0], ([0, 80], [80, 0])), shape=size)
    stored = sp.coo_array(model.stiffness)
    joined = sp.csc_array(
        (
            np.concatenate([stored.data, zeros.data]),
            (np.concatenate([stored.row, zeros.row]), np.concatenate([stored.col, zeros.col])),
        ),
        shape=size,
    )
    assert sp.triu(joined).nnz == 232
    pattern = EntryPattern.of(replace(model, stiffness=joined))
    assert len(pattern) == 231
    assert abs(pattern.matrix(np.zeros(231)) - model.stiffness).max() == 0.0


def test_the_dual_problem_of_kabe_has_the_answer_of_the_dense_one(frame_case: Case) -> None:
    model, data = frame_case
    pattern = EntryPattern.of(model)
    posed = entry_update.equations_of(pattern, model, QuasiModes.of(model, data), 0.03)
    fitted, free = posed.fitted.toarray(), entry_update.null_space(posed.exact)
    start = np.linalg.lstsq(posed.exact, posed.exact_right)[0]
    rows = np.vstack([fitted, posed.cutoff * np.eye(len(pattern))])
    right = np.concatenate([posed.fitted_right, np.zeros(len(pattern))]) - rows @ start
    wanted = start + free @ np.linalg.lstsq(rows @ free, right)[0]
    found = entry_update.smallest_change_sparse(posed)
    assert np.linalg.norm(found - wanted) < 1e-8 * np.linalg.norm(wanted)
    assert np.abs(posed.exact @ found - posed.exact_right).max() < 1e-12


def test_kabe_refuses_what_is_too_large(frame_case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry_update, "MOST_RIGID_UNKNOWNS", 100)
    monkeypatch.setattr(entry_update, "MOST_UNKNOWNS", 200)
    with pytest.raises(NotApplicable, match=r"231 non-zero entries.*gigabytes beyond 200"):
        update(Kabe, frame_case)
    with pytest.raises(NotApplicable, match="dense matrix beyond 100"):
        update(KabeRigid, frame_case)


def test_kabe_needs_a_pattern(frame_case: Case) -> None:
    changed = update(Baruch, frame_case).model
    with pytest.raises(NotApplicable, match="no pattern of zeros"):
        update(Kabe, (changed, frame_case[1]))


def test_kabe_states_by_how_much_a_used_frequency_is_off_where_no_matrix_has_them(
    cases: dict[str, Case],
) -> None:
    model, data = cases["hframe"]
    result = update(KabeRigid, (model, data))
    partners = QuasiModes.of(result.model, data)
    own = partners.modes.natural_frequencies[partners.partners]
    worst = np.abs(own / data.frequencies - 1.0).max()
    assert result.diagnostics["used_frequency_error"] == pytest.approx(worst, rel=1e-9)
    assert 1e-3 < worst < 0.3
    assert result.diagnostics["residual"] > worst
    same_pattern(model, result.model)
    rigid = rigid_modes_of(model)
    force = np.abs(result.model.stiffness_times(rigid)).max()
    assert force <= 1e-9 * (np.abs(result.model.stiffness) @ np.abs(rigid)).max()
    modes = solve_modes(result.model)
    assert modes.rigid.sum() == rigid.shape[1] == 3
    assert (modes.eigenvalues >= 0.0).all()
    with pytest.raises(InputError, match="cutoff -1 is not positive"):
        KabeRigid(least_squares_cutoff=-1.0)
    assert "used_frequency_error" not in update(KabeRigid, cases["frame"]).diagnostics


def test_least_squares_is_the_least_among_what_keeps_the_rigid_modes(
    cases: dict[str, Case],
) -> None:
    """No feasible direction lowers the residual; what a cutoff hides stays as it is."""
    model, data = cases["hframe"]
    pattern = EntryPattern.of(model)
    rigid = rigid_modes_of(model)
    rows = pattern.products(rigid, np.ones(model.size)).toarray()
    free = null_space(pattern.products(rigid, entry_update.force_scale(model)).toarray())
    quasi = QuasiModes.of(model, data)
    equations = replace(entry_update.equations_of(pattern, model, quasi), cutoff=1e-9)
    change, rank = least_squares_change(equations, free)
    assert rank == free.shape[1] < len(equations.exact_right) + len(equations.fitted_right)

    def misfit(x: Any) -> float:
        exact = equations.exact @ x - equations.exact_right
        fitted = equations.fitted @ x - equations.fitted_right
        return float(np.sqrt(exact @ exact + fitted @ fitted))

    scale = np.abs(rows).max() * np.abs(change).max()
    assert np.abs(rows @ change).max() <= 1e-9 * scale
    least = misfit(change)
    assert least > 0.1
    rng = np.random.default_rng(4)
    for size in np.geomspace(1e-4, 1.0, 40):
        step = free @ rng.standard_normal(free.shape[1])
        step *= size * np.linalg.norm(change) / np.linalg.norm(step)
        assert misfit(change + step) >= least * (1.0 - 1e-12)
    cut, shown = least_squares_change(replace(equations, cutoff=0.3), free)
    stacked = np.vstack([equations.exact @ free, equations.fitted @ free])
    hidden = free @ np.linalg.svd(stacked, full_matrices=False)[2][shown:].T
    assert hidden.shape[1] == rank - shown > 0
    assert np.abs(hidden.T @ cut).max() <= 1e-9 * np.linalg.norm(cut)
    assert misfit(cut) > least


def test_kabe_turns_to_least_squares_where_singular_values_do_not_converge(
    cases: dict[str, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = update(KabeRigid, cases["hframe"]).model.stiffness

    def unsolved(*_: Any) -> Any:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(entry_update, "smallest_change", unsolved)
    assert abs(update(KabeRigid, cases["hframe"]).model.stiffness - wanted).max() == 0.0


def test_kabe_gives_up_an_iteration_that_leads_nowhere(
    frame_case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def idle(_: entry_update.Equations, free: FloatArray) -> tuple[FloatArray, int]:
        calls.append(free)
        return np.zeros(len(free)), 0

    monkeypatch.setattr(entry_update, "smallest_change", idle)
    found = update(Kabe, frame_case).model.stiffness
    assert len(calls) == 11
    monkeypatch.setattr(entry_update, "_STALLED", np.inf)
    assert abs(update(Kabe, frame_case).model.stiffness - found).max() == 0.0
    assert len(calls) == 11 + 40


def test_kabe_tells_on_which_step_least_squares_lose_a_mode(
    cases: dict[str, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    (model, data), own = cases["hframe"], QuasiModes.of

    def blind_after_the_first(current: Model, wanted: Measurement) -> QuasiModes:
        if current is not model:
            raise StrategyFailure("no mode of the model matches measured mode 3")
        return own(current, wanted)

    monkeypatch.setattr(QuasiModes, "of", blind_after_the_first)
    with pytest.raises(StrategyFailure, match=r"after step 1 of least squares .* measured mode 3"):
        update(KabeRigid, (model, data))


def test_kabe_without_least_squares_fails_with_its_residual(
    cases: dict[str, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(entry_update, "DENSE_UNKNOWNS", 0)
    with pytest.raises(SelfCheckFailed, match=r"off by .*promises 1e-08") as caught:
        update(Kabe, cases["hframe"])
    assert caught.value.measured > 1e-3


def test_a_broken_expansion_is_found(frame_case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    own = QuasiModes.of

    def stretched(model: Model, data: Measurement) -> QuasiModes:
        quasi = own(model, data)
        return replace(quasi, shapes=1.001 * quasi.shapes)

    monkeypatch.setattr(QuasiModes, "of", stretched)
    shown = r"measured mode at 226.8 Hz comes out at 227.03 Hz in the updated model \(\+0.1 %\)"
    with pytest.raises(SelfCheckFailed, match=shown) as caught:
        update(Baruch, frame_case)
    assert caught.value.measured > 1e-4


def test_mixed_shapes_are_found(frame_case: Case) -> None:
    updated = update(Baruch, frame_case).model
    quasi = QuasiModes.of(*frame_case)
    mixed = np.column_stack([quasi.shapes[:, 0] + 1e-3 * quasi.shapes[:, 1], quasi.shapes[:, 1:]])
    with pytest.raises(SelfCheckFailed, match=r"226.8 Hz"):
        check_used_modes(updated, mixed, quasi.eigenvalues)


def test_berman_refuses_shapes_that_are_one(frame_case: Case) -> None:
    model, data = frame_case
    twice = replace(
        data, frequencies=np.full(3, 226.8), shapes=np.repeat(data.shapes[:, :1], 3, axis=1)
    )
    with pytest.raises(StrategyFailure, match="depend on each other"):
        update(Berman, (model, twice))


def test_a_shape_that_is_nowhere_in_the_model_is_a_failure(frame_case: Case) -> None:
    model, data = frame_case
    odd = replace(data, shapes=np.eye(13)[:, :3])
    for strategy in (Baruch, Kabe, KabeRigid):
        with pytest.raises(StrategyFailure, match="no mode of the model matches"):
            update(strategy, (model, odd))


@pytest.mark.parametrize(("strategy", "rank"), [(Baruch, 3), (Berman, 6)])
def test_thousands_of_dofs_stay_low_rank(
    ladder: FrameBuilder, frame_case: Case, strategy: Any, rank: int
) -> None:
    model, data = Model.of(ladder(elements=100)), frame_case[1]
    result = update(strategy, (model, data))
    change = result.model.stiffness_change
    assert change is not None
    assert change.basis.shape == (model.size, rank)
    modes = solve_modes(result.model, 9)
    assert modes.rigid[:3].all()
    rigid = rigid_modes_of(model)
    # The nominal stiffness itself is free of forces up to rounding only; nothing is added to that.
    own = np.linalg.norm(model.stiffness @ rigid)
    assert np.linalg.norm(change @ rigid) <= 1e-4 * own
    # K phi of a mesh with 3 mm elements is known to 1e-7 only.
    np.testing.assert_allclose(modes.natural_frequencies[3:6], PAPER, rtol=1e-6)
    assert abs(modes.natural_frequencies[6] - 911.0) <= 1.0


def test_kabe_solves_thousands_of_entries(ladder: FrameBuilder, frame_case: Case) -> None:
    model, data = Model.of(ladder(elements=60)), frame_case[1]
    result = update(Kabe, (model, data))
    assert result.diagnostics["entries"] > entry_update.DENSE_UNKNOWNS
    same_pattern(model, result.model)
    quasi = QuasiModes.of(result.model, data)
    found = measure_residuals(result.model, quasi.shapes, quasi.eigenvalues)
    assert found.frequencies <= 1e-7
