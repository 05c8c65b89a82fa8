"""Verdicts: adequacy as a probability, groups, the order of the verdicts; which data they need."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_problems import case_of, catalogue, effects_named, measured

from femubench import Case, Diagnosis, InputError, Measurement, Model, diagnose
from femubench.core.case.modes import NO_SENSORS
from femubench.core.challenge.structures import structure_named
from femubench.core.challenge.truth import finer
from femubench.core.change.change import Change
from femubench.core.change.hypothesis import Hypothesis, by_themselves
from femubench.core.diagnosis import proof, tables
from femubench.core.diagnosis.scatter import scatter_rows
from femubench.core.diagnosis.verdict import (
    Decision,
    Sufficiency,
    angle_between,
    decide,
    fitted_otherwise,
    inseparable,
    most_believed,
)
from femubench.core.fit.residuals import Data
from femubench.core.inference.posterior import Explanation, Posterior
from femubench.core.inference.prior import outside_odds
from femubench.core.inference.search import adequacy
from femubench.core.inference.settings import overridden, settings
from femubench.core.plugin.loader import load_plugins
from femubench.core.schema.diagnosis import Cause
from femubench.fem import Factor, Frame, Joint, Material, Member, Place, Section, Support
from femubench.plugins.effects.mass_offset import MassOffset

FRAME = structure_named("ladder").frame
MODEL = Model.of(FRAME)
Names = tuple[str, ...]


# --- adequacy ---------------------------------------------------------------------------------


def left(residual: np.ndarray[Any, Any], data: Data) -> Any:
    """Return a state that leaves these residuals."""
    problem = SimpleNamespace(data=data)
    count = len(data.measurement)
    return SimpleNamespace(problem=problem, residual=residual, partner=np.arange(count))


@pytest.fixture(scope="module")
def data() -> Data:
    return Data(measured(MODEL, FRAME), np.zeros(0))


def noise(data: Data, rng: np.random.Generator) -> np.ndarray[Any, Any]:
    """Return residuals of pure noise; every shape has lost its scale."""
    residual = rng.standard_normal(len(data))
    mode, sensor = data.shape_rows
    for j in np.unique(mode):
        rows = len(data.measurement) + np.flatnonzero(mode == j)
        seen = data.shapes[sensor[mode == j], j]
        residual[rows] -= seen * (seen @ residual[rows]) / (seen @ seen)
    return residual


def test_noise_is_adequate_as_often_as_the_probability_says(data: Data) -> None:
    """Small probabilities are no more frequent than they say, large deviations aside."""
    rng = np.random.default_rng(0)
    found = np.array([adequacy(left(noise(data, rng), data), 0) for _ in range(500)])
    assert found.min() >= 0.0
    assert found.max() <= 1.0
    for level in (0.2, 0.05, 0.01):
        share = np.mean(found < level)
        assert share < 2.0 * level + 3.0 * np.sqrt(level / len(found))
    assert np.mean(found < 0.2) > 0.05


@pytest.mark.parametrize("fault", ["all", "frequency", "mode", "sensor"])
def test_what_is_off_alone_is_seen_among_many_good_data(data: Data, fault: str) -> None:
    rng = np.random.default_rng(1)
    mode, sensor = data.shape_rows
    count = len(data.measurement)
    residual = noise(data, rng)
    if fault == "all":
        residual *= 1.6
    elif fault == "frequency":
        residual[2] += 6.0
    else:
        rows = mode == 3 if fault == "mode" else sensor == 4
        residual[count + np.flatnonzero(rows)] += 6.0 / np.sqrt(rows.sum()) * 1.5
    assert adequacy(left(noise(data, rng), data), 0) > 0.01
    assert adequacy(left(residual, data), 0) < 1e-3


def test_fitted_values_count_as_spent(data: Data) -> None:
    residual = np.sqrt((len(data) - data.scale_count) / len(data)) * np.ones(len(data))
    few, many = (adequacy(left(residual, data), unknowns) for unknowns in (0, 20))
    assert many < few


def test_both_tails_of_chi_square_are_said_with_their_numbers(data: Data) -> None:
    state = left(noise(data, np.random.default_rng(2)), data)
    state.x = np.zeros(0)
    whole, *parts = scatter_rows(state)
    assert [row.kind for row in (whole, *parts)] == ["all", "frequencies", "shapes"]
    assert (whole.dof, parts[0].dof) == (len(data) - data.scale_count, len(data.measurement))
    assert whole.chi2 == pytest.approx(state.residual @ state.residual)
    assert whole.less_p + whole.more_p == pytest.approx(1.0)
    assert not any(row.warning for row in (whole, *parts))
    state.residual *= 0.25
    few = {row.kind: row for row in scatter_rows(state)}
    assert few["shapes"].factor == pytest.approx(4.0, rel=0.15)
    assert "so little with probability" in few["shapes"].warning
    assert "times too large" in few["shapes"].warning
    assert few["all"].warning == ""  # a kind by itself says more
    assumed = replace(data, measurement=replace(data.measurement, assumed=True))
    state.problem = SimpleNamespace(**{**vars(state.problem), "data": assumed})
    assert not any(row.warning for row in scatter_rows(state))  # nobody has stated that much
    state.residual *= 16.0
    much = {row.kind: row for row in scatter_rows(state)}
    assert much["shapes"].more_p < 1e-12
    assert "so much with probability" in much["shapes"].warning
    assert "4 times too small" in much["shapes"].warning.replace("3.9", "4").replace("4.1", "4")


# --- decisions --------------------------------------------------------------------------------


NO_SHAPES = SimpleNamespace(scale_count=0, measurement=(), shape_rows=(np.zeros(0), np.zeros(0)))


def explained(
    names: Names,
    probability: float,
    *,
    chi2: float = 60.0,
    direction: Sequence[float] = (1.0, 0.0, 0.0),
    place: str = "all",
    book: Names = (),
    data: int = 60,
) -> Any:
    """Return an explanation as far as a verdict looks at it."""
    columns = np.array(direction, dtype=float)[:, None] if names else np.zeros((3, 0))
    return SimpleNamespace(
        log_evidence=float(np.log(probability)),
        base=SimpleNamespace(names=book, parts=book),
        tells_more=False,
        parts=names,
        searched=names,
        effects=frozenset({*book, *names}),
        place=place,
        chi2=chi2,
        log_likelihood=-0.5 * chi2,
        unknowns=len(names),
        log_weight=float(np.log(probability)),
        fit=SimpleNamespace(
            state=SimpleNamespace(
                jacobian=columns,
                x=np.zeros(len(names)),
                residual=np.full(data, np.sqrt(chi2 / data)),
                problem=SimpleNamespace(data=NO_SHAPES),
                partner=(),
            ),
        ),
    )


def posterior(*explanations: Any) -> Posterior:
    return Posterior.of(explanations)


def decided(
    found: Posterior, adequate: float, confirmed: bool, differs: bool | None = None, **test: Any
) -> Decision:
    """Return the decision on the most probable explanation."""
    key = next((key for key in found.names if key), ())
    enough = Sufficiency(adequate, holds=confirmed, **test)
    return decide(found, found.best(key), enough, differs)


ACROSS, ALONG = (0.0, 1.0, 0.0), (1.0, 0.1, 0.0)


def test_nothing_is_said_where_nothing_is_likelier_than_not() -> None:
    found = posterior(explained((), 0.6), explained(("a",), 0.4))
    assert decided(found, 0.5, True).verdict == "none"
    assert decided(found, 0.5, False).verdict == "none"
    assert decided(found, 1e-5, True).verdict == "unknown"
    assert decided(found, 0.5, True).nothing == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("adequate", "confirmed", "expected"),
    [
        (0.5, True, "named"),
        (0.5, False, "not-confirmed"),
        (1e-6, True, "unknown"),
        (1e-6, False, "unknown"),
    ],
)
def test_a_name_needs_an_adequate_fit_and_a_gain_on_unseen_data(
    adequate: float, confirmed: bool, expected: str
) -> None:
    found = posterior(explained(("a",), 0.99), explained((), 0.01, chi2=200.0))
    decision = decided(found, adequate, confirmed)
    assert (decision.verdict, decision.group) == (expected, (("a",),))


def test_a_guess_is_believed_no_more_than_the_data_allow() -> None:
    """What is left, or unseen data, may speak against all that is known."""
    found = posterior(explained(("a",), 0.9999), explained((), 1e-4, chi2=200.0))
    assert decided(found, 0.5, True).held == 1.0
    assert decided(found, 1e-4, True).held == most_believed(1e-4) < 0.003
    assert decided(found, 0.0, True).held == 0.0
    refuted = decided(found, 0.5, False, log_bayes=-5.0)
    assert refuted.held == pytest.approx(1.0 / (1.0 + np.exp(5.0)))
    assert decided(found, 0.5, False, log_bayes=4.0).held == 0.5
    clean = posterior(explained((), 0.999), explained(("a",), 0.001))
    assert decided(clean, 0.5, True).nothing == pytest.approx(0.999)
    assert decided(clean, 1e-9, True).nothing < 1e-6


def test_what_several_causes_imitate_lowers_what_is_stated_and_not_what_is_preferred() -> None:
    """A cause outside the catalogue that they imitate is weighed with each, by its prior."""
    by_one, by_more = settings.prior_imitated
    one, two, nothing = explained(("a",), 0.3), explained(("a", "b"), 0.6), explained((), 0.1)
    for e in (one, two, nothing):
        e.outside = outside_odds(len(e.parts), settings.prior_of_causes)
    _, first, second, *_ = settings.prior_of_causes
    unknown = 0.3 * by_one / first + 0.6 * by_more / second
    found = posterior(one, two, nothing)
    assert found.known == pytest.approx(1.0 / (1.0 + unknown))
    assert found.names == pytest.approx({("a", "b"): 0.6, ("a",): 0.3, (): 0.1})
    assert posterior(nothing).known == 1.0
    assert 0.99 < posterior(one).known < 1.0
    with overridden({"prior_imitated": (5e-5, 5e-5)}):
        two.outside = outside_odds(2, settings.prior_of_causes)
        assert posterior(two).known > 0.999


def test_what_its_own_error_makes_up_for_is_no_cause() -> None:
    """A wrong cause whose own error is most of what it changes fits any data."""
    found = posterior(explained(("a",), 0.99), explained((), 0.01, chi2=200.0))
    assert decided(found, 0.5, True, own=0.22).verdict == "named"
    assert decided(found, 0.5, True, own=0.87).verdict == "unknown"


def test_what_does_not_differ_has_no_cause_and_what_does_is_not_nothing() -> None:
    named = posterior(explained(("a",), 0.99), explained((), 0.01, chi2=200.0))
    clean = posterior(explained((), 0.9), explained(("a",), 0.1))
    assert decided(named, 0.5, True, True).verdict == "named"
    assert decided(named, 0.5, True, False).verdict == "none"
    assert decided(clean, 0.5, True, False).verdict == "none"
    changed = decided(clean, 0.5, True, True)
    assert (changed.verdict, changed.group) == ("unknown", ())


def test_where_unseen_data_cannot_tell_a_name_is_unconfirmed() -> None:
    found = posterior(explained(("a",), 0.99), explained((), 0.01, chi2=200.0))
    decision = decided(found, 0.5, True, tells=False)
    assert (decision.verdict, decision.unconfirmed) == ("named", True)
    assert not decided(found, 0.5, True).unconfirmed


def test_what_unseen_data_bear_out_stands_first() -> None:
    found = posterior(
        explained(("a",), 0.7), explained(("b",), 0.29, direction=ACROSS), explained((), 0.01)
    )
    decision = decide(found, found.best(("b",)), Sufficiency(0.5))
    assert decision.group == (("b",), ("a",))
    assert decision.angles == pytest.approx((0.0, 90.0))


def test_what_unseen_data_refute_at_its_textbook_value_is_tried_as_fitted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    book = explained((), 0.7, chi2=57.0, book=("a",))
    fitted, plain = explained(("a",), 0.2, chi2=53.0), explained((), 0.01, chi2=66.0)
    found = posterior(book, fitted, plain)
    assert (found.key(book), fitted_otherwise(found, book)) == (("a",), [fitted])
    seen: Any = SimpleNamespace(posterior=found, best=book)
    for borne in (fitted, None):
        monkeypatch.setattr(proof, "_judged", lambda case, seen, e, b=borne: (e is b, 0.0))
        assert proof.find_held(None, seen) is borne  # type: ignore[arg-type]


def test_what_only_passes_along_in_the_best_is_nothing_that_all_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    best = explained(("a", "b"), 0.9, book=("shear",))
    best.fit.state.parts = [SimpleNamespace(hypothesis=SimpleNamespace(name=n)) for n in "ab"]
    seen: Any = SimpleNamespace(posterior=posterior(best))
    monkeypatch.setattr(tables, "find_spread", lambda posterior, leader: np.zeros(2))
    monkeypatch.setattr(tables, "find_passengers", lambda state, spread: [False, True])
    assert tables.has_causes(seen, best, ("a",))
    assert tables.has_causes(seen, best, ("shear", "b"))
    assert not tables.has_causes(seen, best, ("b",))


def test_a_group_covers_nearly_all_that_is_not_nothing() -> None:
    """Whatever the angles: those are in the evidence."""
    for share, expected in ((0.9, "ambiguous"), (0.96, "named")):
        for direction in (ALONG, ACROSS):
            found = posterior(
                explained(("a",), share),
                explained(("b",), 0.999 - share, chi2=70.0, direction=direction),
                explained((), 0.001),
            )
            assert decided(found, 0.5, True).verdict == expected


@pytest.mark.parametrize(
    ("names", "chi2", "expected"),
    [
        (("b",), 60.1, True),
        (("b",), 65.9, True),
        (("b",), 66.1, False),
        (("b", "c"), 60.1, False),
        (("a", "b"), 57.0, False),
    ],
)
def test_a_rival_that_only_its_prior_excludes_is_in_the_group(
    names: Names, chi2: float, expected: bool
) -> None:
    """One with more values contradicts nothing: it is left to its evidence."""
    found = posterior(
        explained(("a",), 0.9999),
        explained(names, 1e-5, chi2=chi2, direction=ACROSS),
        explained((), 1e-6, chi2=200.0),
    )
    group, _ = inseparable(found)
    assert (names in group) is expected


def test_textbook_physics_that_the_data_hardly_notice_is_no_part_of_a_name() -> None:
    """Whatever the prior of sizes makes of it, and where nobody tried without it."""
    for chi2, expected in ((60.1, ()), (200.0, ("b",))):
        with_b = explained(("a",), 0.9, chi2=60.0, book=("b",))
        without = explained(("a",), 1e-3, chi2=chi2)
        assert posterior(with_b, without).key(with_b) == (*("a",), *expected)
        alone = explained((), 1e-20, chi2=460.0, book=("b",))
        plain = explained((), 1e-24, chi2=400.0 + chi2)
        assert posterior(with_b, alone, plain).key(with_b) == (*("a",), *expected)


def test_textbook_physics_in_all_that_is_left_is_named_whatever_else_is_there() -> None:
    nothing = explained((), 1e-6, chi2=1000.0)
    core = explained(("a",), 0.6, chi2=80.0, book=("a",))
    with_b = explained(("a", "b"), 0.2, chi2=70.0, book=("a",))
    with_c = explained(("a", "c"), 0.2, chi2=71.0, book=("a",))
    found = posterior(nothing, core, with_b, with_c)
    decision = decided(found, 0.5, True)
    assert (decision.verdict, decision.group) == ("named", (("a",),))


def test_a_cause_that_some_names_lack_is_not_named_for_sure() -> None:
    """Neither where they share nothing, nor where what they share leaves more than noise."""
    nothing = explained((), 1e-6, chi2=1e4)
    apart = posterior(nothing, explained(("b",), 0.5), explained(("c",), 0.5, direction=ACROSS))
    weak = posterior(
        nothing,
        explained(("a",), 0.01, chi2=120.0),
        explained(("a", "b"), 0.5, chi2=60.0),
        explained(("a", "c"), 0.5, chi2=61.0, direction=ACROSS),
    )
    more = posterior(
        nothing, explained(("a",), 0.3, chi2=75.0), explained(("a", "b"), 0.7, chi2=70.0)
    )
    for found in (apart, weak):
        assert decided(found, 0.5, True).verdict == "ambiguous"
    decision = decided(more, 0.5, True)
    assert (decision.verdict, decision.shared) == ("named", ("a",))


def test_an_angle_is_between_subspaces_and_takes_no_units() -> None:
    one, two = explained(("a",), 0.5), explained(("b",), 0.5, direction=(7.0, 7.0, 0.0))
    assert angle_between(one, two) == pytest.approx(45.0)
    assert np.isnan(angle_between(one, explained((), 0.5)))
    still = explained(("c",), 0.5, direction=(0.0, 0.0, 0.0))
    assert np.isnan(angle_between(one, still))


# --- whole diagnoses --------------------------------------------------------------------------

FEW = (
    "youngs-modulus",
    "density",
    "torsion-constant",
    "joint-mass",
    "member-stiffness",
    "member-mass",
    "added-mass",
    "local-stiffness-loss",
)


def trial(effect: str, place: str, *values: float, **options: Any) -> Case:
    """Return a case of a ladder with an effect; three modes are held out."""
    truth = catalogue()[effect].extend(MODEL, place, values)
    test = measured(truth, FRAME, count=9, rng=np.random.default_rng(6), **options)
    return case_of(MODEL, test, 6)


def diagnosed(case: Case, *, names: Sequence[str] = FEW, **options: Any) -> Diagnosis:
    return diagnose(case, effects_named(*names), **options)


def test_stiffness_and_density_part_when_the_structure_is_weighed() -> None:
    heavy = ("density", "all", 0.08)
    blind = diagnosed(trial(*heavy, weighed=False))
    assert blind.verdict == "ambiguous"
    assert {cause.effect for cause in blind.causes} == {"youngs-modulus", "density"}
    assert "angle" in blind.reason
    assert "eigh" in blind.advice[0].measurement
    assert blind.advice[0].separation > 100.0
    weighed = diagnosed(trial(*heavy))
    assert weighed.verdict == "named"
    (cause,) = weighed.causes
    (size,) = cause.parameters
    assert cause.effect == "density"
    assert size.std is not None
    assert abs(size.value - 0.08) < 4.0 * size.std


def test_a_deviation_is_that_of_the_value_in_its_unit() -> None:
    """Six frequencies to 0.2 % give a density to 2 * 0.2 % / sqrt(6) of the structure's mass."""
    truth = catalogue()["density"].extend(MODEL, "all", (0.08,))
    test = measured(truth, FRAME, count=6, shapes=0, weighed=False)
    found = diagnosed(case_of(MODEL, test, 6), names=("density",), tolerance=0.0)
    ((size,),) = (cause.parameters for cause in found.causes)
    assert size.std == pytest.approx(1.08 * 2.0 * 0.002 / np.sqrt(6.0), rel=0.05)


