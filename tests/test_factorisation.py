"""Both back ends of the sparse solver: how often they factorise, what they hold and count."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from large_structures import brick_ladder
from scipy.sparse.linalg import splu

from femubench import fem
from femubench.core.fem.frame import (
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    Member,
    Place,
    PointMass,
    Support,
)
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.sections import Section
from femubench.core.modal import sparse_eigen, superlu_pivots
from femubench.core.modal.eigen import dense_matrices, solve_dense
from femubench.core.modal.factorisation import LU, Cholesky, cholmod_obstacle
from femubench.core.modal.inertia import negative_after, signs_hold
from femubench.core.modal.sparse_eigen import ShiftedModel, lowest_eigenpairs
from femubench.core.modal.superlu_pivots import pivots

FrameBuilder = Callable[..., Frame]
TUBE, ALUMINIUM = Section.round_tube(0.02, 0.002), Material(70e9, 0.3, 2700.0)
BACK_ENDS = ("SuperLU", "CHOLMOD")


def use(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    if name == "SuperLU":
        monkeypatch.setattr(sparse_eigen, "cholmod_obstacle", lambda: "left out by the test")
    elif (obstacle := cholmod_obstacle()) is not None:
        pytest.skip(obstacle)


@pytest.fixture(params=BACK_ENDS)
def back_end(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    use(monkeypatch, request.param)
    return str(request.param)


def lattice(sides: tuple[int, int, int], elements: int = 2) -> Frame:
    """Return a free lattice of bars along x, y and z; a plane one where it has one layer."""
    plane = "out-of-plane" if sides[2] == 1 else "3d"
    joints, members = [], []
    for at in np.ndindex(sides):
        joints.append(Joint(str(at), (0.5 * at[0], 0.45 * at[1], 0.4 * at[2])))
        for axis in range(3):
            other = tuple(int(i) for i in np.add(at, np.eye(3, dtype=int)[axis]))
            if other[axis] < sides[axis]:
                ends = (str(at), str(other))
                members.append(Member(f"m{len(members)}", ends, elements, TUBE, ALUMINIUM))
    return Frame(plane, "euler-bernoulli", tuple(joints), tuple(members))


def equal_beams(count: int) -> Frame:
    """Return beams next to each other that nothing connects: every eigenvalue is repeated."""
    joints, members = [], []
    for i in range(count):
        joints += [Joint(f"A{i}", (0.0, float(i), 0.0)), Joint(f"B{i}", (0.5, float(i), 0.0))]
        members.append(Member(f"m{i}", (f"A{i}", f"B{i}"), 20, TUBE, ALUMINIUM))
    supports = tuple(Support(Place(joint=f"A{i}"), ("z", "rx", "ry")) for i in range(count))
    return Frame(
        "out-of-plane", "euler-bernoulli", tuple(joints), tuple(members), supports=supports
    )


def structures(ladder: FrameBuilder, portal: FrameBuilder) -> Iterator[tuple[str, Model]]:
    """Yield free, suspended, hinged and repeated structures of 200 to 2000 dofs."""
    frame = ladder(elements=30)
    soft = tuple(GroundSpring(Place(joint=j), "z", 100.0) for j in "AC")
    heavy = (PointMass(Place(joint="A"), 200.0),)
    hinge = (JointSpring("J1", "m0", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),)
    yield "free ladder", Model.of(frame)
    yield "suspended ladder", Model.of(replace(frame, springs=soft))
    yield "ladder with a heavy mass", Model.of(replace(frame, masses=heavy))
    yield "portal with springs", Model.of(portal(1, joint_springs=hinge))
    yield "lattice", Model.of(lattice((4, 4, 4)))
    yield "equal beams", Model.of(equal_beams(4))


class Spy:
    """Count factorisations, and how many are held at once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.made: list[bool] = []
        self.held: weakref.WeakSet[LU] = weakref.WeakSet()
        self.most_held = 0
        start, factorise = LU.__init__, Cholesky.factorise

        def counted_start(factor: LU, matrix: sp.csc_array, **given: Any) -> None:
            start(factor, matrix, **given)
            self.made.append(True)
            self.held.add(factor)
            self.most_held = max(self.most_held, len(self.held))

        def counted(cholesky: Cholesky, matrix: sp.csc_array) -> bool:
            self.made.append(factorise(cholesky, matrix))
            return self.made[-1]

        monkeypatch.setattr(LU, "__init__", counted_start)
        monkeypatch.setattr(Cholesky, "factorise", counted)


