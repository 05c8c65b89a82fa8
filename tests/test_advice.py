"""What to measure next: which measurement wins, and by how much."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from advice_problems import STD, advised, every_option, fitted, posed
from diagnosis_problems import clamped_portal, measured, problem_of, sensors_on_joints

from femubench import Model, solve_modes
from femubench.core.advise.advice import advise
from femubench.core.advise.point_attachments import list_supports
from femubench.core.fem.alteration import alter_model
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.fem import (
    Frame,
    GroundSpring,
    Joint,
    Material,
    Member,
    Place,
    Section,
    Support,
    matrix_model,
)
from femubench.plugins.effects.joint_rotation import JointRotation
from femubench.plugins.effects.material import Density, MemberStiffness, YoungsModulus
from femubench.plugins.effects.support_flexibility import SupportFlexibility
from femubench.plugins.effects.temperature import Temperature

FrameBuilder = Callable[..., Frame]


@pytest.fixture(scope="module")
def symmetric(ladder: FrameBuilder) -> Model:
    """Return the ladder with its two mirror symmetries."""
    return Model.of(ladder(polar=False, accelerometer=False))


class TestWinners:
    def test_weighing_tells_modulus_from_density(self, symmetric: Model) -> None:
        truth = YoungsModulus().extend(symmetric, "all", [0.05])
        problem = posed(symmetric, truth, [YoungsModulus(), Density()])
        fits = [fitted(problem, YoungsModulus(), "all"), fitted(problem, Density(), "all")]
        first, *rest = advised(symmetric, problem, fits)
        assert first.measurement == "weigh the structure"
        # A density 5 % lower weighs 1/1.05 - 1; the fit knows it to 2 STD / sqrt(6).
        gap = 1.0 - 1.0 / 1.05
        expected = gap**2 / (STD**2 + (2.0 * STD / 1.05) ** 2 / 6.0)
        assert first.separation == pytest.approx(expected, rel=0.03)
        assert all(advice.separation < 0.02 * first.separation for advice in rest)
        assert all(a.measurement.startswith("attach") for a in rest)  # a known mass is a scale too
        # Scatter of 28 elements makes the nominal mass less sure.
        loose, *_ = advise(symmetric, [problem] * 2, fits, tolerance=0.02)
        more = STD**2 + 0.02**2 / 28 + (2.0 * STD / 1.05) ** 2 / 6.0
        assert loose.separation == pytest.approx(gap**2 / more, rel=0.03)

    def test_what_was_weighed_in_time_is_ranked(self, symmetric: Model) -> None:
        truth = YoungsModulus().extend(symmetric, "all", [0.05])
        problem = posed(symmetric, truth, [YoungsModulus(), Density()])
        fits = [fitted(problem, YoungsModulus(), "all"), fitted(problem, Density(), "all")]
        given = symmetric, [problem] * 2, fits
        only, *rest = advise(*given, tolerance=0.0, stops=lambda: True)
        whole = advise(*given, tolerance=0.0, stops=lambda: False)
        assert not rest
        assert whole[0] == only
        assert len(whole) > 1

    def test_a_weighed_structure_is_not_weighed_again(self, symmetric: Model) -> None:
        truth = YoungsModulus().extend(symmetric, "all", [0.05])
        plain = posed(symmetric, truth, [YoungsModulus(), Density()])
        mass = plain.space.mass
        measurement = replace(plain.data.measurement, total_mass=(mass, 0.02 * mass))
        weighed = replace(
            plain, data=Data(measurement, np.zeros(0)), noise=Noise.of(np.zeros((7, 0)), 0.0)
        )
        fits = [fitted(weighed, YoungsModulus(), "all"), fitted(weighed, Density(), "all")]
        found = advised(symmetric, weighed, fits)
        assert found
        assert not any("weigh" in advice.measurement for advice in found)

    def test_mirror_joints_need_a_place_off_the_symmetry(self, symmetric: Model) -> None:
        truth = JointRotation().extend(symmetric, "A", [3000.0])
        problem = posed(symmetric, truth, [JointRotation()])
        fits = [fitted(problem, JointRotation(), place) for place in ("A", "F")]
        assert abs(fits[0].state.chi2 - fits[1].state.chi2) < 1e-6
        found = advised(symmetric, problem, fits)
        best = next(a for a in found if "antiresonance" in a.measurement)
        assert best.measurement == (
            "measure the antiresonance near 524 Hz of the point receptance at AB@0.5, z"
        )
        assert best.separation > 50.0  # the first prototype's figure for such a point
        assert any(a.measurement == "attach 0.024 kg at A and measure again" for a in found)
        assert all(
            "BE@0.5" not in a.measurement and "modes" not in a.measurement[:15] for a in found
        )
        options = every_option(symmetric, problem, fits)
        middle = [o for text, o in options.items() if " at BE@0.5" in text]
        assert len(middle) == 2
        (modes,) = (o for text, o in options.items() if "2 more modes" in text)
        assert max(*middle, modes) < 1e-6

    def test_responses_are_ranked_next_to_modes_and_sensors(self, symmetric: Model) -> None:
        """Two of a joint's neighbours differ in many antiresonances, unless these are known."""
        frame = symmetric.frame_structure.frame
        truth = JointRotation().extend(symmetric, "A", [3000.0])
        test = measured(truth, frame, shapes=6, weighed=False)
        few = test.sensors.take(range(4)), test.shapes[:4], test.shape_std[:4]
        test = replace(test, **dict(zip(("sensors", "shapes", "shape_std"), few, strict=True)))
        problem = problem_of(symmetric, test, [JointRotation(), YoungsModulus()])
        fits = [fitted(problem, JointRotation(), "A"), fitted(problem, YoungsModulus(), "all")]
        found = {a.measurement: a.separation for a in advised(symmetric, problem, fits)}
        (text,) = (word for word in found if "frequency responses" in word)
        assert re.search(r"to a force at \S+: \d\d antiresonances up to \d+ Hz$", text)
        options = every_option(symmetric, problem, fits)
        single = [o for word, o in options.items() if "the antiresonance near" in word]
        (further,) = (o for word, o in options.items() if "at further joints" in word)
        assert found[text] > max(single)
        assert further > 1.0
        known = advise(symmetric, [problem] * 2, fits, tolerance=0.0, responses=True)
        assert not any("frequency responses" in a.measurement for a in known)
        twins = every_option(symmetric, problem, [fits[0], fits[0]])
        assert twins[text] < 1e-9

    def test_nothing_helps_between_twins_but_one_option_stays(self, symmetric: Model) -> None:
        truth = YoungsModulus().extend(symmetric, "all", [0.05])
        problem = posed(symmetric, truth, [YoungsModulus()])
        found = fitted(problem, YoungsModulus(), "all")
        (only,) = advised(symmetric, problem, [found, found])
        assert only.separation < 1e-12
        assert advised(symmetric, problem, [found]) == ()


