"""The description of a frame, as a case folder gives it: plain data, no mesh yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from scipy.spatial import cKDTree

from femubench.core.fem.damping import Damping
from femubench.core.fem.sections import Section
from femubench.core.typing import FloatArray, IntArray

Made = Literal["welded-tubes", "gusset", "bolted", "solid", "glued"]
MADE = get_args(Made)
Plane = Literal["in-plane", "out-of-plane", "3d"]
BeamTheory = Literal["euler-bernoulli", "timoshenko"]
BendingMass = Literal["cubic", "shear-consistent"]
Vector = tuple[float, float, float]

ACTIVE: Mapping[Plane, tuple[str, ...]] = {
    "in-plane": ("x", "z", "ry"),
    "out-of-plane": ("z", "rx", "ry"),
    "3d": ("x", "y", "z", "rx", "ry", "rz"),
}


@dataclass(frozen=True)
class Material:
    """Isotropic linear material: E in Pa, Poisson's ratio, density in kg/m3, name in its case."""

    E: float
    nu: float
    rho: float
    name: str = field(default="", compare=False)

    @property
    def G(self) -> float:  # noqa: N802 - the field's symbol
        """Return the shear modulus E / 2(1 + nu) in Pa."""
        return self.E / (2.0 * (1.0 + self.nu))


@dataclass(frozen=True)
class Joint:
    """A named point where members meet; joints of one type are expected to behave alike."""

    name: str
    xyz: Vector
    type: str = ""

    @property
    def family(self) -> str:
        """Return its type; a joint without one is a type of its own."""
        return self.type or self.name


@dataclass(frozen=True)
class Member:
    """A straight prismatic member from ends[0] to ends[1], cut into equal elements.

    Arguments:
        up: a vector in the local x-z plane, 3d only; None takes global z, or global x for a
            member along z.
    """

    name: str
    ends: tuple[str, str]
    elements: int
    section: Section
    material: Material
    up: Vector | None = None


@dataclass(frozen=True)
class Place:
    """A point of the structure: a joint (or node), or the station s in 0..1 of a member."""

    joint: str | None = None
    member: str | None = None
    s: float | None = None

    def __str__(self) -> str:
        return self.joint if self.joint is not None else f"{self.member}@{self.s}"


@dataclass(frozen=True)
class PointMass:
    """A mass in kg without own rotary inertia, on a rigid massless arm `offset` (global, m)."""

    at: Place
    mass: float
    offset: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GroundSpring:
    """A spring to ground in one global direction, N/m or N m/rad; a sign changes nothing."""

    at: Place
    direction: str
    stiffness: float


@dataclass(frozen=True)
class Support:
    """Degrees of freedom that are held at a place."""

    at: Place
    fixed: tuple[str, ...]


@dataclass(frozen=True)
class JointSpring:
    """A flexible connection between a joint and one member end.

    The member starts behind an arm of the given length; joint and member end are tied there by
    one spring a direction; directions that are not named are shared.

    Arguments:
        joint: the joint's name.
        member: the member whose end is connected flexibly.
        stiffness: from local directions of the member (x along it) to N/m or N m/rad.
        arm: length in m, measured from the joint along the member.
        arm_factor: None for a rigid massless arm, else a massless beam with the member's
            rigidities times this factor (Horton et al. 1999, section 3.1).
    """

    joint: str
    member: str
    stiffness: Mapping[str, float]
    arm: float = 0.0
    arm_factor: float | None = None


@dataclass(frozen=True)
class RigidEnd:
    """A member end whose first element is partly rigid (Ahmadian et al.; Horton et al. 1999, (5)).

    Arguments:
        stiffness_length: a, the rigid length in the stiffness matrix in m; may be negative.
        mass_length: a0, the rigid massless length in the mass matrix in m.
    """

    joint: str
    member: str
    stiffness_length: float
    mass_length: float = 0.0


