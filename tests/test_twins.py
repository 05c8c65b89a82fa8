"""Twins of cases: similar to the last digit, under other names; who knows cases is found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
import scored
from running import run_jobs
from twin_toys import Chance, Drawn, Memory

import femubench
from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.case.similarity import Similarity, matrix_factors, similar_case, similar_frame
from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.frame import (
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Link,
    Material,
    Member,
    MemberSet,
    Oscillator,
    Place,
    PointMass,
    Preload,
    RigidEnd,
    Support,
)
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section
from femubench.core.library.rank import plan_again, plan_run, rank, request_of, textbook_of
from femubench.core.modal.eigen import solve_modes
from femubench.core.plugin.loader import load_plugins
from femubench.core.run.companions import choose_companions
from femubench.core.run.starts import Starts
from femubench.core.run.store import Store
from femubench.core.schema.records import run_from_json, run_to_json
from femubench.core.schema.results import JobResult, RunData
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.repeatability import unsteady
from femubench.core.score.scoring import judge, reference_of
from femubench.core.score.twin_gain import twin_gains
from femubench.core.twin.disguise import disguise_case
from femubench.core.twin.twins import FAMILIES, Twin, again, twin_of, twins_of
from femubench.core.typing import SparseArray
from tests.command import call_bench

BY = Similarity(length=1.3, modulus=0.7, density=1.4)
COMPUTED = ["frame-solid", "suite/bracket", "suite/tower"]


def everything() -> Frame:
    """A frame in space with one of each thing that a frame can have."""
    tube, pipe = Section.rectangular_tube(0.03, 0.05, 0.002), Section.round_tube(0.04, 0.003)
    steel, light = Material(2.1e11, 0.3, 7850.0), Material(7e10, 0.33, 2700.0)
    joints = [("A", (0, 0, 0)), ("B", (0, 0, 1)), ("C", (0.8, 0.1, 1)), ("D", (0.9, 0.2, 0))]
    joints += [("E", (0.8, 0.9, 1.1)), ("F", (0.9, 0.9, 1.1)), ("G", (0.4, 0.9, 1.2))]
    ends = [("A", "B"), ("B", "C"), ("C", "D"), ("C", "E"), ("B", "E"), ("F", "G"), ("B", "G")]
    members = tuple(
        Member(f"bar-{i}", pair, 2, tube if i % 2 else pipe, light if i > 4 else steel)
        for i, pair in enumerate(ends)
    )
    at = Place(member="bar-1", s=0.4)
    return Frame(
        "3d",
        "timoshenko",
        tuple(Joint(name, xyz, "knee" if name < "D" else "") for name, xyz in joints),
        members,
        masses=(PointMass(at, 1.5, (0.02, 0.0, 0.05)), PointMass(Place(joint="E"), 0.4)),
        springs=(GroundSpring(Place(joint="E"), "y", 3e4), GroundSpring(at, "rx", 70.0)),
        supports=(Support(Place(joint="A"), ("x", "y", "z", "rx", "ry", "rz")),
                  Support(Place(joint="D"), ("x", "y", "z"))),
        joint_springs=(JointSpring("C", "bar-2", {"ry": 4e4, "rz": 5e4}, 0.02),
                       JointSpring("B", "bar-4", {"x": 4e7, "rx": 5e4}, 0.03, 10.0)),
        rigid_ends=(RigidEnd("B", "bar-0", 0.04, 0.01),),
        links=(Link("E", ("F",)),),
        gravity=0.7,
        factors=(Factor("EI", ("bar-3", "bar-1/2"), 1.2), Factor("density", ("all",), 0.9)),
        preloads=(Preload("bar-1", -900.0),),
        eccentricities=(Eccentricity("bar-3", 0.004, -0.003),),
        couplings=(Coupling("bar-0", 0.2),),
        braces=(Brace(("A", "C"), 2e5), Brace(("D", "E"), 1e5, "x")),
        oscillators=(Oscillator(Place(joint="G"), "z", 0.3, 25.0, crosswise=False),),
        sets=(MemberSet("legs", ("bar-0", "bar-2")),),
        families=(MemberSet("section:", ("bar-1",)),),
    )  # fmt: skip


def off(found: SparseArray, wanted: SparseArray) -> float:
    """Return the largest difference of two matrices as a share of their diagonals."""
    size = np.sqrt(np.abs(wanted.diagonal()))
    apart = (found - wanted).tocoo()
    return float(np.max(np.abs(apart.data) / (size[apart.row] * size[apart.col]), initial=0.0))


@cache
def builtin(name: str) -> Case:
    return femubench.cases[name]


@cache
def twin(name: str) -> Twin:
    return twin_of(builtin(name), 1, 5, {"similar": FAMILIES["similar"]})


def rms(case: Case) -> np.ndarray:
    return np.array(list(reference_of(case).rms_percent.values()))


def test_everything_that_a_frame_can_have_scales_to_the_last_digit() -> None:
    frame = everything()
    small, large = Model.of(frame), Model.of(similar_frame(frame, BY))
    mass, stiffness = matrix_factors(small.dofs, BY)
    assert off(large.mass, (mass @ small.mass @ mass).tocsr()) < 1e-12
    assert off(large.stiffness, (stiffness @ small.stiffness @ stiffness).tocsr()) < 1e-10
    # Each thing takes part: without any one of them the matrices are others.
    bare = {"gravity": 0.0, "masses": (), "springs": (), "preloads": (), "oscillators": ()}
    for name, nothing in bare.items():
        other = Model.of(replace(frame, **{name: nothing}))
        other_large = Model.of(similar_frame(replace(frame, **{name: nothing}), BY))
        assert (
            other.size != small.size
            or (other.stiffness != small.stiffness).nnz
            or ((other.mass != small.mass).nnz)
        )
        first = solve_modes(other).elastic.natural_frequencies[:5]
        second = solve_modes(other_large).elastic.natural_frequencies[:5]
        assert second == pytest.approx(BY.frequency * first, rel=1e-9)


def test_other_names_and_orders_change_no_frequency() -> None:
    frame = everything()
    case = replace(toys.tiny_case(), model=Model.of(frame), measurement=_at_joints(frame),
                   modifications=())  # fmt: skip
    hidden = disguise_case(case, np.random.default_rng(3))
    other = hidden.model.frame_structure.frame
    first, second = (solve_modes(m.model).elastic for m in (case, hidden))
    assert second.natural_frequencies[:8] == pytest.approx(first.natural_frequencies[:8], rel=1e-9)
    names = {joint.name for joint in frame.joints} | {member.name for member in frame.members}
    names |= {"knee", "legs"}
    known = {j.name for j in other.joints} | {j.type for j in other.joints}
    known |= {part.name for part in (*other.members, *other.sets)}
    assert not names & known
    assert [m.elements for m in other.members] == [2] * 7
    assert sorted(len(item.members) for item in other.sets) == [2]
    assert not set(case.measurement.sensors.labels) & set(hidden.measurement.sensors.labels)
    seen = np.abs(hidden.model.observe(hidden.measurement.sensors) @ second.shapes)
    again_seen = np.abs(case.model.observe(case.measurement.sensors) @ first.shapes)
    assert np.sort(seen[:, 0]) == pytest.approx(np.sort(again_seen[:, 0]), rel=1e-6)


def _at_joints(frame: Frame) -> femubench.Measurement:
    xyz = np.array([joint.xyz for joint in frame.joints if joint.name != "G"])
    labels = tuple(f"at-{i}" for i in range(len(xyz)))
    sensors = femubench.Sensors(labels, xyz, ("x",) * len(xyz))
    shapes = np.linspace(0.1, 1.0, len(xyz))[:, None]
    one = np.ones(1)
    return femubench.Measurement(sensors, (1,), 9.0 * one, 0.1 * one, one, shapes, 0.1 * shapes)


@pytest.mark.parametrize("name", COMPUTED)
def test_the_nominal_models_predict_what_they_did_times_the_factor(name: str) -> None:
    case, other = builtin(name), twin(name)
    factor = other.measurement.frequencies / case.measurement.frequencies
    assert np.ptp(factor) < 1e-12 * factor[0]
    assert abs(np.log(factor[0])) >= np.log(1.1) - 1e-12
    for first, second in ((case, other), (_textbook(case), _textbook(other))):
        assert rms(second) == pytest.approx(rms(first), rel=1e-9)
        low, high = (solve_modes(c.model).elastic.natural_frequencies[:8] for c in (first, second))
        assert high == pytest.approx(factor[0] * low, rel=1e-10)


def _textbook(case: Case) -> Case:
    return textbook_of([case]).get(case.name, case)


@pytest.mark.parametrize(
    ("strategy", "names"),
    [
        ("berman", ("frame-solid",)),
        ("kabe-rigid", ("hframe-solid",)),
        # Where the order of causes that are equally good decides.
        ("local", ("suite/skew-grid",)),
        ("offset", ("suite/mast-on-pad",)),
    ],
)
def test_what_a_strategy_reckons_errs_on_a_twin_as_on_its_case(
    strategy: str, names: tuple[str, ...]
) -> None:
    found = femubench.strategies[strategy]()
    for name in names:
        errors = []
        for case in (builtin(name), twin(name)):
            rng = np.random.default_rng(0)
            model = found.update(case.model, case.used_measurement(), rng).model
            blocks = judge(case, model, reference_of(case)).blocks
            errors.append([block.rms_percent for block in blocks.values()])
        assert errors[1] == pytest.approx(errors[0], rel=1e-3, abs=1e-7)


def test_matrices_have_similar_ones_too(tmp_path: Path) -> None:
    from femubench.core.case.writing import write_case

    case = builtin("frame-solid")
    factor = 1.1
    changed = replace(case.model, stiffness=factor * case.model.stiffness)
    write_case(tmp_path / "m", case, changed)  # whose matrices no keys give
    plain = read_case(tmp_path / "m")
    assert plain.model.structure is None
    other = twin_of(plain, 2, 8)
    assert rms(other) == pytest.approx(rms(plain), rel=1e-9)
    assert not set(other.model.geometry.names) & set(plain.model.geometry.names)  # type: ignore[attr-defined]
    assert other.model.dofs.direction != plain.model.dofs.direction


def test_rotations_and_the_mass_and_the_band_scale_too() -> None:
    case = builtin("frame-solid")
    measured = case.measurement
    sensors = replace(measured.sensors, directions=("rx", *measured.sensors.directions[1:]))
    case = replace(case, band=(10.0, 20.0), measurement=replace(
        measured, sensors=sensors, total_mass=(2.0, 0.1)))  # fmt: skip
    other = similar_case(case, BY)
    assert other.measurement.shapes[0] == pytest.approx(measured.shapes[0] / 1.3)
    assert other.measurement.shape_std[0] == pytest.approx(measured.shape_std[0] / 1.3)
    assert other.measurement.shapes[1:] == pytest.approx(measured.shapes[1:])
    assert other.measurement.total_mass == pytest.approx((2.0 * BY.mass, 0.1 * BY.mass))
    assert other.band == pytest.approx((10.0 * BY.frequency, 20.0 * BY.frequency))


def test_a_model_without_nodes_has_no_twin() -> None:
    case = toys.tiny_case()
    bare = replace(case, model=toys.matrices_only(case.model))
    with pytest.raises(NotApplicable, match="no similar one"):
        twin_of(bare, 1, 0)
    assert list(twins_of([bare, case], 2, 0))
    assert len(list(twins_of([bare], 2, 0))) == 0


def test_the_first_twin_keeps_the_order_and_others_do_not() -> None:
    case = builtin("suite/tower")
    frame = case.model.frame_structure.frame
    for number, kept in ((1, True), (2, False)):
        drawn = twin_of(case, number, 3)
        other = drawn.model.frame_structure.frame
        xyz = [np.array([joint.xyz for joint in f.joints]) for f in (frame, other)]
        ratio = np.linalg.norm(xyz[1], axis=1) / np.linalg.norm(xyz[0], axis=1)
        assert (np.ptp(ratio) < 1e-9) == kept
        sensors = drawn.measurement.sensors.xyz / case.measurement.sensors.xyz[:, [0, 1, 2]]
        assert (np.nanmax(sensors) - np.nanmin(sensors) < 1e-9) == kept


def test_the_same_seed_gives_the_same_twins_and_another_one_others() -> None:
    case = toys.tiny_case()
    one, same, number, seed = (twin_of(case, *a) for a in ((1, 4), (1, 4), (2, 4), (1, 5)))
    assert one.digest == same.digest
    assert (one.model.stiffness != same.model.stiffness).nnz == 0
    assert len({one.digest, number.digest, seed.digest, case.digest}) == 4
    frequencies = [t.measurement.frequencies[0] for t in (one, number, seed)]
    assert len(set(frequencies)) == 3
    # Noise of a seed is drawn anew for every twin and every seed of twins.
    noise = [t.used_measurement(3).frequencies / t.measurement.frequencies[:3] for t in (one, seed)]
    assert np.abs(noise[0] - noise[1]).max() > 1e-4
    repeat = again(case)
    assert (repeat.used_measurement(3).frequencies == case.used_measurement(3).frequencies).all()


@pytest.fixture(scope="module")
def run() -> RunData:
    case = builtin("frame-solid")
    twins = list(twins_of([case], 2, 11))
    others = choose_companions([case], twins, 2, 11)
    truth = tuple(case.measurement.frequencies[case.measurement.frequencies > 0.0])
    able = [toys.Unchanged(), Memory(truth[:8]), Chance(), Drawn()]
    return run_jobs([case], able, seeds=(0, 1), jobs=2, starts=Starts(companions=others))


def test_who_knows_a_case_by_heart_is_marked(run: RunData) -> None:
    found = twin_gains(run)
    assert found["memory"].original_gain > 0.8
    assert found["memory"].gain == pytest.approx(0.0, abs=1e-6)
    assert found["memory"].suspicious
    assert found["memory"].known == ("frame-solid",)
    honest = {name for name, item in found.items() if not item.suspicious}
    assert honest == {"unchanged", "chance", "drawn"}
    assert found["unchanged"].gain == pytest.approx(found["unchanged"].original_gain, abs=1e-9)


def with_twins(here: JobResult, *there: JobResult) -> RunData:
    """Return a run of one case, of a textbook error of 3 %, with twins of it."""
    stated = scored.meta({"one": {"used": 1.0, "higher": 3.0}})
    names = {result.case: "one" for result in there}
    models = dict.fromkeys(names, stated["models"]["one"])
    twins = {"of": names, "again": {}, "models": models}
    return RunData({**stated, "twins": twins}, (here,), there)


def answer(case: str, error: float, **more: Any) -> JobResult:
    return scored.result(case, higher=error, **more)


def test_over_many_structures_the_signs_decide() -> None:
    # On the twins of twelve structures of thirty a strategy leaves more error: no single case.
    cases = [f"case-{i}" for i in range(30)]
    meta = scored.meta({name: {"used": 1.0, "higher": 3.0} for name in cases})
    twins = {f"{name}~1": name for name in cases}
    meta["twins"] = {
        "of": twins,
        "again": {},
        "models": {twin: meta["models"][name] for twin, name in twins.items()},
    }
    results, others = [], []
    for strategy, factor in (("knows", 1.2), ("none", 1.0), ("slightly", 1.05)):
        for i, name in enumerate(cases):
            error, more = 2.0 + 0.01 * i, factor if i < 12 else 1.0
            results.append(scored.result(name, strategy, higher=error))
            others.append(scored.result(f"{name}~1", strategy, higher=error * more))
    run = RunData(meta, tuple(results), tuple(others))
    found = twin_gains(run)
    assert [found[n].suspicious for n in ("knows", "none", "slightly")] == [True, False, False]
    assert found["knows"].p is not None
    assert found["knows"].p < 0.01
    assert found["knows"].known == ()
    # The lower gain is that of the board.
    rows = leaderboard(run).set_index("strategy")["gain"]
    assert rows["knows"] == pytest.approx(found["knows"].gain)
    assert rows["none"] == pytest.approx(found["none"].original_gain)


def moved_twins(errors: Mapping[str, tuple[float, float]], kind: str, twins: int = 2) -> RunData:
    """Return a run of twelve structures, of which the textbook model errs otherwise on twins.

    Arguments:
        errors: of each strategy in percent on a case, where the textbook model has 6, and on a
            twin, where it has 8.
    """
    cases = [f"case-{i}" for i in range(12)]
    of = {f"{name}~{number}": name for name in cases for number in range(1, twins + 1)}
    meta = scored.meta({name: {"higher": 6.0} for name in cases})
    there = scored.meta({name: {"higher": 8.0} for name in of})["models"]
    kinds = {name: [kind, "similar"] for name in of}
    meta["twins"] = {"of": of, "again": {}, "models": there, "kinds": kinds}
    first = [scored.result(c, s, higher=own[0]) for s, own in errors.items() for c in cases]
    others = [scored.result(t, s, higher=own[1]) for s, own in errors.items() for t in of]
    return RunData(meta, tuple(first), tuple(others))


def test_an_answer_that_does_not_follow_the_data_of_a_stretched_twin_is_no_gain_there() -> None:
    # Half of the way to the case, and as far again on its twin; half of the way on both; a share
    # that is wrong on both; next to nothing done on both.
    errors = {"half": (3.0, 5.0), "follows": (3.0, 4.0), "worse": (9.0, 11.0), "idle": (5.5, 7.5)}
    run = moved_twins(errors, "stretched")
    found, board = twin_gains(run), leaderboard(run).set_index("strategy")["gain"]
    assert found["half"].original_gain == found["follows"].original_gain == pytest.approx(0.5)
    assert found["half"].gain == board["half"] == 0.0
    assert found["follows"].gain == pytest.approx(0.5)
    assert found["worse"].gain == pytest.approx(-3.0 / 11.0)
    assert found["idle"].gain == pytest.approx(0.5 / 8.0)
    assert [name for name, item in found.items() if item.suspicious] == ["half"]
    # On a similar twin the data are the same, and on one twin alone it may be chance.
    for other in (moved_twins(errors, "similar"), moved_twins(errors, "stretched", twins=1)):
        assert twin_gains(other)["half"].gain == pytest.approx(3.0 / 8.0)


def test_one_twin_may_be_chance_and_who_is_never_good_knows_nothing() -> None:
    def suspicious(here: float, *there: float) -> bool:
        listed = (answer(f"one~{i}", error) for i, error in enumerate(there, start=1))
        return twin_gains(with_twins(answer("one", here), *listed))["s"].suspicious

    assert suspicious(0.5, 2.0, 2.0)
    assert not suspicious(0.5, 2.0)
    assert not suspicious(0.5, 2.0, 0.6)
    assert not suspicious(4.0, 20.0, 20.0)


def test_a_job_that_was_stopped_says_nothing_of_what_a_strategy_knows() -> None:
    """A twin that took too long, on a machine with more to do: the other answers are compared."""
    names, own = [f"one~{i}" for i in (1, 2, 3)], answer("one", 0.5)
    for status in ("timeout", "crashed"):
        stopped = [scored.result(name, status=status) for name in names]
        assert twin_gains(with_twins(own, *stopped)) == {}
        found = twin_gains(with_twins(own, *stopped[:2], answer("one~3", 0.5)))["s"]
        assert found.gain == found.original_gain == pytest.approx(2.5 / 3.0)
        assert not found.suspicious
        over = scored.result("one", status=status)
        assert twin_gains(with_twins(over, answer("one~3", 0.5))) == {}
    failed = [scored.result(name, status="failed") for name in names]
    assert twin_gains(with_twins(own, *failed))["s"].suspicious


def test_who_answers_otherwise_every_time_is_found(run: RunData) -> None:
    assert list(unsteady(run)) == ["chance"]
    assert "another model" in unsteady(run)["chance"]
    assert run.meta["unsteady"] == unsteady(run)


def test_twins_lower_gains_and_are_in_no_other_figure(run: RunData) -> None:
    assert {result.case for result in run.results} == {"frame-solid"}
    assert set(run.meta["cases"]) == set(run.meta["reference"]) == {"frame-solid"}
    names = {"frame-solid~1", "frame-solid~2", "frame-solid~again"}
    assert {result.case for result in run.companions} == names
    stated = {result.case: result.provenance for result in run.companions}
    assert stated["frame-solid~2"]["twin_of"] == "frame-solid"
    assert stated["frame-solid~again"]["again"] == "frame-solid"
    bare = RunData({k: v for k, v in run.meta.items() if k != "twins"}, run.results)
    alone, own = (leaderboard(one).set_index("strategy") for one in (bare, run))
    assert own["higher_percent"].equals(alone["higher_percent"].loc[own.index])
    # The lower of case and twin: what was known by heart is no gain.
    assert alone.loc["memory", "gain"] > 0.8
    assert own.loc["memory", "gain"] == pytest.approx(0.0, abs=1e-6)
    assert own.loc["unchanged", "gain"] == pytest.approx(alone.loc["unchanged", "gain"], abs=1e-9)


def test_reports_tell_of_twins(run: RunData) -> None:
    text = " ".join(str(femubench.report(run)).split())
    assert "gain on 2 twins of 1 cases, seed 11" in text
    assert "?: memory knows the cases? gain" in text
    assert "?: chance gave two answers to one job: frame-solid: another model" in text
    assert "memory (knows the cases?)" in str(femubench.report(run, style="markdown"))
    assert "knows the cases? gain" in str(femubench.report(run, style="html"))
    rows = {
        row["strategy"]: row
        for row in json.loads(str(femubench.report(run, style="json")))["leaderboard"]
    }
    assert rows["memory"]["twins"]["suspicious"]
    assert not rows["drawn"]["twins"]["suspicious"]
    assert "unsteady" in rows["chance"]
    assert "unsteady" not in rows["drawn"]
    bare = RunData({k: v for k, v in run.meta.items() if k != "twins"}, run.results)
    for style in ("terminal", "markdown", "html", "json"):
        for one, excluded in ((run, True), (bare, False)):
            said = " ".join(str(femubench.report(one, style=style)).split())
            assert ("memory of the cases is not excluded" not in said) == excluded, style


def test_runs_with_twins_are_kept_read_and_resumed(run: RunData, tmp_path: Path) -> None:
    back = run_from_json(run_to_json(run))
    assert back.companions == run.companions
    store = Store(tmp_path / "store")
    options = {"jobs": 1, "store": store, "nominal": "textbook"}
    first = rank("suite/bracket", "unchanged", twins=1, **options)  # type: ignore[arg-type]
    kept = store.load()
    assert [r.case for r in kept.companions] == ["suite/bracket~1", "suite/bracket~again"]
    assert kept.meta["request"]["twin_seed"] == kept.meta["twins"]["seed"]
    plugins = load_plugins()
    repeats = plan_again(request_of(kept), plugins)
    assert [t.digest for t in repeats.starts.companions.twins] == [
        kept.meta["twins"]["cases"]["suite/bracket~1"]["digest"]
    ]
    # The seed of the last run is taken, so that the same words go on with it.
    given = {"twins": 1, "nominal": "textbook", "resume": True}
    plan = plan_run("suite/bracket", "unchanged", plugins, given, store)
    assert plan.options.twin_seed == first.meta["twins"]["seed"]
    assert plan.jobs == 3
    other = plan_run("suite/bracket", "unchanged", plugins, {"twins": 1})
    assert other.options.twin_seed != plan.options.twin_seed


def test_what_was_measured_has_no_twins(tmp_path: Path) -> None:
    given = {"twins": 2, "twin_seed": 1}
    plan = plan_run(["frame", "frame-solid"], "unchanged", load_plugins(), given)
    assert [t.name for t in plan.starts.companions.twins] == ["frame-solid~1", "frame-solid~2"]
    with pytest.raises(InputError, match="twins"):
        plan_run("frame", "unchanged", load_plugins(), {"twins": 101})
    for word in ("1:", "101"):
        refused = call_bench("run", "frame", "--twins", word, code=2)
        assert "no number of twins" in refused.output
