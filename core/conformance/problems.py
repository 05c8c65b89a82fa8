"""Small structures with a simulated test, each with one feature that methods stumble over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

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
from femubench.core.fem.parameters import Property
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.frf import FrequencyResponses, receptance
from femubench.core.modal.measurement import Measurement

NOMINAL_E, TRUE_E = 72.0e9, 69.0e9  # Pa
ELEMENTS, FINER = 2, 6  # of a member; the truth has three times as many
USED = 4  # modes
_FREQUENCY_STD, _SHAPE_STD, _RESPONSE_STD = 0.002, 0.01, 0.02
_LINES, _DAMPING = 40, 0.005
_JOINTS = {"A": (0.0, 0.0), "B": (0.5, 0.0), "C": (0.9, 0.0), "D": (0.45, 0.37), "F": (0.0, 0.3)}
_MEMBERS = ("AB", "BC", "BD", "AF", "FD")  # a closed mesh and an arm
_SPRINGS: Mapping[Plane, Mapping[str, float]] = {
    "in-plane": {"ry": 4.0e3},
    "out-of-plane": {"rx": 3.0e3, "ry": 4.0e3},
    "3d": {"rx": 3.0e3, "ry": 4.0e3, "rz": 4.0e3},
}


@dataclass(frozen=True)
class UpdatingProblem:
    """What a strategy is given in a check."""

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
    tube = Section.rectangular_tube(0.024, 0.032, 0.002)
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


def measure(truth: Model, sensors: Sensors) -> Measurement:
    """Return the lowest elastic modes of a model, and its responses, as a test would give them."""
    count, every, rows = USED, solve_modes(truth), truth.observe(sensors)
    modes = every.elastic.take(np.arange(count))
    shapes = np.asarray(rows @ modes.shapes)
    # Every shape has its own scale and sign, as in any test.
    shapes = shapes / np.abs(shapes).max(axis=0) * np.array([-1.0, 1.5, 0.5, -2.0])[:count]
    largest = np.abs(shapes).max(axis=0)
    f = modes.natural_frequencies
    lines = np.linspace(0.5 * f[0], 1.1 * f[-1], _LINES)
    values = receptance(every, rows, rows[:1], lines, _DAMPING)
    std = _RESPONSE_STD * np.abs(values)
    force = sensors.take([0])
    return Measurement(
        sensors, tuple(range(1, count + 1)), f, _FREQUENCY_STD * f, np.full(count, np.nan),
        shapes, np.broadcast_to(_SHAPE_STD * largest, shapes.shape).copy(),
        responses=FrequencyResponses(sensors, force, lines, values, deviations=std),
    )  # fmt: skip


def frame_problem(
    name: str,
    plane: Plane,
    *,
    members: tuple[str, ...] = _MEMBERS,
    elements: int = ELEMENTS,
    torsion: tuple[float, float] = (1.0, 1.0),
    **kind: Any,  # noqa: ANN401 - as `small_frame` has it
) -> UpdatingProblem:
    """Return a coarse model that is too stiff, and a test of a finer one.

    Arguments:
        torsion: factor on the torsion constant, of the model and of the truth.
        kind: whether it is grounded, and sprung, as in `small_frame`.
    """
    frame = partial(small_frame, plane, members=members, **kind)
    model = frame(elements=elements, torsion=torsion[0])
    mass = PointMass(Place(joint=members[0][1]), 0.02)
    truth = frame(elements=3 * elements, modulus=TRUE_E, torsion=torsion[1], masses=(mass,))
    return UpdatingProblem(name, Model.of(model), measure(Model.of(truth), sensors_of(model)))


def _as_matrices(problem: UpdatingProblem) -> UpdatingProblem:
    """Return a problem with a model that came as matrices from files."""
    model = problem.model
    names = tuple(f"n{number + 1}" for number in range(int(model.dofs.node.max()) + 1))
    used, node = np.unique(model.dofs.node, return_inverse=True)
    dofs = replace(model.dofs, node=node.astype(np.int64))
    geometry = MatrixGeometry(tuple(names[n] for n in used), dofs)
    return replace(problem, model=Model(model.mass, model.stiffness, dofs, geometry))


def _as_groups(problem: UpdatingProblem) -> UpdatingProblem:
    """Return a problem with matrices of which one member and the others are groups, with masses."""
    structure, nominal = problem.model.frame_structure, problem.model.stiffness
    own = Property("E", "E", tuple(m for m in structure.label_index if m.startswith("AB/")))
    one = structure.with_values([own], [2.0]).matrices()[1] - nominal
    grouped = _as_matrices(problem)
    groups = {"one": one, "others": nominal - one}
    mass = dict.fromkeys(groups, 0.5 * grouped.model.mass)
    return replace(grouped, model=replace(grouped.model, groups=groups, mass_groups=mass))


def _without(problem: UpdatingProblem, *cells: tuple[int | slice, int | slice]) -> UpdatingProblem:
    """Return a problem in which some cells of the shapes are missing, by sensors and modes."""
    shapes, std = problem.measurement.shapes.copy(), problem.measurement.shape_std.copy()
    for cell in cells:
        shapes[cell] = std[cell] = np.nan
    measurement = replace(problem.measurement, shapes=shapes, shape_std=std)
    return replace(problem, measurement=measurement)


def _noisy(problem: UpdatingProblem, draw: int) -> UpdatingProblem:
    """Return a problem with one draw of measurement noise."""
    measurement = problem.measurement.with_noise(np.random.default_rng(draw))
    return replace(problem, measurement=measurement)


def of_case(case: Case) -> UpdatingProblem:
    """Return what a strategy is given of a case."""
    return UpdatingProblem(case.name, case.model, case.used_measurement())


@cache
def problem(name: str) -> UpdatingProblem:
    """Return one of the built problems by name; raises KeyError."""
    if name in _FRAMES:
        return frame_problem(name, **_FRAMES[name])
    base, change = _CHANGED[name]
    return replace(change(problem(base)), name=name)


PLAIN = "grounded frame out of plane"
GROUPED = "matrices with groups"
CROSSED = "frame whose modes change order"
_FREE = "free frame out of plane"
_ALL = slice(None)

_FRAMES: Mapping[str, Mapping[str, Any]] = {
    PLAIN: {"plane": "out-of-plane"},
    "grounded frame in plane": {"plane": "in-plane"},
    "grounded frame in space": {"plane": "3d"},
    _FREE: {"plane": "out-of-plane", "grounded": False},
    "free frame in space": {"plane": "3d", "grounded": False},
    CROSSED: {"plane": "out-of-plane", "grounded": False, "torsion": (0.1, 0.2)},
    "one member": {"plane": "out-of-plane", "members": ("AB",), "elements": FINER},
    "joints without mass": {"plane": "out-of-plane", "sprung": True},
    "joints without mass, free": {"plane": "out-of-plane", "sprung": True, "grounded": False},
}
# The problem that is changed, and how.
_CHANGED: Mapping[str, tuple[str, Callable[[UpdatingProblem], UpdatingProblem]]] = {
    "matrices alone": (PLAIN, _as_matrices),
    GROUPED: (PLAIN, _as_groups),
    # One sensor never worked, and others missed a mode.
    "some shape cells missing": (PLAIN, lambda p: _without(p, (1, _ALL), (0, 2), (3, 0))),
    "one mode without a shape": (PLAIN, lambda p: _without(p, (_ALL, 1))),
    "no shapes at all": (PLAIN, lambda p: _without(p, (_ALL, _ALL))),
    "no responses": (
        PLAIN,
        lambda p: replace(p, measurement=replace(p.measurement, responses=None)),
    ),
    "one used mode": (PLAIN, lambda p: replace(p, measurement=p.measurement.select([1]))),
    **{
        f"{name} with noise, draw {draw}": (name, partial(_noisy, draw=draw))
        for name in (PLAIN, _FREE)
        for draw in (1, 2)
    },
}
PROBLEMS = (*_FRAMES, *_CHANGED)
