"""The promise that a model has given modes, as closely as its own rounding lets it be stated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from femubench import Measurement, Model, Sensors, UpdateResult, strategies
from femubench.core.conformance.problems import UpdatingProblem
from femubench.core.conformance.results import Given, find_missing_mode
from femubench.core.modal.eigen import Modes, solve_dense, solve_modes
from femubench.core.update.promise import check_used_modes, eigenvalue_rounding
from femubench.fem import Frame, Joint, Material, Member, Place, PointMass, Section
from femubench.update import SelfCheckFailed, with_measured_frequencies

EPS = np.finfo(float).eps


def aeroplane(stiffer: float) -> Model:
    """Return a thin wing on a stout fuselage, joined by a short beam so many times too stiff."""
    joints = (
        Joint("nose", (0.6, 0.0, 0.0)),
        Joint("body", (0.0, 0.0, 0.0)),
        Joint("end", (-0.9, 0.0, 0.0)),
        Joint("root", (0.0, 0.0, 0.1)),
        Joint("left", (0.0, 1.0, 0.1)),
        Joint("right", (0.0, -1.0, 0.1)),
    )
    metal, light = Material(72e9, 0.3, 2700.0), Material(2e11 * stiffer, 0.3, 1.0)
    rod, spar = Section.solid_rectangle(0.05, 0.15), Section.solid_rectangle(0.1, 0.01)
    short = Section(0.01, 1e-5, 1e-5, 2e-5, 2e-5)
    members = (
        Member("front", ("body", "nose"), 2, rod, metal),
        Member("rear", ("body", "end"), 2, rod, metal),
        Member("port", ("root", "left"), 4, spar, metal),
        Member("starboard", ("root", "right"), 4, spar, metal),
        Member("link", ("body", "root"), 1, short, light),
    )
    masses = tuple(PointMass(Place(joint=name), 0.5) for name in ("left", "right"))
    return Model.of(Frame("3d", "euler-bernoulli", joints, members, masses=masses))


def elastic(model: Model, count: int = 5) -> Modes:
    return solve_modes(model).elastic.take(np.arange(count))


def data(model: Model, factor: float = 1.01) -> Measurement:
    """Return modes of a model as if measured at the joints, frequencies a percent higher."""
    modes, frame = elastic(model), model.frame_structure.frame
    places = np.repeat(frame.corners, 3, axis=0)
    labels = tuple(f"s{k}" for k in range(len(places)))
    sensors = Sensors(labels, places, ("x", "y", "z") * len(frame.joints))
    shapes = np.asarray(model.observe(sensors) @ modes.shapes)
    shapes = shapes / np.abs(shapes).max(axis=0)
    hertz = factor * modes.natural_frequencies
    none, noise = np.full(len(hertz), np.nan), np.full(shapes.shape, 0.01)
    numbers = tuple(range(1, len(hertz) + 1))
    return Measurement(sensors, numbers, hertz, 0.002 * hertz, none, shapes, noise)


@pytest.mark.parametrize("stiffer", [1.0, 1e4])
def test_entries_off_by_rounding_move_the_eigenvalues_within_the_bound(stiffer: float) -> None:
    model, rng = aeroplane(stiffer), np.random.default_rng(1)
    modes = elastic(model)
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    bound = eigenvalue_rounding(model, modes.shapes, modes.eigenvalues) / 4.0
    moved = []
    for _ in range(20):
        off = np.tril(1.0 + EPS * rng.choice([-1.0, 1.0], stiffness.shape))
        off = off + np.tril(off, -1).T
        other = solve_dense(mass, stiffness * off)[0][6 : 6 + len(modes)]
        moved.append(np.abs(other / modes.eigenvalues - 1.0) / bound)
    worst = np.max(moved, axis=0)
    assert worst.max() < 2.0  # what the entries make, and the solution as much again
    assert worst.max() > 0.1


@pytest.mark.parametrize("name", ["berman", "secant", "baruch"])
def test_matrix_methods_work_next_to_stiff_parts(name: str) -> None:
    model = aeroplane(1e3)
    measurement = data(model)
    result = strategies[name]().update(model, measurement, np.random.default_rng(0))
    assert (
        find_missing_mode(Given(UpdatingProblem("", model, measurement), result, frozenset()))
        is None
    )


@pytest.mark.parametrize("stiffer", [1.0, 1e3])
def test_a_broken_promise_is_said_all_the_same(stiffer: float) -> None:
    model = aeroplane(stiffer)
    modes = elastic(model)
    known = eigenvalue_rounding(model, modes.shapes, modes.eigenvalues)
    assert known.max() < 1e-4
    check_used_modes(model, modes.shapes, modes.eigenvalues)
    off = modes.eigenvalues * (1.0 + 1e-4 * (np.arange(len(modes)) == 0))
    with pytest.raises(SelfCheckFailed, match="comes out at") as caught:
        check_used_modes(model, modes.shapes, off)
    assert caught.value.measured == pytest.approx(1e-4, rel=0.2)
    assert caught.value.allowed < 1e-4
    measurement = data(model)
    met = with_measured_frequencies(model, data(model, 1.01 * (1.0 + 1e-4)))
    result = UpdateResult(met, parameter_count=1)
    fault = find_missing_mode(Given(UpdatingProblem("", model, measurement), result, frozenset()))
    assert fault is not None
    assert "expected" in fault


def test_without_stiff_parts_nothing_more_is_allowed(ladder: Any) -> None:
    model = Model.of(ladder())
    modes = solve_modes(model).elastic.take(np.arange(3))
    assert eigenvalue_rounding(model, modes.shapes, modes.eigenvalues).max() < 1e-10
    off = replace(modes, eigenvalues=modes.eigenvalues * (1.0 + 3e-8))
    with pytest.raises(SelfCheckFailed) as caught:
        check_used_modes(model, off.shapes, off.eigenvalues)
    assert caught.value.allowed == 1e-8


def test_a_model_spoilt_by_enormous_stiffness_is_excused_nothing() -> None:
    model = aeroplane(1.0)
    modes, rng = elastic(model), np.random.default_rng(0)
    basis = np.linalg.qr(modes.shapes)[0]
    across = rng.standard_normal(model.size)
    across -= basis @ (basis.T @ across)
    across *= np.sqrt(1e12 * abs(model.stiffness).max()) / np.linalg.norm(across)
    added = sp.csr_array(np.outer(across, across))
    spoilt = replace(model, structure=None, stiffness=sp.csr_array(model.stiffness + added))
    with pytest.raises(SelfCheckFailed, match="comes out at"):
        check_used_modes(spoilt, modes.shapes, 1.5 * modes.eigenvalues)