@pytest.mark.parametrize("size", [0.01, 0.05])
def test_what_is_said_to_be_missing_is_in_the_extended_model(size: float) -> None:
    """Also where nothing is the likeliest single answer, and something likelier than nothing."""
    truth = catalogue()["member-mass"].extend(MODEL, "rung-middle", (size,))
    test = measured(truth, FRAME, count=9, rng=np.random.default_rng(0))
    found = diagnosed(case_of(MODEL, test, 6))
    same = found.extended is MODEL
    assert (found.verdict == "none") == (found.causes == ()) == same
    assert (found.chi2[1] < found.chi2[0]) == (not same)


@pytest.fixture(scope="module")
def clean() -> Diagnosis:
    test = measured(MODEL, FRAME, count=9, rng=np.random.default_rng(16))
    return diagnose(case_of(MODEL, test, 6))


def test_a_clean_model_lacks_nothing_and_says_what_it_would_have_seen(clean: Diagnosis) -> None:
    assert clean.verdict == "none"
    assert clean.causes == ()
    assert clean.extended is not None
    assert clean.gain.used_percent[0] == clean.gain.used_percent[1]
    known = by_themselves(catalogue().values())
    applicable = {effect.name for effect in known if effect.places(MODEL)}
    assert {row.effect for row in clean.smallest_visible} == applicable
    assert all(row.size > 0.0 for row in clean.smallest_visible)
    assert "show nothing that the model lacks" in clean.sentence


