"""Sensitivities of eigenvalues and mode shapes against differences of solved models."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femubench import Model, Modes, solve_modes
from femubench.core.fem.derivatives import derivatives, list_touched
from femubench.core.fem.frame import (
    Frame,
    Joint,
    JointSpring,
    Material,
    Member,
    Place,
    RigidEnd,
    Support,
)
from femubench.core.fem.parameters import QUANTITIES, Property
from femubench.core.modal.sensitivity import (
    eigenvalue_sensitivities,
    shape_sensitivities,
)
from femubench.fem import Section, Structure

STEP = 1e-5
ELASTIC = 4


def spring_frame(hframe: Any) -> Frame:
    """Massless stiff arms, so that dofs without mass are there, and two attached masses."""
    springs = tuple(
        JointSpring(joint, "horizontal", {"x": 3.3e9, "z": 4.5e9, "ry": 3e5}, 0.02, 5.0)
        for joint in ("T1", "T2")
    )
    return hframe(mesh=(4, 2, 4), joint_springs=springs)


def rigid_frame(hframe: Any) -> Frame:
    ends = (("T1", "horizontal", 0.02), ("T2", "horizontal", -0.028), ("T1", "lower1", 0.004))
    rigid = tuple(RigidEnd(joint, member, a, max(a, 0.0) / 2) for joint, member, a in ends)
    return hframe(mesh=(4, 2, 4), rigid_ends=rigid)


def supported(ladder: Any) -> Frame:
    support = Support(Place(joint="A"), ("z", "rx", "ry"))
    return replace(ladder("timoshenko", polar=False, elements=2), supports=(support,))


@pytest.fixture(params=["spring", "rigid", "supported", "cubic-mass", "3d"])
def structure(request: pytest.FixtureRequest, hframe: Any, ladder: Any, portal: Any) -> Structure:
    timoshenko = ladder("timoshenko", polar=False, elements=2)
    frames = {
        "spring": lambda: spring_frame(hframe),
        "rigid": lambda: rigid_frame(hframe),
        "supported": lambda: supported(ladder),
        "cubic-mass": lambda: replace(timoshenko, bending_mass="cubic"),
        "3d": lambda: portal(3, elements=1),
    }
    return Structure.build(frames[request.param]())


def all_parameters(structure: Structure) -> list[Property]:
    """Return one parameter of every quantity, on a part of the frame that breaks its symmetry."""
    labels = [label for label in structure.labels if label]
    some = tuple(dict.fromkeys(labels[: 2 * len(labels) // 3]))
    chosen = [
        Property(f"{quantity} here", quantity, some)
        for quantity in QUANTITIES
        if quantity not in ("rigid", "spring")
    ]
    chosen.append(Property("E everywhere", "E", tuple(dict.fromkeys(labels))))
    ends = tuple(structure.element_ends)[:2]
    chosen.append(Property("rigid end", "rigid", ends, "m"))
    chosen += [Property(place, "spring", (place,), "N/m") for place in structure.spring_labels]
    return chosen


def present_value(structure: Structure, parameter: Property) -> float:
    """Return a parameter's value: 1 for a factor, else the mean rigid length or stiffness."""
    if parameter.is_factor:
        return 1.0
    values = [
        structure.springs[part.rows]
        if part.kind == "spring"
        else getattr(structure.properties, part.kind)[part.rows]
        for part in list_touched(structure, [parameter])
    ]
    return float(np.concatenate(values).mean())


def moved(structure: Structure, parameter: Property, sign: float) -> tuple[Structure, float]:
    """Return the structure with the parameter a little off, and by how much."""
    value = present_value(structure, parameter)
    step = STEP * (0.05 if parameter.quantity == "rigid" else abs(value))
    # a parameter sets every place to one value: the springs and lengths here are alike
    return structure.with_values([parameter], [value + sign * step]), step


def prepared(structure: Structure) -> tuple[Structure, list[Property]]:
    """Return a structure that was updated before, with its rigid lengths alike at the places."""
    parameters = all_parameters(structure)
    rigid = next(p for p in parameters if p.quantity == "rigid")
    factor = next(p for p in parameters if p.quantity == "EI")
    return structure.with_values([rigid, factor], [0.004, 0.8]), parameters


def aligned(modes: Modes, reference: Modes) -> Modes:
    """Return modes with the signs of the reference, whose order they must keep."""
    sign = np.sign(np.einsum("ij,ij->j", modes.shapes, reference.shapes))
    return Modes(modes.eigenvalues, modes.shapes * sign, modes.rigid)


def lowest_elastic(model: Model) -> Modes:
    return solve_modes(model).elastic.take(np.arange(ELASTIC))


