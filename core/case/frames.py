"""Make a `Frame` of the tables of `case.toml`, and find sensors and attachments on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from femubench.core.case.checks import check_frame
from femubench.core.case.faults import Fault, Misfit, WrongDirection, at_key
from femubench.core.case.schema import FrameSpec, MassSpec, OscillatorSpec, SectionSpec, SpringSpec
from femubench.core.errors import ModelError
from femubench.core.fem.frame import (
    ACTIVE,
    BeamTheory,
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    Member,
    Oscillator,
    Place,
    Plane,
    PointMass,
    Preload,
    RigidEnd,
    Support,
    Vector,
)
from femubench.core.fem.mesh import locate
from femubench.core.fem.sections import SHAPES, Section, constant_kappa

_SIZES = ("width", "height", "diameter", "wall")
_CONSTANTS = ("A", "Iy", "Iz", "J", "Jp")
_NEEDED: dict[Plane, tuple[str, ...]] = {
    "in-plane": ("A", "Iy"),
    "out-of-plane": ("A", "Iy", "J", "Jp"),
    "3d": ("A", "Iy", "Iz", "J", "Jp"),
}


def section_of(spec: SectionSpec, plane: Plane, beam: BeamTheory) -> Section:
    """Return the section of a table, numbers beside a shape taking the place of the shape's.

    Raises:
        Fault: where a size or a constant is missing or does not belong there.
    """
    shape = spec.shape
    section = _from_numbers(spec, plane) if shape is None else _from_shape(spec, shape)
    if spec.kappa is not None:
        section = replace(section, kappa=constant_kappa(spec.kappa))
    if beam == "timoshenko" and section.kappa is None:
        raise Fault(("kappa",), "missing key", "the shear coefficient of a timoshenko beam, > 0")
    return section


def _from_shape(spec: SectionSpec, shape: str) -> Section:
    if shape not in SHAPES:
        raise Fault(("shape",), f"unknown shape {shape[:40]!r}", f"one of {', '.join(SHAPES)}")
    make, keys = SHAPES[shape]
    sizes: dict[str, float] = {}
    for key in _SIZES:
        value = getattr(spec, key)
        if key in keys and value is None:
            raise Fault((key,), "missing key", f"{', '.join(keys)}, each > 0 in m")
        if key not in keys and value is not None:
            raise Fault((key,), f"not a size of a {shape}", f"{', '.join(keys)}")
        if value is not None:
            sizes[key] = value
    wall = sizes.get("wall", 0.0)
    smallest = min(value for key, value in sizes.items() if key != "wall")
    if wall >= smallest / 2:
        raise Fault(("wall",), f"wall {wall:g}", f"a number < {smallest / 2:g}, half of the size")
    given = {key: getattr(spec, key) for key in _CONSTANTS if getattr(spec, key) is not None}
    return replace(make(**sizes), **given)


def _from_numbers(spec: SectionSpec, plane: Plane) -> Section:
    for key in _SIZES:
        if getattr(spec, key) is not None:
            raise Fault((key,), "a size without a shape", f"shape = one of {', '.join(SHAPES)}")
    given: dict[str, float] = {
        key: getattr(spec, key) for key in _CONSTANTS if getattr(spec, key) is not None
    }
    if "Iy" in given and "Iz" in given:
        given.setdefault("Jp", given["Iy"] + given["Iz"])
    for key in _NEEDED[plane]:
        if key not in given:
            expected = f"{', '.join(_NEEDED[plane])}, which plane {plane!r} needs"
            raise Fault((key,), "missing key", expected)
    a, iy, iz, j, jp = (given.get(key, 0.0) for key in _CONSTANTS)
    return Section(A=a, Iy=iy, Iz=iz, J=j, Jp=jp)


class Site(Protocol):
    """A structure on which places and directions can be checked; every method raises Misfit."""

    def point(self, place: Place) -> Vector:
        """Return where a place lies in m."""
        ...

    def check_direction(self, place: Place, direction: str) -> None:
        """Check that something may act in a direction there."""
        ...

    def check_sensor(self, xyz: Vector, direction: str) -> None:
        """Check that a point lies on the structure and can be measured in a direction."""
        ...


class FrameSite:
    """The site of a frame: joints, and stations of members."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.joints = {joint.name: joint.xyz for joint in frame.joints}
        self.members = {member.name: member.ends for member in frame.members}

    def point(self, place: Place) -> Vector:
        """Return where a place lies in m."""
        if place.joint is not None:
            if place.joint not in self.joints:
                raise Misfit(f"there is no joint {place.joint!r}", "a joint or member@station")
            return self.joints[place.joint]
        if place.member not in self.members or place.s is None:
            raise Misfit(f"there is no member {place.member!r}", "a joint or member@station")
        first, second = (np.array(self.joints[name]) for name in self.members[place.member])
        x, y, z = (float(v) for v in (1.0 - place.s) * first + place.s * second)
        return x, y, z

    def check_direction(self, place: Place, direction: str) -> None:
        """Check that the plane has a direction."""
        allowed = ACTIVE[self.frame.plane]
        if direction.lstrip("+-") not in allowed:
            expected = f"{', '.join(allowed)}, the directions of plane {self.frame.plane!r}"
            raise WrongDirection(f"direction {direction!r} is not there", expected)

    def check_sensor(self, xyz: Vector, direction: str) -> None:
        """Check that a point lies on a member and that the plane has the direction."""
        try:
            place = locate(self.frame, np.array(xyz))
        except ModelError as error:
            raise Misfit(str(error), "a point within 1e-6 m of a member") from None
        self.check_direction(place, direction)


