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


def test_what_an_update_changed_in_the_matrices_stays() -> None:
    model = laden_frame()
    updated = replace(model, stiffness=1.1 * model.stiffness, mass=0.9 * model.mass)
    back = in_si(from_si(updated, "mm"), "mm")
    for role in ("mass", "stiffness"):
        one, other = getattr(back, role), getattr(updated, role)
        assert abs(one - other).max() < 1e-12 * abs(other).max()


def test_a_spring_of_one_pound_an_inch() -> None:
    mass, stiffness = np.array([[2.0]]), np.array([[3.0]])
    model = in_si(matrix_model(mass, stiffness, ["1"], ["x"], np.zeros((1, 3))), "in")
    assert model.stiffness[0, 0] == pytest.approx(3.0 * 175.126835, rel=1e-7)  # N/m in lbf/in
    assert model.mass[0, 0] == pytest.approx(2.0 * 175.126835, rel=1e-7)  # kg in lbf s2/in
