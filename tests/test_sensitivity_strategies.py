"""The sensitivity strategies: table 4 of Horton et al. (1999), other frames, statistics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_problems import sensors_on_joints
from scipy import stats

from femubench import (
    Diverged,
    InputError,
    Measurement,
    Model,
    NotApplicable,
    Sensors,
    Strategy,
    StrategyFailure,
    UpdateResult,
    solve_modes,
)
from femubench.core.conformance.problems import problem
from femubench.core.fem.model_parameters import matrix_slopes
from femubench.core.modal.eigen import count_evaluations
from femubench.core.modal.sensitivity import eigenvalue_sensitivities
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.options import options_of, with_options
from femubench.core.update.residuals import Targets, predict
from femubench.effect import Change
from femubench.fem import (
    Frame,
    GroundSpring,
    Joint,
    Material,
    Member,
    Place,
    PointMass,
    Property,
    Section,
    Structure,
)
from femubench.plugins.strategies.bayesian import Bayesian
from femubench.plugins.strategies.factors import Global, Local
from femubench.plugins.strategies.offset import Offset
from femubench.plugins.strategies.spring import Spring
from femubench.update import (
    Changes,
    Joints,
    UpdateOptions,
    sensitivity_update,
)
from tests.simulated import modes_at

RNG = np.random.default_rng(0)
HFRAME_HZ = np.array([77.13, 137.60, 300.90, 404.98, 482.23])
LADDER_HZ = np.array([226.8, 275.2, 537.4])
PAPER_SPRINGS = {"x": 3.30e9, "z": 4.48e9, "ry": 3.02e6}


def measured(
    truth: Frame | Model, count: int, frequencies: np.ndarray | None = None, std: float = 0.005
) -> Measurement:
    """Return modes of a truth at sensors; frequencies replaced by printed ones where given."""
    model = Model.of(truth) if isinstance(truth, Frame) else truth
    sensors = sensors_on_joints(model.frame_structure.frame)
    return modes_at(model, sensors, count, hertz=frequencies, hertz_std=std)


def with_shear(frame: Frame) -> Frame:
    members = tuple(
        replace(m, section=replace(m.section, kappa=Section.constant_kappa(0.4355)))
        for m in frame.members
    )
    return replace(frame, beam="timoshenko", members=members)


@pytest.fixture(scope="module")
def hframe_case(hframe: Any) -> tuple[Model, Measurement]:
    """The published frequencies; shapes of a finer frame with shear and rotary inertia."""
    truth = with_shear(hframe(mesh=(32, 16, 32)))
    return Model.of(hframe()), measured(truth, 5, HFRAME_HZ)


def ratios(result: UpdateResult) -> dict[str, float]:
    return {p.name: p.after / p.before for p in result.parameters}


def nearest_factor(residual: str, measured_hz: np.ndarray, nominal_hz: np.ndarray) -> float:
    """Return the factor on the whole stiffness with the least sum of squares, in closed form."""
    if residual == "frequency":
        return float((measured_hz @ nominal_hz) / (nominal_hz @ nominal_hz)) ** 2
    wanted, own = np.square(measured_hz), np.square(nominal_hz)
    if residual == "relative-eigenvalue":
        wanted, own = np.ones_like(wanted), own / wanted
    return float((wanted @ own) / (own @ own))


@pytest.mark.parametrize("residual", ["frequency", "eigenvalue", "relative-eigenvalue"])
def test_global_gives_the_factor_that_its_residual_asks_for(ladder: Any, residual: Any) -> None:
    """Out of plane the factor scales the whole stiffness, so that the optimum is known."""
    model = Model.of(ladder())
    data = measured(model, 3, LADDER_HZ)
    options = UpdateOptions(residual=residual)
    strategy = Global() if residual == "frequency" else Global(options=options)
    (factor,) = ratios(strategy.update(model, data, RNG)).values()
    nominal = solve_modes(model).elastic.natural_frequencies[:3]
    assert factor == pytest.approx(nearest_factor(residual, LADDER_HZ, nominal), rel=1e-5)
    others = {"frequency", "eigenvalue", "relative-eigenvalue"} - {residual}
    for other in others:
        assert abs(factor / nearest_factor(other, LADDER_HZ, nominal) - 1.0) > 1e-3


def test_initial_springs_are_twice_those_of_the_element_behind(hframe_case: Any) -> None:
    """The printed values come from elements of 0.0450 m, mesh C has 0.04625 m."""
    frame = hframe_case[0].frame_structure.frame
    found = Joints(Structure.build(frame)).spring_estimates(("horizontal@T1", "horizontal@T2"))
    longer = 0.04625 / 0.0450
    powers = {"x": 1, "z": 3, "ry": 1}
    expected = {name: PAPER_SPRINGS[name] / longer**power for name, power in powers.items()}
    assert found == pytest.approx(expected, rel=2e-3)


# The iteration --------------------------------------------------------------------------------


def test_an_iteration_is_one_eigenvalue_solution(hframe_case: Any) -> None:
    with count_evaluations() as counter:
        result = Local().update(*hframe_case, RNG)
    steps = [entry["iteration"] for entry in result.history]
    assert steps == list(range(len(steps)))
    assert counter.count == len(result.history)
    costs = [entry["cost"] for entry in result.history]
    assert costs == sorted(costs, reverse=True)
    assert result.history[-1]["EI at T branch"] == result.parameters[0].after
    assert result.diagnostics["converged"] == 1.0


def test_a_budget_of_solutions_ends_with_the_best_point_so_far(hframe_case: Any) -> None:
    whole = Local().update(*hframe_case, RNG)
    for most in (1, 3, len(whole.history) + 1):
        limited = Local(options=replace(Local().options, max_solves=most, restarts=most % 2))
        with count_evaluations() as counter:
            found = limited.update(*hframe_case, RNG)
        assert counter.count == min(most, len(whole.history))
        assert found.history == whole.history[:most]
        assert found.diagnostics["converged"] == (most > len(whole.history))
    with pytest.raises(ValueError, match=r"max_solves is -1, not 0 \(no limit\) or more"):
        replace(Local().options, max_solves=-1)


START = 4  # solutions for pairs, for a basis of shapes, at the start, and of one step


@pytest.mark.parametrize(
    "name",
    [
        *("eigensensitivity", "sparse", "multi-start", "eigenvector-difference", "strain-energy"),
        *("cma-es", "particle-swarm", "physical", "generic-ls", "nobari-rigid", "global"),
        *("bayesian-sampling", "transitional-mcmc"),
    ],
)
def test_every_strategy_keeps_to_a_budget_of_solutions(hframe_case: Any, name: str) -> None:
    model, test = hframe_case
    plugin = load_plugins().strategies[name]
    (key,) = (key for key in options_of(plugin) if key.endswith("max_solves"))
    made = []
    for most in (1, 9, 45):
        with count_evaluations() as counter:
            result = with_options(plugin, {key: most}).update(model, test, RNG)
        assert 0 < counter.count <= max(most, START)
        assert solve_modes(result.model).elastic.natural_frequencies[0] > 0.0
        made.append(counter.count)
    assert made[0] < made[-1]  # more is made of more
    with pytest.raises(InputError, match="max_solves is -1"):
        with_options(plugin, {key: -1})


def test_every_step_is_equation_4(hframe_case: Any) -> None:
    model, data = hframe_case
    options = UpdateOptions(damping=0.05, max_iterations=2, max_step=10.0)
    result = Local(options).update(model, data, RNG)
    structure = model.frame_structure
    parameters = [
        Property("x", "EI", ("horizontal/1", "horizontal/16")),
        Property("z", "EI", ("lower1/8", "lower2/8", "upper1/1", "upper2/1")),
    ]
    beta = 0.05 * np.sum(data.eigenvalues**2)
    values = np.ones(2)
    for entry in result.history[1:]:
        present = Model.of(structure.with_values(parameters, values))
        modes = solve_modes(present).elastic.take(np.arange(5))
        # factors are differentiated about their present value: this is s = S diag|theta|
        s = eigenvalue_sensitivities(present, modes, parameters)
        gap = data.eigenvalues - modes.eigenvalues
        values = values * np.exp(np.linalg.solve(s.T @ s + beta * np.eye(2), s.T @ gap))
        found = [entry["EI at T branch"], entry["EI at T through"]]
        np.testing.assert_allclose(found, values, rtol=1e-6)
    assert len(result.history) == 3
    assert structure.changes == ()


def test_stiffness_stays_positive_without_damping(hframe_case: Any) -> None:
    options = UpdateOptions(damping=0.0)
    strategy = Spring(arm=0.02, stiffness=PAPER_SPRINGS, options=options)
    result = strategy.update(*hframe_case, RNG)
    for entry in result.history:
        assert all(entry[p.name] > 0.0 for p in result.parameters)
    assert (solve_modes(result.model).eigenvalues >= 0.0).all()


@pytest.mark.parametrize(
    ("strategy", "residual"),
    [(Local, "frequency"), (Spring, "relative-eigenvalue"), (Offset, "eigenvalue")],
)
def test_a_truth_within_the_class_is_recovered(
    hframe: Any, strategy: type[Strategy], residual: str
) -> None:
    model = Model.of(hframe(mesh=(4, 2, 4)))
    names, values = {
        "Local": (("EI at T branch", "EI at T through"), (0.6, 1.2)),
        "Spring": (("k_ry T branch", "EI all members"), (3e5, 1.02)),
        "Offset": (("a T branch", "EI all members"), (-0.01, 0.97)),
    }[strategy.__name__]
    options = UpdateOptions(residual=residual, damping=1e-6)  # type: ignore[arg-type]
    tool = strategy(options=options)  # type: ignore[call-arg]
    start = tool.update(model, measured(model, 5), RNG)
    # the class is what the strategy would build: set its parameters to a truth
    structure = start.model.frame_structure
    groups = {p.name: p for p, _ in structure.changes}
    known = [groups[name] for name in names]
    neutral = structure.with_values(
        [*groups.values()], [_neutral(p, start) for p in groups.values()]
    )
    truth = Model.of(neutral.with_values(known, values))
    result = tool.update(model, measured(truth, 6), RNG)
    found = {p.name: p.after for p in result.parameters}
    for name, value in zip(names, values, strict=True):
        assert found[name] == pytest.approx(value, rel=2e-3)


def _neutral(parameter: Property, start: UpdateResult) -> float:
    """Return what takes a parameter back to where the strategy starts from."""
    estimate = next(p for p in start.parameters if p.name == parameter.name)
    return estimate.before / estimate.after if parameter.is_factor else estimate.before


def test_a_mode_that_matches_nothing_is_left_out(hframe_case: Any) -> None:
    model, data = hframe_case
    shapes = data.shapes.copy()
    shapes[:, 2] = np.random.default_rng(3).normal(size=len(shapes))
    spoilt = Local().update(model, replace(data, shapes=shapes), RNG)
    assert spoilt.diagnostics["paired_modes"] == 4.0
    without = Local().update(model, data.select([1, 2, 4, 5]), RNG)
    assert ratios(spoilt) == pytest.approx(ratios(without), rel=1e-3)


def test_a_partner_that_is_lost_for_an_iteration_is_followed(hframe_case: Any) -> None:
    model, data = hframe_case
    shapes = data.shapes.copy()
    shapes[:, 2] = np.random.default_rng(3).normal(size=len(shapes))
    before = predict(Targets(data), model)
    alone = predict(Targets(replace(data, shapes=shapes)), model)
    followed = predict(Targets(replace(data, shapes=shapes)), model, before)
    assert alone.partner[2] == -1
    assert np.isnan(alone.residual[2])
    np.testing.assert_array_equal(followed.partner, before.partner)


def test_no_mode_at_all_is_a_failure(hframe_case: Any) -> None:
    model, data = hframe_case
    noise = np.random.default_rng(4).normal(size=data.shapes.shape)
    with pytest.raises(StrategyFailure, match="no mode"):
        Global().update(model, replace(data, shapes=noise), RNG)


def test_frequencies_alone_will_do(hframe_case: Any) -> None:
    model, data = hframe_case
    bare = replace(data, shapes=np.full(data.shapes.shape, np.nan))
    with_shapes, without = (Local().update(model, d, RNG) for d in (data, bare))
    assert ratios(without) == pytest.approx(ratios(with_shapes), rel=1e-6)


def test_an_optimum_out_of_range_is_a_divergence(hframe_case: Any) -> None:
    model, data = hframe_case
    every = model.frame_structure.elements
    limits = {"lower": 0.95, "upper": 1.05}
    narrow = Change.scale_property("EI all members", "EI", every, fatal=True, **limits)
    with pytest.raises(Diverged, match=r"EI all members left its range 0\.95\.\.1\.05"):
        sensitivity_update(model.frame_structure, [narrow], data)
    soft = Change.scale_property("EI all members", "EI", every, **limits)
    result = sensitivity_update(model.frame_structure, [soft], data)
    assert result.parameters[0].after == pytest.approx(0.95)


def test_no_more_parameters_than_frequencies(hframe_case: Any) -> None:
    model, data = hframe_case
    short = UpdateOptions(max_iterations=2)
    assert Spring(options=short).update(model, data.select([1, 2]), RNG).parameter_count == 2
    assert Offset(options=short).update(model, data.select([1, 2]), RNG).parameter_count == 2
    one = Local(short).update(model, data.select([1]), RNG)
    assert [p.name for p in one.parameters] == ["EI at all"]

    def some(name: str) -> Change:
        return Change.scale_property(name, "EI", ())

    levels = [[some("a"), some("b")], [], [some("c"), some("d")], [some("e")]]
    counts = {n: [change.name for change in Changes.determined(levels, n)] for n in (1, 2, 3, 4, 9)}
    assert counts == {1: ["a"], 2: ["a", "b"], 3: ["a", "b"], 4: list("abcd"), 9: list("abcde")}


# Other frames ---------------------------------------------------------------------------------


IN_PLANE, IN_SPACE = "grounded frame in plane", "free frame in space"


@pytest.fixture(scope="module")
def cases(ladder: Any, asymmetric_ladder: Any) -> dict[str, tuple[Model, Measurement]]:
    finer = ladder("timoshenko", polar=False, elements=8, E=71e9)
    truth = asymmetric_ladder(3.0, beam="timoshenko", polar=False, elements=8, E=71e9)
    return {
        "ladder": (Model.of(ladder()), measured(finer, 3, LADDER_HZ)),
        "asymmetric": (Model.of(ladder(stretch=1.04)), measured(truth, 5)),
        **{name: (problem(name).model, problem(name).measurement) for name in (IN_PLANE, IN_SPACE)},
    }


@pytest.mark.parametrize(
    ("strategy", "case"),
    [
        *((Global(), "ladder"), (Local(), IN_PLANE), (Spring(), IN_SPACE), (Spring(), IN_PLANE)),
        *(
            (Offset(), "asymmetric"),
            (Offset(), IN_SPACE),
            (Bayesian(), "ladder"),
            (Bayesian(), IN_SPACE),
        ),
    ],
)
def test_every_strategy_gives_a_physical_model_on_other_frames(
    cases: Any, strategy: Strategy, case: str
) -> None:
    model, data = cases[case]
    matrices = model.mass.copy(), model.stiffness.copy()
    short = replace(strategy.options, max_iterations=20)  # type: ignore[attr-defined]
    result = replace(strategy, options=short).update(model, data, RNG)  # type: ignore[type-var]
    modes = solve_modes(result.model)
    assert modes.rigid.sum() == solve_modes(model).rigid.sum()
    assert (modes.eigenvalues >= 0.0).all()
    assert result.history[-1]["cost"] < 0.9 * result.history[0]["cost"]
    assert result.diagnostics["paired_modes"] == len(data)
    assert result.parameter_count == len(result.parameters)
    # the nominal model is left as it was
    for kept, now in zip(matrices, (model.mass, model.stiffness), strict=True):
        assert abs(kept - now).max() == 0.0
    # what the harness does with the result: sensors and a design change
    assert result.model.observe(data.sensors).shape == (len(data.sensors), result.model.size)
    middle = Place(member=model.frame_structure.frame.members[0].name, s=0.5)
    masses, springs = [PointMass(middle, 0.5)], [GroundSpring(middle, "z", 1e6)]
    changed = solve_modes(result.model.attach(masses, springs))
    assert changed.rigid.sum() == max(modes.rigid.sum() - 1, 0)
    assert (changed.eigenvalues >= 0.0).all()


def test_the_softer_joint_of_the_asymmetric_frame_comes_out_softer(cases: Any) -> None:
    model, data = cases["asymmetric"]
    truth_free = Bayesian().update(model, data, RNG)
    estimates = {p.name: p for p in truth_free.parameters}
    assert estimates["E at L"].after < 1.0 - 2.0 * (estimates["E at L"].std or 0.0)


def test_joint_groups(hframe: Any, ladder: Any) -> None:
    groups = {group.name: group.ends for group in Joints(Structure.build(hframe())).groups()}
    assert groups == {
        "T through": ("lower1@T1", "upper1@T1", "lower2@T2", "upper2@T2"),
        "T branch": ("horizontal@T1", "horizontal@T2"),
    }
    found = {group.name: len(group.ends) for group in Joints(Structure.build(ladder())).groups()}
    assert found == {"L": 8, "T through": 4, "T branch": 2}
    untyped = replace(ladder(), joints=tuple(replace(j, type="") for j in ladder().joints))
    joints = Joints(Structure.build(untyped))
    assert len(joints.groups()) == 8
    assert [g.name for g in joints.groups_within(3)] == [
        "all",
        "all through",
        "all branch",
    ]
    assert [g.name for g in joints.groups_within(2)] == ["all"]
    assert Joints(Structure.build(ladder())).half_depth("BE@B") == pytest.approx(0.0127)


def test_the_springs_of_a_ladder_sit_at_the_faces(cases: Any) -> None:
    model, data = cases["ladder"]
    result = Spring(options=UpdateOptions(max_iterations=2)).update(model, data, RNG)
    springs = result.model.frame_structure.frame.joint_springs
    ends = sorted(f"{s.member}@{s.joint}" for s in springs)
    assert ends == ["AD@A", "AD@D", "BE@B", "BE@E", "CF@C", "CF@F"]
    np.testing.assert_allclose([s.arm for s in springs], 0.0127)
    assert {tuple(s.stiffness) for s in springs} == {("z", "rx", "ry")}
    assert [p.name for p in result.parameters] == ["k_ry L", "k_ry T branch", "E all members"]


def test_the_global_factor_takes_the_shear_stiffness_along(ladder: Any) -> None:
    nominal = Model.of(ladder("timoshenko", polar=False, elements=2))
    truth = Model.of(ladder("timoshenko", polar=False, elements=2, E=60e9))
    result = Global().update(nominal, measured(truth, 4), RNG)
    before = nominal.frame_structure.frame.members[0].material.E
    assert result.parameters[0].after == pytest.approx(60e9 / before, rel=1e-6)
    assert abs(result.model.stiffness - truth.stiffness).max() < 1e-5 * truth.stiffness.max()


def test_what_is_not_there_is_not_applicable(hframe_case: Any) -> None:
    model, data = hframe_case
    matrices = replace(model, structure=None)
    frame = model.frame_structure.frame
    beam = replace(frame, members=frame.members[:1], joints=frame.joints, masses=())
    beam = replace(beam, joints=tuple(j for j in beam.joints if j.name in ("T1", "T2")))
    for strategy in (Spring(), Offset(), Local()):
        with pytest.raises(NotApplicable, match="matrices"):
            strategy.update(matrices, data, RNG)
    for strategy in (Local(), Spring(), Offset()):
        with pytest.raises(NotApplicable):
            strategy.update(Model.of(beam), data, RNG)


# Statistics -----------------------------------------------------------------------------------


def test_the_linear_gaussian_limit_has_the_closed_form(ladder: Any) -> None:
    model = Model.of(ladder(elements=2))
    exact = measured(model, 6, std=1e-6)
    rng = np.random.default_rng(8)
    data = exact.with_noise(rng)
    strategy = Bayesian(stiffness_std=1e-5, torsion_std=2e-5, joint_std=5e-5)
    result = strategy.update(model, data, RNG)
    _, changes = strategy.pose(model, data)
    modes = solve_modes(model).elastic.take(np.arange(6))
    slope = eigenvalue_sensitivities(model, modes, [change.property for change in changes])
    deviation = 8.0 * np.pi**2 * data.frequencies * data.frequency_std
    s = slope / deviation[:, None]
    prior = np.diag([1.0 / change.parameters[0].std ** 2 for change in changes])
    covariance = np.linalg.inv(s.T @ s + prior)
    expected = covariance @ s.T @ ((data.eigenvalues - modes.eigenvalues) / deviation)
    found = np.array([p.after - 1.0 for p in result.parameters])
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(
        [p.std or 0.0 for p in result.parameters], np.sqrt(np.diagonal(covariance)), rtol=1e-3
    )


@pytest.mark.slow(5)
def test_the_stated_deviations_are_right(ladder: Any) -> None:
    """Truths from the prior, data from the truths: (theta_hat - theta) / std is a unit normal."""
    rng = np.random.default_rng(21)
    model = Model.of(ladder(elements=2))
    structure = model.frame_structure
    strategy = Bayesian(joint_std=0.3)
    _, changes = strategy.pose(model, measured(model, 6))
    std = np.array([change.parameters[0].std for change in changes])
    parameters = [change.property for change in changes]
    scores = []
    for _ in range(30):
        truth = std * rng.standard_normal(len(std))
        real = Model.of(structure.with_values(parameters, np.exp(truth)))
        data = measured(real, 6, std=0.003).with_noise(rng)
        result = strategy.update(model, data, rng)
        found = np.array([np.log(p.after) for p in result.parameters])
        deviation = np.array([(p.std or 0.0) / p.after for p in result.parameters])
        assert (deviation < std).all()
        scores.append((found - truth) / deviation)
    squares = np.square(scores).sum(axis=0)
    low, high = stats.chi2.ppf([1e-3, 1.0 - 1e-3], len(scores))
    assert ((squares > low) & (squares < high)).all()
    assert np.abs(np.mean(scores, axis=0)).max() < 3.5 / np.sqrt(len(scores))


def test_weighing_tells_density_from_stiffness(ladder: Any) -> None:
    model = Model.of(ladder(elements=4, accelerometer=False))
    frame = ladder(elements=4, accelerometer=False)
    heavier = tuple(
        replace(m, material=replace(m.material, rho=1.05 * m.material.rho)) for m in frame.members
    )
    truth = Model.of(replace(frame, members=heavier))
    structure = model.frame_structure
    mass = float(structure.properties.rhoA @ structure.properties.length)
    data = replace(measured(truth, 5, std=1e-4), total_mass=(1.05 * mass, 1e-4 * mass))
    weighed = {p.name: p for p in Bayesian().update(model, data, RNG).parameters}
    assert weighed["density all members"].after == pytest.approx(1.05, rel=1e-3)
    assert weighed["E all members"].after == pytest.approx(1.0, abs=0.02)
    bare = {
        p.name: p for p in Bayesian().update(model, replace(data, total_mass=None), RNG).parameters
    }
    assert "density all members" not in bare
    assert bare["E all members"].after == pytest.approx(1.0 / 1.05, rel=0.02)


def test_the_jacobian_of_scaled_shapes(ladder: Any) -> None:
    model = Model.of(ladder(elements=2))
    structure = model.frame_structure
    data = Targets(measured(model, 3).with_noise(np.random.default_rng(2)), "frequency", True, True)
    labels = tuple(label for label in structure.labels if label)
    parameters = [Property("GJ", "GJ", labels), Property("EI", "EI", labels[:3])]
    slopes = matrix_slopes(model, parameters)
    slope = predict(data, model).jacobian(slopes, lambda: np.zeros(2))
    for p, parameter in enumerate(parameters):
        up, down = (
            predict(data, Model.of(structure.with_values([parameter], [1.0 + h]))).residual
            for h in (1e-5, -1e-5)
        )
        difference = -(up - down) / 2e-5
        np.testing.assert_allclose(slope[:, p], difference, atol=1e-5 * np.abs(difference).max())


def test_statistics_need_deviations(hframe_case: Any) -> None:
    model, data = hframe_case
    with pytest.raises(NotApplicable, match="standard deviation"):
        Bayesian().update(model, replace(data, frequency_std=np.zeros(5)), RNG)


@pytest.mark.parametrize("strategy", [Spring(), Local(), Bayesian()], ids=lambda s: s.name)
def test_sections_given_as_the_numbers_that_the_plane_needs(strategy: Strategy) -> None:
    section = Section(A=2.2e-4, Iy=2.0e-8, Iz=0.0, J=3.0e-8, Jp=4.0e-8)
    tube = Material(68e9, 0.33, 2700.0)
    joints = (Joint("A", (0, 0, 0)), Joint("B", (0.8, 0, 0)), Joint("C", (0.8, 0.6, 0)))
    members = (
        Member("ab", ("A", "B"), 4, section, tube),
        Member("bc", ("B", "C"), 4, section, tube),
    )
    model = Model.of(Frame("out-of-plane", "euler-bernoulli", joints, members))
    truth = solve_modes(model).elastic.natural_frequencies[:2]
    none = np.zeros((0, 2))
    sensors = Sensors((), np.zeros((0, 3)), ())
    data = Measurement(sensors, (1, 2), 0.97 * truth, 0.01 * truth, np.full(2, np.nan), none, none)
    result = strategy.update(model, data, RNG)
    found = solve_modes(result.model).elastic.natural_frequencies[:2]
    assert np.abs(found / data.frequencies - 1.0).max() < 0.03
