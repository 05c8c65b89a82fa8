"""Eigenpairs: signs, repeated roots, order, determinism."""

from __future__ import annotations

import gc
import pickle
import weakref
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from femubench import Model
from femubench.core.modal.eigen import (
    DENSE_LIMIT,
    count_evaluations,
    dense_matrices,
    modes_of,
    once_for,
    solve_dense,
    solve_modes,
)
from femubench.fem import FloatArray, Frame, Joint, LowRank, Material, Member, ModelError, Section
from femubench.update import with_stiffness_step

FrameBuilder = Callable[..., Frame]


def dense(model: Model) -> tuple[FloatArray, FloatArray]:
    return dense_matrices(model)


def test_negative_eigenvalues_keep_their_sign(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    modes = solve_modes(model)
    shapes = np.asarray(model.mass @ modes.shapes[:, 3:6])
    drop = np.diag([-1.5 * modes.eigenvalues[3], 3e5, -1.2 * modes.eigenvalues[5]])
    updated = solve_modes(replace(model, stiffness_change=LowRank(shapes, drop)))
    expected = modes.eigenvalues.copy()
    expected[3:6] += np.diag(drop)
    np.testing.assert_allclose(updated.eigenvalues, np.sort(expected), rtol=1e-7, atol=1e-3)
    assert (updated.natural_frequencies[:2] < 0.0).all()
    assert updated.natural_frequencies[0] == pytest.approx(
        -np.sqrt(0.5 * modes.eigenvalues[3]) / (2 * np.pi)
    ) or updated.natural_frequencies[1] == pytest.approx(
        -np.sqrt(0.5 * modes.eigenvalues[3]) / (2 * np.pi)
    )


@pytest.mark.parametrize("factor", [-1e-9, -1.0, -1.0 + 1e-12, -1e7])
def test_a_negative_eigenvalue_of_any_size_spoils_no_other(
    ladder: FrameBuilder, factor: float
) -> None:
    # Whatever shift the solver takes, an eigenvalue may lie right at minus the shift.
    model = Model.of(ladder())
    mass, stiffness = dense(model)
    values, shapes = solve_dense(mass, stiffness)
    scale = float(1e-6 * np.median(np.diagonal(stiffness) / np.diagonal(mass)))
    force = mass @ shapes[:, 5]
    change = (factor * scale - values[5]) * np.outer(force, force)
    found, _ = solve_dense(mass, stiffness + change)
    expected = np.sort(np.append(np.delete(values, 5), factor * scale))
    tolerance = 1e-7 * values[3]
    np.testing.assert_allclose(found[:12], expected[:12], rtol=1e-7, atol=tolerance)


def test_indefinite_mass_is_refused(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    shapes = np.asarray(model.mass @ solve_modes(model).shapes[:, 3:4])
    with pytest.raises(ModelError, match="mass matrix is not positive"):
        solve_modes(replace(model, mass_change=LowRank(shapes, np.array([[-2.0]]))))


def test_matrices_that_are_not_finite_are_refused(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    bad = model.stiffness.copy()
    bad.data[0] = np.nan
    with pytest.raises(ModelError, match="not finite"):
        solve_modes(replace(model, stiffness=bad))


def test_repeated_eigenvalues_give_orthonormal_shapes() -> None:
    section = Section.round_tube(0.02, 0.002)
    joints = (Joint("A", (0.0, 0.0, 0.0)), Joint("B", (0.3, 0.4, 0.5)))
    member = Member("m", ("A", "B"), 6, section, Material(70e9, 0.3, 2700.0))
    model = Model.of(Frame("3d", "euler-bernoulli", joints, (member,)))
    modes = solve_modes(model)
    assert modes.rigid.sum() == 6
    pairs = modes.eigenvalues[6:12].reshape(3, 2)
    np.testing.assert_allclose(pairs[:, 0], pairs[:, 1], rtol=1e-9)
    gram = modes.shapes.T @ model.mass.toarray() @ modes.shapes
    np.testing.assert_allclose(gram, np.eye(len(modes)), atol=1e-8)


def test_low_eigenvalues_keep_their_digits_where_most_dofs_hardly_have_mass() -> None:
    """Floors on columns almost without mass, whose own eigenvalues are 1e13 times higher."""
    springs = 1e5 * np.array([1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0])
    stiffness = np.diag(springs[:-1] + springs[1:])
    stiffness -= np.diag(springs[1:-1], 1) + np.diag(springs[1:-1], -1)
    mass = np.diag([1e-12, 5.0, 1e-12, 4.0, 1e-12, 3.0, 1e-12])
    expected = 1.0 / eigh(mass, stiffness, eigvals_only=True)[::-1]
    np.testing.assert_allclose(solve_dense(mass, stiffness)[0][:3], expected[:3], rtol=1e-12)


def test_what_is_known_of_a_large_model_is_not_solved_again(ladder: FrameBuilder) -> None:
    frame = ladder(elements=60)
    model = Model.of(frame)
    assert model.size > DENSE_LIMIT
    direct = solve_modes(model, 12)
    shape = np.asarray(model.mass @ direct.elastic.shapes[:, :1])
    unstable = LowRank(shape, np.array([[-2.0 * direct.elastic.eigenvalues[0]]]))
    with count_evaluations() as made:
        for count in (12, 8, 12, 15, 10):
            assert len(modes_of(model, count)) == len(solve_modes(model, count)) == count
    assert made.count == 2
    np.testing.assert_allclose(
        modes_of(model, 12).elastic.eigenvalues, direct.elastic.eigenvalues, rtol=1e-9
    )
    # What a change does to known modes is known, and of a negative eigenvalue there is one more.
    changed = with_stiffness_step(model, modes_of(model, 15), unstable)
    with count_evaluations() as made:
        for look in (solve_modes, modes_of):
            found = look(changed, 9)
            assert len(found) == 10
            assert found.eigenvalues[0] == pytest.approx(-direct.elastic.eigenvalues[0])
    assert made.count == 0
    with count_evaluations() as made:
        assert len(modes_of(changed, 15)) == len(modes_of(changed, 14)) + 1 == 16
    assert made.count == 1


def test_what_is_made_of_a_model_ends_with_it_and_does_not_travel(ladder: FrameBuilder) -> None:
    def use() -> weakref.ref[Model]:
        model = Model.of(ladder())
        assert once_for(model, "itself", lambda: model) is model
        copy = pickle.loads(pickle.dumps(model))
        assert once_for(copy, "itself", lambda: copy) is copy
        return weakref.ref(model)

    held = use()
    gc.collect()
    assert held() is None
