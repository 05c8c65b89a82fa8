"""Frames of round tubes as plans: what an engineer draws, and beams three times finer of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import pi
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Plane = Literal["in-plane", "out-of-plane", "3d"]
E, NU, RHO = 2.1e11, 0.3, 7850.0
FINER = 3
# Directions that a plane leaves free: x, y, z, rx, ry, rz from 1.
FREE = {"in-plane": (1, 3, 5), "out-of-plane": (3, 4, 5), "3d": (1, 2, 3, 4, 5, 6)}
AXES = "xyz"


@dataclass(frozen=True)
class Tube:
    """A round tube: diameter and wall in m."""

    diameter: float
    wall: float

    @property
    def area(self) -> float:
        """Return the area in m2."""
        return pi * self.wall * (self.diameter - self.wall)

    @property
    def inertia(self) -> float:
        """Return the second moment of area in m4; the torsion constant is twice that."""
        inner = self.diameter - 2.0 * self.wall
        return pi / 64.0 * (self.diameter**4 - inner**4)


@dataclass(frozen=True)
class Bar:
    """A member between two joints, drawn with some elements."""

    name: str
    ends: tuple[str, str]
    tube: str
    elements: int = 4


@dataclass(frozen=True)
class Plan:
    """What an engineer draws.

    Arguments:
        name, title: of the structure.
        plane: as in case.toml.
        joints: position in m and type of each.
        tubes: by name.
        bars: the members.
        clamped: joints.
        sensors: joints or ``bar@s``, and the directions that are read there.
        used, held_out: numbers of modes.
    """

    name: str
    title: str
    plane: Plane
    joints: Mapping[str, tuple[tuple[float, float, float], str]]
    tubes: Mapping[str, Tube]
    bars: tuple[Bar, ...]
    clamped: tuple[str, ...]
    sensors: tuple[tuple[str, str], ...]
    used: int = 6
    held_out: int = 4

    def bar(self, name: str) -> Bar:
        """Return a member by its name."""
        return next(bar for bar in self.bars if bar.name == name)

    def along(self, bar: Bar) -> Array:
        """Return the vector from one end to the other in m."""
        first, last = (np.array(self.joints[end][0]) for end in bar.ends)
        return np.asarray(last - first)

    def length(self, bar: Bar) -> float:
        """Return the length in m."""
        return float(np.linalg.norm(self.along(bar)))

    def ends_at(self, joint: str) -> int:
        """Return how many members end at a joint."""
        return sum(joint in bar.ends for bar in self.bars)

    @property
    def mass(self) -> float:
        """Return the mass in kg."""
        return sum(RHO * self.tubes[b.tube].area * self.length(b) for b in self.bars)

    @property
    def extent(self) -> float:
        """Return the longest side of the box around it in m."""
        return float(np.ptp([xyz for xyz, _ in self.joints.values()], axis=0).max())

    @property
    def labels(self) -> list[tuple[str, str, str]]:
        """Return label, place and direction of every sensor."""
        return [
            (f"{number}{direction.upper()}", at, direction)
            for number, (at, directions) in enumerate(self.sensors, 1)
            for direction in directions
        ]


@dataclass
class Beams:
    """Beams three times finer than the plan, as they are handed to OpenSees.

    Arguments:
        plan: what they are cut from.
        nodes: positions, m.
        fixed: six flags a node.
        elements: properties of every beam.
        of: numbers of the beams of every member, from its first end on.
        joints: node of every joint.
        masses: node and kg.
        hinges: two nodes in one place, and the springs between them by direction; all other
            directions are rigid.
        grounds: a node, and its springs to the ground by direction.
        struts: two nodes, N/m and m.
    """

    plan: Plan
    nodes: list[list[float]] = field(default_factory=list)
    fixed: list[list[int]] = field(default_factory=list)
    elements: list[dict[str, Any]] = field(default_factory=list)
    of: dict[str, list[int]] = field(default_factory=dict)
    joints: dict[str, int] = field(default_factory=dict)
    masses: list[tuple[int, float]] = field(default_factory=list)
    hinges: list[tuple[int, int, dict[str, float]]] = field(default_factory=list)
    grounds: list[tuple[int, dict[str, float]]] = field(default_factory=list)
    struts: list[tuple[int, int, float, float]] = field(default_factory=list)

    def add_node(self, xyz: Iterable[float], clamped: bool = False) -> int:
        """Return the number of a new node."""
        free = () if clamped else FREE[self.plan.plane]
        self.nodes.append([float(value) for value in xyz])
        self.fixed.append([int(d not in free) for d in range(1, 7)])
        return len(self.nodes) - 1

    def node(self, at: str) -> int:
        """Return the node at a joint, or at ``bar@s``."""
        name, _, station = at.partition("@")
        if not station:
            return self.joints[name]
        numbers = self.of[name]
        position = round(float(station) * len(numbers))
        ends = [self.elements[i]["ends"] for i in numbers]
        return int([*(end[0] for end in ends), ends[-1][1]][position])

    def part(self, bar: str, joint: str) -> tuple[int, int]:
        """Part the end of a member from its joint; return the two nodes."""
        first = self.plan.bar(bar).ends[0] == joint
        element = self.elements[self.of[bar][0 if first else -1]]
        old = element["ends"][0 if first else 1]
        new = self.add_node(self.nodes[old])
        element["ends"][0 if first else 1] = new
        return old, new

    def frame(self, count: int) -> dict[str, Any]:
        """Return what the solver reads."""
        parts = ("nodes", "fixed", "elements", "masses", "hinges", "grounds", "struts")
        return {**{part: getattr(self, part) for part in parts}, "count": count}


def cut(plan: Plan) -> Beams:
    """Return the beams of a sound structure."""
    beams = Beams(plan)
    for name, (xyz, _) in plan.joints.items():
        beams.joints[name] = beams.add_node(xyz, clamped=name in plan.clamped)
    for bar in plan.bars:
        tube, along = plan.tubes[bar.tube], plan.along(bar)
        start = np.array(plan.joints[bar.ends[0]][0])
        count = FINER * bar.elements
        inside = [beams.add_node(start + along * i / count) for i in range(1, count)]
        chain = [beams.joints[bar.ends[0]], *inside, beams.joints[bar.ends[1]]]
        upright = abs(along[2]) > 0.9 * plan.length(bar)
        properties = {
            "A": tube.area,
            "E": E,
            "G": E / (2.0 * (1.0 + NU)),
            "I": tube.inertia,
            "J": 2.0 * tube.inertia,
            "rhoA": RHO * tube.area,
            "up": [1.0, 0.0, 0.0] if upright else [0.0, 0.0, 1.0],
        }
        beams.of[bar.name] = list(range(len(beams.elements), len(beams.elements) + count))
        beams.elements += [{**properties, "ends": list(pair)} for pair in pairwise(chain)]
    return beams


def _portal() -> Plan:
    joints = {
        **{f"foot-{i}": ((x, 0.0, 0.0), "foot") for i, x in enumerate((0.0, 1.5, 2.7), 1)},
        **{
            f"head-{i}": ((x, 0.0, 1.1), "tee" if i == 2 else "corner")
            for i, x in enumerate((0.0, 1.5, 2.7), 1)
        },
    }
    posts = tuple(Bar(f"post-{i}", (f"foot-{i}", f"head-{i}"), "post") for i in (1, 2, 3))
    beams = (
        Bar("beam-1", ("head-1", "head-2"), "beam"),
        Bar("beam-2", ("head-2", "head-3"), "beam"),
    )
    sensors = (
        *(("head-1", "xz"), ("head-2", "x"), ("head-3", "xz")),
        *((f"post-{i}@0.5", "x") for i in (1, 2, 3)),
        *((f"beam-{i}@{s}", "z") for i in (1, 2) for s in (0.25, 0.5, 0.75)),
    )
    tubes = {"post": Tube(0.0483, 0.0032), "beam": Tube(0.0603, 0.0029)}
    feet = ("foot-1", "foot-2", "foot-3")
    title = "Portal of two unequal bays of round tubes, clamped, in its plane"
    return Plan("two-bay-portal", title, "in-plane", joints, tubes, (*posts, *beams), feet, sensors)


def _ladder() -> Plan:
    stations = (0.0, 0.42, 0.88, 1.3, 1.6)
    joints = {
        f"{side}-{i}": ((x, y, 0.0), "root" if i == 0 else ("corner" if i == 4 else "tee"))
        for side, y in (("left", 0.0), ("right", 0.36))
        for i, x in enumerate(stations)
    }
    rails = tuple(
        Bar(f"{side}-rail-{i}", (f"{side}-{i - 1}", f"{side}-{i}"), "rail", 3)
        for side in ("left", "right")
        for i in range(1, 5)
    )
    rungs = tuple(Bar(f"rung-{i}", (f"left-{i}", f"right-{i}"), "rung", 3) for i in range(1, 5))
    sensors = tuple((f"{side}-{i}", "z") for side in ("left", "right") for i in range(1, 5))
    sensors += tuple((f"rung-{i}@{1 / 3:.6f}", "z") for i in (2, 4))
    sensors += tuple((f"{side}-rail-4@{1 / 3:.6f}", "z") for side in ("left", "right"))
    tubes = {"rail": Tube(0.0337, 0.0026), "rung": Tube(0.0269, 0.0023)}
    title = "Ladder of round tubes with uneven rungs, clamped at one end, out of its plane"
    return Plan(
        "cantilever-ladder",
        title,
        "out-of-plane",
        joints,
        tubes,
        (*rails, *rungs),
        ("left-0", "right-0"),
        sensors,
    )


def _tower() -> Plan:
    plan = {"A": (0.0, 0.0), "B": (0.8, 0.0), "C": (0.9, 0.6), "D": (0.0, 0.6)}
    joints = {
        **{f"{k}0": ((x, y, 0.0), "foot") for k, (x, y) in plan.items()},
        **{f"{k}1": ((x, y, 0.7), "corner") for k, (x, y) in plan.items()},
        "tip": ((1.4, 0.0, 0.7), "tip"),
    }
    legs = tuple(Bar(f"leg-{k}", (f"{k}0", f"{k}1"), "leg", 3) for k in plan)
    ring = tuple(
        Bar(f"ring-{a}{b}", (f"{a}1", f"{b}1"), "ring", 3) for a, b in ("AB", "BC", "CD", "DA")
    )
    arm = Bar("arm", ("B1", "tip"), "ring", 3)
    sensors = (
        *((f"{k}1", "xyz") for k in plan),
        ("tip", "yz"),
        *((f"leg-{k}@{1 / 3:.6f}", "xy") for k in plan),
        (f"ring-CD@{2 / 3:.6f}", "yz"),
    )
    tubes = {"leg": Tube(0.0424, 0.0026), "ring": Tube(0.0337, 0.0026)}
    title = "Tower of four legs with a ring and an arm, of round tubes, clamped"
    return Plan(
        *("arm-tower", title, "3d", joints, tubes, (*legs, *ring, arm)),
        tuple(f"{k}0" for k in plan),
        sensors,
    )


def plans() -> dict[str, Plan]:
    """Return the structures by name."""
    return {plan.name: plan for plan in (_portal(), _ladder(), _tower())}