def test_two_factorisations_one_at_a_time(
    back_end: str, ladder: FrameBuilder, portal: FrameBuilder, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, model in structures(ladder, portal):
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            lowest_eigenpairs(model, 12)
        assert spy.made == [True, True], name
        assert spy.most_held == (back_end == "SuperLU"), name


def test_both_back_ends_give_the_same_eigenvalues(
    ladder: FrameBuilder, portal: FrameBuilder, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, model in structures(ladder, portal):
        found = {}
        for back_end in BACK_ENDS:
            with monkeypatch.context() as patch:
                use(patch, back_end)
                found[back_end], shapes = lowest_eigenpairs(model, 12)
        small = np.abs(shapes)
        rounding = 32 * np.finfo(float).eps * (small * (abs(model.stiffness) @ small)).sum(axis=0)
        np.testing.assert_allclose(
            found["SuperLU"], found["CHOLMOD"], rtol=1e-9, atol=rounding.max(), err_msg=name
        )


@pytest.mark.usefixtures("back_end")
def test_no_mode_of_a_cluster_is_missed() -> None:
    model = Model.of(equal_beams(9))
    expected, _ = solve_dense(*dense_matrices(model))
    for count in (3, 9, 10, 20):
        found, shapes = lowest_eigenpairs(model, count)
        np.testing.assert_allclose(found, expected[:count], rtol=1e-8)
        np.testing.assert_allclose(
            shapes.T @ model.mass_times(shapes), np.eye(count), rtol=0, atol=1e-7
        )


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("about", [1, 60])
def test_the_count_is_right_close_to_eigenvalues(portal: FrameBuilder, about: int) -> None:
    model = Model.of(portal(1))
    plain, _ = solve_dense(*dense_matrices(model))
    basis = np.asarray(model.mass @ np.random.default_rng(0).standard_normal((model.size, 2)))
    change = LowRank(basis, np.diag([-50.0 * plain[8], 1e5]))
    for candidate in (model, replace(model, stiffness_change=change)):
        expected, _ = solve_dense(*dense_matrices(candidate))
        assert (expected[0] < -1.0) == (candidate is not model)
        for number in (9, 15, 40):
            for side in (-1.0, 1.0):
                shift = float(expected[number] * (1.0 + 1e-6 * side))
                below = ShiftedModel(candidate, shift).eigenvalues_below(about)
                assert below in (None, int(np.sum(expected < shift)))


def test_the_count_by_pins_is_one(portal: FrameBuilder, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, "CHOLMOD")
    monkeypatch.setattr(sparse_eigen, "LU", None)
    model = Model.of(portal(1))
    expected, _ = solve_dense(*dense_matrices(model))
    for number in (8, 20):
        shift = float(0.5 * (expected[number] + expected[number + 1]))
        assert ShiftedModel(model, shift).eigenvalues_below(number) == number + 1


def vanishing_pivots(seed: int) -> tuple[Model, float]:
    """Return a model and a shift that leaves an ulp of 60 diagonals, the first to be pivots.

    Their multipliers of 1e16 round away what the diagonals of their neighbours were.
    """
    random, n, tiny = np.random.default_rng(seed), 600, 60
    strong = (np.repeat(np.arange(tiny), 2), tiny + random.choice(n - tiny, 2 * tiny, False))
    chain = np.arange(tiny, n - 1)
    rows, columns = np.append(strong[1], chain + 1), np.append(strong[0], chain)
    values = np.append(random.uniform(2.4, 2.7, 2 * tiny), np.full(len(chain), -0.1))
    weak = sp.random_array(
        (n - tiny, n - tiny),
        density=8 / n,
        rng=random,
        data_sampler=lambda size: random.uniform(-0.03, 0.03, size),
    )
    low = sp.coo_array((values, (rows, columns)), shape=(n, n))
    low = low + sp.block_diag([sp.csc_array((tiny, tiny)), weak])
    diagonal = np.append(np.full(tiny, np.nextafter(1.0, 2.0)), np.full(n - tiny, 4.05))
    stiffness = sp.csc_array(low + low.T + sp.diags_array(diagonal))
    return fem.matrix_model(sp.eye_array(n), stiffness, range(n), ["x"] * n), 1.0


def test_planes_order_a_thick_solid(monkeypatch: pytest.MonkeyPatch) -> None:
    """They fill less than minimum degree, and answers and counts stay."""
    use(monkeypatch, "SuperLU")
    solid = brick_ladder(2, 4, 3)
    force = np.random.default_rng(0).standard_normal((solid.size, 2))
    answers, fills, counts = [], [], []
    for large in (solid.size, solid.size + 1):
        monkeypatch.setattr(sparse_eigen, "_LARGE", large)
        shifted = ShiftedModel(solid, -1e6)
        answers.append(shifted.solve(force))
        fills.append(shifted._factor._factor.L.nnz)
        counts.append(shifted.move(1e9).eigenvalues_below())
    assert la.norm(answers[1] - answers[0]) < 1e-9 * la.norm(answers[1])
    assert fills[0] < 0.9 * fills[1]
    assert counts == [7, 7]


@pytest.mark.parametrize("seed", range(2))
def test_signs_of_grown_pivots_are_not_believed(
    seed: int, back_end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, shift = vanishing_pivots(seed)
    mass, stiffness = dense_matrices(model)
    eigenvalues = np.linalg.eigvalsh(stiffness - shift * mass)
    assert np.abs(eigenvalues).min() > 1.0
    expected = int(np.sum(eigenvalues < 0.0))
    matrix = sp.csc_array(model.stiffness - shift * model.mass)
    assert not signs_hold(LU(matrix), matrix)
    assert signs_hold(LU(matrix, pivot=1.0), matrix)
    assert ShiftedModel(model, shift).eigenvalues_below(expected) == expected
    if back_end == "SuperLU":
        monkeypatch.setattr(sparse_eigen, "negative_by_pins", lambda *_: None)
        assert ShiftedModel(model, shift).eigenvalues_below(expected) is None


def test_rounding_that_hides_an_eigenvalue_is_said() -> None:
    for smallest, expected in ((1e-11, 1), (-1e-11, 0), (1e-15, None), (-1e-15, None)):
        capacitance = np.diag([smallest, 1.0])
        assert negative_after(0, np.array([-1.0, 1.0]), capacitance) == expected


@pytest.mark.usefixtures("back_end")
def test_the_count_next_to_an_eigenvalue_of_a_fine_mesh() -> None:
    model = Model.of(lattice((4, 4, 1), 200))
    eigenvalues, _ = lowest_eigenpairs(model, 14)
    for near, counts in ((1e-3, {13}), (1e-7, {13, None})):
        shift = float(eigenvalues[-1] * (1.0 - near))
        assert ShiftedModel(model, shift).eigenvalues_below(13) in counts


@pytest.mark.usefixtures("back_end")
def test_matrices_without_places() -> None:
    ones = np.ones(600)
    chain = sp.diags_array([2.0 * ones, -ones[1:], -ones[1:]], offsets=[0, 1, -1])
    model = fem.matrix_model(sp.eye_array(600), chain, range(600), ["x"] * 600)
    found, _ = lowest_eigenpairs(model, 6)
    expected = 4.0 * np.sin(np.arange(1, 7) * np.pi / 1202.0) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_pivots_are_the_diagonal_of_u() -> None:
    random = np.random.default_rng(0)
    for size in (1, 7, 300):
        half = sp.random_array((size, size), density=min(1.0, 5.0 / size), rng=random)
        matrix = half + half.T + sp.diags_array(random.standard_normal(size))
        factor = splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A")
        np.testing.assert_array_equal(pivots(factor), factor.U.diagonal())


def test_pivots_of_another_layout_are_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    matrix = sp.csc_matrix(np.diag([2.0, -3.0, 4.0]) + 0.5)
    assert np.iscomplexobj(pivots(splu(matrix.astype(complex))))
    factor = splu(matrix)
    for field, value in (("_COLUMNS", 7), ("_LOWEST", 2**62), ("_DOUBLE", 0)):
        with monkeypatch.context() as other:
            other.setattr(superlu_pivots, field, value)
            assert superlu_pivots._supernodes(factor) is None
            np.testing.assert_array_equal(pivots(factor), factor.U.diagonal())
    assert superlu_pivots._supernodes(factor) is not None


def test_bending_alone_is_a_smooth_field() -> None:
    # w = x^2 less its mean and slope: strain energy 4 EI L over mass rho A L^5 / 180.
    model = Model.of(replace(equal_beams(1), supports=()))
    rigid = sparse_eigen.rigid_modes_of(model)
    bound = sparse_eigen.softest_smooth_field(model, rigid, model.mass_times(rigid))
    length = 0.5
    bending = ALUMINIUM.E * TUBE.Iy / (ALUMINIUM.rho * TUBE.A)
    exact = 720.0 * bending / length**4
    assert bound is not None
    assert 0.99 * exact < bound < (1.0 + 1e-9) * exact