def test_where_models_of_this_kind_are_as_wrong_the_sentence_says_by_how_much() -> None:
    test = measured(MODEL, FRAME, count=6, shapes=0)
    off = 1.0 + 0.02 * np.random.default_rng(4).standard_normal(6)
    case = case_of(MODEL, replace(test, frequencies=off * test.frequencies), 6)
    found = diagnose(replace(case, model_error=1.0), effects_named("density"))
    size = found.gain_rms.used_percent[0]
    assert (found.verdict, size > 1.0) == ("none", True)
    assert found.sentence.startswith(f"The model is {size:.2g} % off in the used modes (rms), and")


def test_scatter_of_the_elements_is_no_noise_of_the_measurement() -> None:
    """Frequencies to 0.01 % that are 0.05 % off: no cause, but not nothing either."""
    test = measured(MODEL, FRAME, count=6, shapes=0, weighed=False)
    off = 1.0 + 0.0005 * np.random.default_rng(4).standard_normal(6)
    close = replace(test, frequencies=off * test.frequencies, frequency_std=1e-4 * test.frequencies)
    found = diagnose(case_of(MODEL, close, 6), effects_named("density"))
    assert (found.verdict, found.like_a_beam > 0.5) == ("none", True)
    size = found.gain_rms.used_percent[0]
    assert found.sentence.startswith(f"The model is {size:.2g} % off in the used modes (rms), and")


