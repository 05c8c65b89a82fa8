"""Strategies of stiffness factors, their parameter sets and steps, and the secant adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import femubench
from femubench import (
    InputError,
    Measurement,
    Model,
    NotApplicable,
    Sensors,
    Strategy,
    read_case,
    solve_modes,
)
from femubench.core.update.change_lists import element_sets
from femubench.fem import (
    Frame,
    Joint,
    Material,
    Member,
    MemberSet,
    Place,
    Section,
    Structure,
    Support,
    matrix_model,
)
from femubench.modal import mac, rigid_modes_of
from femubench.plugins.strategies.bayesian import Bayesian
from femubench.plugins.strategies.cma_es import CmaEs
from femubench.plugins.strategies.cross_model import CrossModel, cross_equations
from femubench.plugins.strategies.eigensensitivity import (
    Eigensensitivity,
    l_curve_corner,
    l_curve_curvature,
    tikhonov,
)
from femubench.plugins.strategies.eigenvector_difference import EigenvectorDifference
from femubench.plugins.strategies.multi_start import MultiStart
from femubench.plugins.strategies.particle_swarm import ParticleSwarm
from femubench.plugins.strategies.secant import Secant
from femubench.plugins.strategies.sparse import Sparse, lasso
from femubench.plugins.strategies.strain_energy import StrainEnergy, energy_change_index
from femubench.scenarios import HERE
from femubench.update import Changes, ModalSpace, QuasiModes
from tests.simulated import modes_at

STEEL = Material(2.1e11, 0.3, 7850.0)
BAR = Section(4e-4, 1.2e-8, 1.2e-8, 2e-8, 2.4e-8)
FACTOR = 0.7
RNG = np.random.default_rng(0)


def frame_of_five() -> Frame:
    """Return a free frame in space without any symmetry."""
    corners = {
        "A": (0.0, 0.0, 0.0),
        "B": (0.9, 0.0, 0.0),
        "C": (1.0, 0.7, 0.1),
        "D": (0.1, 0.6, 0.0),
        "E": (0.4, 0.3, 0.5),
    }
    ends = ("AB", "BC", "CD", "DA", "DE")
    members = tuple(Member(f"m-{e}", (e[0], e[1]), 2, BAR, STEEL) for e in ends)
    joints = tuple(Joint(name, xyz) for name, xyz in corners.items())
    return Frame("3d", "euler-bernoulli", joints, members)


def cantilever() -> Frame:
    """Return a clamped beam of twenty members."""
    joints = tuple(Joint(f"J{i}", (0.05 * i, 0.0, 0.0)) for i in range(21))
    members = tuple(Member(f"m-{i}", (f"J{i}", f"J{i + 1}"), 1, BAR, STEEL) for i in range(20))
    support = Support(Place("J0"), ("x", "z", "ry"))
    return Frame("in-plane", "euler-bernoulli", joints, members, supports=(support,))


def tower() -> Frame:
    """Return a mast on a cross of four clamped legs: its modes of bending come in equal pairs."""
    feet = {"N": (0.0, 0.4), "S": (0.0, -0.4), "E": (0.4, 0.0), "W": (-0.4, 0.0)}
    joints = [Joint(name, (0.0, 0.0, z)) for name, z in (("top", 1.0), ("mid", 0.5), ("base", 0.0))]
    joints += [Joint(name, (x, y, 0.0)) for name, (x, y) in feet.items()]
    ends = {"low": ("base", "mid"), "high": ("mid", "top"), **{n: (n, "base") for n in feet}}
    members = tuple(Member(f"m-{name}", pair, 3, BAR, STEEL) for name, pair in ends.items())
    supports = tuple(Support(Place(name), ("x", "y", "z", "rx", "ry", "rz")) for name in feet)
    return Frame("3d", "euler-bernoulli", tuple(joints), members, supports=supports)


def everywhere(model: Model) -> Sensors:
    """Return a sensor on every degree of freedom."""
    labels = tuple(f"{n}{d}" for n, d in zip(model.dofs.node, model.dofs.direction, strict=True))
    return Sensors(labels, model.dofs.xyz, model.dofs.direction)


def planted(
    frame: Frame, member: str, count: int, factor: float = FACTOR
) -> tuple[Model, Measurement]:
    """Return a frame and exact modes of the same with one member softer, seen everywhere."""
    model = Model.of(frame)
    parts = Changes(model).parameterise("members")
    factors = np.where(np.array(parts.names) == f"E {member}", factor, 1.0)
    return model, modes_at(parts.at(np.log(factors)), everywhere(model), count, shape_std=0.01)


def factors_of(strategy: Strategy, model: Model, measurement: Measurement) -> dict[str, float]:
    """Return the factors that a strategy finds, by name."""
    result = strategy.update(model, measurement, np.random.default_rng(1))
    return {item.name.removeprefix("E "): item.after for item in result.parameters}


@pytest.mark.parametrize(
    ("strategy", "within"),
    [
        (Eigensensitivity(), 1e-4),
        (MultiStart(starts=2, basis=100), 1e-4),
        (CmaEs(evaluations=1000, basis=60), 0.01),
        (ParticleSwarm(largest=1.6), 0.02),
        (CrossModel(expansion="force"), 1e-5),
        (EigenvectorDifference(starts=2, basis=100), 1e-4),
        (StrainEnergy(), 1e-4),
        (Sparse(), 0.02),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_planted_change_is_found_from_exact_modes(strategy: Strategy, within: float) -> None:
    model, measurement = planted(frame_of_five(), "m-CD", 6)
    found = factors_of(strategy, model, measurement)
    assert found.pop("m-CD") == pytest.approx(FACTOR, abs=within)
    assert list(found.values()) == pytest.approx([1.0] * len(found), abs=within)


def test_a_swarm_moves_as_its_equations_say_particle_by_particle() -> None:
    """Clerc & Kennedy (2002), type 1", in their form of position and velocity, number by number."""
    low, high, phi = np.array([-2.0, -1.0, 0.2]), np.array([1.0, 3.0, 4.0]), 4.1

    def cost(x: np.ndarray) -> float:  # type: ignore[type-arg]
        return float(np.square(x - [0.3, 2.9, 0.2]).sum() + np.sin(5.0 * x).sum())

    swarm = ParticleSwarm(particles=5, evaluations=60)
    found, least, history = swarm.search(cost, low, high, np.random.default_rng(4))
    rng, chi = np.random.default_rng(4), 2.0 / abs(2.0 - phi - np.sqrt(phi**2 - 4.0 * phi))
    assert round(chi, 4) == 0.7298
    x = [list(low + (high - low) * row) for row in rng.random((5, 3))]
    x[0] = [0.0, 0.0, 0.2]
    v = [list(low + (high - low) * row - x[i]) for i, row in enumerate(rng.random((5, 3)))]
    own = [(cost(np.array(row)), list(row)) for row in x]
    for _ in range(11):
        leader, drawn = min(own)[1], rng.random((2, 5, 3))
        for i, d in np.ndindex(5, 3):
            pull = drawn[0, i, d] * (own[i][1][d] - x[i][d]) + drawn[1, i, d] * (
                leader[d] - x[i][d]
            )
            v[i][d] = chi * (v[i][d] + phi / 2.0 * pull)
            x[i][d] += v[i][d]
            if not low[d] <= x[i][d] <= high[d]:
                x[i][d], v[i][d] = min(max(x[i][d], low[d]), high[d]), 0.0
        own = [
            min(best, (cost(np.array(row)), list(row))) for best, row in zip(own, x, strict=True)
        ]
    assert (len(history), least) == (11, pytest.approx(min(own)[0], rel=1e-9))
    assert found == pytest.approx(min(own)[1], rel=1e-6)
    with pytest.raises(InputError, match="2 at least"):
        ParticleSwarm(particles=1)


