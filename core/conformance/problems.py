"""Small structures with a simulated test, each with one feature that methods stumble over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.fem.frame import (
    ACTIVE,
    Frame,
    Joint,
    JointSpring,
    Material,
    Member,
    Place,
    Plane,
    PointMass,
    Support,
)
from femubench.core.fem.model import Model
from femubench.core.fem.sections import rectangular_tube
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement

NOMINAL_E, TRUE_E = 72.0e9, 69.0e9  # Pa
ELEMENTS, FINER = 2, 6  # of a member; the truth has three times as many
USED = 4  # modes
_FREQUENCY_STD, _SHAPE_STD = 0.002, 0.01
_JOINTS = {"A": (0.0, 0.0), "B": (0.5, 0.0), "C": (0.9, 0.0), "D": (0.45, 0.37), "F": (0.0, 0.3)}
_MEMBERS = ("AB", "BC", "BD", "AF", "FD")  # a closed mesh and an arm
_SPRINGS: Mapping[Plane, Mapping[str, float]] = {
    "in-plane": {"ry": 4.0e3},
    "out-of-plane": {"rx": 3.0e3, "ry": 4.0e3},
    "3d": {"rx": 3.0e3, "ry": 4.0e3, "rz": 4.0e3},
}


@dataclass(frozen=True)
class Problem:
    """What a strategy is given in a check.

    Arguments:
        name: for messages.
        model: the nominal model.
        measurement: the used modes.
    """

    name: str
    model: Model
    measurement: Measurement


def small_frame(
    plane: Plane,
    *,
    elements: int = ELEMENTS,
    modulus: float = NOMINAL_E,
    members: tuple[str, ...] = _MEMBERS,
    grounded: bool = True,
    sprung: bool = False,
    torsion: float = 1.0,
    masses: tuple[PointMass, ...] = (),
) -> Frame:
    """Return a frame of four members, or some of them, with two kinds of joints.

    Arguments:
        members: two letters each, their joints.
        grounded: whether the far end of the longest run is held.
        sprung: whether every member end is tied to its joint by rotational springs, which leaves
            the joints' own rotations without mass.
        torsion: factor on the torsion constant.
    """
    tube = rectangular_tube(0.024, 0.032, 0.002)
    section = replace(tube, J=torsion * tube.J)
    material = Material(modulus, 0.33, 2700.0)
    names = sorted({joint for member in members for joint in member})
    joints = tuple(Joint(name, _at(plane, name), "T" if name == "B" else "L") for name in names)
    built = tuple(Member(m, (m[0], m[1]), elements, section, material) for m in members)
    springs = tuple(
        JointSpring(joint, member, _SPRINGS[plane])
        for member in members
        for joint in member
        if sprung
    )
    held = (Support(Place(joint="C"), ACTIVE[plane]),) if grounded and "BC" in members else ()
    ground = held or ((Support(Place(joint="A"), ACTIVE[plane]),) if grounded else ())
    return Frame(
        plane, "euler-bernoulli", joints, built,
        masses=masses, supports=ground, joint_springs=springs,
    )  # fmt: skip


def _at(plane: Plane, joint: str) -> tuple[float, float, float]:
    across, along = _JOINTS[joint]
    return (across, 0.0, along) if plane == "in-plane" else (across, along, 0.0)


def sensors_of(frame: Frame) -> Sensors:
    """Return sensors at all nodes that are not held, in all translations."""
    active = [direction for direction in ACTIVE[frame.plane] if len(direction) == 1]
    ends = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    held = {support.at.joint for support in frame.supports}
    points = {name: xyz for name, xyz in ends.items() if name not in held}
    inner = {
        f"{m.name}/{k}": ends[m.ends[0]] + k / m.elements * (ends[m.ends[1]] - ends[m.ends[0]])
        for m in frame.members
        for k in range(1, m.elements)
    }
    rows = [(n, xyz, d) for n, xyz in {**points, **inner}.items() for d in active]
    return Sensors(
        tuple(f"{name}{direction}" for name, _, direction in rows),
        np.array([xyz for _, xyz, _ in rows]),
        tuple(direction for _, _, direction in rows),
    )


def measured(truth: Model, sensors: Sensors) -> Measurement:
    """Return the lowest elastic modes of a model as a test would give them."""
    count = USED
    modes = solve_modes(truth).elastic.take(np.arange(count))
    shapes = np.asarray(truth.observe(sensors) @ modes.shapes)
    # Every shape has its own scale and sign, as in any test.
    shapes = shapes / np.abs(shapes).max(axis=0) * np.array([-1.0, 1.5, 0.5, -2.0])[:count]
    largest = np.abs(shapes).max(axis=0)
    f = modes.natural_frequencies
    return Measurement(
        sensors, tuple(range(1, count + 1)), f, _FREQUENCY_STD * f, np.full(count, np.nan),
        shapes, np.broadcast_to(_SHAPE_STD * largest, shapes.shape).copy(),
    )  # fmt: skip


def frame_problem(
    name: str,
    plane: Plane,
    *,
    grounded: bool = True,
    sprung: bool = False,
    members: tuple[str, ...] = _MEMBERS,
    elements: int = ELEMENTS,
    torsion: tuple[float, float] = (1.0, 1.0),
) -> Problem:
    """Return a coarse model that is too stiff, and a test of a finer one.

    Arguments:
        torsion: factor on the torsion constant, of the model and of the truth.
    """
    model = small_frame(
        plane, elements=elements, grounded=grounded, sprung=sprung, members=members,
        torsion=torsion[0],
    )  # fmt: skip
    mass = PointMass(Place(joint=members[0][1]), 0.02)
    truth = small_frame(
        plane, elements=3 * elements, modulus=TRUE_E, grounded=grounded, sprung=sprung,
        members=members, torsion=torsion[1], masses=(mass,),
    )  # fmt: skip
    return Problem(name, Model.of(model), measured(Model.of(truth), sensors_of(model)))


def as_matrices(problem: Problem, name: str) -> Problem:
    """Return the same problem with a model that came as matrices from files."""
    model = problem.model
    names = tuple(f"n{number + 1}" for number in range(int(model.dofs.node.max()) + 1))
    used = sorted(set(model.dofs.node.tolist()))
    place = {node: i for i, node in enumerate(used)}
    node = np.array([place[int(n)] for n in model.dofs.node], dtype=np.int64)
    dofs = replace(model.dofs, node=node)
    geometry = MatrixGeometry(tuple(names[n] for n in used), dofs)
    return Problem(name, Model(model.mass, model.stiffness, dofs, geometry), problem.measurement)


def without_cells(problem: Problem) -> Problem:
    """Return a problem in which one sensor never worked and others missed a mode."""
    shapes, std = problem.measurement.shapes.copy(), problem.measurement.shape_std.copy()
    shapes[1, :] = std[1, :] = np.nan
    shapes[0, 2] = std[0, 2] = shapes[3, 0] = std[3, 0] = np.nan
    measurement = replace(problem.measurement, shapes=shapes, shape_std=std)
    return Problem("some shape cells missing", problem.model, measurement)


def without_shape(problem: Problem, *modes: int, name: str) -> Problem:
    """Return a problem in which some modes, by their column, have a frequency alone."""
    shapes, std = problem.measurement.shapes.copy(), problem.measurement.shape_std.copy()
    shapes[:, modes] = std[:, modes] = np.nan
    return replace(
        problem, name=name, measurement=replace(problem.measurement, shapes=shapes, shape_std=std)
    )


def _noisy(name: str, draw: int) -> Problem:
    """Return a problem with one draw of measurement noise."""
    plain = problem(name)
    measurement = plain.measurement.with_noise(np.random.default_rng(draw))
    return replace(plain, name=f"{name} with noise, draw {draw}", measurement=measurement)


def of_case(case: Case) -> Problem:
    """Return what a strategy is given of a case."""
    return Problem(case.name, case.model, case.used_measurement())


@cache
def problem(name: str) -> Problem:
    """Return one of the built problems by name; raises KeyError."""
    return _PROBLEMS[name]()


PLAIN = "grounded frame out of plane"
CROSSED = "frame whose modes change order"
_FREE = "free frame out of plane"
_IN_PLANE = "grounded frame in plane"

_PROBLEMS: Mapping[str, Callable[[], Problem]] = {
    PLAIN: lambda: frame_problem(PLAIN, "out-of-plane"),
    _IN_PLANE: lambda: frame_problem(_IN_PLANE, "in-plane"),
    "grounded frame in space": lambda: frame_problem("grounded frame in space", "3d"),
    _FREE: lambda: frame_problem(_FREE, "out-of-plane", grounded=False),
    "free frame in space": lambda: frame_problem("free frame in space", "3d", grounded=False),
    CROSSED: lambda: frame_problem(CROSSED, "out-of-plane", grounded=False, torsion=(0.1, 0.2)),
    "matrices alone": lambda: as_matrices(problem(PLAIN), "matrices alone"),
    "one member": lambda: frame_problem(
        "one member", "out-of-plane", members=("AB",), elements=FINER
    ),
    "some shape cells missing": lambda: without_cells(problem(PLAIN)),
    "one mode without a shape": lambda: without_shape(
        problem(PLAIN), 1, name="one mode without a shape"
    ),
    "no shapes at all": lambda: without_shape(
        problem(PLAIN), *range(USED), name="no shapes at all"
    ),
    "one used mode": lambda: Problem(
        "one used mode", problem(PLAIN).model, problem(PLAIN).measurement.select([1])
    ),
    "joints without mass": lambda: frame_problem(
        "joints without mass", "out-of-plane", sprung=True
    ),
    "joints without mass, free": lambda: frame_problem(
        "joints without mass, free", "out-of-plane", sprung=True, grounded=False
    ),
    **{
        f"{name} with noise, draw {draw}": partial(_noisy, name, draw)
        for name in (PLAIN, _FREE)
        for draw in (1, 2)
    },
}
PROBLEMS = tuple(_PROBLEMS)
