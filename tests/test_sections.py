"""Section constants against published figures, closed forms and an independent integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femubench.core.fem.sections import SHAPES, Section, saint_venant_rectangle


def test_tube_of_the_first_paper() -> None:
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    assert pytest.approx(219.15e-6, rel=1e-5) == tube.A
    assert tube.Iy == pytest.approx(19562e-12, rel=3e-5)
    assert tube.Jp == pytest.approx(39125e-12, rel=3e-5)
    assert pytest.approx(29033e-12, rel=3e-5) == tube.J


def test_tube_of_the_second_paper() -> None:
    tube = Section.rectangular_tube(0.040, 0.040, 0.0025)
    assert tube.kappa is not None
    assert tube.kappa(0.3)[1] == pytest.approx(0.4355, abs=5e-5)


def integrate(width: float, height: float, wall: float) -> tuple[float, float, float]:
    """Return A, Iy and Iz of a tube by the midpoint rule on a grid that the walls fit."""
    n = 400
    y = (np.arange(n) + 0.5) / n * width - width / 2
    z = (np.arange(n) + 0.5) / n * height - height / 2
    Y, Z = np.meshgrid(y, z, indexing="ij")
    inside = (np.abs(Y) < width / 2 - wall) & (np.abs(Z) < height / 2 - wall)
    cell = np.where(inside, 0.0, width * height / n**2)
    return float(cell.sum()), float((cell * Z**2).sum()), float((cell * Y**2).sum())


def test_rectangular_tube_by_integration_with_the_axes_the_right_way_round() -> None:
    tube = Section.rectangular_tube(0.04, 0.08, 0.004)
    area, iy, iz = integrate(0.04, 0.08, 0.004)
    assert iy > 2 * iz
    np.testing.assert_allclose([tube.A, tube.Iy, tube.Iz], [area, iy, iz], rtol=1e-4)
    assert tube.Jp == tube.Iy + tube.Iz


@pytest.mark.parametrize(("ratio", "beta"), [(1.0, 0.1406), (2.0, 0.2287), (10.0, 0.3123)])
def test_torsion_of_a_solid_rectangle(ratio: float, beta: float) -> None:
    # Timoshenko & Goodier, art. 109, table: J = beta * long * short^3.
    for a, b in ((ratio, 1.0), (1.0, ratio)):
        assert saint_venant_rectangle(a, b) == pytest.approx(beta * ratio, rel=5e-4)


@pytest.mark.parametrize("thickness", [1e-4, np.finfo(float).tiny])
def test_torsion_of_a_foil_is_a_third_of_width_times_thickness_cubed(thickness: float) -> None:
    assert saint_venant_rectangle(100.0, thickness) == pytest.approx(
        100.0 * thickness**3 / 3.0, rel=1e-5
    )


def test_round_sections() -> None:
    solid, tube = Section.round_tube(0.02, 0.01), Section.round_tube(0.05, 0.002)
    np.testing.assert_allclose([solid.A, solid.Iy], [np.pi * 1e-4, np.pi * 1e-8 / 4], rtol=1e-12)
    assert tube.Iy == pytest.approx(np.pi / 64 * (0.05**4 - 0.046**4), rel=1e-12)
    assert tube.J == tube.Jp == pytest.approx(2 * tube.Iy)


@pytest.mark.parametrize("wall", [0.0001, 0.0199])
def test_the_wall_follows_from_the_area(wall: float) -> None:
    assert Section.rectangular_tube(0.04, 0.08, wall).wall == pytest.approx(wall, rel=1e-9)
    assert Section.round_tube(0.04, wall).wall == pytest.approx(wall, rel=1e-9)
    assert Section.solid_rectangle(0.04, 0.08).wall == 0.0
    assert replace(Section.rectangular_tube(0.04, 0.08, wall), shape="").wall == 0.0


@pytest.mark.parametrize("nu", [0.0, 0.33])
def test_cowpers_coefficients(nu: float) -> None:
    # Cowper 1966, table 1: closed forms of the special sections.
    square = SHAPES["square-tube"][0](0.04, 0.002).kappa
    disc = SHAPES["solid-circle"][0](0.03).kappa
    thin_circle = Section.round_tube(1.0, 1e-9).kappa
    block = Section.solid_rectangle(0.02, 0.05).kappa
    expected = {
        square: 20 * (1 + nu) / (48 + 39 * nu),
        disc: 6 * (1 + nu) / (7 + 6 * nu),
        thin_circle: 2 * (1 + nu) / (4 + 3 * nu),
        block: 10 * (1 + nu) / (12 + 11 * nu),
    }
    for kappa, value in expected.items():
        np.testing.assert_allclose(kappa(nu), [value, value], rtol=1e-8)
