"""Large models: few modes and the response to each hypothesis do what all modes would do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from diagnosis_problems import sensors_on_joints
from numpy.testing import assert_allclose

from femubench import Measurement, Model, Sensors, solve_modes
from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.change.hypothesis import Hypothesis, hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.fem.frame import GroundSpring, Joint, Material, Member, Place, Support
from femubench.core.fem.model import Dofs
from femubench.core.fem.sections import Section
from femubench.core.fit.extended_model import departure, extend_model, raw_residual
from femubench.core.fit.modal_fit import Problem, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection, Projector
from femubench.core.fit.residuals import Data
from femubench.core.fit.static_response import Basis, LargeProblem, enrich_problem, place_data
from femubench.core.inference.effort import Effort
from femubench.core.inference.examine import Examination, examine
from femubench.core.inference.screening import _pulls, screen_hypotheses
from femubench.core.modal.eigen import count_evaluations, modes_of
from femubench.core.roles import Effect
from femubench.fem import Frame
from femubench.plugins.effects.added_mass import AddedMass
from femubench.plugins.effects.attached_oscillator import AttachedOscillator
from femubench.plugins.effects.axial_preload import AxialPreload
from femubench.plugins.effects.joint_rotation import JointRotation
from femubench.plugins.effects.local_stiffness_loss import LocalStiffnessLoss
from femubench.plugins.effects.material import MemberMass, MemberStiffness, YoungsModulus
from femubench.plugins.effects.shear_deformation import ShearDeformation
from femubench.plugins.effects.temperature import Temperature
from tests.simulated import modes_at

FrameBuilder = Callable[..., Frame]
KNOWN: tuple[Effect, ...] = (AddedMass(), JointRotation(), MemberStiffness(), YoungsModulus())
USED, HELD_OUT = 6, 3
ALUMINIUM = Material(70e9, 0.33, 2700.0)


@pytest.fixture(scope="module")
def model(ladder: FrameBuilder) -> Model:
    """Return the ladder with 40 elements a member, 837 dofs."""
    frame = ladder("timoshenko", elements=40, polar=False, accelerometer=False)
    return Model.of(replace(frame, rotary_inertia=True))


def measured(
    truth: Model, sensors: Sensors, count: int, rng: np.random.Generator | None = None
) -> Measurement:
    """Return a test of a model, exact without a generator, with the deviations of a good test."""
    found = modes_at(truth, sensors, count, hertz_std=0.002)
    if rng is None:
        return found
    frequencies = found.frequencies + found.frequency_std * rng.standard_normal(count)
    shapes = found.shapes + 0.015 * rng.standard_normal(found.shapes.shape)
    return replace(found, frequencies=frequencies, shapes=shapes)


def posed_on(model: Model, hypotheses: tuple[Hypothesis, ...]) -> Problem:
    measurement = measured(model, sensors_on_joints(model.frame_structure.frame), USED)
    data = Data(measurement, np.zeros(0))
    noise = Noise.of(np.zeros((len(data), 0)), 0.0)
    return place_data(Basis.of(model, measurement), data, noise, hypotheses)


def projected(problem: Problem, hypothesis: Hypothesis) -> Projection:
    assert isinstance(problem, LargeProblem)
    return Projector(problem.model, problem.common.modes.shapes)(hypothesis)


def one(model: Model, effect: Effect, place: str) -> Hypothesis:
    (found,) = (h for h in hypotheses_of(model, [effect]) if h.place == place)
    return found


class TestCoordinates:
    @pytest.mark.parametrize(
        ("effect", "place", "x"),
        [
            (JointRotation(), "E", [2.3]),
            (LocalStiffnessLoss(), "AB/13", [2.0]),
            (MemberMass(), "EF", [1.5]),
            (AttachedOscillator(), "BE@0.5", [1.0, -0.4]),
        ],
    )
    def test_the_spectrum_is_that_of_the_extended_model(
        self, model: Model, effect: Effect, place: str, x: list[float]
    ) -> None:
        hypothesis = one(model, effect, place)
        problem = posed_on(model, ())
        own, parts = enrich_problem(problem, (projected(problem, hypothesis),))
        state = state_at(own, parts, np.array(x))
        exact = np.sort(solve_modes(extend_model(model, parts, np.array(x)), 24).eigenvalues)
        assert_allclose(state.eigenvalues[3:12], exact[3:12], rtol=1e-6)
        raw = raw_residual(own, extend_model(model, parts, np.array(x)))
        assert_allclose(state.raw, raw, atol=1e-3)

    def test_one_basis_has_the_slopes_of_all(self, model: Model) -> None:
        """Forces at the sensors in the basis make readings right to first order."""
        problem = posed_on(model, ())
        step = np.array([1e-3])
        for effect, place in ((LocalStiffnessLoss(), "AB/13"), (AddedMass(), "BC@0.25")):
            part = projected(problem, one(model, effect, place))
            first, second = (
                raw_residual(problem, extend_model(model, (part,), k * step)) for k in (1.0, 2.0)
            )
            slope = state_at(problem, (part,), 1.5 * step).jacobian[:, 0]
            assert_allclose(slope, (first - second) / step, atol=2e-3 * np.abs(slope).max())

    @pytest.mark.parametrize(
        ("effect", "place"), [(AttachedOscillator(), "BE@0.5"), (AddedMass(), "BC@0.25")]
    )
    def test_coordinates_of_many_are_those_of_each(
        self, model: Model, effect: Effect, place: str
    ) -> None:
        """Screened in modes and its own response, as in all that a fit of it has."""
        hypotheses = (one(model, MemberStiffness(), "AB"), one(model, effect, place))
        problem = posed_on(model, hypotheses)
        base = state_at(problem, (), np.zeros(0))
        parts = [projected(problem, hypothesis) for hypothesis in hypotheses]
        for part, found in zip(
            parts, screen_hypotheses(problem, base, parts, Effort()), strict=True
        ):
            own, (there,) = enrich_problem(problem, (part,))
            for x, residual in zip(found.grid, found.residuals, strict=True):
                exact = state_at(own, (there,), x).residual
                assert_allclose(residual, exact, atol=1e-2 * max(1.0, np.abs(exact).max()))

    def test_what_follows_a_mode_is_condensed(self, model: Model) -> None:
        """Forces of an oscillator as of the mass and spring that stand at a point of the model."""
        hypothesis = one(model, AttachedOscillator(), "BE@0.5")
        projector = Projector(model, solve_modes(model, 30).shapes)
        near, values = np.eye(30)[:, 8:13], np.linspace(1.0, 3.0, 5) * 1e6
        found = _pulls(projector, hypothesis, near, values, weighed=False)
        part = projector(hypothesis)
        factors = hypothesis.factors(found.grid)
        forces = np.tensordot(found.shares, found.forces, axes=1)
        for g in (0, len(found.grid) // 2, len(found.grid) - 1):
            stiff, mass = (part.matrix(factors[g], mass=kind) for kind in (False, True))
            assert stiff is not None
            assert mass is not None
            for j, value in enumerate(values):
                dynamic = stiff - value * mass
                inner, blunt = dynamic[30, 30], 0.05 * stiff[30, 30]
                own = inner / (inner**2 + blunt**2)  # 1 / inner, but for a resonance
                follow = own * (dynamic[30:, :30] @ near[:, j])
                exact = dynamic[:30, :30] @ near[:, j] - dynamic[:30, 30:] @ follow
                assert_allclose(forces[g, :, j], exact, atol=1e-9 * np.abs(exact).max())

    def test_a_large_model_is_solved_once_for_fewer_modes(self, model: Model) -> None:
        fresh, other = (Model.of(model.frame_structure.frame) for _ in range(2))
        with count_evaluations() as counter:
            many, few = (modes_of(fresh, count) for count in (24, 9))
            assert counter.count == 1
            more = modes_of(fresh, 30)
            assert counter.count == 2
        assert (len(many), len(few), len(more)) == (24, 9, 30)
        assert_allclose(few.eigenvalues[3:], solve_modes(other, 9).eigenvalues[3:], rtol=1e-9)


@pytest.mark.parametrize(
    "effect", [ShearDeformation(), Temperature(), AxialPreload()], ids=lambda effect: effect.name
)
def test_alike_elements_share_matrices_and_act_as_each_alone(model: Model, effect: Effect) -> None:
    frame = model.frame_structure.frame
    tube = Section.rectangular_tube(0.06, 0.03, 0.003)
    members = tuple(replace(member, section=tube) for member in frame.members)
    model = Model.of(replace(frame, beam="euler-bernoulli", members=members))
    basis = np.random.default_rng(3).standard_normal((model.size, 5))
    hypothesis = hypotheses_of(model, [effect])[-1]
    place, part = hypothesis.place, Projector(model, basis)(hypothesis)
    values = hypothesis.values(hypothesis.grid)[-1]
    after = effect.extend(model, place, [float(v) for v in values])
    for mass, old, new in (
        (False, model.stiffness, after.stiffness),
        (True, model.mass, after.mass),
    ):
        change = part.matrix(hypothesis.grid_factors[-1], mass=mass)
        expected = basis.T @ ((new - old) @ basis)
        if change is None:
            assert abs(expected).max() <= 1e-12 * abs(basis.T @ (old @ basis)).max()
        else:
            assert_allclose(change, expected, rtol=0, atol=2e-6 * abs(expected).max())
    blocks = {id(t.operator.blocks): t.operator.blocks for t in hypothesis.change.terms}
    elements = len(model.frame_structure.mesh.ends)
    # One matrix an element would be as much as an assembled one, for every term of every place.
    assert all(len(own) <= elements for own in blocks.values())
    if effect.name != "temperature":
        assert all(len(own) < elements / 4 for own in blocks.values())


@pytest.fixture(scope="module")
def found(model: Model) -> Callable[..., Examination]:
    """Return what exact data of the ladder with an effect in it are found to show."""

    def run(effect: Effect, place: str, value: float, *others: Effect) -> Examination:
        truth = effect.extend(model, place, [value])
        measurement = measured(truth, sensors_on_joints(model.frame_structure.frame), USED)
        return examine(model, measurement, [*KNOWN, *others], tolerance=0.0, pairs=False)

    return run


class TestNaming:
    def test_what_is_hidden_is_found(self, found: Callable[..., Examination]) -> None:
        effect, place, value = JointRotation(), "E", 2000.0
        best = found(effect, place, value).best
        (part,) = best.parts
        assert (part.hypothesis.name, part.hypothesis.place) == (effect.name, place)
        assert part.hypothesis.values(best.fit.state.x[None])[0, 0] == pytest.approx(
            value, rel=1e-2
        )
        # The prior pulls a little; the modes of a truncated space would leave thousands.
        assert best.chi2 < 0.1
        assert departure(best.fit) < 1e-2

    @pytest.mark.slow(5)
    def test_damage_over_many_elements_is_set_apart_from_that_of_one(
        self, model: Model, found: Callable[..., Examination]
    ) -> None:
        examination = found(MemberStiffness(), "AB", -0.3, LocalStiffnessLoss())
        best = examination.best
        assert (best.searched, best.place) == (("member-stiffness",), "AB")
        shortlist = [p.hypothesis for p in examination.problem.space.projections]
        assert len(shortlist) < sum({h.name: h.places for h in shortlist}.values())
        assert {h.name for h in shortlist} > {effect.name for effect in KNOWN}

    def test_a_model_of_matrices(self, model: Model) -> None:
        """Groups of a stiffness matrix, no elements, no tolerances, no model error."""
        n = model.size
        xyz = np.column_stack([np.arange(n, dtype=float), np.zeros((n, 2))])
        dofs = Dofs(np.arange(n), ("z",) * n, xyz)
        geometry = MatrixGeometry(tuple(f"n{i}" for i in range(n)), dofs)
        feet = zip("ACDF", (1e5, 2e5, 4e5, 7e5), strict=True)
        springs = [GroundSpring(Place(joint=joint), "z", value) for joint, value in feet]
        whole = model.attach((), springs).stiffness
        weaker = MemberStiffness().extend(model, "BE", [-0.5]).stiffness
        rung = sp.csc_array(2.0 * (model.stiffness - weaker))
        held = sp.csc_array(whole - rung)
        bare = Model(model.mass, held + rung, dofs, geometry, groups={"frame": held, "rung": rung})
        truth = MemberStiffness().extend(bare, "group:rung", [0.6])
        rows = np.arange(10, n, 47)
        labels = tuple(f"s{i}" for i in rows)
        sensors = Sensors(labels, xyz[rows], ("z",) * len(rows))
        rng = np.random.default_rng(3)
        measurement = measured(truth, sensors, USED + HELD_OUT, rng)
        used, held_out = tuple(range(1, USED + 1)), tuple(range(USED + 1, USED + HELD_OUT + 1))
        case = Case("case", "", "", Path(), bare, measurement, used, held_out, model_error=0.0)
        diagnosis = diagnose(case, [MemberStiffness(), YoungsModulus()], pairs=False)
        assert [(c.effect, c.place) for c in diagnosis.causes] == [
            ("member-stiffness", "group:rung")
        ]
        assert diagnosis.causes[0].parameters[0].value == pytest.approx(0.6, rel=0.2)


def lattice(count: int, elements: int) -> Frame:
    """Return a building of count x count x count bays, clamped at its feet."""
    rng = np.random.default_rng(0)
    section = Section.rectangular_tube(0.06, 0.03, 0.003)
    grid = [(i, j, k) for i in range(count + 1) for j in range(count + 1) for k in range(count + 1)]
    joints = tuple(
        Joint(
            "J{}.{}.{}".format(*at),
            tuple(np.array(at) * (1.0, 0.8, 0.9) + 0.03 * rng.standard_normal(3)),
        )
        for at in grid
    )
    members = []
    for at in grid:
        for along in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
            to = tuple(a + b for a, b in zip(at, along, strict=True))
            if max(to) <= count and (along[2] or at[2]):
                ends = "J{}.{}.{}".format(*at), "J{}.{}.{}".format(*to)
                name = f"m{len(members) + 1}"
                members.append(Member(name, ends, elements, section, ALUMINIUM))
    feet = (joint.name for joint in joints if joint.name.endswith(".0"))
    held = ("x", "y", "z", "rx", "ry", "rz")
    supports = tuple(Support(Place(joint=foot), held) for foot in feet)
    return Frame("3d", "timoshenko", joints, tuple(members), supports=supports, rotary_inertia=True)


@pytest.mark.nightly
@pytest.mark.parametrize(("elements", "size"), [(10, 2000), (118, 29000)])
def test_a_lattice_is_diagnosed_in_minutes(elements: int, size: int) -> None:
    frame = lattice(2, elements)
    model = Model.of(frame)
    assert model.size > size
    free = [joint for joint in frame.joints if not joint.name.endswith(".0")][:15]
    points = [(joint, direction) for joint in free for direction in "xy"]
    sensors = Sensors(
        tuple(f"{joint.name}:{d}" for joint, d in points),
        np.array([joint.xyz for joint, _ in points]),
        tuple(d for _, d in points),
    )
    truth = MemberStiffness().extend(model, "m15", [-0.3])
    measurement = measured(truth, sensors, 12, np.random.default_rng(3))
    case = Case("lattice", "", "", Path(), model, measurement, tuple(range(1, 9)), (9, 10, 11, 12))
    diagnosis = diagnose(case)
    assert diagnosis.verdict == "named"
    assert (diagnosis.causes[0].effect, diagnosis.causes[0].place) == ("member-stiffness", "m15")
