"""Blocks, rigid-body modes, gains, ranks and the leaderboard."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
import scored
from scored import result

from femubench import InputError
from femubench.core.case.case import Case
from femubench.core.fem.frame import Support
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal import eigen
from femubench.core.modal.eigen import solve_modes
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import RunData
from femubench.core.score.leaderboard import Standings, leaderboard
from femubench.core.score.ranking import rank_items, rank_results
from femubench.core.score.scoring import (
    Reference,
    frequency_error,
    judge,
    predict_block,
    reference_of,
    score_model,
)


@pytest.fixture(scope="module")
def case() -> Case:
    return toys.tiny_case()


@pytest.fixture(scope="module")
def reference(case: Case) -> Reference:
    return reference_of(case)


def shifted(model: Model, direction: str, stiffness: float) -> Model:
    basis = np.zeros((model.size, 1))
    basis[model.dofs.direction.index(direction)] = 1.0
    return replace(model, stiffness_change=LowRank(basis, np.array([[stiffness]])))


def test_blocks_hold_the_modes_that_were_asked_for(case: Case, reference: Reference) -> None:
    blocks = score_model(case, case.model)
    assert list(blocks) == ["used", "higher", "modified"]
    assert [m.number for m in blocks["used"].modes] == [1, 2, 3]
    assert [m.number for m in blocks["higher"].modes] == [4, 5]
    assert {m.modification for m in blocks["modified"].modes} == {"mass at C"}
    assert reference.rms_percent == {name: block.rms_percent for name, block in blocks.items()}
    assert all(block.mean_mac > 0.9 for block in blocks.values())


def test_rms_is_that_of_the_relative_frequency_errors(case: Case) -> None:
    block = score_model(case, case.model)["used"]
    elastic = solve_modes(case.model).elastic.natural_frequencies[:3]
    errors = elastic / case.measurement.frequencies[:3] - 1.0
    assert block.rms_percent == pytest.approx(100 * np.sqrt(np.mean(errors**2)), rel=1e-12)
    assert 2.0 < block.rms_percent < 10.0  # E is 10 % too high


def test_the_truth_scores_almost_nothing(case: Case, reference: Reference) -> None:
    masses = (toys.PointMass(toys.Place(joint="A"), 0.005),)
    truth = Model.of(toys.frame(9, 70.0e9, masses))
    judgement = judge(case, truth, reference)
    assert all(block.rms_percent < 1e-6 for block in judgement.blocks.values())
    assert all(block.mean_mac == pytest.approx(1.0) for block in judgement.blocks.values())
    assert (judgement.rigid_body_modes, judgement.negative_eigenvalues) == (3, 0)


def test_modes_are_never_paired_by_index(case: Case) -> None:
    order = [4, 2, 0, 3, 1]
    shuffled = replace(
        case, measurement=case.measurement.select([case.measurement.numbers[i] for i in order])
    )
    assert score_model(shuffled, case.model) == score_model(case, case.model)


def test_used_and_higher_modes_never_share_a_partner(case: Case) -> None:
    twice = replace(
        case.measurement,
        frequencies=case.measurement.frequencies[[0, 1, 2, 2, 4]],
        shapes=case.measurement.shapes[:, [0, 1, 2, 2, 4]],
    )
    blocks = score_model(replace(case, measurement=twice), case.model)
    # Apart, each block gives its copy of mode 3 the best partner there is; together only one.
    higher = predict_block(case.model, twice.select([4]), None)
    assert higher[0].predicted_hz == blocks["used"].modes[2].predicted_hz
    pairs = [*blocks["used"].modes, *blocks["higher"].modes]
    partners = [pair.predicted_hz for pair in pairs if pair.predicted_hz is not None]
    assert len(set(partners)) == len(partners)


def test_a_mode_that_no_sensor_sees_has_no_shape_to_pair_by(case: Case) -> None:
    # Sensors at the corner alone read x-bending and torsion at roundoff level for this direction.
    at = toys.sensors()
    blind = replace(case.measurement, sensors=replace(at, xyz=np.tile(at.xyz[:1], (len(at), 1))))
    pairs = predict_block(case.model, blind, None)
    assert all(pair.mac is None or 0.0 <= pair.mac <= 1.0 for pair in pairs)


def mast(stiffer: float, up: tuple[float, float, float]) -> Model:
    """A mast along z, stiffer by that share about one of two axes."""
    section = toys.Section(A=4e-4, Iy=1.2e-8 * (1.0 + stiffer), Iz=1.2e-8, J=2e-8, Jp=2.4e-8)
    joints = toys.Joint("A", (0.0, 0.0, 0.0)), toys.Joint("B", (0.0, 0.0, 1.0))
    steel = toys.Material(2.1e11, 0.3, 7850.0)
    member = toys.Member("mast", ("A", "B"), 6, section, steel, up)
    clamped = (Support(toys.Place(joint="A"), ("x", "y", "z", "rx", "ry", "rz")),)
    return Model.of(toys.Frame("3d", "euler-bernoulli", joints, (member,), supports=clamped))


@pytest.mark.parametrize(("split", "alike"), [(1e-4, True), (0.1, False)])
def test_modes_closer_than_a_test_can_tell_are_judged_as_a_space(split: float, alike: bool) -> None:
    """Frequencies known to 0.2 %: the planes of a round mast say nothing, those of an oval do."""
    heights = np.tile([0.25, 0.5, 0.75, 1.0], 2)
    xyz = np.column_stack([0.0 * heights, 0.0 * heights, heights])
    at = toys.Sensors(tuple(f"s{i}" for i in range(8)), xyz, ("x",) * 4 + ("y",) * 4)
    along, across = mast(split, (1.0, 0.0, 0.0)), mast(split, (1.0, 0.7, 0.0))
    modes = solve_modes(along).take(np.arange(4))
    hertz = modes.natural_frequencies
    shapes = along.observe(at) @ modes.shapes
    none = np.full(4, np.nan)
    measured = toys.Measurement(
        at, (1, 2, 3, 4), hertz, 2e-3 * hertz, none, shapes, np.full(shapes.shape, 0.01)
    )
    # Turned by 35 degrees, each shape has a share of 1 / (1 + 0.7^2) in the measured plane.
    pairs = predict_block(across, measured, None)
    wanted = 1.0 if alike else 1.0 / 1.49
    assert [pair.mac for pair in pairs] == pytest.approx([wanted] * 4, abs=1e-6)
    assert [pair.predicted_hz for pair in pairs] == pytest.approx(hertz.tolist(), rel=1e-9)


@pytest.mark.parametrize(
    ("predicted", "error"), [(None, 1.0), (-99.0, 1.0), (0.0, 1.0), (97.0, 0.03), (150.0, 0.5)]
)
def test_what_a_pair_counts(predicted: float | None, error: float) -> None:
    assert frequency_error(PairedMode(1, 100.0, predicted, None)) == pytest.approx(error)


def test_rigid_body_modes_are_counted_against_the_nominal_model(
    case: Case, reference: Reference
) -> None:
    assert reference.rigid.shape[1] == 3
    nominal = judge(case, case.model, reference)
    assert (nominal.rigid_body_modes, nominal.negative_eigenvalues) == (3, 0)
    grounded = judge(case, shifted(case.model, "z", 1.0e6), reference)
    assert (grounded.rigid_body_modes, grounded.negative_eigenvalues) == (2, 0)
    buckled = judge(case, shifted(case.model, "z", -1.0e3), reference)
    assert (buckled.rigid_body_modes, buckled.negative_eigenvalues) == (2, 1)


def test_a_matrix_model_that_lost_its_rigid_body_modes_is_found_out(case: Case) -> None:
    plain = replace(case, model=toys.matrices_only(case.model))
    reference = reference_of(plain)
    rigid = plain.model.mass @ reference.rigid
    spoilt = plain.model.stiffness + 1e3 * rigid[:, :2] @ rigid[:, :2].T
    changed = replace(plain.model, stiffness=type(plain.model.stiffness)(spoilt))
    assert judge(plain, plain.model, reference).rigid_body_modes == 3
    assert judge(plain, changed, reference).rigid_body_modes == 1


def test_zero_modes_that_are_no_rigid_motions_do_not_count(
    case: Case, reference: Reference
) -> None:
    # A hinge in the middle: two mechanisms more, mixed with the three rigid-body modes.
    stiffness = case.model.stiffness.toarray()
    modes = solve_modes(case.model).elastic
    pushed = case.model.mass @ modes.shapes[:, :2]
    stiffness -= pushed @ np.diag(modes.eigenvalues[:2]) @ pushed.T
    loose = replace(case.model, stiffness=type(case.model.stiffness)(stiffness))
    judgement = judge(case, loose, reference)
    assert (judgement.rigid_body_modes, judgement.negative_eigenvalues) == (3, 0)


@pytest.mark.parametrize(
    ("share", "kept", "negative"), [(5e-7, 3, 0), (-5e-7, 3, 0), (2e-6, 2, 0), (-2e-6, 2, 1)]
)
def test_a_millionth_of_the_first_elastic_eigenvalue_is_zero(
    case: Case, reference: Reference, share: float, kept: int, negative: int
) -> None:
    """M r c r' M gives the rigid motion r the eigenvalue c, and leaves all other modes alone."""
    moved = np.asarray(case.model.mass @ reference.rigid[:, :1])
    first = float(solve_modes(case.model).elastic.eigenvalues[0])
    change = LowRank(moved, np.array([[share * first]]))
    judgement = judge(case, replace(case.model, stiffness_change=change), reference)
    assert (judgement.rigid_body_modes, judgement.negative_eigenvalues) == (kept, negative)


