"""Causes that no effect of the catalogue describes, for the verdict ``unknown``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.fem.frame import (
    ACTIVE,
    Factor,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Member,
    Place,
)
from femubench.core.fem.mesh import member_axes
from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Outside:
    """A cause outside the catalogue.

    Arguments:
        text: what it is, in words.
        frame: the frame that has it.
        sensors: what the readings of the sensors become, a matrix (n_sensors, n_sensors); None
            where the sensors are right.
    """

    text: str
    frame: Frame
    sensors: FloatArray | None = None


Drawing = Callable[[Frame, int, np.random.Generator], Outside]


def _pick_end(frame: Frame, rng: np.random.Generator, least: int = 2) -> tuple[Joint, list[Member]]:
    """Return a joint at which so many members end at least, and these, in random order."""
    joints = [joint for joint in frame.joints if len(frame.ends_at(joint.name)) >= least]
    joint = joints[int(rng.integers(len(joints)))]
    members = [frame.members[frame.member_index[name]] for name in frame.ends_at(joint.name)]
    return joint, [members[i] for i in rng.permutation(len(members))]


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.random())


def _length(frame: Frame, member: Member) -> float:
    return member_axes(frame, member)[1]


def sliding_joint(frame: Frame, _: int, rng: np.random.Generator) -> Outside:
    """Let a member end shift across its axis against the joint."""
    joint, (member, *_rest) = _pick_end(frame, rng)
    reference = 12.0 * member.material.E * member.section.Iy / _length(frame, member) ** 3
    stiffness = reference * _log(rng, 1.0, 30.0)
    spring = JointSpring(joint.name, member.name, {"z": stiffness})
    text = f"member {member.name} slides at {joint.name}, {stiffness:.3g} N/m across its axis"
    return Outside(text, replace(frame, joint_springs=(*frame.joint_springs, spring)))


def displace_joint(frame: Frame, _: int, rng: np.random.Generator) -> Outside:
    """Move a joint within the plane of the frame: a wrong drawing."""
    joint, (member, *_rest) = _pick_end(frame, rng)
    # The axes in which the structure extends, which are not those in which it moves.
    extent = np.ptp(frame.corners, axis=0)
    axes = np.flatnonzero(extent > 1e-9)
    direction = np.zeros(3)
    direction[axes] = rng.standard_normal(len(axes))
    shift = float(rng.uniform(0.02, 0.05)) * _length(frame, member)
    x, y, z = np.array(joint.xyz) + shift * direction / np.linalg.norm(direction)
    moved = replace(joint, xyz=(float(x), float(y), float(z)))
    joints = tuple(moved if item.name == joint.name else item for item in frame.joints)
    text = f"joint {joint.name} lies {1e3 * shift:.3g} mm off the drawing"
    return Outside(text, replace(frame, joints=joints))


def swap_sensors(frame: Frame, sensors: int, rng: np.random.Generator) -> Outside:
    """Exchange the cables of two sensors."""
    first, second = (int(i) for i in rng.choice(sensors, 2, replace=False))
    matrix = np.eye(sensors)
    matrix[[first, second]] = matrix[[second, first]]
    return Outside(f"sensors {first + 1} and {second + 1} are swapped", frame, matrix)


def wrong_gain(frame: Frame, sensors: int, rng: np.random.Generator) -> Outside:
    """Give one sensor a gain that is 30 % off."""
    sensor, gain = int(rng.integers(sensors)), float(rng.choice([0.7, 1.3]))
    matrix = np.eye(sensors)
    matrix[sensor, sensor] = gain
    return Outside(f"sensor {sensor + 1} has a gain of {gain:g}", frame, matrix)


def hold_rotation(frame: Frame, _: int, rng: np.random.Generator) -> Outside:
    """Hold a joint by a rotational spring to ground."""
    joint, (member, *_rest) = _pick_end(frame, rng)
    rotations = [name for name in ACTIVE[frame.plane] if name.startswith("r")]
    direction = rotations[int(rng.integers(len(rotations)))]
    reference = 4.0 * member.material.E * member.section.Iy / _length(frame, member)
    stiffness = reference * _log(rng, 0.1, 5.0)
    spring = GroundSpring(Place(joint=joint.name), direction, stiffness)
    text = f"a spring of {stiffness:.3g} N m/rad to ground about {direction} at {joint.name}"
    return Outside(text, replace(frame, springs=(*frame.springs, spring)))


def taper_member(frame: Frame, _: int, rng: np.random.Generator) -> Outside:
    """Let the stiffness of a member fall along it from 1.4 to 0.6 of the nominal one."""
    member = frame.members[int(rng.integers(len(frame.members)))]
    scale = np.linspace(1.4, 0.6, member.elements)
    scale = scale[::-1] if rng.random() < 0.5 else scale
    factors = tuple(
        Factor("E", (f"{member.name}/{k + 1}",), float(value)) for k, value in enumerate(scale)
    )
    text = f"the stiffness of {member.name} goes from {scale[0]:g} to {scale[-1]:g} along it"
    return Outside(text, replace(frame, factors=frame.factors + factors))


def uneven_joint(frame: Frame, _: int, rng: np.random.Generator) -> Outside:
    """Make a joint of three members turn on one leg and stiff on another."""
    joint, (soft, stiff, *_rest) = _pick_end(frame, rng, least=3)
    reference = 4.0 * soft.material.E * soft.section.Iy / _length(frame, soft)
    spring = JointSpring(joint.name, soft.name, {"ry": reference * _log(rng, 0.5, 5.0)})
    at_start = stiff.ends[0] == joint.name
    numbers = (1, 2) if at_start else (stiff.elements - 1, stiff.elements)
    places = tuple(f"{stiff.name}/{k}" for k in numbers)
    factor = Factor("E", places, float(rng.uniform(1.5, 3.0)))
    changed = replace(
        frame,
        joint_springs=(*frame.joint_springs, spring),
        factors=(*frame.factors, factor),
    )
    text = f"joint {joint.name} turns at {soft.name} and is {factor.factor:.3g} times as stiff"
    return Outside(f"{text} towards {stiff.name}", changed)


OUTSIDE: Mapping[str, Drawing] = {
    "sliding-joint": sliding_joint,
    "displaced-joint": displace_joint,
    "swapped-sensors": swap_sensors,
    "wrong-gain": wrong_gain,
    "held-rotation": hold_rotation,
    "tapered-member": taper_member,
    "uneven-joint": uneven_joint,
}
SENSOR_FAULTS = frozenset({"swapped-sensors", "wrong-gain"})