@dataclass(frozen=True)
class Link:
    """A rigid connection: motions of some joints follow from those of another, as of one body.

    Arguments:
        leads: the joint whose motions are free.
        follows: the joints that go along with it, each behind a rigid massless arm.
        motions: which of their motions follow; empty for all. A rigid floor is ``x, y, rz``.
    """

    leads: str
    follows: tuple[str, ...]
    motions: tuple[str, ...] = ()


HALVES = (":first", ":second")


def halves_of(place: str) -> tuple[str, ...]:
    """Return the words of both halves of an element; nothing for what is half of one."""
    return () if split_half(place)[1] else tuple(f"{place}{word}" for word in HALVES)


def split_half(place: str) -> tuple[str, int]:
    """Return an element, and which half of it a place is, 1 or 2; 0 for all of it."""
    half = next((k for k, word in enumerate(HALVES, 1) if place.endswith(word)), 0)
    return (place.removesuffix(HALVES[half - 1]), half) if half else (place, 0)


@dataclass(frozen=True)
class Factor:
    """A multiple of what sections and materials give, at some places of the frame.

    Arguments:
        quantity: a key of `femubench.core.fem.parameters.QUANTITIES` that is a factor, e.g. ``E``.
        at: ``all``, member names, ``member/k`` for one element, ``member/k:first`` and
            ``member/k:second`` for half of one.
        factor: of the property; several factors on one place multiply.
    """

    quantity: str
    at: tuple[str, ...]
    factor: float


@dataclass(frozen=True)
class Preload:
    """The self-equilibrated state of stress that a lack of fit of one member leaves.

    Arguments:
        member: the member that was too short or too long.
        force: the normal force of largest magnitude anywhere in the frame in N, with the sign of
            the force in `member`, tension positive.
    """

    member: str
    force: float


@dataclass(frozen=True)
class Eccentricity:
    """The line of the mass centres of a member, off its axis by (y, z) in local axes, in m."""

    member: str
    y: float = 0.0
    z: float = 0.0


@dataclass(frozen=True)
class Coupling:
    """Bending-torsion coupling of a member's sections.

    Arguments:
        member: its name.
        coefficient: c in the strain energy (EI k^2 + 2 c sqrt(EI GJ) k t + GJ t^2) / 2 of the
            curvature k about local y and the twist t, -1 < c < 1.
    """

    member: str
    coefficient: float


@dataclass(frozen=True)
class Brace:
    """A massless spring between two joints, N/m: along their line, or in one global direction.

    Arguments:
        direction: x, y or z; empty for the line between the joints.
    """

    ends: tuple[str, str]
    stiffness: float
    direction: str = ""


@dataclass(frozen=True)
class Oscillator:
    """A mass in kg that rides on a place and moves on a spring in one global direction.

    Arguments:
        frequency: natural frequency on a fixed base in Hz.
        crosswise: whether it goes along with its place in the other directions.
    """

    at: Place
    direction: str
    mass: float
    frequency: float
    crosswise: bool = True


@dataclass(frozen=True)
class MemberSet:
    """Members that belong together: a set of the user's, or all of one section or material.

    Arguments:
        name: of a set of `[[model.sets]]`; of a family a word of its own, e.g. ``section:tube``.
        members: their names.
    """

    name: str
    members: tuple[str, ...]


@dataclass(frozen=True)
class JointKind:
    """How the joints of a type are made, which says by how much their stiffness may be off."""

    type: str
    made: Made