def test_no_equation_asks_for_what_the_expanded_shapes_cannot_have() -> None:
    """Shapes rotated within their partners are blind to all other modes of the model.

    Such modes had equations of their own, with a zero on the right for any measured shape.
    """
    model, measurement = planted(frame_of_five(), "m-CD", 6)
    parts, quasi = Changes(model).parameterise("own"), QuasiModes.of(model, measurement)
    own = solve_modes(model).elastic
    every = own.take(np.arange(18))
    _, right = cross_equations(parts, every, quasi.shapes, measurement.eigenvalues)
    assert np.isclose(right, 0.0, atol=1e-9).sum() == 72
    found = CrossModel().update(model, measurement, np.random.default_rng(0))
    assert found.diagnostics["equations"] == 36.0


@pytest.mark.parametrize(
    ("member", "saddle", "optimum"), [("upper-1", 262.3, 40.8), ("lower-1", 122.0, 45.8)]
)
def test_a_symmetric_start_is_left_for_the_better_optimum(
    member: str, saddle: float, optimum: float
) -> None:
    """One of two equal members is softer: frequencies have no slope by their difference.

    Which of the two it is, frequencies cannot tell; that they differ, they can.
    """
    frame = replace(read_case(HERE / "hframe").model.frame_structure.frame, masses=())
    model, measurement = planted(frame, member, 5, 0.5)
    ends = {}
    for restarts in (0, 1):
        options = replace(Bayesian().options, restarts=restarts)
        strategy = Bayesian(changes="members", options=options)
        ends[restarts] = strategy.update(model, measurement, np.random.default_rng(0))
    assert Bayesian().options == replace(Bayesian().options, restarts=1)
    pair = [f"E {member}", f"E {member[:-1]}2"]
    values = {
        restarts: [p.after for p in end.parameters if p.name in pair]
        for restarts, end in ends.items()
    }
    assert values[0][0] == pytest.approx(values[0][1], rel=1e-3)
    assert abs(values[1][0] - values[1][1]) > 0.35
    costs = {restarts: end.history[-1]["cost"] for restarts, end in ends.items()}
    assert (costs[0], costs[1]) == (
        pytest.approx(saddle, rel=0.01),
        pytest.approx(optimum, rel=0.01),
    )
    steps = [int(entry["iteration"]) for entry in ends[1].history]
    assert steps == list(range(len(steps)))