@pytest.mark.parametrize("effect", ["added-mass", "joint-rotation"])
def test_three_times_the_smallest_visible_size_is_found(clean: Diagnosis, effect: str) -> None:
    """For a spring a third of the stiffness; at the place where it would show best."""
    row = next(row for row in clean.smallest_visible if row.effect == effect)
    parameters = catalogue()[effect].parameters(MODEL, row.place)
    softer = parameters[0].scaling == "compliance"
    size = row.size / 3.0 if softer else 3.0 * row.size
    values = [size] * len(parameters)
    truth = catalogue()[effect].extend(MODEL, row.place, values)
    test = measured(truth, FRAME, count=9, rng=np.random.default_rng(16))
    found = diagnosed(case_of(MODEL, test, 6), names=(*FEW, "joint-rotation"), pairs=False)
    assert found.verdict in ("named", "ambiguous")
    assert effect in {cause.effect for cause in found.causes}


def test_what_the_data_say_and_what_the_prior_adds_make_up_the_odds() -> None:
    found = diagnosed(trial("density", "all", 0.08, weighed=False), pairs=False)
    nothing, rival = found.evidence
    assert nothing.against == "nothing"
    assert nothing.data == pytest.approx(0.5 * (found.chi2[0] - found.chi2[1]))
    assert nothing.data > 20.0
    assert nothing.prior < 0.0
    # Modulus or density: the same data, and so does the prior say.
    assert rival.against.split(" at ")[0] in ("youngs-modulus", "density")
    assert abs(rival.data) < 1.0
    first, second = (cause.probability for cause in found.causes)
    assert rival.data + rival.prior == pytest.approx(np.log(first / second), abs=0.05)


