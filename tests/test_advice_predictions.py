"""What explanations predict for data not yet taken, against whole models meshed anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from advice_problems import STD, every_option, fitted, one_outlook, posed
from diagnosis_problems import clamped_portal, measured, part_at, problem_of
from numpy.testing import assert_allclose
from scipy.special import logsumexp

from femubench import Model, solve_modes
from femubench.core.advise.advice import align_shapes
from femubench.core.advise.point_attachments import antiresonances, predict_loaded_frequencies
from femubench.core.advise.prediction import Outlook, Points, Predicted, distance
from femubench.core.fem.alteration import Alteration
from femubench.core.fit.modal_fit import Fit, Problem, state_at
from femubench.core.inference.settings import overridden
from femubench.core.modal.antiresonances import predict_antiresonances
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.roles import Effect
from femubench.effect import ModelPlaces
from femubench.fem import FloatArray, Frame, Material, Place, PointMass, Section, Support
from femubench.plugins.effects.added_mass import AddedMass
from femubench.plugins.effects.grounding_spring import GroundingSpring
from femubench.plugins.effects.joint_rotation import JointRotation
from femubench.plugins.effects.material import YoungsModulus
from femubench.plugins.effects.support_flexibility import SupportFlexibility

FrameBuilder = Callable[..., Frame]
TUBE, STEEL = Section.rectangular_tube(0.04, 0.03, 0.002), Material(2.1e11, 0.3, 7850.0)
FEET = clamped_portal(4, TUBE, STEEL)
STEP = 1e-3  # deviations


@pytest.fixture(scope="module")
def symmetric(ladder: FrameBuilder) -> Model:
    """Return the ladder with its two mirror symmetries."""
    return Model.of(ladder(polar=False, accelerometer=False))


def views_around(problem: Problem, found: Fit) -> list[list[Outlook]]:
    """Return what is seen a step down and up along each column of the root of a covariance."""
    steps = STEP * np.linalg.cholesky(found.covariance).T
    ends = [(found.state.x - step, found.state.x + step) for step in steps]
    at = [[Fit(state_at(problem, found.parts, x), 0.0) for x in pair] for pair in ends]
    return [[one_outlook(problem, moved)[0] for moved in pair] for pair in at]


def seen_values(view: Outlook, points: Points, shapes: FloatArray) -> list[Predicted]:
    """Return predictions of every kind, shapes at their best scale to given ones."""
    return [
        view.mass(),
        view.frequencies(view.further(2)),
        align_shapes(shapes, *view.shapes()),
        view.flexibility(),
        *predict_loaded_frequencies(view, points, 0.03),
        *antiresonances(view),
    ]


class TestPredictions:
    """Small pencils against whole models that were meshed and solved anew."""

    @pytest.mark.parametrize("name", ["ladder", "hframe", "portal"])
    def test_loaded_and_held_structures(
        self, name: str, ladder: FrameBuilder, hframe: FrameBuilder, portal: FrameBuilder
    ) -> None:
        builders = {"ladder": ladder, "hframe": lambda: hframe(mesh=(8, 4, 8))}
        frame = builders.get(name, lambda: replace(portal(3), joint_springs=(), rigid_ends=()))()
        model = Model.of(frame)
        effect, size = AddedMass(), [0.05]
        place = frame.joints[0].name
        extended = effect.extend(model, place, size)
        problem = posed(model, extended, [effect])
        part = part_at(problem, effect.name, place)
        x = np.array(
            [p.coordinate(v) for p, v in zip(part.hypothesis.parameters, size, strict=True)]
        )
        view, points = one_outlook(problem, Fit(state_at(problem, (part,), x), 0.0))
        loaded = predict_loaded_frequencies(view, points, 0.04)
        zeros = antiresonances(view)
        rigid = problem.space.rigid
        for i in range(0, len(points.labels), 3):
            at = ModelPlaces(model).point(points.labels[i])
            other = extended.attach([PointMass(at, 0.04)], [])
            expected = solve_modes(other).natural_frequencies[rigid : rigid + 6]
            assert_allclose(loaded[i].values, expected, rtol=2e-5)
            sensor = sum(points.counts[:i])
            row = np.asarray(
                ModelPlaces(extended).translations(at, points.directions[i][:1]).toarray()
            )
            free = la.null_space(row)
            inner = [free.T @ m.toarray() @ free for m in (extended.stiffness, extended.mass)]
            top = problem.data.measurement.frequencies.max()
            found = zeros[sensor].values[zeros[sensor].values < top]
            eigenvalues = la.eigh(*inner, eigvals_only=True)
            exact = np.sqrt(np.abs(eigenvalues)) / (2 * np.pi)
            gap = np.abs(exact - found[:, None]).min(axis=1) / found
            assert gap.max(initial=0.0) < 2e-4
            poles = solve_modes(extended).natural_frequencies
            near = np.abs(exact[:, None] - poles).min(axis=1) < 0.0101 * exact
            low = exact > problem.space.zero
            assert len(found) >= int((~near & low & (exact < 0.99 * top)).sum())

    @overridden({"spare_modes": 1000})  # all modes: the rule alone is at stake
    def test_spread_is_the_change_within_a_deviation(self, ladder: FrameBuilder) -> None:
        frame = ladder(polar=False)
        frame = replace(frame, supports=tuple(Support(Place(joint=j), ("z",)) for j in "ADF"))
        model = Model.of(frame)
        truth = JointRotation().extend(model, "L", [4e3, 3e3])
        problem = posed(model, truth, [JointRotation()])
        found = fitted(problem, JointRotation(), "L", 1.0)
        middle, points = one_outlook(problem, found)
        assert problem.space.rigid == 0
        shapes, _ = middle.shapes()
        centre = seen_values(middle, points, shapes)
        for column, views in enumerate(views_around(problem, found)):
            ends = [seen_values(view, points, shapes) for view in views]
            for own, low, high in zip(centre, *ends, strict=True):
                slope = (high.values - low.values) / (2.0 * STEP)
                scale = np.abs(own.spread).max(initial=1e-12)
                assert np.abs(own.spread[:, column] - slope).max(initial=0.0) < 1e-4 * scale

    @overridden({"spare_modes": 1000})
    def test_antiresonances_at_the_sensors_of_the_test(self, ladder: FrameBuilder) -> None:
        """Against the zeros of the extended model, and their change within a deviation."""
        frame = ladder(polar=False)
        model = Model.of(frame)
        truth = JointRotation().extend(model, "L", [4e3, 3e3])
        test = measured(truth, frame, shapes=6, weighed=False)
        problem = problem_of(model, test, [JointRotation()])
        found = fitted(problem, JointRotation(), "L", 1.0)
        view, _ = one_outlook(problem, found)
        highest = float(test.frequencies.max())
        own, spread = next(view.zeros(highest))
        values = found.parts[0].hypothesis.values(found.state.x[None])[0].tolist()
        whole = JointRotation().extend(model, "L", values)
        at = whole.observe(test.sensors)
        modes, lines = solve_modes(whole), np.array([0.5 * test.frequencies.min(), highest])
        flat = np.zeros(len(modes))
        partner = int(modes.rigid.sum()) + np.arange(len(test))
        exact = predict_antiresonances(
            PredictedResponses(modes, partner, (at, at[[0]], lines), flat)
        )
        pairs = own.pair(exact)
        assert len(own) > 10
        assert (pairs >= 0).mean() > 0.9
        apart = np.abs(own.frequencies / exact.frequencies[pairs] - 1.0)[pairs >= 0]
        assert apart.max() < 1e-3
        for column, views in enumerate(views_around(problem, found)):
            low, high = (next(view.zeros(highest))[0] for view in views)
            slope = high.frequencies[own.pair(high)] - low.frequencies[own.pair(low)]
            slope /= 2.0 * STEP
            gap = np.abs(spread[:, column] - slope)
            assert np.median(gap) < 1e-4 * np.abs(spread).max()
            assert gap.max() < 1e-2 * np.abs(spread).max()

    @pytest.mark.parametrize(
        ("effect", "place", "shown"),
        [
            (SupportFlexibility(), "support:fl", 0),
            (SupportFlexibility(), "support:fr", 2),
            (YoungsModulus(), "all", 1),
        ],
    )
    def test_without_a_support_as_drawn_without_it(
        self, effect: Effect, place: str, shown: int
    ) -> None:
        """What gives at the support itself goes with it, all else stays."""
        model = Model.of(FEET)
        typical = [float(p.value(0.6)) for p in effect.parameters(model, place)]
        problem = posed(model, effect.extend(model, place, typical), [effect])
        found = fitted(problem, effect, place, 0.5)
        view, _ = one_outlook(problem, found)
        away = Alteration(removed=FEET.supports[:1])
        without = view.altered(away)
        assert without is not None
        bare = Model.of(replace(FEET, supports=FEET.supports[1:]))
        values = found.parts[0].hypothesis.values(found.state.x[None])[0].tolist()
        exact = effect.extend(bare, place, values) if shown else bare
        expected = solve_modes(exact).natural_frequencies[:6]
        assert_allclose(without.values, expected, rtol=5e-4)
        assert (np.abs(without.spread) > 1e-6 * expected[:, None]).any(axis=0).sum() == shown
        for column, pair in enumerate(views_around(problem, found) if shown else ()):
            low, high = (side.altered(away) for side in pair)
            assert low is not None
            assert high is not None
            slope = (high.values - low.values) / (2.0 * STEP)
            scale = np.abs(slope).max()
            assert_allclose(without.spread[:, column], slope, atol=1e-4 * scale)

    def test_deflection_of_a_held_frame(self, ladder: FrameBuilder) -> None:
        frame = ladder(polar=False, accelerometer=False)
        held = replace(frame, supports=(Support(Place(joint="A"), ("z", "rx", "ry")),))
        model = Model.of(held)
        effects = [GroundingSpring(), YoungsModulus()]
        problem = posed(model, YoungsModulus().extend(model, "all", [0.1]), effects)
        fits = [fitted(problem, YoungsModulus(), "all"), fitted(problem, GroundingSpring(), "F")]
        options = every_option(model, problem, fits)
        (text,) = (text for text in options if "static" in text)
        assert text == "measure the static deflection under a known load at F, z"
        view, _ = one_outlook(problem, fits[0])
        row = ModelPlaces(model).translations(Place(joint="F"), ["z"]).toarray()[0]
        stiff = YoungsModulus().extend(model, "all", [0.1]).stiffness.toarray()
        exact = float(row @ la.solve(stiff, row))
        found = view.flexibility().values.max()
        assert found == pytest.approx(exact, rel=1e-3)


def test_distance_against_likelihood_ratios(symmetric: Model) -> None:
    """Twice the mean log likelihood ratio of simulated data is the distance, coarsely.

    Whole models with the mass on them, at coordinates drawn from each posterior, stand for what
    the two explanations say; none of the linear rules takes part. The distance charges each side
    with the spread of both, a likelihood with its own: they agree where measurement noise rules.
    """
    rng = np.random.default_rng(7)
    mass = 0.1
    problem = posed(symmetric, JointRotation().extend(symmetric, "A", [3e3]), [JointRotation()])
    fits = [fitted(problem, JointRotation(), at) for at in ("A", "F")]
    predicted = []
    for found in fits:
        view, points = one_outlook(problem, found)
        predicted.append(predict_loaded_frequencies(view, points, mass)[points.labels.index("A")])
    tables = [_drawn(symmetric, found, "A", mass, rng) for found in fits]
    std = 3.0 * STD * tables[0].mean(axis=0)
    stated = distance(predicted[0], predicted[1], std)
    ratios = []
    for truth, sign in ((0, 1.0), (1, -1.0)):
        drawn = tables[truth][rng.integers(len(tables[truth]), size=2000)]
        data = drawn + std * rng.standard_normal(drawn.shape)
        logs = [_log_likelihood(data, table, std) for table in tables]
        ratios.append(2.0 * sign * float(np.mean(logs[0] - logs[1])))
    assert stated > 5.0
    assert np.mean(ratios) == pytest.approx(stated, rel=0.2)


def _drawn(
    model: Model, found: Fit, place: str, mass: float, rng: np.random.Generator
) -> FloatArray:
    """Return frequencies with the mass at draws from a posterior, (30, m)."""
    hypothesis = found.parts[0].hypothesis
    rows = []
    for z in rng.standard_normal(30):
        x = found.state.x + np.sqrt(found.covariance[0, 0]) * z
        values = [float(v) for v in hypothesis.values(x[None])[0]]
        extended = hypothesis.effect.extend(model, hypothesis.place, values)
        loaded = extended.attach([PointMass(Place(joint=place), mass)], [])
        rows.append(solve_modes(loaded).elastic.natural_frequencies[:6])
    return np.array(rows)


def _log_likelihood(data: FloatArray, table: FloatArray, std: FloatArray) -> FloatArray:
    """Return ln p(data) averaged over the draws, (n_data,)."""
    gap = (data[:, None, :] - table) / std
    return np.asarray(logsumexp(-0.5 * np.square(gap).sum(axis=2), axis=1))


def test_distance_counts_measurement_and_both_fits() -> None:
    first = Predicted(np.array([1.0, 0.0]), np.array([[0.3], [0.0]]))
    second = Predicted(np.array([0.0, 0.0]), np.array([[0.0], [0.4]]))
    std = np.array([0.4, 0.2])
    assert distance(first, second, std) == pytest.approx(1.0 / (0.16 + 0.09))