def test_an_optimum_that_is_the_only_one_stays_to_the_last_digit() -> None:
    model, measurement = planted(frame_of_five(), "m-CD", 6)
    found = []
    for restarts in (0, 3):
        options = replace(Bayesian().options, restarts=restarts)
        result = Bayesian(options=options).update(model, measurement, np.random.default_rng(0))
        found.append([p.after for p in result.parameters])
    assert found[0] == found[1]


def test_a_sum_of_sizes_finds_the_one_of_twenty_members_where_squares_blur_it() -> None:
    model, measurement = planted(cantilever(), "m-6", 8)
    found = factors_of(Sparse(), model, measurement)
    changed = {name: value for name, value in found.items() if abs(value - 1.0) > 0.01}
    assert list(changed) == ["m-6"]
    assert changed["m-6"] == pytest.approx(FACTOR, abs=0.03)
    blurred = factors_of(Eigensensitivity(shape_weight=0.0), model, measurement)
    assert sum(abs(value - 1.0) > 0.01 for value in blurred.values()) > 5


def test_the_member_whose_strain_energy_changed_most_is_the_softer_one() -> None:
    model, measurement = planted(frame_of_five(), "m-DE", 5)
    assert set(factors_of(StrainEnergy(above=2.0), model, measurement)) == {"m-DE"}
    before = np.array([[1.0, 2.0], [1.0, 0.0], [2.0, 2.0]])
    after = np.array([[1.5, 2.0], [1.0, 9.0], [1.0, 1.0]])
    # A ratio of the second member in the second mode, which it does not strain, says nothing.
    assert energy_change_index(before, after).tolist() == [0.5, 0.0, 1.0]


def test_results_keep_rigid_motion_and_positive_stiffness_far_from_any_fit() -> None:
    model, measurement = planted(frame_of_five(), "m-AB", 4)
    wrong = replace(measurement, frequencies=measurement.frequencies * [1.3, 0.8, 1.2, 0.9])
    for strategy in (Eigensensitivity(), Sparse(), CrossModel(), StrainEnergy(), Secant()):
        found = strategy.update(model, wrong, np.random.default_rng(0)).model
        modes = solve_modes(found)
        assert modes.rigid.sum() == 6
        assert modes.elastic.eigenvalues[0] > 0.0