def test_a_guess_that_does_not_explain_the_data_is_not_stated_as_sure() -> None:
    """Two sensors swapped: no effect does that, whatever fits best."""
    case = trial("member-mass", "rung-middle", 0.2)
    shapes = case.measurement.shapes.copy()
    shapes[[0, 3]] = shapes[[3, 0]]
    swapped = replace(case, measurement=replace(case.measurement, shapes=shapes))
    found = diagnosed(swapped, faults=False, pairs=False)
    assert found.verdict == "unknown"
    assert found.causes
    assert all(cause.probability < 0.02 for cause in found.causes)
    assert found.nothing < 0.02


# --- what cannot be diagnosed, and what can all the same --------------------------------------


def bare(measurement: Measurement) -> Measurement:
    """Return the frequencies alone."""
    empty = np.zeros((0, len(measurement)))
    return replace(measurement, sensors=NO_SENSORS, shapes=empty, shape_std=empty, total_mass=None)


def test_one_used_mode_is_diagnosed_as_far_as_it_goes() -> None:
    count = 1
    case = trial("member-mass", "rung-middle", 0.2)
    found = diagnosed(replace(case, used=case.used[:count]))
    assert found.data_count > 0
    assert found.verdict in ("none", "ambiguous", "named", "unknown", "not-confirmed")
    lonely = replace(case, used=case.used[:count], held_out=(), modifications=())
    alone = diagnosed(replace(lonely, measurement=bare(case.measurement)))
    assert np.isfinite(alone.chi2).all()


