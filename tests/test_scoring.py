"""Blocks, rigid-body modes, scores, ranks and the leaderboard."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest

from femubench.core.case.case import Case
from femubench.core.fem.frame import Support
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal import eigen
from femubench.core.modal.eigen import solve_modes
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult, Run, Status
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.ranking import rank_items, rank_results, score_of
from femubench.core.score.scoring import (
    Reference,
    frequency_error,
    judge,
    predict_block,
    reference_of,
    score_model,
)
from femubench.results import find_basis, ranks_by_floor


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


def test_a_block_without_data_is_not_there(case: Case) -> None:
    bare = replace(case, held_out=(), modifications=())
    assert list(score_model(bare, case.model)) == ["used"]


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


def result(
    strategy: str,
    *,
    status: Status = "ok",
    seed: int = 0,
    case: str = "a",
    rms: float = 1.0,
    **more: Any,
) -> JobResult:
    blocks = {name: Block(rms, 0.9, ()) for name in ("used", "higher")} if status == "ok" else {}
    return JobResult(case, strategy, seed, status, blocks=blocks, **more)


REFERENCE = {"a": {"used": 4.0, "higher": 2.0}, "b": {"used": 1.0, "higher": 5.0}}
META = {"reference": REFERENCE, "seeds": [0], "seed": 5, "strategies": []}


def test_score_is_what_is_left_of_the_error_on_unseen_data() -> None:
    assert score_of(result("s"), REFERENCE["a"]) == pytest.approx(1.05 / 2.05, rel=1e-14)
    both = {"used": 4.0, "higher": 2.0, "modified": 7.0}
    blocks = {name: Block(rms, None, ()) for name, rms in (("higher", 1.0), ("modified", 3.0))}
    expected = math.sqrt((1.05 / 2.05) * (3.05 / 7.05))
    assert score_of(replace(result("s"), blocks=blocks), both) == pytest.approx(expected, rel=1e-14)
    # A case that holds nothing back has nothing else to say.
    assert score_of(result("s"), {"used": 4.0}) == pytest.approx(1.05 / 4.05, rel=1e-14)


@pytest.mark.parametrize(
    ("status", "score"),
    [("failed", 10), ("crashed", 10), ("timeout", 10), ("diverged", 10), ("not-applicable", 1)],
)
def test_score_of_a_job_without_model(status: str, score: float) -> None:
    assert score_of(result("s", status=status), REFERENCE["a"]) == score


def test_ranks_go_by_physics_then_score() -> None:
    results = [
        result("zeta", rms=2.0),
        result("best", rms=0.1, rigid_body_modes=2, rigid_body_modes_expected=3),
        result("negative", rms=0.2, negative_eigenvalues=1),
        result("alpha", rms=2.0),
        result("gone", status="crashed"),
        result("zeta", rms=9.0, case="b"),
    ]
    found = rank_results(results, REFERENCE)
    places = [(item.strategy, item.rank) for item in found]
    assert places == [
        ("zeta", 1),
        ("best", 3),
        ("negative", 4),
        ("alpha", 1),
        ("gone", 5),
        ("zeta", 1),
    ]
    assert [item.score for item in rank_results(found)] == [item.score for item in found]


def test_equal_scores_share_a_rank_whatever_their_rounding() -> None:
    """As physical and nobari-rigid, which are one method on a ladder."""
    for noise in (0.0, 1e-12, -1e-12):
        rms = {"beta": 2.0 * (1.0 + noise), "last": 2.1, "alpha": 2.0, "first": 1.0}
        results = [result(name, rms=value) for name, value in rms.items()]
        assert {r.strategy: r.rank for r in rank_results(results, REFERENCE)} == {
            "first": 1,
            "alpha": 2,
            "beta": 2,
            "last": 4,
        }
        meta = {**META, "reference": {"a": REFERENCE["a"]}}
        table = leaderboard(Run(meta, tuple(results)))
        assert table["strategy"].tolist() == ["first", "alpha", "beta", "last"]
        assert table["rank"].tolist() == [1, 2, 2, 4]


def test_ties_are_transitive_and_end_at_a_gap() -> None:
    scores = [1.0 + 0.9e-6 * k for k in range(4)] + [1.0 + 5e-6]
    items = list(zip("dcbae", scores, strict=True))
    for order in (items, items[::-1]):
        found = rank_items(order, lambda item: ((), item[1], item[0]))
        assert [(rank, name) for rank, (name, _) in found] == [
            *((1, name) for name in "abcd"),
            (5, "e"),
        ]
    tiers = rank_items(["x", "y"], lambda name: ((name == "x",), 1.0, name))
    assert tiers == [(1, "y"), (2, "x")]


def test_without_reference_the_result_of_the_baseline_serves() -> None:
    found = rank_results(
        [result("still", rms=2.0), result("good", rms=1.0), result("x", case="b")],
        baseline="still",
    )
    assert [item.score for item in found] == pytest.approx([1.0, 1.05 / 2.05, 10.0])


def board(reference: dict[str, dict[str, float]], *results: JobResult, **meta: Any) -> Any:
    return leaderboard(Run({**META, "reference": reference, **meta}, results)).iloc[0]


def with_blocks(case: str, **errors: float) -> JobResult:
    return replace(
        result("s", case=case), blocks={k: Block(rms, None, ()) for k, rms in errors.items()}
    )


def test_gain_is_what_is_taken_away_of_the_error_on_unseen_data() -> None:
    results = (result("s", rms=1.0), with_blocks("b", used=3.0, higher=4.0))
    row = board(REFERENCE, *results)
    ratios = [1.05 / 2.05, 4.05 / 5.05]
    assert row["gain"] == pytest.approx(1.0 - math.sqrt(np.prod(ratios)), rel=1e-12)
    assert row["used_percent"] == 2.0  # the median over the two cases
    assert row["higher_percent"] == 2.5
    assert np.isnan(row["modified_percent"])
    better = board(
        REFERENCE,
        *(replace(item, blocks={**item.blocks, "used": Block(0.0, None, ())}) for item in results),
    )
    assert better["gain"] == row["gain"]  # meeting what was given is no gain


def test_every_structure_counts_once_however_many_cases_it_has() -> None:
    reference = {name: {"used": 1.0, "higher": 1.0} for name in "abc"}
    errors = {"a": 3.0, "b": 3.0, "c": 0.5}
    results = [with_blocks(name, higher=rms) for name, rms in errors.items()]
    apart = board(reference, *results)
    assert 1.0 - apart["gain"] == pytest.approx((3.05**2 * 0.55) ** (1 / 3) / 1.05)
    one = board(reference, *results, structures={"a": "x", "b": "x"})
    assert 1.0 - one["gain"] == pytest.approx((3.05 * 0.55) ** 0.5 / 1.05)


def test_data_that_two_cases_of_a_structure_share_count_once() -> None:
    reference = {"a": {"higher": 2.0, "modified": 1.0}, "b": {"modified": 1.0}}
    results = [with_blocks("a", higher=1.0, modified=4.0), with_blocks("b", modified=4.0)]
    row = board(reference, *results, structures={"a": "x", "b": "x"})
    alone = board({"a": reference["a"]}, results[0])
    assert row["gain"] == pytest.approx(alone["gain"], rel=1e-14)
    other = board(reference | {"b": {"modified": 1.1}}, *results, structures={"a": "x", "b": "x"})
    assert other["gain"] < row["gain"] - 0.05


@pytest.mark.parametrize("floor", [0.005, 0.2])
def test_what_is_added_to_all_errors_can_be_chosen(floor: float) -> None:
    run = Run({**META, "reference": {"a": {"higher": 2.0}}}, (with_blocks("a", higher=1.0),))
    left = 1.0 - leaderboard(run, floor)["gain"][0]
    assert left == pytest.approx((1.0 + floor) / (2.0 + floor))


def test_ranks_that_rest_on_the_floor_are_told() -> None:
    reference = {"a": {"higher": 1.0}, "b": {"higher": 1.0}}
    errors = {"met": (0.0, 4.0), "even": (0.45, 0.45)}
    results = [
        replace(with_blocks(case, higher=rms), strategy=name)
        for name, pair in errors.items()
        for case, rms in zip("ab", pair, strict=True)
    ]
    found = ranks_by_floor(Run({**META, "reference": reference}, tuple(results)))
    assert found == {"met": (1, 1, 1, 2, 2), "even": (2, 2, 2, 1, 1)}


def test_a_missing_result_scores_ten_and_a_strategy_without_any_is_there() -> None:
    run = Run({**META, "strategies": ["s", "never"]}, (result("s", rms=1.0),))
    table = leaderboard(run).set_index("strategy")
    expected = 1.0 - math.sqrt(1.05 / 2.05 * 10.0)
    assert table.loc["s", "gain"] == pytest.approx(expected, rel=1e-12)
    assert table.loc["never", "gain"] == pytest.approx(-9.0)
    assert table.loc["s", ["ok", "total"]].tolist() == [1, 2]


def test_a_case_that_holds_nothing_back_counts_only_among_its_like() -> None:
    reference = {"a": {"used": 4.0, "higher": 2.0, "modified": 1.0}, "b": {"used": 3.0}}
    seen = with_blocks("a", used=0.0, higher=1.0, modified=2.0)
    row = board(reference, seen, result("s", rms=0.0, case="b"))
    expected = 1.0 - math.sqrt((1.05 / 2.05) * (2.05 / 1.05))
    assert row["gain"] == pytest.approx(expected, rel=1e-12)
    assert row[["ok", "total"]].tolist() == [2, 2]
    assert board(reference, result("s", case="b"))["gain"] == pytest.approx(-9.0)
    given = Run({**META, "reference": {"b": {"used": 3.0}}}, (result("s", case="b"),))
    assert leaderboard(given)["gain"][0] == pytest.approx(1.0 - 1.05 / 3.05)
    assert find_basis(given) == "given"
    assert find_basis(Run({**META, "reference": reference}, (seen,))) == "unseen"


def test_tests_stand_apart_from_computed_truths() -> None:
    reference = {"a": {"higher": 1.0}, "b": {"higher": 1.0}}
    results = (with_blocks("a", higher=0.5), with_blocks("b", higher=3.0))
    row = board(reference, *results, classes={"b": ["free"]})
    assert row["gain_tests"] == pytest.approx(1.0 - 0.55 / 1.05)
    assert np.isnan(board(reference, *results)["gain_tests"])


def test_ranks_are_from_the_textbook_model_and_the_start_as_drawn_is_beside() -> None:
    reference = {"a": {"higher": 1.0}, "b": {"higher": 1.0}}
    starts = {"starts": {"a": ["textbook", "drawn"], "b": ["textbook"]}, "alike": ["b"]}
    results = [
        replace(with_blocks("a", higher=0.5), nominal="textbook"),
        replace(with_blocks("a", higher=2.0), negative_eigenvalues=1),
        replace(with_blocks("b", higher=1.0), nominal="textbook"),
    ]
    run = Run({**META, "reference": reference, **starts}, rank_results(results, reference))
    row = leaderboard(run).iloc[0]
    assert row["gain"] == pytest.approx(1.0 - math.sqrt(0.55 / 1.05))
    assert row["gain_drawn"] == pytest.approx(1.0 - math.sqrt(2.05 / 1.05))
    assert not row["unphysical"]
    assert row["total"] == 2
    assert [item.rank for item in run.results] == [1, 1, 1]


def test_who_is_not_applicable_scores_as_the_model_that_was_given() -> None:
    errors = {"used": 6.0, "higher": 8.0}
    drawn = {name: Block(error, None, ()) for name, error in errors.items()}
    idle = replace(result("idle", status="not-applicable"), start_percent=errors)
    same = replace(result("same"), blocks=drawn)
    assert score_of(idle, REFERENCE["a"]) == score_of(same, REFERENCE["a"])
    assert score_of(idle, REFERENCE["a"]) == pytest.approx(8.05 / 2.05, rel=1e-14)
    found = rank_results(
        [idle, same, result("better", rms=1.9), result("worse", rms=9.0)], REFERENCE
    )
    assert [(item.strategy, item.rank) for item in found] == [
        ("idle", 2), ("same", 2), ("better", 1), ("worse", 4),
    ]  # fmt: skip
    assert rank_results(found) == found
    # From the textbook model it stays on the line that a measurement has to pass.
    starts = {"starts": {"a": ["textbook", "drawn"]}, "reference": {"a": REFERENCE["a"]}}
    line = replace(result("idle", status="not-applicable"), nominal="textbook")
    row = leaderboard(Run({**META, **starts}, (line, idle))).iloc[0]
    assert row["gain"] == 0.0
    assert row["gain_drawn"] == pytest.approx(1.0 - 8.05 / 2.05, rel=1e-14)
    assert np.isnan(row["higher_percent"])  # it is no model of the strategy's


def test_the_unphysical_rank_below_the_physical_and_no_model_at_all_below_both() -> None:
    lost = result("lost", rms=0.1, rigid_body_modes=1, rigid_body_modes_expected=3)
    fine = result("lost", rms=0.1, case="b", rigid_body_modes=3, rigid_body_modes_expected=3)
    bad = [result("bad", status="failed"), result("bad", status="failed", case="b")]
    poor = [result("poor", rms=50.0), result("poor", status="failed", case="b")]
    table = leaderboard(Run(META, (lost, fine, *bad, *poor)))
    assert table["strategy"].tolist() == ["poor", "lost", "bad"]
    assert table["rank"].tolist() == [1, 2, 3]
    assert table["unphysical"].tolist() == [False, True, False]
    assert table["rigid_modes_lost"].tolist() == [0, 2, 0]


def test_several_seeds_give_the_median_and_an_interval() -> None:
    errors = [1.0, 3.0, 2.0, 5.0, 4.0]
    results = [result("s", seed=k, rms=rms) for k, rms in enumerate(errors)]
    meta = {**META, "reference": {"a": REFERENCE["a"]}, "seeds": list(range(5))}
    row = leaderboard(Run(meta, tuple(results))).iloc[0]
    assert row["gain"] == pytest.approx(1.0 - 3.05 / 2.05, rel=1e-12)
    assert row["gain_low"] < row["gain"] < row["gain_high"]
    again = leaderboard(Run(meta, tuple(reversed(results)))).iloc[0]
    assert again.to_dict() == pytest.approx(row.to_dict(), nan_ok=True)
    one = leaderboard(Run(META, (result("s"),))).iloc[0]
    assert np.isnan(one["gain_low"])