def test_slopes_are_those_of_differences_and_few_shapes_give_the_same_frequencies() -> None:
    case = femubench.cases["frame"]
    measurement = case.used_measurement()
    parts = Changes(case.model).parameterise("members")
    log, step = 0.2 * np.sin(np.arange(len(parts))), 1e-5
    whole = ModalSpace.of(parts, measurement, shape_weight=0.1)
    few = ModalSpace.of(parts, measurement, shape_weight=0.1, size=40)
    largest = ModalSpace.of(parts, measurement, shape_weight=0.1, scaled="largest")
    for space in (whole, few, largest):
        ahead, behind = (
            [space.fit(log + sign * step * unit).residual for unit in np.eye(len(parts))]
            for sign in (1.0, -1.0)
        )
        slope = (np.array(ahead) - np.array(behind)).T / (2.0 * step)
        assert space.fit(log).slope == pytest.approx(slope, abs=1e-6)
    fit = whole.fit(log)
    model = parts.at(log)
    modes = solve_modes(model).elastic
    likeness = mac(measurement.shapes, model.observe(measurement.sensors) @ modes.shapes[:, :3])
    misfit = np.square(fit.residual[3:] / 0.1).reshape(3, -1).sum(axis=1)
    assert misfit == pytest.approx(1.0 - np.diag(likeness), abs=1e-9)
    assert fit.residual[:3] == pytest.approx(
        1.0 - modes.natural_frequencies[:3] / measurement.frequencies, abs=1e-9
    )
    shapes = largest.fit(log).residual[3:].reshape(3, -1)
    at = np.abs(measurement.shapes).argmax(axis=0)
    assert shapes[[0, 1, 2], at] == pytest.approx(np.zeros(3), abs=1e-12)
    assert few.fit(log).residual[:3] == pytest.approx(fit.residual[:3], abs=2e-3)


# A shear frame of eighteen storeys: stiffness in 100 kN/m, weights in kN, relative changes.
STOREYS = np.array(
    [1155, 1092, 1073, 1028, 1028, 990, 963, 938, 876, 840, 824, 788, 712, 660, 619, 562, 491, 363]
)
WEIGHTS = np.repeat([208.0, 206.0, 202.0], [11, 6, 1])
CHANGES = np.array([5, 5, -5, -10, 10, -15, 15, 25, -10, 20, 30, 25, -15, 5, -15, 10, 20, 20])  # %


def test_the_published_changes_of_eighteen_storeys_are_found_by_eigenvectors() -> None:
    """Of SMU's example (Wang, Dong & Li): four modes at seven floors, all digits that it prints."""
    groups = {}
    for k, size in enumerate(1e5 * STOREYS):
        edge = np.zeros((1, 18))
        edge[0, max(k - 1, 0) : k + 1] = [-1.0, 1.0] if k else [1.0]
        groups[f"storey-{k + 1}"] = sp.csc_array(size * edge.T @ edge)
    stiffness = sum(groups.values(), start=sp.csc_array((18, 18)))
    mass = sp.diags_array(WEIGHTS * 1e3 / 9.8, format="csc")
    nodes, heights = [f"n{k + 1}" for k in range(18)], np.arange(18.0)
    xyz = np.column_stack([np.zeros((18, 2)), heights])
    plain = matrix_model(mass, stiffness, nodes, ("x",) * 18, xyz=xyz)
    model = replace(plain, groups=groups)
    truth = Changes(model).parameterise("groups").at(np.log1p(CHANGES / 100.0))
    floors = [0, 3, 6, 8, 11, 14, 17]
    seen = Sensors(tuple(nodes[k] for k in floors), xyz[floors], ("x",) * 7)
    measurement = modes_at(truth, seen, 4, shape_std=0.01)
    strategy = EigenvectorDifference(starts=0, shape_weight=1.0)
    result = strategy.update(model, measurement, np.random.default_rng(0))
    found = [100.0 * (p.after - 1.0) for p in result.parameters]
    assert found == pytest.approx(CHANGES, abs=0.5)