def frame_of(model: FrameSpec) -> Frame:
    """Return the frame that `[model]` describes; raises Fault with a path below `model`."""
    check_frame(model)
    sections = {}
    for name, spec in model.sections.items():
        with at_key("sections", name):
            sections[name] = section_of(spec, model.plane, model.beam)
    frame = Frame(
        plane=model.plane,
        beam=model.beam,
        joints=tuple(Joint(joint.name, joint.xyz, joint.type) for joint in model.joints),
        members=_members(model, sections),
        joint_springs=tuple(
            JointSpring(
                spring.joint, spring.member, spring.stiffness, spring.arm, spring.arm_factor
            )
            for spring in model.joint_springs
        ),
        rigid_ends=tuple(
            RigidEnd(end.joint, end.member, end.stiffness_length, end.mass_length)
            for end in model.rigid_ends
        ),
        rotary_inertia=model.rotary_inertia,
        bending_mass=model.bending_mass,
        factors=tuple(Factor(item.quantity, item.at, item.factor) for item in model.factors),
        preloads=tuple(Preload(item.member, item.force) for item in model.preloads),
        eccentricities=tuple(
            Eccentricity(item.member, item.y, item.z) for item in model.eccentricities
        ),
        couplings=tuple(Coupling(item.member, item.coefficient) for item in model.couplings),
        braces=tuple(Brace(item.ends, item.stiffness) for item in model.braces),
    )
    return _with_attachments(frame, model)


def _members(model: FrameSpec, sections: Mapping[str, Section]) -> tuple[Member, ...]:
    materials = {name: Material(m.E, m.nu, m.rho) for name, m in model.materials.items()}
    return tuple(
        Member(m.name, m.ends, m.elements, sections[m.section], materials[m.material], m.up)
        for m in model.members
    )


def _with_attachments(frame: Frame, model: FrameSpec) -> Frame:
    site = FrameSite(frame)
    masses = point_masses(model.masses, site)
    springs = ground_springs(model.springs, site)
    supports = []
    for i, support in enumerate(model.supports):
        with at_key("supports", i, "at"):
            site.point(support.at)
        supports.append(Support(support.at, support.fixed))
    return replace(
        frame,
        masses=masses,
        springs=springs,
        supports=tuple(supports),
        oscillators=_oscillators(model.oscillators, site),
    )


def _oscillators(specs: Sequence[OscillatorSpec], site: FrameSite) -> tuple[Oscillator, ...]:
    oscillators = []
    for i, spec in enumerate(specs):
        with at_key("oscillators", i, "at"):
            site.point(spec.at)
        with at_key("oscillators", i, "direction"):
            site.check_direction(spec.at, spec.direction)
            if "r" in spec.direction:
                raise Misfit(f"{spec.direction!r} is a rotation", "a translation")
        oscillators.append(Oscillator(spec.at, spec.direction, spec.mass, spec.frequency))
    return tuple(oscillators)


def point_masses(specs: Sequence[MassSpec], site: Site) -> tuple[PointMass, ...]:
    """Return the masses of a list; raises Fault with a path from ``masses`` on."""
    masses = []
    for i, spec in enumerate(specs):
        with at_key("masses", i, "at"):
            site.point(spec.at)
        masses.append(PointMass(spec.at, spec.mass, spec.offset))
    return tuple(masses)


def ground_springs(specs: Sequence[SpringSpec], site: Site) -> tuple[GroundSpring, ...]:
    """Return the springs of a list; raises Fault with a path from ``springs`` on."""
    springs = []
    for i, spec in enumerate(specs):
        with at_key("springs", i, "at"):
            site.point(spec.at)
        with at_key("springs", i, "direction"):
            site.check_direction(spec.at, spec.direction)
        springs.append(GroundSpring(spec.at, spec.direction, spec.stiffness))
    return tuple(springs)