@dataclass(frozen=True)
class Frame:
    """A frame of beams with everything that is attached to it.

    Arguments:
        rotary_inertia: whether rho I takes part, or a multiple of it; None follows the beam
            theory.
        bending_mass: ``shear-consistent`` takes the functions of the Timoshenko element (Friedman
            & Kosmatka 1993), Hermite's without shear; ``cubic`` takes these in every theory.
        gravity: multiple of the own weight, down along z, that acts on its stiffness.
        free: whether the structure is known to hang free, so that nothing may hold it.
        damping: of the whole frame; None where nothing is known of it.
        sets: named by the user.
        families: the members of every section and of every material, by the names that these have
            in the case; empty for a frame that was not read.
    """

    plane: Plane
    beam: BeamTheory
    joints: tuple[Joint, ...]
    members: tuple[Member, ...]
    masses: tuple[PointMass, ...] = ()
    springs: tuple[GroundSpring, ...] = ()
    supports: tuple[Support, ...] = ()
    joint_springs: tuple[JointSpring, ...] = ()
    rigid_ends: tuple[RigidEnd, ...] = ()
    links: tuple[Link, ...] = ()
    rotary_inertia: bool | float | None = None
    bending_mass: BendingMass = "shear-consistent"
    gravity: float = 0.0
    free: bool = False
    damping: Damping | None = None
    factors: tuple[Factor, ...] = ()
    preloads: tuple[Preload, ...] = ()
    eccentricities: tuple[Eccentricity, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    braces: tuple[Brace, ...] = ()
    oscillators: tuple[Oscillator, ...] = ()
    sets: tuple[MemberSet, ...] = ()
    families: tuple[MemberSet, ...] = field(default=(), compare=False)
    joint_kinds: tuple[JointKind, ...] = ()

    @property
    def rotary_share(self) -> float:
        """Return how much of rho I takes part in the mass matrix, 0 for none, 1 for all."""
        share = self.rotary_inertia
        return float(self.beam == "timoshenko" if share is None else share)

    @property
    def active(self) -> tuple[str, ...]:
        """Return the directions in which joints may move, of x, y, z, rx, ry, rz."""
        return ACTIVE[self.plane]

    @cached_property
    def joint_index(self) -> Mapping[str, int]:
        """Return the position of every joint in `joints`."""
        return {joint.name: i for i, joint in enumerate(self.joints)}

    @cached_property
    def member_index(self) -> Mapping[str, int]:
        """Return the position of every member in `members`."""
        return {member.name: i for i, member in enumerate(self.members)}

    @cached_property
    def corners(self) -> FloatArray:
        """Return the positions of the joints in m, (n_joints, 3)."""
        return np.array([joint.xyz for joint in self.joints], dtype=float)

    def __getstate__(self) -> dict[str, Any]:
        # A tree is made again where it is wanted.
        return {name: value for name, value in vars(self).items() if name != "corner_tree"}

    @cached_property
    def corner_tree(self) -> cKDTree:
        """Return where the joints lie, to look points up."""
        return cKDTree(self.corners)

    @cached_property
    def member_ends(self) -> IntArray:
        """Return the joint numbers of every member's ends, (n_members, 2)."""
        index = self.joint_index
        ends = (index[name] for member in self.members for name in member.ends)
        return np.fromiter(ends, dtype=np.int64).reshape(-1, 2)

    @cached_property
    def _ends(self) -> Mapping[str, tuple[str, ...]]:
        ends: dict[str, list[str]] = {}
        for member in self.members:
            for joint in dict.fromkeys(member.ends):
                ends.setdefault(joint, []).append(member.name)
        return {joint: tuple(members) for joint, members in ends.items()}

    @cached_property
    def joint_types(self) -> Mapping[str, tuple[str, ...]]:
        """Return from joint types to their joints; free ends and untyped joints are left out."""
        types: dict[str, list[str]] = {}
        for joint in self.joints:
            if joint.type and len(self.ends_at(joint.name)) > 1:
                types.setdefault(joint.type, []).append(joint.name)
        return {kind: tuple(names) for kind, names in types.items()}

    def joint(self, name: str) -> Joint:
        """Return the joint of that name; raises KeyError."""
        return self.joints[self.joint_index[name]]

    def member_length(self, name: str) -> float:
        """Return the distance of a member's two joints in m."""
        first, last = self.corners[self.member_ends[self.member_index[name]]]
        return float(np.linalg.norm(last - first))

    def ends_at(self, joint: str) -> tuple[str, ...]:
        """Return the names of the members that end at a joint."""
        return self._ends.get(joint, ())

    def with_attachments(
        self, masses: tuple[PointMass, ...], springs: tuple[GroundSpring, ...]
    ) -> Frame:
        """Return the frame with further masses and springs to ground."""
        return replace(self, masses=self.masses + masses, springs=self.springs + springs)
