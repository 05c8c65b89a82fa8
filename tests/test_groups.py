"""Groups of matrices as parameters, with priors, of strategies and effects; faces of parts."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_problems import effects_named, part_at, problem_of

import femubench
from femubench import Case, InputError, Measurement, Model, Sensors, read_case, solve_modes
from femubench.core.case.writing import write_case
from femubench.core.fem.model_parameters import matrix_slopes, with_values
from femubench.core.fit.modal_fit import fit, state_at
from femubench.core.inference.coordinates import modes_for
from femubench.core.inference.examine import model_error_of, settle, with_scales
from femubench.core.inference.model_error import error_slopes, general_slopes
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.prior import Base
from femubench.core.inference.search import _from_both_sides
from femubench.core.run.jobs import missing_capability
from femubench.effect import Parameter
from femubench.fem import (
    Frame,
    GroundSpring,
    Groups,
    Joint,
    Material,
    Member,
    MemberSet,
    Place,
    Property,
    Section,
    matrix_model,
)
from femubench.modal import GroupPriors, eigenvalue_sensitivities
from femubench.plugins.effects.interface_spring import InterfaceSpring
from femubench.plugins.effects.material import GroupMass, GroupMaterial, MemberStiffness
from femubench.plugins.strategies.bayesian import Bayesian
from femubench.plugins.strategies.eigensensitivity import Eigensensitivity
from femubench.plugins.strategies.factors import Global, Local
from femubench.plugins.strategies.generic import GenericLS
from femubench.plugins.strategies.physical import Physical
from femubench.plugins.strategies.sampling import BayesianSampling
from femubench.scenarios.matlab_footbridge import TEST, VARIABLE
from femubench.scenarios.nodes_from_stiffness import label_rows
from femubench.update import Changes

STEEL = Material(2.1e11, 0.3, 7850.0)
BAR = Section(4e-4, 1.2e-8, 1.2e-8, 2e-8, 2.4e-8)
RNG = np.random.default_rng(0)
TRUTH = {"left": 0.8, "right": 1.0, "foot": 0.3, "head": 1.0}
SHARED = Path(__file__).parents[2] / "shared" / "data" / "bridge"


def beam() -> Frame:
    """Return two members in line on two springs, a set of each."""
    joints = tuple(Joint(name, (x, 0.0, 0.0)) for name, x in (("A", 0.0), ("B", 0.6), ("C", 1.0)))
    members = (Member("AB", ("A", "B"), 3, BAR, STEEL), Member("BC", ("B", "C"), 2, BAR, STEEL))
    springs = tuple(
        GroundSpring(Place(at), direction, 1.5e4)
        for at, direction in (("A", "z"), ("A", "x"), ("C", "z"))
    )
    sets = (MemberSet("left", ("AB",)), MemberSet("right", ("BC",)))
    return Frame("in-plane", "euler-bernoulli", joints, members, springs=springs, sets=sets)


def alone(model: Model) -> Model:
    """Return matrices alone, nodes named as the joints or by their number."""
    names = [joint.name for joint in model.frame_structure.frame.joints]
    nodes = [names[n] if n < len(names) else f"n{n}" for n in model.dofs.node]
    return matrix_model(
        model.mass, model.stiffness, nodes, model.dofs.direction, xyz=model.dofs.xyz
    )


def grouped(frame: Frame) -> Model:
    """Return the matrices of a frame alone, its sets and its springs as groups."""
    model = Model.of(frame)
    structure = model.frame_structure
    names = [found.name for found in frame.sets]
    factors = Changes(model).parameterise("sets").properties
    twice = [structure.with_values([factor], [2.0]).matrices()[1] for factor in factors]
    parts = {n: m - structure.matrices()[1] for n, m in zip(names, twice, strict=True)}
    for name, springs in (("foot", frame.springs[:2]), ("head", frame.springs[2:])):
        parts[name] = structure.assemble_attachments((), springs)[1]
    return replace(alone(model), groups=parts, mass_groups={"half": 0.5 * model.mass})


MODEL = grouped(beam())


def measured(truth: Model, count: int) -> Measurement:
    """Return the lowest modes of a model as a test without error would give them."""
    rows = [i for i, d in enumerate(truth.dofs.direction) if d != "ry"]
    directions = tuple(truth.dofs.direction[i] for i in rows)
    sensors = Sensors(tuple(f"S{i}" for i in rows), truth.dofs.xyz[rows], directions)
    modes = solve_modes(truth).elastic.take(np.arange(count))
    shapes = modes.shapes[rows]
    f = modes.natural_frequencies
    std = np.full(shapes.shape, 0.01 * np.abs(shapes).max())
    missing = np.full(count, np.nan)
    return Measurement(sensors, tuple(range(1, count + 1)), f, 1e-4 * f, missing, shapes, std, None)


def changed(factors: dict[str, float]) -> Model:
    """Return the beam with other groups."""
    parameters = [Property(name, "E", (f"group:{name}",)) for name in factors]
    return Groups(MODEL).with_factors(parameters, list(factors.values()))


DATA = measured(changed(TRUTH), 5)


@pytest.mark.parametrize(
    "strategy",
    [Local(), Global(changes="groups"), Bayesian(), Physical()],
    ids=lambda strategy: type(strategy).__name__,
)
def test_strategies_find_the_factors_of_groups(strategy: femubench.Strategy) -> None:
    assert missing_capability(strategy.needs, MODEL, DATA) is None
    result = strategy.update(replace(MODEL, mass_groups={}), DATA, RNG)
    found = {p.name.removeprefix("stiffness group:"): p.after for p in result.parameters}
    assert {name: found[name] for name in TRUTH} == pytest.approx(TRUTH, rel=0.03)
    for name, part in result.model.groups.items():
        np.testing.assert_allclose(part.toarray(), found[name] * MODEL.groups[name].toarray())


def test_a_cause_is_also_fitted_from_beyond_where_modes_change_places() -> None:
    """A head a hundred times softer: from where it is stiffer than drawn no step leads there."""
    test = measured(changed({"head": 0.01}), 3)
    test = replace(test, frequency_std=1e-3 * test.frequencies)
    problem = problem_of(MODEL, test, effects_named("member-stiffness"))
    part = part_at(problem, "member-stiffness", "group:head")
    stuck = fit(problem, (part,), np.array([0.5]))
    assert stuck is not None
    assert stuck.state.chi2 > 1e6
    found = _from_both_sides(problem, stuck)
    assert found.state.chi2 < 0.1
    assert part.hypothesis.values(found.state.x[None])[0, 0] == pytest.approx(-0.99, rel=1e-3)
    assert _from_both_sides(problem, found) is found


def test_the_whole_stiffness_always_has_a_factor() -> None:
    bare = replace(MODEL, groups={}, mass_groups={})
    stiffer = measured(Groups(bare).with_factors([Property("K", "E", ("all",))], [1.21]), 3)
    for strategy in (Global(), Bayesian(stiffness_std=10.0)):
        (parameter,) = strategy.update(bare, stiffer, RNG).parameters
        assert (parameter.name, parameter.after) == ("stiffness all", pytest.approx(1.21, rel=1e-4))


def test_reasons_say_what_would_make_a_strategy_applicable() -> None:
    bare = replace(MODEL, groups={})
    for strategy in (Local(), Physical(), Eigensensitivity()):
        reason = missing_capability(strategy.needs, bare, DATA)
        assert reason is not None
        assert "declare [[model.groups]]" in reason
    reason = missing_capability(GenericLS.needs, MODEL, DATA)
    assert reason is not None
    assert reason.endswith("kind 'frame' has them")


def test_few_frequencies_merge_groups_into_levels() -> None:
    counts = {}
    for count in (1, 2, 3, 4):
        changes = Changes(MODEL).groups_within(count)
        counts[count] = [change.name.removeprefix("stiffness ") for change in changes]
    assert counts[4] == [f"group:{name}" for name in TRUTH]
    assert counts[3] == ["group:foot", "group:head", "structure"]
    assert (counts[2], counts[1]) == (["supports", "structure"], ["all groups"])


def test_supports_are_what_rigid_motions_strain() -> None:
    assert GroupPriors(MODEL).supports == {"foot", "head"}
    # A pier of beams couples dofs; that it holds the structure is seen from its rigid motions.
    pier = {**MODEL.groups, "foot": MODEL.groups["foot"] + 1e-6 * MODEL.groups["left"]}
    assert GroupPriors(replace(MODEL, groups=pier)).supports == {"foot", "head"}
    # With positions that are not true nothing is free of force, and springs alone are known.
    lost = replace(MODEL.dofs, xyz=np.zeros((MODEL.size, 3)))
    assert GroupPriors(replace(MODEL, dofs=lost, groups=pier)).supports == {"head"}


def test_a_prior_is_a_factor_as_likely_as_not() -> None:
    stated = replace(MODEL, group_priors={"left": 2.0})
    draws = np.exp(GroupPriors(stated).std("left") * RNG.standard_normal(200_000))
    assert np.mean((draws > 0.5) & (draws < 2.0)) == pytest.approx(0.5, abs=0.005)
    stds = {
        change.name: change.parameters[0].std
        for change in Changes(stated).groups("stiffness", own_prior=True)
    }
    assert stds["stiffness group:right"] == 0.1
    assert stds["stiffness group:foot"] == pytest.approx(np.log(5.0) / 0.67449, rel=1e-4)
    (parameter,) = MemberStiffness().parameters(stated, "group:left")
    quartiles = parameter.value(np.array([-0.67449, 0.67449]))
    assert quartiles == pytest.approx([-0.5, 1.0], rel=1e-4)
    assert parameter.coordinate(1.0) == pytest.approx(0.67449, rel=1e-4)


def test_masses_of_groups_change_too() -> None:
    heavier = Groups(MODEL).with_factors([Property("m", "density", ("group:half",))], [1.2])
    result = Bayesian().update(
        replace(MODEL, groups={"none": 1e-12 * MODEL.groups["left"]}), measured(heavier, 4), RNG
    )
    found = {p.name: p.after for p in result.parameters}
    assert found["mass group:half"] == pytest.approx(1.2, rel=1e-3)
    assert result.model.total_mass == pytest.approx(1.1 * MODEL.total_mass, rel=1e-3)
    extended = GroupMass().extend(MODEL, "group:half", [0.2])
    assert abs(extended.mass - heavier.mass).max() == 0.0
    assert GroupMass().places(MODEL) == ("group:half",)


def test_another_material_scales_the_mass_and_the_stiffness_of_a_part() -> None:
    """Steel for aluminium: both are three times as large; a joint is of no material."""
    halves = {"left": MODEL.mass_groups["half"], "foot": MODEL.mass_groups["half"]}
    model = replace(MODEL, mass_groups=halves)
    effect = GroupMaterial()
    assert effect.places(model) == ["group:left"]
    assert effect.places(replace(model, group_kinds={"left": "joint"})) == []
    steel = effect.extend(model, "group:left", [1.9, 0.05])
    assert abs(steel.mass - model.mass - 1.9 * halves["left"]).max() < 1e-12
    gain = 2.9 * 1.05 - 1.0
    np.testing.assert_allclose(
        (steel.stiffness - model.stiffness).todense(), gain * model.groups["left"].todense(),
        atol=1e-6 * abs(model.stiffness).max(),
    )  # fmt: skip
    factors = effect.change(model, "group:left").coefficients(np.array([[1.9, 0.05]]))
    np.testing.assert_allclose(factors, [[1.9, gain]])


def test_a_part_that_is_stated_is_a_part_that_is_not() -> None:
    stated = replace(MODEL, group_kinds={"left": "part"})
    joint = replace(MODEL, group_kinds={"left": "joint"})
    effect = MemberStiffness()
    assert effect.parameters(stated, "group:left") == effect.parameters(MODEL, "group:left")
    assert effect.parameters(joint, "group:left") != effect.parameters(MODEL, "group:left")


def test_slopes_are_those_of_differences() -> None:
    parameters = [Property("a", "E", ("group:left", "group:foot"))]
    parameters += [Property("b", "density", ("group:half",)), Property("c", "E", ("all",))]
    at = with_values(MODEL, parameters, [1.3, 0.8, 1.1])
    modes = solve_modes(at).elastic.take(np.arange(3))
    slopes = eigenvalue_sensitivities(at, modes, parameters)
    for p, parameter in enumerate(parameters):
        near = (with_values(at, [parameter], [1.0 + h]) for h in (1e-5, -1e-5))
        up, down = (solve_modes(model).elastic.eigenvalues[:3] for model in near)
        np.testing.assert_allclose(slopes[:, p], (up - down) / 2e-5, rtol=1e-6)
    products = matrix_slopes(at, parameters).products(modes.shapes[:, 0], modes.eigenvalues[0])
    np.testing.assert_allclose(modes.shapes[:, 0] @ products, slopes[0], rtol=1e-9)


def test_wide_priors_are_not_sampled_over_useless_polynomials() -> None:
    wide = replace(MODEL, group_priors=dict.fromkeys(TRUTH, 1e3))
    data = replace(DATA.select([1, 2]), frequency_std=0.01 * DATA.frequencies[:2])
    result = BayesianSampling().update(wide, data, RNG)
    assert result.diagnostics["steps"] == 0.0
    assert result.diagnostics["normal_approximation"] == 1.0
    assert result.uncertainty is not None
    assert len(result.uncertainty.samples) > 4
    found = solve_modes(result.model).elastic.natural_frequencies[:2]
    np.testing.assert_allclose(found, data.frequencies, rtol=0.02)


def test_what_a_group_is_says_how_far_it_may_change() -> None:
    joint = replace(MODEL, group_kinds={"left": "joint"})
    assert GroupPriors(joint).std("left") == pytest.approx(GroupPriors(MODEL).std("foot"))
    assert GroupPriors(joint).std("left", "mass") == 0.5
    (softer,) = MemberStiffness().parameters(joint, "group:left")
    assert softer.value(softer.range[1]) == pytest.approx(0.0)
    assert softer.value(softer.range[0]) < -0.999
    uppers = {
        change.places[0]: change.parameters[0].upper
        for change in Changes(joint).groups("stiffness", own_prior=True)
    }
    assert uppers["group:left"] == 2.0
    assert uppers["group:foot"] > 20.0


def test_groups_are_classes_of_model_error() -> None:
    slopes = error_slopes(problem_of(MODEL, DATA, ()), modes_for(MODEL))
    step = 1e-4
    for kind, names, quantity in (
        ("group stiffness", ("left", "right"), "E"),
        ("joint groups", ("foot", "head"), "E"),
        ("group mass", ("half",), "density"),
    ):
        for name, slope in zip(names, slopes[kind].T, strict=True):
            ends = [
                Groups(MODEL).with_factors(
                    [Property(name, quantity, (f"group:{name}",))], [1.0 + s]
                )
                for s in (step, -step)
            ]
            raw = [state_at(problem_of(m, DATA, ()), (), np.zeros(0)).raw for m in ends]
            expected = (raw[1] - raw[0]) / (2.0 * step)
            np.testing.assert_allclose(slope, expected, atol=1e-3 * np.abs(expected).max())


def test_what_is_drawn_wrong_acts_on_the_modes_with_the_cause_in_them() -> None:
    """Next to a head a hundred times softer, error of groups is that of a beam on such a head.

    It is taken where the cause is once it no longer moves, wherever it was sought from.
    """
    there = changed({"head": 0.01})
    problem = problem_of(MODEL, measured(there, 4), effects_named("member-stiffness"))
    part = part_at(problem, "member-stiffness", "group:head")
    error, nothing = model_error_of(problem, None, 1.0, 0.0), state_at(problem, (), np.zeros(0))
    near, starts = error.fit(nothing), []
    for softer in (-0.9, -0.99):
        x = np.array([part.hypothesis.parameters[0].coordinate(softer)])
        found = fit(problem, (part,), x, steps=0)
        assert found is not None
        starts.append(Explanation(Base((), 0.0), found, 1))
    once = [with_scales(error, start, near, nothing).fit.state for start in starts]
    ends = [e.fit.state for e in settle(error, starts, near, nothing)]
    assert abs(ends[0].x - ends[1].x) < 0.02 < abs(once[0].x - starts[0].fit.state.x)
    noise = once[1].problem.noise
    slopes = error_slopes(problem_of(there, problem.data.measurement, ()), modes_for(there))
    slopes["general"] = general_slopes(starts[1].fit.state)
    assert noise.scales is not None
    moved = error.moved(slopes).add_own_error(nothing, starts[1].fit.state)
    own = moved.covariance(noise.scales)
    size = np.sqrt(own.diagonal())
    share = (noise.factor @ noise.factor.T - own) / np.outer(size, size)
    np.testing.assert_allclose(share, 0.0, atol=1e-6)


def test_groups_read_back_as_they_were_written(tmp_path: Path) -> None:
    model = replace(MODEL, group_priors={"foot": 3.0}, group_kinds={"left": "joint"})
    case = femubench.cases["frame"]
    own = Case(**{**vars(case), "name": "beam", "model": model, "measurement": DATA})
    own = replace(own, used=(1, 2, 3), held_out=(4, 5), modifications=(), reference=None)
    write_case(tmp_path / "beam", own)
    back = read_case(tmp_path / "beam").model
    assert (list(back.groups), list(back.mass_groups)) == (list(TRUTH), ["half"])
    assert dict(back.group_priors) == {"foot": 3.0}
    assert dict(back.group_kinds) == {"left": "joint"}
    assert own.error_width == 1.0
    for name in TRUTH:
        assert abs(back.groups[name] - model.groups[name]).max() == 0.0
    assert abs(back.mass_groups["half"] - model.mass_groups["half"]).max() == 0.0
    text = (tmp_path / "beam" / "case.toml").read_text(encoding="utf-8")
    for wrong in ("prior = 1.0", "prior = -2.0"):
        changed_text = text.replace("prior = 3.0", wrong)
        (tmp_path / "beam" / "case.toml").write_text(changed_text, encoding="utf-8")
        with pytest.raises(InputError, match="> 1"):
            read_case(tmp_path / "beam")


def parted() -> Frame:
    """Return the beam in two parts whose ends share a place."""
    whole = beam()
    joints = (*whole.joints, Joint("D", whole.joint("B").xyz))
    members = (whole.members[0], replace(whole.members[1], ends=("D", "C")))
    turn = GroundSpring(Place("C"), "x", 1e4)
    return replace(whole, joints=joints, members=members, springs=(*whole.springs, turn))


def test_springs_between_faces_are_the_same_in_frames_and_matrices() -> None:
    effect, model = InterfaceSpring(), Model.of(parted())
    assert effect.places(model) == ("B-D", "B-D:x", "B-D:z")
    assert effect.places(Model.of(beam())) == ()
    extended = effect.extend(model, "B-D", [1e6])
    assert [b.direction for b in extended.frame_structure.frame.braces] == ["x", "z"]
    assert "B-D" in effect.places(alone(model))
    other = effect.extend(alone(model), "B-D", [1e6])
    np.testing.assert_allclose(
        other.stiffness.toarray(), extended.stiffness.toarray(), rtol=1e-12, atol=1e-6
    )
    change = effect.change(model, "B-D")
    unit = np.eye(model.size)
    total = 1e6 * change.terms[0].operator.apply(unit) + model.stiffness.toarray()
    np.testing.assert_allclose(total, extended.stiffness.toarray(), rtol=1e-12, atol=1e-6)
    # Stiff enough, the parts move as one again along x and z.
    stiff = solve_modes(effect.extend(model, "B-D", [1e12])).elastic
    shape = stiff.shapes[:, 0]
    labels = zip(model.dofs.direction, model.dofs.xyz[:, 0], strict=True)
    at = [i for i, (d, x) in enumerate(labels) if d == "z" and np.isclose(x, 0.6)]
    assert len(at) == 2
    assert shape[at[0]] == pytest.approx(shape[at[1]], abs=1e-6 * np.abs(shape).max())


def test_a_factor_never_reaches_zero() -> None:
    parameter = Parameter("change of E", "", 2.0, scaling="factor")
    low, high = parameter.range
    assert parameter.value(low) > -1.0
    assert parameter.value(high) == pytest.approx(np.expm1(12.0))
    assert parameter.coordinate(parameter.value(-3.0)) == pytest.approx(-3.0)


def test_rows_without_labels_are_known_by_motions_without_force() -> None:
    joints = [
        Joint(f"{side}{i}", (3.0 * i, y, z))
        for i in range(4)
        for side, y, z in (("l", 0.0, 0.0), ("r", 2.0, 0.0), ("u", 0.5, 1.5))
    ]
    pairs = [(f"{a}{i}", f"{b}{i}") for i in range(4) for a, b in ("lr", "ru", "ul")]
    pairs += [(f"{s}{i}", f"{s}{i + 1}") for i in range(3) for s in "lru"]
    members = tuple(Member(f"{a}-{b}", (a, b), 1, BAR, STEEL) for a, b in pairs)
    model = Model.of(Frame("3d", "euler-bernoulli", tuple(joints), members))
    # Held lengthwise at both feet of one end, as a bridge is.
    label = list(zip(model.dofs.node, model.dofs.direction, strict=True))
    keep = [i for i, (node, d) in enumerate(label) if not (d == "x" and node in (0, 1))]
    keep = [keep[i] for i in _shuffled_within_nodes([label[i][0] for i in keep])]
    stiffness = model.stiffness.toarray()[np.ix_(keep, keep)]
    directions = [label[i][1] for i in keep]
    turns = np.array([d.startswith("r") for d in directions])
    feet = [[i for i, k in enumerate(keep) if label[k] in ((0, d), (1, d))] for d in "yz"]
    rows = label_rows(stiffness, turns, *feet)
    assert rows is not None
    assert [row.direction for row in rows] == directions
    xyz = np.array([row.xyz for row in rows])
    wanted = model.dofs.xyz[keep]
    np.testing.assert_allclose(xyz - xyz[0], wanted - wanted[0], atol=1e-6)
    assert label_rows(np.diag(np.ones(6)), np.arange(6) > 2, [0], [1]) is None


def _shuffled_within_nodes(nodes: list[int]) -> list[int]:
    rng = np.random.default_rng(5)
    order = np.argsort(nodes, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(np.array(nodes)[order])) + 1)
    return [int(i) for part in parts for i in rng.permutation(part)]


@pytest.fixture(scope="module")
def bridge() -> Case:
    """Return the published footbridge, where its files are at hand."""
    folder = Path(os.environ.get(VARIABLE, SHARED))
    if not (folder / TEST).is_file():
        pytest.skip(f"the files of the footbridge are in no folder {folder}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(folder))
        return femubench.cases["footbridge"]


def test_the_footbridge_is_where_it_stands(bridge: Case) -> None:
    model = bridge.model
    assert model.total_mass == pytest.approx(34_178, rel=1e-3)
    assert np.ptp(model.dofs.xyz, axis=0) == pytest.approx([30.18, 2.13, 2.74], abs=0.01)
    assert GroupPriors(model).supports == {"K_y1", "K_y2", "K_z1", "K_z2"}


def test_bearings_of_the_footbridge_foretell_its_unseen_modes(bridge: Case) -> None:
    measured_hz = bridge.measurement.frequencies
    result = Eigensensitivity().update(bridge.model, bridge.used_measurement(), RNG)
    found = {p.name.removeprefix("stiffness group:"): p.after for p in result.parameters}
    assert found["K_y1"] < 0.5
    assert found["K_z2"] > 1.2
    own = solve_modes(result.model, 5).natural_frequencies
    errors = own[[3, 4]] / measured_hz[[3, 4]] - 1.0
    assert np.sqrt(np.mean(np.square(errors))) < 0.015