@pytest.mark.slow(5)
def test_data_of_another_structure_are_no_reason_to_name_anything() -> None:
    case = trial("density", "all", 0.01)
    rng = np.random.default_rng(2)
    test = case.measurement
    strange = replace(
        test,
        frequencies=4.7 * test.frequencies[::-1],
        frequency_std=4.7 * test.frequency_std[::-1],
        shapes=rng.standard_normal(test.shapes.shape),
        total_mass=None,
    )
    found = diagnosed(replace(case, measurement=strange), pairs=False)
    assert found.verdict == "unknown"
    assert found.adequacy_p < 1e-3


def beam(elements: int, section: Section, *, clamped: bool = False) -> Frame:
    """Return a beam of 1 m in the x-z plane, held at one end or at both."""
    joints = Joint("A", (0.0, 0.0, 0.0), "E"), Joint("B", (1.0, 0.0, 0.0), "E")
    member = Member("beam", ("A", "B"), elements, section, Material(2.1e11, 0.3, 7850.0))
    held = ("A", "B") if clamped else ("A",)
    supports = tuple(Support(Place(joint=name), ("x", "z", "ry")) for name in held)
    return Frame("in-plane", "euler-bernoulli", joints, (member,), supports=supports)


WHOLE = Section(1e-4, 1e-9, 1e-9, 2e-9, 2e-9)
PLANE = Section(1e-4, 1e-9, 0.0, 0.0, 0.0)  # A and Iy alone, which is all that a plane needs