def test_a_model_that_loses_a_mode_fits_no_better_than_before() -> None:
    """All members softer and softer: the frequency falls as the root, until nothing pairs."""
    model = Model.of(cantilever())
    first = modes_at(model, everywhere(model), 1, shape_std=0.01)
    bare = replace(first, shapes=np.full_like(first.shapes, np.nan))
    parts = Changes(model).parameterise("members")
    space = ModalSpace.of(parts, bare, shape_weight=0.0)
    fits = [space.fit(np.full(len(parts), 2.0 * np.log(r))) for r in (0.9, 0.8, 0.73, 0.7, 0.5)]
    assert [fit.paired for fit in fits] == [1, 1, 1, 0, 0]
    costs = [fit.cost for fit in fits]
    assert costs[:3] == pytest.approx([0.1**2, 0.2**2, 0.27**2], rel=1e-6)
    assert min(costs[3:]) > costs[2]


def test_modes_of_one_frequency_turn_by_no_rounding() -> None:
    """Stiffness that grows everywhere alike turns no shape; that of one leg finds its factor."""
    model, measurement = planted(tower(), "m-N", 6)
    hertz = solve_modes(model).natural_frequencies
    assert hertz[[1, 3]] == pytest.approx(hertz[[0, 2]], rel=1e-9)
    parts = Changes(model).parameterise("members")
    space = ModalSpace.of(
        parts, modes_at(model, everywhere(model), 4, shape_std=0.01), shape_weight=1.0
    )
    slope = space.fit(np.zeros(len(parts))).slope
    assert slope[:4].sum(axis=1) == pytest.approx([-0.5] * 4)
    assert slope[4:].sum(axis=1) == pytest.approx(np.zeros(len(slope) - 4), abs=1e-9)
    found = factors_of(Eigensensitivity(), model, measurement)
    assert found.pop("m-N") == pytest.approx(FACTOR, abs=1e-3)
    assert list(found.values()) == pytest.approx([1.0] * len(found), abs=1e-3)


def test_the_curvature_is_that_of_the_curve_and_its_corner_beats_other_weights() -> None:
    rng = np.random.default_rng(3)
    left, _ = np.linalg.qr(rng.standard_normal((40, 12)))
    right, _ = np.linalg.qr(rng.standard_normal((12, 12)))
    matrix = left @ np.diag(10.0 ** (-0.35 * np.arange(12))) @ right
    truth = right.T @ 0.6 ** np.arange(12)
    data = matrix @ truth + 2e-3 * rng.standard_normal(40)
    weights = np.logspace(0.0, -3.0, 1200)
    answers = [tikhonov(matrix, data, w) for w in weights]
    x = np.log([np.linalg.norm(matrix @ a - data) for a in answers])
    y = np.log([np.linalg.norm(a) for a in answers])
    t = np.log(weights)
    (dx, dy) = (np.gradient(v, t) for v in (x, y))
    bend = (dx * np.gradient(dy, t) - dy * np.gradient(dx, t)) / (dx**2 + dy**2) ** 1.5
    inside = slice(5, -5)
    curvature = l_curve_curvature(matrix, data, weights)[inside]
    assert curvature == pytest.approx(bend[inside], abs=0.01 * np.abs(bend[inside]).max())

    def error(weight: float) -> float:
        return float(np.linalg.norm(tikhonov(matrix, data, weight) - truth))

    corner = l_curve_corner(matrix, data)
    assert error(corner) < 2.0 * min(error(w) for w in weights)
    assert error(corner) < 0.5 * min(error(1.0), error(1e-3))


def test_the_penalty_of_sizes_meets_its_conditions_and_equal_columns_share() -> None:
    rng = np.random.default_rng(5)
    matrix, right = rng.standard_normal((6, 10)), rng.standard_normal(6)
    weight = 0.2 * float(np.abs(matrix.T @ right).max())
    x = lasso(matrix, right, weight)
    pull = matrix.T @ (right - matrix @ x)
    assert 0 < np.count_nonzero(x) <= 6
    assert pull[x != 0.0] == pytest.approx(weight * np.sign(x[x != 0.0]), rel=1e-5)
    assert np.abs(pull[x == 0.0]).max() <= weight
    assert not lasso(matrix, right, 5.1 * weight).any()
    most = int(np.abs(x).argmax())
    shared = lasso(np.column_stack([matrix, matrix[:, most] * (1.0 + 1e-9)]), right, weight)
    assert shared[most] == shared[-1]
    assert 2.0 * shared[-1] == pytest.approx(x[most])
    twice = lasso(np.ones((1, 2)), np.array([3.0]), 1.0)
    assert twice == pytest.approx([1.0, 1.0], rel=1e-6)


