"""The description of a structure, from which both the solid and the beam model are made."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from truths.sections import Section

Array = npt.NDArray[np.float64]
Point = tuple[float, float, float]
Place = str | tuple[str, float]  # a joint, or a member and the share of its length


@dataclass(frozen=True)
class Material:
    """Hold Young's modulus (Pa), Poisson's ratio and density (kg/m3)."""

    E: float
    nu: float
    rho: float

    def scaled(self, stiffness: float = 1.0, mass: float = 1.0) -> Material:
        """Return the material with multiples of its modulus and density."""
        return Material(self.E * stiffness, self.nu, self.rho * mass)


# Class of the structures that were made after the rule of the boards was fixed.
AFTER = "after the rule"
STEEL = Material(210e9, 0.3, 7850.0)
ALUMINIUM = Material(70e9, 0.33, 2700.0)


@dataclass(frozen=True)
class Member:
    """Describe a straight member between two joints.

    Arguments:
        ends: names of two joints.
        elements: beam elements of the drawn model.
        up: a vector in the local x-z plane; by default global z, or x for an upright.
        extend: lengths in m by which the solid passes its joints, so that walls meet.
        weld: length in m of the layer at either end that a defect may change; 0 for none.
        drawn_up: what the drawing has in place of `up` where a warp turns the section.
    """

    name: str
    ends: tuple[str, str]
    section: str
    material: str
    elements: int = 4
    up: Point | None = None
    extend: tuple[float, float] = (0.0, 0.0)
    weld: float = 0.0
    drawn_up: Point | None = None


@dataclass(frozen=True)
class Block:
    """Describe a plate, gusset, cap or hole that only the solid has; material "" cuts.

    Arguments:
        low, high: opposite corners, m.
        first: painted before the members, which then pass through it.
    """

    name: str
    low: Point
    high: Point
    material: str
    first: bool = False


@dataclass(frozen=True)
class Lump:
    """Describe a mass (kg) at a global offset (m) from a place, and whether it is drawn."""

    at: Place
    mass: float
    offset: Point = (0.0, 0.0, 0.0)
    drawn: bool = True


@dataclass(frozen=True)
class Spring:
    """Describe a spring to ground (N/m; N m/rad about rx, ry, rz), and whether it is drawn."""

    at: Place
    direction: str
    stiffness: float
    drawn: bool = True


@dataclass(frozen=True)
class Strut:
    """Describe an axial spring (N/m) with a mass (kg) shared by its two ends; never drawn."""

    ends: tuple[Place, Place]
    stiffness: float
    mass: float = 0.0


@dataclass(frozen=True)
class Oscillator:
    """Describe a mass (kg) on a spring, moving in one direction at a frequency (Hz) of its own."""

    at: Place
    direction: str
    mass: float
    frequency: float


@dataclass(frozen=True)
class Clamp:
    """Describe a clamp: all nodes of a box are fixed; the drawing fixes the joint there.

    Arguments:
        low, high: opposite corners of the box, m.
    """

    at: str
    low: Point
    high: Point

    def holds(self, points: Array) -> npt.NDArray[np.bool_]:
        """Return which points (3, ...) of the straight description are fixed, (...)."""
        shape = (3, *(1,) * (points.ndim - 1))
        low, high = (np.array(corner).reshape(shape) for corner in (self.low, self.high))
        return np.asarray(((points >= low - 1e-6) & (points <= high + 1e-6)).all(axis=0))


@dataclass(frozen=True)
class Change:
    """Describe a known change of the design."""

    name: str
    lumps: tuple[Lump, ...] = ()
    springs: tuple[Spring, ...] = ()


@dataclass(frozen=True)
class Structure:
    """Describe a structure: what is drawn, how it is really made, how it is tested.

    Arguments:
        title: one line.
        classes: words by which it is found in a list.
        story: what it is and how its joints are made, for its README.
        plane: `"3d"`, `"in-plane"` (x-z) or `"out-of-plane"` (x-y), of the drawn model.
        beam: theory of the drawn model.
        joints: points in m, before `warp`.
        types: of the joints; a joint that is not named has the type of its name.
        blocks: what only the solid has; its materials stand in `materials` too.
        warp: maps (3, n) points of the straight description to the real, curved or tapered one.
        size: element length of the coarse and of the fine mesh, m.
        guess: a frequency near the first elastic one, Hz; the solver starts from it.
        mesher: `"bricks"` for members along the axes, `"tetrahedra"` for any.
        graded: whether bricks are longer away from joints.
        sensors: places, each with the directions measured there.
        used, held_out: numbers of modes.
        scatter: relative standard deviation of a measured frequency.
        shape_scatter: of a shape, of its largest component.
        together: share of the frequencies' variance that all modes have in common.
        weighed: relative standard deviation of the weighed mass; 0 for not weighed.
        default: whether it belongs to the small set of `bench run`.
    """

    name: str
    title: str
    classes: tuple[str, ...]
    story: str
    materials: Mapping[str, Material]
    sections: Mapping[str, Section]
    joints: Mapping[str, Point]
    members: tuple[Member, ...]
    sensors: tuple[tuple[Place, str], ...]
    changes: tuple[Change, ...]
    used: int
    held_out: int
    size: tuple[float, float]
    guess: float
    plane: str = "3d"
    beam: str = "euler-bernoulli"
    types: Mapping[str, str] = field(default_factory=dict)
    blocks: tuple[Block, ...] = ()
    lumps: tuple[Lump, ...] = ()
    springs: tuple[Spring, ...] = ()
    struts: tuple[Strut, ...] = ()
    oscillators: tuple[Oscillator, ...] = ()
    clamps: tuple[Clamp, ...] = ()
    mesher: str = "bricks"
    graded: bool = True
    warp: Callable[[Array], Array] | None = None
    scatter: float = 0.003
    shape_scatter: float = 0.02
    together: float = 0.5
    weighed: float = 0.005
    default: bool = False

    @property
    def seed(self) -> int:
        """Return the seed of the measurement's scatter, made of the name."""
        return int.from_bytes(hashlib.sha256(self.name.encode()).digest()[:4], "big")

    @property
    def seats(self) -> list[tuple[str, float]]:
        """Return the places within members where something is measured or attached."""
        lumps, springs = list(self.lumps), list(self.springs)
        for change in self.changes:
            lumps += change.lumps
            springs += change.springs
        places = [at for at, _ in self.sensors] + [lump.at for lump in lumps]
        places += [spring.at for spring in springs] + [item.at for item in self.oscillators]
        return sorted({at for at in places if not isinstance(at, str)})

    @property
    def hung_mass(self) -> float:
        """Return the mass of what is attached, kg."""
        hung = sum(item.mass for item in self.lumps)
        hung += sum(item.mass for item in self.struts)
        return hung + sum(item.mass for item in self.oscillators)

    def warped(self, points: Array) -> Array:
        """Return points (3, n) of the straight description where they really are."""
        return points if self.warp is None else self.warp(points)

    def member(self, name: str) -> Member:
        """Return a member by its name."""
        return next(member for member in self.members if member.name == name)

    def point(self, place: Place) -> Array:
        """Return a place of the straight description, m."""
        if isinstance(place, str):
            return np.array(self.joints[place], dtype=float)
        start, end = (np.array(self.joints[j], dtype=float) for j in self.member(place[0]).ends)
        return np.asarray(start + place[1] * (end - start))

    def axes(self, member: Member) -> tuple[Array, float]:
        """Return local axes x, y, z as rows and the length (m) in the straight description."""
        start, end = (np.array(self.joints[j], dtype=float) for j in member.ends)
        length = float(np.linalg.norm(end - start))
        x = (end - start) / length
        upright = abs(x[2]) > 1 - 1e-9
        up = np.array(member.up or ((1.0, 0.0, 0.0) if upright else (0.0, 0.0, 1.0)))
        y = np.cross(up, x)
        y /= np.linalg.norm(y)
        return np.array([x, y, np.cross(x, y)]), length

    @property
    def solid_members(self) -> list[Member]:
        """Return the members that the solid has; a drawn link only joins centre lines."""
        made = {name for name, s in self.sections.items() if s.rectangles}
        return [member for member in self.members if member.section in made]

    def at_joint(self, joint: str) -> Member:
        """Return the first member that ends at a joint."""
        return next(member for member in self.members if joint in member.ends)