@pytest.mark.parametrize(("used", "shapes"), [(2, 0), (5, 3)])
def test_fewer_modes_in_the_model_than_in_the_data_are_one_clear_error(
    used: int, shapes: int
) -> None:
    frame = beam(1, WHOLE)
    test = measured(Model.of(beam(12, WHOLE)), frame, count=5, shapes=shapes)
    with pytest.raises(InputError, match=r"the model has 3 modes, the data have [45]") as caught:
        diagnosed(case_of(Model.of(frame), test, used))
    assert "\n" not in str(caught.value)


def test_a_section_of_a_plane_frame_needs_its_area_and_iy_alone() -> None:
    frame = beam(6, PLANE, clamped=True)
    model = Model.of(frame)
    truth = catalogue()["youngs-modulus"].extend(model, "all", (-0.1,))
    test = measured(truth, frame, count=6, shapes=3)
    found = diagnose(case_of(model, test, 4), effects_named("youngs-modulus", "axial-preload"))
    assert "youngs-modulus" in {cause.effect for cause in found.causes}
    (preload,) = catalogue()["axial-preload"].parameters(model, "beam")
    assert preload.scale == pytest.approx(0.15 * np.pi**2 * 2.1e11 * 1e-9)


@pytest.mark.parametrize("missing", [False, True])
def test_a_mode_that_the_band_should_hold_and_does_not_is_said(missing: bool) -> None:
    case = trial("member-mass", "rung-middle", 0.05)
    m = case.measurement
    band = 0.5 * float(m.frequencies[0]), 1.02 * float(m.frequencies[-1])
    kept = replace(case, band=band)
    if missing:
        kept = replace(kept, measurement=m.select([n for n in m.numbers if n != 8]))
        kept = replace(kept, held_out=tuple(n for n in case.held_out if n != 8))
    said = [look.what for look in diagnosed(kept, pairs=False).looks if "band" in look.what]
    assert len(said) == int(missing)
    if missing:
        assert "without a partner: mode 8" in said[0]


