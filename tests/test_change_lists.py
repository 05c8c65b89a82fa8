"""Lists of changes: parts and effects as parameters of every strategy that fits some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import femubench
from femubench import InputError, Model, NotApplicable
from femubench.core.change.change import parameter_of
from femubench.core.update.change_lists import check_changes
from femubench.effect import Change
from femubench.fem import Place, Support
from femubench.modal import eigenvalue_sensitivities
from femubench.update import (
    Changes,
    ModalSpace,
    ParametricModel,
    sensitivity_update,
)

FRAME = femubench.cases["frame"]
WORDS = (
    "sections+joint-rotation",
    "members+density+joint-mass",
    "joint-offset+torsion-constant",
    "shear-deformation+rotary-inertia",
    "local-stiffness-loss@rung-middle/2+added-mass@J1",
    "joints",
)
FAMILY = (
    *("global", "local", "spring", "offset", "bayesian", "bayesian-sampling", "sparse"),
    *("eigensensitivity", "cma-es", "particle-swarm", "multi-start", "strain-energy"),
    "cross-model",
)


def inside(parametric: ParametricModel) -> np.ndarray:
    """Return coordinates off all limits, a third of the way to what is likely."""
    high = np.minimum(parametric.upper, 0.5)
    return np.where(parametric.lower < -0.5, 0.1, 0.0) + 0.4 * high


@pytest.mark.parametrize(
    ("case", "words"), [*(("frame", words) for words in WORDS), ("hframe", "joint-offset+density")]
)
def test_slopes_of_a_list_are_those_of_differences(case: str, words: str) -> None:
    model = femubench.cases[case].model
    parametric = ParametricModel(model, tuple(Changes(model).listed(words)))
    x = inside(parametric)
    at = parametric.at(x)
    modes = femubench.solve_modes(at).elastic.take(np.arange(4))
    slopes = eigenvalue_sensitivities(at, modes, parametric.slopes(x, at)) * parametric.steps(x)
    step, masses = 1e-5, parametric.mass_slopes(x, at) * parametric.steps(x)
    for k, unit in enumerate(np.eye(len(x))):
        up, down = (parametric.at(x + sign * step * unit) for sign in (1.0, -1.0))
        high, low = (femubench.solve_modes(m).elastic.eigenvalues[:4] for m in (up, down))
        # Differences of eigenvalues are known to rounding of the largest one of the model.
        scale = np.abs(slopes).max(axis=1) + 0.5 * modes.eigenvalues
        np.testing.assert_array_less(
            np.abs(slopes[:, k] - (high - low) / (2.0 * step)), 2e-5 * scale
        )
        weighed = [parametric.mass(x + s * step * unit, m) for s, m in ((1, up), (-1, down))]
        assert masses[k] == pytest.approx((weighed[0] - weighed[1]) / (2.0 * step), abs=1e-6)


def test_the_modal_space_has_the_frequencies_and_slopes_of_the_model() -> None:
    parametric = Changes(FRAME.model).parameterise("sections+joint-rotation+joint-mass")
    used, x = FRAME.used_measurement(), inside(parametric)
    space = ModalSpace.of(parametric, used, shape_weight=0.1, at=0.5 * x)
    exact = femubench.solve_modes(parametric.at(x)).elastic.natural_frequencies[:6]
    values, _ = space.eigenpairs(x)
    hertz = np.sqrt(np.abs(values)) / (2.0 * np.pi)
    assert hertz[hertz > 1.0][:6] == pytest.approx(exact, rel=1e-8)
    ahead, behind = (
        [space.fit(x + sign * 1e-5 * unit).residual for unit in np.eye(len(x))] for sign in (1, -1)
    )
    slope = (np.array(ahead) - np.array(behind)).T / 2e-5
    assert space.fit(x).slope == pytest.approx(slope, abs=2e-6)


def test_an_effect_sits_at_its_coarsest_places_or_at_the_one_that_is_named() -> None:
    model = FRAME.model
    names = [change.name for change in Changes(model).listed("joint-rotation+density")]
    assert names == ["joint-rotation L", "joint-rotation T", "density all"]
    (alone,) = Changes(model).listed("joint-rotation@J1")
    assert alone.places == ("J1",)
    free, held = (Changes(model).listed("density", prior_std=std)[0] for std in (None, 0.1))
    assert parameter_of(free.parameters[0]).std == np.inf
    assert parameter_of(held.parameters[0]).std == 1.0


def test_what_has_no_place_or_name_is_one_line() -> None:
    check_changes("own")
    with pytest.raises(InputError, match=r"there is no 'member' \(expected own, elements, "):
        check_changes("sections+member")
    with pytest.raises(NotApplicable, match="joint-rotation has no place in this model at 'X'"):
        Changes(FRAME.model).listed("joint-rotation@X")
    matrices = replace(FRAME.model, structure=None)
    with pytest.raises(NotApplicable, match="joint-rotation has no place in this model"):
        Changes(matrices).listed("joint-rotation")
    with pytest.raises(NotApplicable, match=r"attached-oscillator.* adds degrees of freedom"):
        Changes(FRAME.model).parameterise("attached-oscillator@J1")
    with pytest.raises(NotApplicable, match=r"is in E .* and in E "):
        Changes(FRAME.model).parameterise("members+sections")


@pytest.mark.parametrize(
    "name",
    [
        n if n in ("offset", "sparse") else pytest.param(n, marks=pytest.mark.nightly)
        for n in FAMILY
    ],
)
def test_every_strategy_of_the_family_fits_effects_and_sections_together(name: str) -> None:
    strategy = femubench.strategies[name](changes="joint-rotation+sections")
    used = FRAME.used_measurement()
    result = strategy.update(FRAME.model, used, np.random.default_rng(0))
    expected = 2 if name == "strain-energy" else 5  # which fits what it names alone
    assert len(result.parameters) >= expected
    modes = femubench.solve_modes(result.model)
    assert int(modes.rigid.sum()) == 3
    assert modes.eigenvalues.min() > -1e-6 * modes.elastic.eigenvalues[0]
    error = np.abs(modes.elastic.natural_frequencies[:3] / used.frequencies - 1.0).max()
    if name not in ("cross-model", "strain-energy"):  # linear about rigid joints
        assert error < 0.02


def test_a_value_that_is_set_moves_in_its_unit_and_keeps_its_sign() -> None:
    soft = Change.set_property("k", "spring", ("a@B:ry",), 1e4, 1.0, 1e7, unit="N m/rad")
    signed = Change.set_property("a", "rigid", ("a@B",), -0.02, -0.1, 0.1, unit="m", signed=True)
    assert soft.values(np.array([[np.log(2.0)]]))[0, 0] == pytest.approx(2e4)
    assert signed.values(np.array([[2.0]]))[0, 0] == pytest.approx(0.02)
    assert signed.bounds[0] == pytest.approx([-4.0])
    both = ParametricModel(FRAME.model, (soft, signed, Change.scale_property("E", "E", ())))
    steps = both.steps(np.array([np.log(2.0), 2.0, 0.3]))
    assert steps == pytest.approx([2e4, 0.02, 1.0])  # a factor counts about its present value
    factor = Change.scale_property("E", "E", ("rung-middle/1",), prior_std=0.1)
    result = sensitivity_update(FRAME.model, [factor], FRAME.used_measurement())
    assert result.parameters[0].places == ("rung-middle/1",)


def test_a_list_that_contradicts_itself_is_refused() -> None:
    for words, message in (
        ("members+members", "'members' stands there twice"),
        ("own+members", "'own' alone"),
        ("members@rung-middle", "only effects have places"),
    ):
        with pytest.raises(InputError, match=message):
            check_changes(words)
    with pytest.raises(InputError, match=r"one of own, .* not 'members\+sections'"):
        check_changes("members+sections", parts_alone=True)
    with pytest.raises(NotApplicable, match=r"no plugin|nobody"):
        Changes(FRAME.model).listed("nobody/effect")
    together = Changes(FRAME.model).parameterise("joint-rotation+joint-flexibility")
    with pytest.raises(NotApplicable, match="do not go together in this model"):
        ModalSpace.of(together, FRAME.used_measurement(), shape_weight=0.0)
    with pytest.raises(NotApplicable, match="do not go together in this model"):
        sensitivity_update(FRAME.model, together.changes, FRAME.used_measurement())


def test_a_point_without_a_mass_is_worse_than_any_model() -> None:
    lighter = Changes(FRAME.model).parameterise("member-mass+density")
    space = ModalSpace.of(lighter, FRAME.used_measurement(), shape_weight=0.1)
    low = space.fit(lighter.lower)
    assert low.paired == 0
    assert low.cost > 1e3 * space.fit(np.zeros(len(lighter))).cost
    assert not low.slope.any()


def test_masses_of_matrices_and_of_held_frames_have_the_terms_in_them() -> None:
    held = replace(
        FRAME.model.frame_structure.frame, supports=(Support(Place(joint="J1"), ("z", "rx", "ry")),)
    )
    frame = ParametricModel(Model.of(held), tuple(Changes(Model.of(held)).listed("added-mass@J5")))
    (kilograms,) = frame.values(np.array([0.5]))
    at = frame.at(np.array([0.5]))
    assert frame.mass(np.array([0.5]), at) == pytest.approx(
        frame.model.total_mass + kilograms, rel=1e-12
    )
    half = replace(FRAME.model, structure=None, mass_groups={"half": 0.5 * FRAME.model.mass})
    factor = Change.scale_property("mass", "density", ("group:half",))
    both = ParametricModel(half, (factor, *Changes(half).listed("youngs-modulus")))
    x = np.zeros(len(both))
    x[0] = np.log(1.2)
    assert both.mass(x, both.at(x)) == pytest.approx(1.1 * half.total_mass, rel=1e-9)
    assert both.mass_slopes(x, both.at(x))[0] == pytest.approx(0.6 * half.total_mass, rel=1e-9)