def test_eigenvalues_and_shapes_agree_with_central_differences(structure: Structure) -> None:
    structure, parameters = prepared(structure)
    model = Model.of(structure)
    every = solve_modes(model)
    modes = lowest_elastic(model)
    slope = eigenvalue_sensitivities(model, modes, parameters)
    turn = [shape_sensitivities(model, modes, j, parameters) for j in range(ELASTIC)]
    first = int(np.flatnonzero(~every.rigid)[0])
    summed = [shape_sensitivities(model, every, first + j, parameters) for j in range(ELASTIC)]
    for p, parameter in enumerate(parameters):
        up, step = moved(structure, parameter, 1.0)
        down, _ = moved(structure, parameter, -1.0)
        plus, minus = (aligned(lowest_elastic(Model.of(s)), modes) for s in (up, down))
        value = max(abs(present_value(structure, parameter)), step / STEP)
        expected = (plus.eigenvalues - minus.eigenvalues) / (2.0 * step)
        gap = np.abs(slope[:, p] - expected) * value
        assert (gap < 1e-6 * modes.eigenvalues).all()
        shape_change = (plus.shapes - minus.shapes) / (2.0 * step) * value
        size = np.abs(modes.shapes).max(axis=0)
        for j in range(ELASTIC):
            for computed in (turn[j], summed[j]):
                gap = np.abs(computed[:, p] * value - shape_change[:, j]).max() / size[j]
                assert gap < 1e-6 * max(1.0, np.abs(shape_change[:, j]).max() / size[j])


def test_element_derivatives_are_those_of_the_assembled_matrices(structure: Structure) -> None:
    structure, parameters = prepared(structure)
    change = derivatives(structure, parameters)
    rng = np.random.default_rng(1)
    left, right = rng.normal(size=(2, structure.gather.shape[1], 3))
    stiffness, mass = change.quadratic(left, right)
    products = np.array([change.products(right[:, j], 7.0) for j in range(3)])
    for p, parameter in enumerate(parameters):
        (up, step), (down, _) = (moved(structure, parameter, sign) for sign in (1.0, -1.0))
        for computed, index in ((mass, 0), (stiffness, 1)):
            matrix = (up.matrices()[index] - down.matrices()[index]) / (2.0 * step)
            size = abs(structure.matrices()[index]).max() / max(step / STEP, 1e-300)
            expected = np.einsum("ij,ij->j", left, matrix @ right)
            assert np.abs(computed[:, p] - expected).max() < 1e-8 * size * len(left)
        expected_force = np.array(
            [
                (up.matrices()[1] - down.matrices()[1]) @ right[:, j]
                - 7.0 * ((up.matrices()[0] - down.matrices()[0]) @ right[:, j])
                for j in range(3)
            ]
        ) / (2.0 * step)
        size = abs(structure.matrices()[1]).max() / max(step / STEP, 1e-300)
        assert np.abs(products[:, :, p] - expected_force).max() < 1e-8 * size * 10


def test_a_factor_on_all_stiffness_moves_every_eigenvalue_alike(portal: Any) -> None:
    structure = Structure.build(portal(5))
    model = Model.of(structure)
    modes = solve_modes(model).elastic.take(np.arange(8))
    labels = tuple(label for label in structure.labels if label)
    stiffness, density = Property("E", "E", labels), Property("rho", "density", labels)
    slope = eigenvalue_sensitivities(model, modes, [stiffness, density])
    np.testing.assert_allclose(slope[:, 0], modes.eigenvalues, rtol=1e-9)
    np.testing.assert_allclose(slope[:, 1], -modes.eigenvalues, rtol=1e-9)
    doubled = Model.of(structure.with_values([stiffness], [2.0]))
    np.testing.assert_allclose(
        solve_modes(doubled).elastic.eigenvalues[:8], 2.0 * modes.eigenvalues, rtol=1e-9
    )


def test_a_repeated_eigenvalue_leaves_out_what_turns_inside_its_space() -> None:
    tube = Section.rectangular_tube(0.04, 0.04, 0.002)
    steel = Material(207e9, 0.3, 7850.0)
    joints = (Joint("foot", (0.0, 0.0, 0.0)), Joint("top", (1.0, 0.0, 0.0)))
    clamp = Support(Place(joint="foot"), ("x", "y", "z", "rx", "ry", "rz"))
    member = Member("post", ("foot", "top"), 3, tube, steel)
    frame = Frame("3d", "euler-bernoulli", joints, (member,), supports=(clamp,))
    structure = Structure.build(frame)
    model = Model.of(structure)
    modes = solve_modes(model)
    np.testing.assert_allclose(modes.eigenvalues[0], modes.eigenvalues[1], rtol=1e-9)
    parameter = Property("EI below", "EI", ("post/1",))
    summed = shape_sensitivities(model, modes, 0, [parameter])
    bordered = shape_sensitivities(model, modes.take(np.arange(4)), 0, [parameter])
    size = np.abs(modes.shapes[:, 0]).max()
    np.testing.assert_allclose(bordered, summed, atol=1e-8 * size)
    assert np.abs(summed).max() > 1e-2 * size
    # what is left of the derivative has no part in the space of the two modes
    inside = modes.shapes[:, :2].T @ model.mass_times(summed)
    np.testing.assert_allclose(inside, 0.0, atol=1e-9)