def test_without_effects_there_is_nothing_to_name() -> None:
    effects = effects_named("amplitude-dependent-stiffness")  # which needs a second level
    wrong = diagnose(trial("youngs-modulus", "all", 0.2), effects)
    assert wrong.verdict == "unknown"
    assert wrong.causes == ()
    test = measured(MODEL, FRAME, count=9, rng=np.random.default_rng(16))
    right = diagnose(case_of(MODEL, test, 6), effects)
    assert right.verdict == "none"
    assert right.smallest_visible == ()


def test_there_must_be_a_used_mode() -> None:
    case = trial("density", "all", 0.08)
    with pytest.raises(InputError, match="no used mode"):
        diagnosed(replace(case, used=()))


def test_what_half_an_element_has_lost_is_named_there() -> None:
    lost = 0.75
    frame = replace(finer(FRAME), factors=(Factor("E", ("front-left/6",), 1.0 - lost),))
    test = measured(Model.of(frame), frame, rng=np.random.default_rng(3))
    found = diagnose(case_of(MODEL, test, 6), effects_named("local-stiffness-loss", "added-mass"))
    (cause,) = found.causes
    assert (found.verdict, cause.place) == ("named", "front-left/3:second")
    (parameter,) = cause.parameters
    assert abs(parameter.value - lost) < 2.0 * (parameter.std or 0.0)
    written = found.extended.frame_structure.frame.factors[-1]
    assert written.at == ("front-left/3:second",)


def test_a_diagnosis_leaves_nothing_behind_but_the_last() -> None:
    """A model keeps what was made of it, and each look for plugins makes effects anew."""
    case = case_of(MODEL, measured(MODEL, FRAME), 6)
    counts = []
    for _ in range(3):
        effects = load_plugins().effects
        assert diagnose(case, [effects["added-mass"], effects["member-stiffness"]]).examination
        gc.collect()
        counts.append(sum(type(kept) in (Hypothesis, Explanation) for kept in gc.get_objects()))
    assert counts[2] == counts[1]


def test_what_refines_a_shared_cause_is_said() -> None:
    """A mass on an arm is weighed as `added-mass`: where that is shared it was left out."""
    part = SimpleNamespace(hypothesis=Hypothesis(MassOffset(), Change(places=("B",)), 1))
    explanation: Any = SimpleNamespace(parts=(part,))
    found = [Cause("mass-offset", "B", (), 1.0, ""), Cause("density", "all", (), 1.0, "")]
    assert tables.only_shared(found, explanation, ("added-mass",)) == found[:1]
    assert tables.only_shared(found, explanation, ("density", "mass-offset")) == found[1:]