def test_the_secant_adjustment_is_that_of_quasi_newton_methods() -> None:
    model, measurement = planted(frame_of_five(), "m-AB", 3)
    result = Secant().update(model, measurement, np.random.default_rng(0))
    modes = solve_modes(result.model)
    assert modes.elastic.natural_frequencies[:3] == pytest.approx(measurement.frequencies, rel=1e-8)
    rigid = rigid_modes_of(model)
    assert np.abs(result.model.stiffness_times(rigid)).max() < 1e-6 * abs(model.stiffness).max()
    # One pair of vectors: y = K s exactly, and a change of rank two.
    one = measurement.select([1])
    change = Secant().update(model, one, np.random.default_rng(0)).model.stiffness_change
    assert change is not None
    assert sorted(np.sign(np.linalg.eigvalsh(change.core))) == [-1.0, 1.0]


def test_parts_make_the_stiffness_and_sets_name_what_the_frame_has() -> None:
    frame = frame_of_five()
    model = Model.of(frame)
    parts = Changes(model).parameterise("members")
    every = np.eye(model.size)
    matrices = parts.energies(every, every)
    np.testing.assert_allclose(
        parts.start_slopes.combine(every[:, 3], np.diag([1.0, 2.0, 3.0, 4.0, 5.0])),
        np.array([(p + 1.0) * part[:, 3] for p, part in enumerate(matrices)]).T,
        atol=1e-12 * np.abs(matrices).max(),
    )
    whole = matrices.sum(axis=0)
    stiffness = model.stiffness.toarray()
    assert np.abs(whole - stiffness).max() < 1e-9 * np.abs(stiffness).max()
    factors = np.array([0.5, 1.0, 2.0, 1.5, 0.8])
    summed = np.tensordot(factors, matrices, axes=1)
    assert (
        np.abs(parts.at(np.log(factors)).stiffness - summed).max() < 1e-9 * np.abs(stiffness).max()
    )
    assert len(Changes(model).parameterise("elements")) == 10
    ring = MemberSet("ring", ("m-AB", "m-BC", "m-CD", "m-DA"))
    sets = replace(frame, sets=(ring, MemberSet("mast", ("m-DE",))))
    assert list(element_sets(Structure.build(sets), "sets")) == ["set:ring", "set:mast"]
    overlapping = replace(frame, sets=(ring, MemberSet("side", ("m-DA",))))
    with pytest.raises(NotApplicable, match=r"m-DA/1 is in set:ring and in set:side"):
        element_sets(Structure.build(overlapping), "sets")
    with pytest.raises(NotApplicable, match=r"changes=sets needs `\[\[model.sets\]\]`"):
        element_sets(Structure.build(frame), "sets")
    with pytest.raises(InputError, match="there is no 'member'"):
        Eigensensitivity(changes="member")


def test_groups_of_matrices_have_factors_too() -> None:
    model, measurement = planted(frame_of_five(), "m-CD", 6)
    parts = Changes(model).parameterise("members")
    energies = parts.energies(np.eye(model.size), np.eye(model.size))
    groups = {"mast": sp.csc_array(energies[4]), "back": sp.csc_array(energies[2])}
    matrices = replace(model, structure=None, groups=groups)
    wanted = {"stiffness group:mast": 1.0, "stiffness group:back": FACTOR}
    for strategy in (Eigensensitivity(), Eigensensitivity(changes="groups"), Sparse()):
        found = factors_of(strategy, matrices, measurement)
        assert found == pytest.approx(wanted, abs=0.01)
    with pytest.raises(NotApplicable, match="needs a model from matrices for which"):
        Eigensensitivity(changes="groups").update(model, measurement, np.random.default_rng(0))
    with pytest.raises(NotApplicable, match="changes=members needs a frame of members"):
        Eigensensitivity(changes="members").update(matrices, measurement, RNG)
