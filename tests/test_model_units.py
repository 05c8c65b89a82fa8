"""Models in millimetres and inches: the same structure, the same frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import femubench
from femubench import Model
from femubench.core.case.schema import LengthUnit
from femubench.core.case.units import from_si, in_si
from femubench.fem import GroundSpring, JointSpring, Oscillator, Place, PointMass, matrix_model

KILO = 1e3  # kg in a tonne


def laden_frame() -> Model:
    """Return a frame with what has units of its own: masses on arms, springs, oscillators."""
    frame = femubench.cases["frame"].model.frame_structure.frame
    member, place = frame.members[0], Place(joint=frame.joints[1].name)
    return Model.of(
        replace(
            frame,
            masses=(PointMass(place, 0.3, (0.1, 0.2, 0.0)),),
            springs=(GroundSpring(place, "z", 3e4), GroundSpring(place, "rx", 2e3)),
            joint_springs=(JointSpring(member.ends[0], member.name, {"ry": 5e3}, arm=0.01),),
            oscillators=(Oscillator(place, "z", 0.1, 40.0),),
        )
    )


@pytest.mark.parametrize("unit", ["cm", "mm", "in", "ft"])
def test_elements_and_matrices_are_converted_alike(unit: LengthUnit) -> None:
    model = laden_frame()
    names = [str(node) for node in model.dofs.node]
    bare = matrix_model(
        model.mass, model.stiffness, names, model.dofs.direction, xyz=model.dofs.xyz
    )
    elements, matrices = from_si(model, unit), from_si(bare, unit)
    for role in ("mass", "stiffness"):
        one, other = getattr(elements, role), getattr(matrices, role)
        assert abs(one - other).max() < 1e-10 * abs(other).max()
        for back, first in ((in_si(elements, unit), model), (in_si(matrices, unit), bare)):
            apart = abs(getattr(back, role) - getattr(first, role)).max()
            assert apart < 1e-12 * abs(getattr(first, role)).max()
    np.testing.assert_allclose(elements.dofs.xyz, matrices.dofs.xyz, rtol=1e-12)


def test_millimetres_are_those_of_tonnes_and_megapascals() -> None:
    model = laden_frame()
    frame = from_si(model, "mm").frame_structure.frame
    origin = model.frame_structure.frame
    steel, before = frame.members[0].material, origin.members[0].material
    assert pytest.approx(before.E / 1e6) == steel.E
    assert steel.rho == pytest.approx(before.rho / KILO / 1e9)
    assert frame.springs[0].stiffness == pytest.approx(30.0)  # N/mm
    assert frame.springs[1].stiffness == pytest.approx(2e6)  # N mm
    assert frame.masses[0].mass == pytest.approx(3e-4)


def test_a_spring_of_one_pound_an_inch() -> None:
    mass, stiffness = np.array([[2.0]]), np.array([[3.0]])
    model = in_si(matrix_model(mass, stiffness, ["1"], ["x"], np.zeros((1, 3))), "in")
    assert model.stiffness[0, 0] == pytest.approx(3.0 * 175.126835, rel=1e-7)  # N/m in lbf/in
    assert model.mass[0, 0] == pytest.approx(2.0 * 175.126835, rel=1e-7)  # kg in lbf s2/in