class TestSupports:
    """A structure that is held otherwise shows which of two explanations is right."""

    def test_a_soft_foot_or_a_softer_whole(self) -> None:
        """Two frequencies of a bent post on one foot leave both; hung free, one is out."""
        section, steel = Section.rectangular_tube(0.04, 0.03, 0.002), Material(2.1e11, 0.3, 7850.0)
        whole = clamped_portal(4, section, steel)
        foot, other = SupportFlexibility(), YoungsModulus()
        model = Model.of(replace(whole, supports=whole.supports[:1]))
        soft = foot.extend(model, "support:fl", [1e8, 2e4])
        problem = posed(model, soft, [foot, other], count=2)
        fits = [fitted(problem, foot, "support:fl", 1.0), fitted(problem, other, "all", -0.5)]
        best = advised(model, problem, fits)[0]
        assert best.measurement.startswith("hang it free, not held at fl and measure again, above")
        # Free, E alone lowers both modes, as far as two held ones say: known to STD / sqrt(2).
        modulus = float(fits[1].parts[0].hypothesis.values(fits[1].state.x[None])[0, 0])
        ratio = np.sqrt(1.0 + modulus)
        expected = 2.0 * ((1.0 - ratio) / STD) ** 2 / (1.0 + ratio**2)
        assert best.separation == pytest.approx(expected, rel=0.02)

    def test_mirrored_feet(self) -> None:
        """Frequencies are the same; those without a foot are not, and the modes named are."""
        section, steel = Section.rectangular_tube(0.04, 0.03, 0.002), Material(2.1e11, 0.3, 7850.0)
        frame, foot = clamped_portal(4, section, steel), SupportFlexibility()
        model = Model.of(frame)
        problem = posed(model, foot.extend(model, "support:fl", [2e6, 3e4]), [foot])
        fits = [fitted(problem, foot, f"support:{at}", 1.0) for at in ("fl", "fr")]
        best = advised(model, problem, fits)[0]
        text = "take away the support at fr and measure again, above all the modes near"
        assert best.measurement.startswith(text)
        # The model with the foot at fl alone, soft or rigid, meshed anew.
        bare = Model.of(replace(frame, supports=frame.supports[:1]))
        values = fits[0].parts[0].hypothesis.values(fits[0].state.x[None])[0].tolist()
        first, second = (
            solve_modes(one).natural_frequencies[:6]
            for one in (foot.extend(bare, "support:fl", values), bare)
        )
        apart = np.abs(first / second - 1.0)
        named = [float(f) for f in re.findall(r"[0-9.]+", best.measurement)]
        shown = [int(np.abs(first - f).argmin()) for f in named]
        assert set(shown) == set(np.argsort(-apart)[:2].tolist())
        # Two deviations of the fit come on top of those of the measurement.
        assert 1.0 < best.separation < np.square(apart / STD).sum()

    def test_one_that_hangs_free_is_held_at_sensors(
        self, symmetric: Model, ladder: FrameBuilder
    ) -> None:
        soft, frame = JointRotation(), ladder(polar=False, accelerometer=False)
        truth = soft.extend(symmetric, "A", [3e3])
        test = measured(truth, frame, shapes=1, weighed=False)
        near = [i for i, label in enumerate(test.sensors.labels) if label == "Dz"]
        seen = test.sensors.take(near), test.shapes[near], test.shape_std[near]
        test = replace(test, sensors=seen[0], shapes=seen[1], shape_std=seen[2])
        problem = problem_of(symmetric, test, [soft])
        fits = [fitted(problem, soft, at, 0.5) for at in ("A", "F")]
        held = [text for text in every_option(symmetric, problem, fits) if "hold " in text]
        values = fits[0].parts[0].hypothesis.values(fits[0].state.x[None])[0].tolist()
        pinned = Model.of(replace(frame, supports=(Support(Place("D"), ("z",)),), free=False))
        exact = solve_modes(soft.extend(pinned, "A", values)).elastic.natural_frequencies
        assert len(held) == 1
        assert held[0].startswith("hold D in z and measure again")
        for named in re.findall(r"[0-9.]+", held[0]):
            assert np.abs(exact / float(named) - 1.0).min() < 5e-3

    def test_no_mechanism_and_no_soil_is_taken_away(self) -> None:
        section, steel = Section.rectangular_tube(0.04, 0.03, 0.002), Material(2.1e11, 0.3, 7850.0)
        hinges = Support(Place("fl"), ("x", "z")), Support(Place("fr"), ("z",))
        frame = replace(clamped_portal(4, section, steel), supports=hinges)
        frame = frame.with_attachments((), (GroundSpring(Place(member="left", s=0.5), "x", 1e4),))
        model, whole = Model.of(frame), YoungsModulus()
        problem = posed(model, whole.extend(model, "all", [0.05]), [whole, Density()])
        fits = [fitted(problem, effect, "all") for effect in (whole, Density())]
        ways = [text for text, *_ in list_supports(model, problem.data.measurement.sensors)]
        assert ways == ["take away the support at fl", "take away the support at fr"]
        # Without fr the spring keeps it from turning about fl; without fl it can turn.
        options = [text for text in every_option(model, problem, fits) if "take away" in text]
        assert [text.startswith(ways[1]) for text in options] == [True]

    def test_a_support_of_matrices_is_a_group(self) -> None:
        """Frequencies do not say which of two pads is soft; those without one of them do."""
        section, steel = Section.rectangular_tube(0.04, 0.03, 0.002), Material(2.1e11, 0.3, 7850.0)
        bare = replace(clamped_portal(4, section, steel), supports=())
        pad = {"x": 2e6, "z": 4e6, "ry": 3e4}

        def on(**shares: float) -> Model:
            feet = [(Place(f), share) for f, share in shares.items()]
            springs = [GroundSpring(at, d, s * k) for at, s in feet for d, k in pad.items()]
            return Model.of(bare.with_attachments((), tuple(springs)))

        parts = {f: on(**{f: 1.0}).stiffness - on().stiffness for f in ("fl", "fr")}
        groups, kinds = {"portal": on().stiffness, **parts}, dict.fromkeys(parts, "support")
        model = replace(on(fl=1.0, fr=1.0), structure=None, groups=groups, group_kinds=kinds)
        test = measured(on(fl=0.5, fr=1.0), bare, shapes=0, weighed=False)
        problem = problem_of(model, test, [MemberStiffness()])
        fits = [fitted(problem, MemberStiffness(), f"group:{f}", -0.5) for f in parts]
        best = advised(model, problem, fits)[0]
        text = "take away the support at group:fr and measure again, above all the modes near"
        assert best.measurement.startswith(text)
        exact = solve_modes(on(fl=0.5)).natural_frequencies
        for named in re.findall(r"[0-9.]+", best.measurement):
            assert np.abs(exact / float(named) - 1.0).min() < 6e-3

    def test_matrices_that_hang_free_are_held_at_nodes(self, symmetric: Model) -> None:
        dofs = symmetric.dofs
        known = symmetric.mass, symmetric.stiffness, dofs.node.tolist(), dofs.direction, dofs.xyz
        plain = matrix_model(*known)
        sensors = sensors_on_joints(symmetric.frame_structure.frame)
        assert list(list_supports(plain, sensors)) == []
        (way, held, _), *_ = list_supports(replace(plain, free=True), sensors)
        assert way == "hold 0 in z"
        free, pinned = (solve_modes(m) for m in (plain, alter_model(plain, held)))
        assert (free.rigid.sum(), pinned.rigid.sum()) == (3, 2)


