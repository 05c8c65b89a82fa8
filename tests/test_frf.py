"""Receptances against the inverse of the dynamic stiffness, and in their limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femubench import Model, Modes, Sensors, solve_modes
from femubench.core.fem.slopes import TermSlopes
from femubench.core.modal import receptances
from femubench.core.modal.receptances import receptance_slopes, response_modes
from femubench.core.typing import AnyArray, FloatArray, SparseArray
from femubench.effect import Change, ModelPlaces, Parameter
from femubench.fem import Frame, ModelError, Place, Support
from femubench.modal import receptance
from femubench.update import ParametricModel

FrameBuilder = Callable[..., Frame]
POINTS = Sensors(
    ("B", "E", "mid", "F"),
    np.array(
        [[0.2921, 0.0, 0.0], [0.2921, 0.2794, 0.0], [0.2921, 0.12, 0.0], [0.5842, 0.2794, 0.0]]
    ),
    ("z", "-z", "rx", "ry"),
)
FREQUENCIES = np.array([20.0, 150.0, 255.0, 400.0, 580.0, 1000.0, 3000.0])


@pytest.mark.parametrize(("held", "damping"), [(True, 0.0), (False, "each")])
def test_receptance_is_the_inverse_dynamic_stiffness(
    ladder: FrameBuilder, held: bool, damping: float | str
) -> None:
    frame = ladder("timoshenko", polar=False)
    if held:
        frame = replace(frame, supports=(Support(Place(joint="A"), ("z", "rx", "ry")),))
    model = Model.of(frame)
    modes = solve_modes(model)
    ratio = np.linspace(0.002, 0.05, len(modes)) if damping == "each" else damping
    mass, stiffness = model.mass.toarray(), model.stiffness.toarray()
    omega_r = np.sqrt(np.maximum(modes.eigenvalues, 0.0))
    weighted = mass @ modes.shapes
    viscous = weighted @ np.diag(2.0 * ratio * omega_r * np.ones(len(modes))) @ weighted.T
    rows = model.observe(POINTS)
    found = receptance(modes, rows, rows[:2], FREQUENCIES, ratio)
    assert found.shape == (7, 4, 2)
    for f, frequency in enumerate(FREQUENCIES):
        w = 2 * np.pi * frequency
        dynamic = stiffness - w**2 * mass + 1j * w * viscous
        expected = rows @ np.linalg.solve(dynamic, rows[:2].toarray().T)
        np.testing.assert_allclose(
            found[f], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max()
        )


def test_a_free_structure_tends_to_a_rigid_body(ladder: FrameBuilder) -> None:
    model = Model.of(ladder(accelerometer=False))
    modes = solve_modes(model)
    mass = float(np.sum(np.square(modes.shapes[:, :3].T @ model.mass @ up(model))))
    w = 2 * np.pi * 0.05
    corners = Sensors(
        tuple("ACDF"), np.array([j.xyz for j in model.frame_structure.frame.joints])[[0, 2, 3, 5]],
        ("z",) * 4,
    )  # fmt: skip
    # Equal forces at the four corners of a symmetric frame act at its centre of mass.
    rows = model.observe(corners)
    found = receptance(modes, rows, rows, np.array([0.05]), 0.01)[0].sum(axis=1) / 4
    np.testing.assert_allclose(found, -1.0 / (w**2 * mass), rtol=1e-5)
    length = 4 * 0.2921 + 3 * 0.2794
    assert mass == pytest.approx(219.15e-6 * 2700.0 * length, rel=1e-4)


def up(model: Model) -> np.ndarray:  # type: ignore[type-arg]
    return np.array([float(d == "z") for d in model.dofs.direction])


def test_zero_frequency_of_a_free_structure_is_refused(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    rows = model.observe(POINTS)
    with pytest.raises(ModelError, match="infinite"):
        receptance(solve_modes(model), rows, rows, np.array([0.0]))


def test_missing_damping_counts_as_none(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    modes, rows = solve_modes(model), model.observe(POINTS)
    some = np.full(len(modes), np.nan)
    found = receptance(modes, rows, rows, FREQUENCIES, some)
    np.testing.assert_array_equal(found, receptance(modes, rows, rows, FREQUENCIES))


@pytest.fixture
def changing(ladder: FrameBuilder) -> ParametricModel:
    """Give a held frame with factors on stiffness, mass and shear, and a mass at one joint."""
    support = (Support(Place(joint="A"), ("z", "rx", "ry")),)
    model = Model.of(replace(ladder("timoshenko", polar=False), supports=support))
    structure = model.frame_structure
    every = structure.elements
    mass = Change.proportional(ModelPlaces(model).mass_term([Place(joint="F")]))
    mass = replace(mass, name="m", parameters=(MASS,))
    factors = [Change.scale_property(q, q, every[:9]) for q in ("E", "density", "shear", "GJ")]
    return ParametricModel(model, (*factors, mass))


MASS = Parameter("mass", "kg", 0.1, 0.0, 0.0, 1.0)


def damped_solve(
    model: Model, rows: SparseArray, ratio: FloatArray, w: float
) -> tuple[AnyArray, AnyArray]:
    """Return displacements and receptances under forces at all rows, by a dense solution."""
    modes = solve_modes(model)
    weighted = model.mass.toarray() @ modes.shapes
    viscous = (weighted * (2.0 * ratio * np.sqrt(modes.eigenvalues))) @ weighted.T
    dynamic = (model.stiffness - w**2 * model.mass).toarray() + 1j * w * viscous
    moved = np.linalg.solve(dynamic, rows.toarray().T)
    return moved, rows @ moved


def test_slopes_of_receptances_are_those_of_direct_solutions(changing: ParametricModel) -> None:
    """Against differences of dense solutions of the damped model, every mode with its own ratio."""
    model, x = changing.model, np.array([0.1, -0.05, 0.2, 0.0, 0.3])
    at = changing.at(x)
    rows, modes = model.observe(POINTS), solve_modes(at)
    ratio = np.linspace(0.002, 0.05, len(modes))
    found = receptance_slopes(
        modes, rows, rows[:2], FREQUENCIES, changing.slopes(x, at), ratio
    ) * changing.steps(x)
    for p, step in enumerate(1e-5 * np.eye(len(x))):
        up, down = (changing.at(x + sign * step) for sign in (1.0, -1.0))
        for f, hertz in enumerate(FREQUENCIES):
            first, last = (damped_solve(m, rows, ratio, 2 * np.pi * hertz)[1] for m in (up, down))
            expected = (first - last)[:, :2] / 2e-5
            scale = np.abs(expected).max() + 1e-9 * np.abs(first).max()
            np.testing.assert_allclose(found[f, ..., p], expected, rtol=0.0, atol=2e-5 * scale)


def test_slopes_of_modes_that_share_a_frequency() -> None:
    """Two equal oscillators: their sum of motions does not depend on how their modes are turned."""
    stiffness = sp.diags_array(np.array([4e6, 4e6, 9e6])).tocsc()
    part = sp.csc_array(np.array([[1e5, 2e4, 0.0], [2e4, 3e5, 1e4], [0.0, 1e4, 2e5]]))
    slopes = TermSlopes((("stiffness", lambda v: part @ v),), np.ones((1, 1)))
    rows, hz = sp.csr_array(np.eye(3)), np.array([200.0, 317.0, 318.4, 480.0])
    modes = Modes(np.array([4e6, 4e6, 9e6]), np.eye(3), np.zeros(3, dtype=bool))
    found = receptance_slopes(modes, rows, rows, hz, slopes, 0.01)[..., 0]
    step = 1e-6

    def solved(sign: float) -> AnyArray:
        k, turn = np.linalg.eigh(stiffness.toarray() + sign * step * part.toarray())
        own = Modes(k, turn, modes.rigid)
        return receptance(own, rows, rows, hz, 0.01)

    expected = (solved(1.0) - solved(-1.0)) / (2.0 * step)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2e-6 * np.abs(expected).max())


def test_modes_in_a_band_and_what_responds_statically(
    changing: ParametricModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a model too large for all modes: receptances and slopes in the band as of all of them."""
    model, rows = changing.model, changing.model.observe(POINTS)
    low = FREQUENCIES[FREQUENCIES < 450.0]
    every = receptance(solve_modes(model), rows, rows, low, 0.01)
    exact = receptance_slopes(solve_modes(model), rows, rows, low, changing.start_slopes, 0.01)
    monkeypatch.setattr(receptances, "_FEW", 10)
    monkeypatch.setattr(receptances, "modes_up_to", lambda m, hz: modes_below(m, hz))
    few = response_modes(model, rows, 450.0)
    assert len(few) < 20
    plain = receptance(modes_below(model, 675.0), rows, rows, low, 0.01)
    found = receptance(few, rows, rows, low, 0.01)
    scale = np.abs(every).max(axis=0)
    assert np.abs(plain - every).max(axis=0).max() > 0.0
    assert (np.abs(found - every) / scale).max() < 0.01 * (np.abs(plain - every) / scale).max()
    slopes = receptance_slopes(few, rows, rows, low, changing.start_slopes, 0.01)
    np.testing.assert_allclose(slopes, exact, rtol=0.0, atol=5e-3 * np.abs(exact).max())


def modes_below(model: Model, hertz: float) -> Modes:
    modes = solve_modes(model)
    return modes.take(np.flatnonzero(modes.natural_frequencies < hertz))