def test_a_zero_mode_that_is_a_rigid_motion_by_half_is_none(
    case: Case, reference: Reference
) -> None:
    """The mean of a rigid motion and of an elastic mode takes no force, their difference does."""
    elastic = solve_modes(case.model).elastic
    first, value = elastic.shapes[:, 0], float(elastic.eigenvalues[0])
    apart = (reference.rigid[:, 0] - first) / np.sqrt(2.0)
    stiffness = case.model.stiffness.toarray()
    for shape, own in ((first, -value), (apart, value)):
        moved = case.model.mass @ shape
        stiffness += own * np.outer(moved, moved)
    mixed = replace(case.model, stiffness=type(case.model.stiffness)(stiffness))
    judgement = judge(case, mixed, reference)
    assert (judgement.rigid_body_modes, judgement.negative_eigenvalues) == (2, 0)


def test_a_large_model_offers_as_many_modes_as_a_small_one(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    fine = Model.of(toys.frame(40, 77.0e9))
    dense = score_model(case, fine)
    monkeypatch.setattr(eigen, "DENSE_LIMIT", 50)
    monkeypatch.setattr("femubench.core.score.scoring.DENSE_LIMIT", 50)
    sparse = score_model(case, fine)
    for name, block in dense.items():
        assert sparse[name].rms_percent == pytest.approx(block.rms_percent, rel=1e-6)


ERRORS = {"a": {"used": 4.0, "higher": 2.0}, "b": {"used": 1.0, "higher": 5.0}}


def row(errors: dict[str, dict[str, float]], *results: Any, **more: Any) -> Any:
    return leaderboard(scored.run(errors, results, **more)).iloc[0]


def test_gain_is_what_is_removed_of_the_error_out_of_band_or_added() -> None:
    for own, gain in ((1.0, 0.5), (2.0, 0.0), (4.0, -0.5), (33.0, -31.0 / 33.0), (-1.0, 0.5)):
        assert row({"a": ERRORS["a"]}, result(higher=own))["gain"] == pytest.approx(gain)
    both = {"a": {"used": 4.0, "higher": 2.0, "modified": 6.0}}
    found = row(both, result(used=0.0, higher=1.0, modified=5.0))
    assert found["gain"] == pytest.approx(0.25)  # of 4 and 3 %, each block with one weight
    assert (found["error_percent"], found["textbook_percent"]) == pytest.approx((3.0, 4.0))
    # Meeting what was given is no gain, but where a case holds nothing back.
    assert row({"a": ERRORS["a"]}, result(used=0.0, higher=2.0))["gain"] == pytest.approx(0.0)
    assert row({"a": {"used": 4.0}}, result(used=1.0))["gain"] == pytest.approx(0.75)


@pytest.mark.parametrize(
    "more",
    [
        {"status": "failed"}, {"status": "crashed"}, {"status": "timeout"}, {"status": "diverged"},
        {"status": "not-applicable"}, {"higher": 0.1, "negative_eigenvalues": 1},
        {"higher": 0.1, "rigid_body_modes": 2, "rigid_body_modes_expected": 3},
    ],
)  # fmt: skip
def test_without_a_possible_model_the_one_that_was_given_counts(more: dict[str, Any]) -> None:
    for nominal, gain in (("textbook", 0.0), ("drawn", -0.75)):
        drawn = {"a": {"used": 6.0, "higher": 8.0}}
        run = scored.run(ERRORS, [result(**more, nominal=nominal)], drawn=drawn)
        assert run.results[0].gain == pytest.approx(gain), nominal
    found = row({"a": ERRORS["a"]}, result(**more))
    assert found[["answered", "total", "gain"]].tolist() == [0, 1, 0.0]
    assert found["unphysical"] == ("higher" in more)


def test_a_missing_result_counts_as_the_model_that_was_given() -> None:
    run = scored.run(ERRORS, [result(higher=1.0)], strategies=["s", "never"])
    table = leaderboard(run).set_index("strategy")
    assert table["gain"].to_dict() == pytest.approx({"s": 0.25, "never": 0.0})
    assert table.loc["s", ["answered", "total"]].tolist() == [1, 2]


def test_ranks_go_by_gain_alone() -> None:
    listed = [
        result(strategy="zeta", higher=1.0),
        result(strategy="odd", higher=0.1, negative_eigenvalues=1),
        result(strategy="alpha", higher=1.0),
        result(strategy="gone", status="crashed"),
        result(strategy="worse", higher=3.0),
        result("b", "zeta", higher=9.0),
    ]
    found = scored.run(ERRORS, listed).results
    places = [(item.strategy, item.rank) for item in found]
    assert places == [
        ("zeta", 1), ("odd", 3), ("alpha", 1), ("gone", 3), ("worse", 5), ("zeta", 1),
    ]  # fmt: skip
    assert rank_results(found, {}) == found  # of a run without models they stay as they are


def test_equal_gains_share_a_rank_whatever_their_rounding() -> None:
    """As physical and nobari-rigid, which are one method on a ladder."""
    for noise in (0.0, 1e-12, -1e-12):
        errors = {"beta": 1.0 * (1.0 + noise), "last": 1.5, "alpha": 1.0, "first": 0.5}
        run = scored.run(
            {"a": ERRORS["a"]}, [result(strategy=n, higher=e) for n, e in errors.items()]
        )
        ranks = {"first": 1, "alpha": 2, "beta": 2, "last": 4}
        assert {r.strategy: r.rank for r in run.results} == ranks
        table = leaderboard(run)
        assert dict(zip(table["strategy"], table["rank"], strict=True)) == ranks
        assert table["strategy"].tolist() == list(ranks)


def test_ties_are_transitive_and_end_at_a_gap() -> None:
    numbers = [1.0 + 0.9e-6 * k for k in range(4)] + [1.0 + 5e-6]
    items = list(zip("dcbae", numbers, strict=True))
    for order in (items, items[::-1]):
        found = rank_items(order, lambda item: ((), item[1], item[0]))
        assert [(rank, name) for rank, (name, _) in found] == [
            *((1, name) for name in "abcd"),
            (5, "e"),
        ]
    tiers = rank_items(["x", "y"], lambda name: ((name == "x",), 1.0, name))
    assert tiers == [(1, "y"), (2, "x")]


def test_yardsticks_stand_in_their_place_and_have_no_rank() -> None:
    errors = {"best": 0.5, "line": 1.0, "last": 1.5}
    listed = [result(strategy=name, higher=error) for name, error in errors.items()]
    table = leaderboard(scored.run({"a": ERRORS["a"]}, listed, yardsticks={"line": "a line"}))
    assert table["strategy"].tolist() == ["best", "line", "last"]
    assert table["rank"].tolist()[::2] == [1, 2]
    assert np.isnan(table["rank"][1])


def test_every_structure_counts_once_however_many_cases_and_seeds_it_has() -> None:
    errors = {name: {"higher": 4.0} for name in "abc"}
    own = {"a": 2.0, "b": 3.0, "c": 0.0}
    listed = [result(name, higher=error) for name, error in own.items()]
    assert row(errors, *listed)["gain"] == pytest.approx((0.5 + 0.25 + 1.0) / 3)
    one = row(errors, *listed, structures={"a": "x", "b": "x"})
    assert one["gain"] == pytest.approx((0.375 + 1.0) / 2)
    assert one["error_percent"] == pytest.approx(1.25)
    seeds = [result("a", seed=k, higher=error) for k, error in enumerate((2.0, 4.0, 8.0))]
    assert row({"a": errors["a"]}, *seeds, seeds=[0, 1, 2])["gain"] == pytest.approx(0.0)


def test_how_many_structures_are_better_and_much_worse() -> None:
    errors = {name: {"higher": 4.0} for name in "abcd"}
    own = {"a": 3.9, "b": 4.0, "c": 4.9, "d": 5.1}
    found = row(errors, *(result(name, higher=error) for name, error in own.items()))
    assert (found["better_share"], found["worse_share"]) == (0.25, 0.25)


def test_a_case_that_holds_nothing_back_counts_only_among_its_like() -> None:
    errors = {"a": ERRORS["a"], "b": {"used": 3.0}}
    seen = result(used=0.0, higher=1.0)
    found = row(errors, seen, result("b", used=0.0))
    assert found["gain"] == pytest.approx(0.5)
    assert found[["answered", "total"]].tolist() == [2, 2]
    given = scored.run({"b": {"used": 3.0}}, [result("b", used=1.5)])
    assert leaderboard(given)["gain"][0] == pytest.approx(0.5)
    assert Standings.basis_of(given) == "given"
    assert Standings.basis_of(scored.run(errors, [seen])) == "unseen"


def test_tests_stand_apart_from_computed_truths() -> None:
    errors = {"a": {"higher": 1.0}, "b": {"higher": 1.0}}
    listed = (result(higher=0.5), result("b", higher=3.0))
    assert row(errors, *listed, classes={"b": ["free"]})["gain_tests"] == pytest.approx(0.5)
    assert np.isnan(row(errors, *listed)["gain_tests"])


def test_ranks_are_from_the_textbook_model_and_the_start_as_drawn_stands_next_to_it() -> None:
    errors = {"a": {"higher": 1.0}, "b": {"higher": 1.0}}
    starts = {"starts": {"a": ["textbook", "drawn"], "b": ["textbook"]}, "alike": ["b"]}
    listed = [
        result(higher=0.5, nominal="textbook"),
        result(higher=2.0, nominal="drawn"),
        result("b", higher=1.0, nominal="textbook"),
    ]
    run = scored.run(errors, listed, drawn={"a": {"higher": 3.0}}, **starts)
    found = leaderboard(run).iloc[0]
    assert found["gain"] == pytest.approx(0.25)
    assert found["gain_drawn"] == pytest.approx(-0.25)
    assert found["total"] == 2
    assert [item.rank for item in run.results] == [1, 1, 1]
    # What fails from the model as drawn leaves that.
    lost = [listed[0], result(status="failed", nominal="drawn"), listed[2]]
    again = scored.run(errors, lost, drawn={"a": {"higher": 3.0}}, **starts)
    assert leaderboard(again)["gain_drawn"][0] == pytest.approx(-1.0 / 3.0)


def test_several_seeds_of_few_structures_give_an_interval_over_seeds() -> None:
    listed = [result(seed=k, higher=e) for k, e in enumerate((1.0, 1.2, 0.8, 0.5, 1.5))]
    stated = {"seeds": list(range(5))}
    found = row({"a": ERRORS["a"]}, *listed, **stated)
    assert found["gain"] == pytest.approx(0.5)
    assert found["gain_low"] < found["gain"] < found["gain_high"]
    again = row({"a": ERRORS["a"]}, *reversed(listed), **stated)
    assert again["gain_low"] == pytest.approx(found["gain_low"])
    assert np.isnan(row({"a": ERRORS["a"]}, listed[0])["gain_low"])


def test_a_run_without_what_its_gains_rest_on_is_to_be_run_again() -> None:
    old = RunData({"run": "old", "reference": {"a": {"higher": 2.0}}}, (result(higher=1.0),))
    with pytest.raises(InputError, match=r"keeps no candidate partners of case 'a'.*run it again"):
        leaderboard(old)
    lacking = scored.run(ERRORS, [result("c", higher=1.0)])
    with pytest.raises(InputError, match=r"case 'c'.*run it again"):
        leaderboard(lacking)