class TestGroups:
    def test_of_three_says_which_are_set_apart(self, symmetric: Model) -> None:
        effects = [YoungsModulus(), Density(), Temperature()]
        truth = YoungsModulus().extend(symmetric, "all", [-0.015])
        problem = posed(symmetric, truth, effects)
        found = advised(symmetric, problem, [fitted(problem, e, "all") for e in effects])
        texts = [advice.measurement for advice in found]
        assert texts[:2] == [
            "read the temperature (tells youngs-modulus from temperature only)",
            "weigh the structure (tells youngs-modulus from density only)",
        ]
        # -1.5 % is 41.7 K of aluminium, known to 2 STD / sqrt(6) of E and a priori to 10 K.
        per_kelvin = 3.6e-4
        std = 2.0 * STD * 0.985 / np.sqrt(6.0) / per_kelvin
        share = 1.0 / (1.0 + (std / 10.0) ** 2)
        expected = (share * 0.015 / per_kelvin) ** 2 / (1.0 + share * std**2)
        assert found[0].separation == pytest.approx(expected, rel=0.02)

    def test_second_level_has_its_rank_and_only_for_what_is_softer(self, symmetric: Model) -> None:
        effects = [YoungsModulus(), Density()]
        for change, shown in ((-0.03, True), (0.03, False)):
            truth = YoungsModulus().extend(symmetric, "all", [change])
            problem = posed(symmetric, truth, effects)
            found = advised(symmetric, problem, [fitted(problem, e, "all") for e in effects])
            sizes = [advice.separation for advice in found]
            assert sizes == sorted(sizes, reverse=True)
            levels = [a for a in found if "twice the excitation level" in a.measurement]
            assert len(levels) == shown
            if shown:
                # The fall of every frequency is ln sqrt(0.97), known to STD / sqrt(6).
                fall = 1.0 / np.sqrt(1.0 + change) - 1.0
                expected = fall**2 / (2.0 * STD**2 + STD**2) * 6.0
                assert levels[0].separation == pytest.approx(expected, rel=0.05)


