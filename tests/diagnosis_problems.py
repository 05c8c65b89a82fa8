"""Data of known models, and the problems that a diagnosis makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from femubench import Case, Measurement, Model, Sensors, solve_modes
from femubench.core.case.modes import NO_SENSORS
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.fem.frame import ACTIVE
from femubench.core.fit.modal_basis import nominal_space
from femubench.core.fit.modal_fit import Problem
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.fit.residuals import Data
from femubench.core.inference.examine import pose_problem
from femubench.core.plugin.loader import load_plugins
from femubench.core.roles import Effect
from femubench.fem import FloatArray, Frame, Joint, Material, Member, Place, Section, Support

FREQUENCY_STD, SHAPE_STD, MASS_STD = 0.002, 0.015, 0.002


@cache
def catalogue() -> dict[str, Effect]:
    """Return the effects of all plugins by name."""
    return dict(load_plugins().effects)


def effects_named(*names: str) -> tuple[Effect, ...]:
    return tuple(catalogue()[name] for name in names)


def sensors_on_joints(frame: Frame) -> Sensors:
    """Return a sensor in every translation of the plane at every joint and member middle."""
    directions = [d for d in ACTIVE[frame.plane] if not d.startswith("r")]
    points = [(joint.name, joint.xyz) for joint in frame.joints]
    corner = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    points += [
        (m.name, tuple(0.5 * (corner[m.ends[0]] + corner[m.ends[1]]))) for m in frame.members
    ]
    rows = [(name, xyz, d) for name, xyz in points for d in directions]
    return Sensors(
        tuple(f"{name}{d}" for name, _, d in rows),
        np.array([xyz for _, xyz, _ in rows]),
        tuple(d for *_, d in rows),
    )


def measured(
    model: Model,
    frame: Frame,
    *,
    count: int = 6,
    shapes: int = 5,
    first: int = 0,
    weighed: bool = True,
    rng: np.random.Generator | None = None,
) -> Measurement:
    """Return a test of a model: frequencies, some shapes, the mass; exact without a generator.

    Arguments:
        model: what is tested.
        frame: of the sensors.
        count: number of modes.
        shapes: number of modes with a shape; 0 for no sensors at all.
        first: of the elastic modes.
        weighed: whether the mass is known.
        rng: of the noise.
    """
    modes = solve_modes(model).elastic.take(np.arange(first, first + count))
    frequencies = modes.natural_frequencies
    sensors = sensors_on_joints(frame) if shapes else NO_SENSORS
    seen = np.asarray(model.observe(sensors) @ modes.shapes) if shapes else np.zeros((0, count))
    seen = seen / np.abs(seen).max(axis=0, initial=1e-300)
    mass = model.total_mass
    if rng is not None:
        frequencies = frequencies * (1.0 + FREQUENCY_STD * rng.standard_normal(count))
        seen = seen + SHAPE_STD * rng.standard_normal(seen.shape)
        mass *= 1.0 + MASS_STD * float(rng.standard_normal())
    seen[:, shapes:] = np.nan
    return Measurement(
        sensors,
        tuple(range(1, count + 1)),
        frequencies,
        FREQUENCY_STD * frequencies,
        np.full(count, np.nan),
        seen,
        SHAPE_STD * np.ones(seen.shape),
        (mass, MASS_STD * mass) if weighed else None,
    )


def problem_of(
    model: Model, measurement: Measurement, effects: Iterable[Effect], tolerance: float = 0.0
) -> Problem:
    """Return a problem without the correction for the mesh."""
    if tolerance:
        problem, _ = pose_problem(model, measurement, hypotheses_of(model, effects), tolerance)
        return replace(problem, data=Data(measurement, np.zeros(0)))
    known = hypotheses_of(model, effects)
    space = nominal_space(model, solve_modes(model), measurement.sensors, known)
    data = Data(measurement, np.zeros(0))
    return Problem(model, space, data, Noise.of(np.zeros((len(data), 0)), 0.0))


def part_at(problem: Problem, name: str, place: str) -> Projection:
    return next(
        p
        for p in problem.space.projections
        if (p.hypothesis.name, p.hypothesis.place) == (name, place)
    )


def coordinates(part: Projection, values: Sequence[float]) -> FloatArray:
    parameters = part.hypothesis.parameters
    return np.array([p.coordinate(v) for p, v in zip(parameters, values, strict=True)])


def case_of(model: Model, measurement: Measurement, used: int, **more: object) -> Case:
    """Return a case in memory whose first modes are used, the others held out."""
    numbers = measurement.numbers
    case = Case("case", "", "computed", Path("case"), model, measurement, numbers[:used], ())
    return replace(case, **{"held_out": numbers[used:], **more})  # type: ignore[arg-type]


def clamped_portal(elements: int, section: Section, material: Material) -> Frame:
    """Return a portal in its plane, its feet on clamps."""
    places = {"fl": (0.0, 0.0), "fr": (1.2, 0.0), "el": (0.0, 1.0), "er": (1.2, 1.0)}
    joints = tuple(Joint(name, (x, 0.0, z)) for name, (x, z) in places.items())
    ends = {"left": ("fl", "el"), "right": ("fr", "er"), "beam": ("el", "er")}
    members = tuple(Member(name, pair, elements, section, material) for name, pair in ends.items())
    feet = tuple(Support(Place(joint=j), ("x", "z", "ry")) for j in ("fl", "fr"))
    return Frame("in-plane", "euler-bernoulli", joints, members, supports=feet)
