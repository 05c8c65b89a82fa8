"""Modes after many attachments, against solutions of the whole attached models."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femubench.core.fem.frame import GroundSpring, Place, PointMass, Support
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal import many_changes as module
from femubench.core.modal.eigen import DENSE_LIMIT, Modes, count_evaluations, solve_modes
from femubench.core.modal.many_changes import Change, ManyChanges, many_changes, modes_of_changes
from tests.lattices import lattice

COUNT = 12


@pytest.fixture(scope="module")
def block() -> Model:
    model = Model.of(lattice(2, 3))
    assert model.size == 810 > DENSE_LIMIT
    return model


@pytest.fixture(scope="module")
def small() -> Model:
    """Return a model that is solved densely, so that the proofs are held against another solver."""
    return Model.of(lattice(2, 1))


def drawn(model: Model, count: int, seed: int) -> Iterator[Change]:
    """Yield changes of several kinds: masses, offset masses, springs, many at once, heavy ones."""
    rng, frame = np.random.default_rng(seed), model.frame_structure.frame
    joints, members = frame.joints, frame.members

    def place() -> Place:
        if rng.random() < 0.5:
            return Place(joint=joints[rng.integers(len(joints))].name)
        s = float(rng.uniform(0.02, 0.98))
        return Place(member=members[rng.integers(len(members))].name, s=s)

    def mass(low: float, high: float) -> PointMass:
        return PointMass(place(), model.total_mass * 10.0 ** rng.uniform(low, high))

    def spring() -> GroundSpring:
        return GroundSpring(place(), "xyz"[rng.integers(3)], 10.0 ** rng.uniform(2.0, 9.0))

    for i in range(count):
        offset = replace(mass(-3.0, -1.0), offset=tuple(rng.uniform(-0.05, 0.05, 3)))
        yield (
            ([mass(-4.0, -1.0)], []),
            ([], [spring()]),
            ([offset], [spring(), spring()]),
            ([mass(-3.0, -1.0) for _ in range(3)], [spring()]),
            ([mass(0.0, 1.5)], []),
        )[i % 5]


def elastic_gap(found: Modes, expected: Modes) -> float:
    """Return the largest relative difference of frequencies, those of rigid-body modes left out."""
    np.testing.assert_array_equal(found.rigid, expected.rigid)
    first = float(np.abs(expected.elastic.eigenvalues).min())
    still = np.abs(expected.eigenvalues) < 1e-6 * first
    np.testing.assert_allclose(found.eigenvalues[still], 0.0, atol=1e-6 * first)
    ratio = found.natural_frequencies[~still] / expected.natural_frequencies[~still]
    return float(np.abs(ratio - 1.0).max())


@pytest.mark.slow(5)
def test_forty_changes_are_those_of_full_solutions(small: Model) -> None:
    many = many_changes(small, COUNT)
    proven = 0
    for masses, springs in drawn(small, 40, seed=5):
        changed = small.attach(masses, springs)
        expected = solve_modes(changed, COUNT)
        found = many.proven(masses, springs, COUNT)
        proven += found is not None
        found = many.after(masses, springs, COUNT) if found is None else found
        assert elastic_gap(found, expected) < 1e-5
        gram = found.shapes.T @ changed.mass @ found.shapes
        np.testing.assert_allclose(gram, np.eye(COUNT), atol=1e-9)
    assert proven >= 38


def test_one_solution_and_one_factorisation_serve_all(
    block: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = {"solutions": 0, "factorisations": 0}

    def counted(name: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            made[name] += 1
            return function(*arguments)

        return call

    monkeypatch.setattr(module, "solve_modes", counted("solutions", solve_modes))
    monkeypatch.setattr(module, "ShiftedModel", counted("factorisations", module.ShiftedModel))
    changes = [change for i, change in enumerate(drawn(block, 20, seed=6)) if i % 5 < 2]
    found = modes_of_changes(block, changes, COUNT)
    assert len(found) == 8
    assert made == {"solutions": 1, "factorisations": 1}
    for change, modes in zip(changes, found, strict=True):
        assert elastic_gap(modes, solve_modes(block.attach(*change), COUNT)) < 1e-5


def test_too_few_modes_cost_further_steps_and_then_a_solution(block: Model) -> None:
    modes = solve_modes(block, 40)
    change = ([PointMass(Place(member="m7", s=0.4), 0.2 * block.total_mass)], [])
    expected = solve_modes(block.attach(*change), 9)
    tries = []
    for kept in (40, 12, 9):
        with count_evaluations() as counter:
            found = ManyChanges(block, modes.take(np.arange(kept))).after(*change, 9)
        tries.append(counter.count)
        assert elastic_gap(found, expected) < 1e-5
    assert tries[0] < tries[1]  # steps
    assert ManyChanges(block, modes.take(np.arange(9))).proven(*change, 9) is None


def test_no_frequency_is_given_that_is_less_certain_than_asked(small: Model) -> None:
    modes = solve_modes(small, 13)
    for closely in (1e-3, 1e-7):
        many = ManyChanges(small, modes, closely)
        for masses, springs in drawn(small, 20, seed=7):
            found = many.proven(masses, springs, 9)
            if found is not None:
                expected = solve_modes(small.attach(masses, springs), 9)
                assert elastic_gap(found, expected) < max(closely, 1e-8)


def test_models_that_an_update_has_changed(block: Model) -> None:
    modes = solve_modes(block, 10)
    basis = block.mass @ modes.shapes[:, 6:9]
    # The first elastic mode comes out with a negative eigenvalue, the next two are moved.
    core = np.diag([-1.2, 0.1, -0.2]) * modes.eigenvalues[6:9]
    stiffness = LowRank(basis, core)
    mass = LowRank(basis, np.diag([0.02, 0.0, 0.01]))
    updated = replace(block, stiffness_change=stiffness, mass_change=mass)
    many = many_changes(updated, COUNT)
    for masses, springs in drawn(block, 10, seed=8):
        expected = solve_modes(updated.attach(masses, springs), COUNT)
        found = many.after(masses, springs, COUNT)
        assert len(found) == len(expected)
        assert elastic_gap(found, expected) < 1e-5


def test_matrices_without_a_frame_and_a_frame_on_supports(block: Model) -> None:
    joint = Place(joint="J111")
    change = ([PointMass(joint, 1.0)], [GroundSpring(joint, "x", 1e5)])
    held = Model.of(lattice(2, 3, supports=(Support(Place(joint="J000"), ("x", "y", "z")),)))
    for model in (replace(block, structure=None), held):
        expected = solve_modes(model.attach(*change), COUNT)
        found = modes_of_changes(model, [change], COUNT)[0]
        assert elastic_gap(found, expected) < 1e-5
        likeness = np.einsum(
            "ij,ij->j", found.shapes, model.attach(*change).mass @ expected.shapes
        )[~expected.rigid]
        np.testing.assert_allclose(np.abs(likeness), 1.0, atol=1e-5)


def test_a_mass_between_nodes_of_a_frame_that_no_motion_leaves_free() -> None:
    held = Support(Place(joint="J000"), ("x", "y", "z", "rx", "ry", "rz"))
    model = Model.of(lattice(2, 3, supports=(held,)))
    member = model.frame_structure.frame.members[-1].name
    change = ([PointMass(Place(member=member, s=0.4), 1.0)], [])
    found = modes_of_changes(model, [change], COUNT)[0]
    assert elastic_gap(found, solve_modes(model.attach(*change), COUNT)) < 1e-5
