"""Structures that blind cases are drawn on: nominal frame, measuring points, a known change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from femubench.core.errors import InputError
from femubench.core.fem.frame import (
    Frame,
    GroundSpring,
    Joint,
    Material,
    Member,
    Place,
    PointMass,
    Support,
)
from femubench.core.fem.mesh import place_xyz
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors

ALUMINIUM = Material(E=70e9, nu=0.33, rho=2700.0)
STEEL = Material(E=207e9, nu=0.3, rho=7850.0)


@dataclass(frozen=True)
class Specimen:
    """A structure as its owner has drawn it.

    Arguments:
        name: the word after ``bench challenge new --structure``.
        title: one line.
        frame: the nominal frame on its coarse mesh.
        points: from sensor label to place and direction.
        change: masses and springs of the known modification.
        change_name: its name.
    """

    name: str
    title: str
    frame: Frame
    points: Mapping[str, tuple[Place, str]]
    change: tuple[tuple[PointMass, ...], tuple[GroundSpring, ...]]
    change_name: str

    @cached_property
    def model(self) -> Model:
        """Return the nominal model."""
        return Model.of(self.frame)

    @cached_property
    def sensors(self) -> Sensors:
        """Return the measuring points on the nominal frame."""
        return sensors_on(self.frame, self.points)


def sensors_on(frame: Frame, points: Mapping[str, tuple[Place, str]]) -> Sensors:
    """Return the measuring points on a frame, which may differ from the nominal one."""
    xyz = np.array([place_xyz(frame, place) for place, _ in points.values()])
    return Sensors(tuple(points), xyz, tuple(direction for _, direction in points.values()))


def _at(word: str) -> Place:
    member, found, station = word.partition("@")
    return Place(member=member, s=float(station)) if found else Place(joint=word)


def _specimen(
    name: str, title: str, frame: Frame, words: Sequence[str], at: str, mass: float, spring: str
) -> Specimen:
    """Return a specimen whose known change is a mass (kg) and a spring (N/m) at mid-member.

    Arguments:
        at: the member, with its article where its name takes one.
    """
    middle = Place(member=at.removeprefix("the "), s=0.5)
    change = (PointMass(middle, mass),), (GroundSpring(middle, "z", float(spring)),)
    stated = f"{mass:g} kg and {spring} N/m at the middle of {at}"
    points = {}
    for i, word in enumerate(words):
        place, _, direction = word.partition(":")
        points[f"P{i + 1}{direction}"] = (_at(place), direction)
    return Specimen(name, title, frame, points, change, stated)


def _ladder(name: str, stretch: float = 1.0) -> Specimen:
    """Return the welded ladder, out of plane, free; 81 dofs.

    Source: geometry as in Ahmadian, Gladwell & Ismail (1997).

    Arguments:
        stretch: factor on the half side ``front-left``.
    """
    half, rung = 0.2921, 0.2794  # m, centre lines
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    joints = (
        Joint("J1", (2 * half, rung, 0.0), "L"),
        Joint("J3", (2 * half, 0.0, 0.0), "L"),
        Joint("J5", (half, 0.0, 0.0), "T"),
        Joint("J7", (half * (1.0 - stretch), 0.0, 0.0), "L"),
        Joint("J9", (0.0, rung, 0.0), "L"),
        Joint("J11", (half, rung, 0.0), "T"),
    )
    ends = {
        "rung-right": ("J1", "J3"),
        "front-right": ("J3", "J5"),
        "front-left": ("J5", "J7"),
        "rung-left": ("J7", "J9"),
        "back-left": ("J9", "J11"),
        "back-right": ("J11", "J1"),
        "rung-middle": ("J5", "J11"),
    }
    members = tuple(Member(key, pair, 4, tube, ALUMINIUM) for key, pair in ends.items())
    words = [f"{joint.name}:z" for joint in joints] + [f"{key}@0.5:z" for key in ends]
    frame = Frame("out-of-plane", "euler-bernoulli", joints, members)
    title = "Ladder frame, out of plane"
    return _specimen(name, title, frame, words, "front-left", 0.5, "1e6")


def _hframe(name: str) -> Specimen:
    """Return the H-frame, in plane, free; 99 dofs.

    Source: geometry as in Horton, Gurgenci, Veidt & Friswell (1999).
    """
    tube = Section.rectangular_tube(0.040, 0.040, 0.0025)
    joints = [Joint("T1", (0.0, 0.0, 0.0), "T"), Joint("T2", (0.74, 0.0, 0.0), "T")]
    members = [Member("horizontal", ("T1", "T2"), 8, tube, STEEL)]
    words = ["T1:x", "T1:z", "T2:z", *(f"horizontal@{s}:z" for s in (0.25, 0.5, 0.75))]
    for side, x in (("1", 0.0), ("2", 0.74)):
        low, high, joint = f"lower-end-{side}", f"upper-end-{side}", f"T{side}"
        joints += [Joint(low, (x, 0.0, -0.3)), Joint(high, (x, 0.0, 0.5))]
        members.append(Member(f"lower-{side}", (low, joint), 4, tube, STEEL))
        members.append(Member(f"upper-{side}", (joint, high), 8, tube, STEEL))
        words += [f"{low}:x", f"lower-{side}@0.5:x", f"{high}:x"]
        words += [f"upper-{side}@{s}:x" for s in (0.25, 0.5, 0.75)]
    frame = Frame("in-plane", "euler-bernoulli", tuple(joints), tuple(members))
    return _specimen(name, "H-frame, in plane", frame, words, "the horizontal", 1.0, "1e6")


def _portal(name: str) -> Specimen:
    """Return a two-storey portal on clamped feet, in plane; 78 dofs."""
    column = Section.rectangular_tube(0.040, 0.040, 0.003)
    beam = Section.rectangular_tube(0.030, 0.050, 0.003)
    joints = (
        Joint("A", (0.0, 0.0, 0.0), "foot"),
        Joint("B", (1.1, 0.0, 0.0), "foot"),
        Joint("C", (0.0, 0.0, 0.8), "T"),
        Joint("D", (1.1, 0.0, 0.8), "T"),
        Joint("E", (0.0, 0.0, 1.45), "L"),
        Joint("F", (1.1, 0.0, 1.45), "L"),
    )
    members = (
        Member("left-lower", ("A", "C"), 5, column, STEEL),
        Member("right-lower", ("B", "D"), 5, column, STEEL),
        Member("floor", ("C", "D"), 5, beam, STEEL),
        Member("left-upper", ("C", "E"), 4, column, STEEL),
        Member("right-upper", ("D", "F"), 4, column, STEEL),
        Member("roof", ("E", "F"), 5, beam, STEEL),
    )
    columns = ("left-lower", "right-lower", "left-upper", "right-upper")
    words = ["C:x", "E:x", *(f"{name}@0.5:x" for name in columns)]
    words += [f"{name}@{s}:z" for name in ("floor", "roof") for s in (0.25, 0.5, 0.75)]
    supports = tuple(Support(Place(joint=name), ("x", "z", "ry")) for name in "AB")
    frame = Frame("in-plane", "euler-bernoulli", joints, members, supports=supports)
    title = "Two-storey portal on clamped feet, in plane"
    return _specimen(name, title, frame, words, "the roof", 2.0, "2e5")


def _table(name: str) -> Specimen:
    """Return a table of four legs on hinged feet with a rail, in space; 168 dofs."""
    leg = Section.rectangular_tube(0.030, 0.030, 0.002)
    rim = Section.rectangular_tube(0.020, 0.040, 0.002)
    corners = {"1": (0.0, 0.0), "2": (0.9, 0.0), "3": (0.9, 0.6), "4": (0.0, 0.6)}
    joints = [Joint(f"F{k}", (x, y, 0.0), "foot") for k, (x, y) in corners.items()]
    joints += [Joint(f"C{k}", (x, y, 0.7), "corner") for k, (x, y) in corners.items()]
    joints += [Joint("R1", (0.35, 0.0, 0.7), "T"), Joint("R2", (0.35, 0.6, 0.7), "T")]
    members = [Member(f"leg-{k}", (f"F{k}", f"C{k}"), 3, leg, ALUMINIUM) for k in corners]
    rims = {
        "front-left": ("C1", "R1"),
        "front-right": ("R1", "C2"),
        "right": ("C2", "C3"),
        "back-right": ("C3", "R2"),
        "back-left": ("R2", "C4"),
        "left": ("C4", "C1"),
        "rail": ("R1", "R2"),
    }
    counts = {"front-left": 2, "front-right": 3, "back-right": 3, "back-left": 2}
    members += [Member(k, ends, counts.get(k, 3), rim, ALUMINIUM) for k, ends in rims.items()]
    words = [f"C{k}:{d}" for k in ("1", "3") for d in ("x", "y")]
    words += [f"leg-{k}@0.5:{d}" for k in corners for d in ("x", "y")]
    words += [f"{k}@0.5:z" for k in rims] + ["front-right@0.5:y", "right@0.5:x", "rail@0.5:x"]
    feet = tuple(Support(Place(joint=f"F{k}"), ("x", "y", "z")) for k in corners)
    frame = Frame("3d", "euler-bernoulli", tuple(joints), tuple(members), supports=feet)
    title = "Table on four hinged legs, in space"
    return _specimen(name, title, frame, words, "the rail", 0.5, "5e4")


# The names go into the seeds of hidden cases: another name is another draw.
_BUILDERS: Mapping[str, Callable[[str], Specimen]] = {
    "ladder": _ladder,
    "ladder-asymmetric": partial(_ladder, stretch=1.04),
    "hframe": _hframe,
    "portal": _portal,
    "table": _table,
}
STRUCTURES = tuple(_BUILDERS)


@lru_cache(maxsize=len(_BUILDERS))
def structure_named(name: str) -> Specimen:
    """Return a structure.

    Raises:
        InputError: for an unknown name.
    """
    if name not in _BUILDERS:
        expected = f"one of {', '.join(STRUCTURES)}"
        raise InputError(f"no structure {name!r}", key="structure", expected=expected)
    return _BUILDERS[name](name)