def test_modes_that_further_points_do_not_see_say_nothing() -> None:
    """Of a bar whose bending in z is measured everywhere, those in y alone are left to see."""
    bar, steel = Section(6e-4, 8e-8, 2e-8, 5e-8, 1e-7), Material(2.1e11, 0.3, 7850.0)
    joints = Joint("foot", (0.0, 0.0, 0.0)), Joint("tip", (1.0, 0.0, 0.0))
    foot = Support(Place("foot"), ("x", "y", "z", "rx", "ry", "rz"))
    member = Member("bar", ("foot", "tip"), 8, bar, steel)
    frame = Frame("3d", "euler-bernoulli", joints, (member,), supports=(foot,))
    model = Model.of(frame)
    test = measured(YoungsModulus().extend(model, "all", [0.02]), frame, shapes=6, weighed=False)
    kept = [i for i, label in enumerate(test.sensors.labels) if label not in ("bary", "barx")]
    own = test.sensors.take(kept), test.shapes[kept], test.shape_std[kept]
    test = replace(test, **dict(zip(("sensors", "shapes", "shape_std"), own, strict=True)))
    problem = problem_of(model, test, [YoungsModulus(), Density()])
    fits = [fitted(problem, effect, "all") for effect in (YoungsModulus(), Density())]
    assert all(np.isfinite(a.separation) for a in advised(model, problem, fits))
