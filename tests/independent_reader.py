"""A second, small reader of planar case folders, written from the format's description alone.

It shares nothing with femubench: plain 2-D elements whose stiffness comes from the flexibility of
a cantilever, masses by numerical integration, dense matrices, dofs numbered by hand.
"""

from __future__ import annotations

import csv
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

PLANES = {"out-of-plane": ("z", "rx", "ry"), "in-plane": ("x", "z", "ry")}
Matrix = Any


@dataclass
class Rod:
    """One element: its two nodes, its constants, where it lies on its member."""

    start: int
    stop: int
    member: str
    span: tuple[float, float]
    constants: dict[str, float]


@dataclass
class Net:
    """Nodes by position, elements, and the global matrices while they fill up."""

    plane: str
    points: list[tuple[float, float, float]] = field(default_factory=list)
    rods: list[Rod] = field(default_factory=list)


class IndependentCase:
    """Frequencies and sensor readings of a planar case folder."""

    def __init__(self, folder: Path, modification: int | None = None) -> None:
        self.folder = folder
        self.text = tomllib.loads((folder / "case.toml").read_text())
        self.model = self.text["model"]
        self.plane = self.model["plane"]
        self.names = PLANES[self.plane]
        extra = {} if modification is None else self.text["modification"][modification]
        self.masses = self.model.get("masses", []) + extra.get("masses", [])
        self.springs = self.model.get("springs", []) + extra.get("springs", [])
        self.supports = self.model.get("supports", [])
        self.net = Net(self.plane)
        self.node_of: dict[Any, int] = {}
        self.mesh()
        self.solve()

    # -- mesh ----------------------------------------------------------------------------------

    def mesh(self) -> None:
        self.corner = {}
        for joint in self.model["joints"]:
            self.corner[joint["name"]] = np.array(joint["xyz"], dtype=float)
            self.net.points.append(tuple(joint["xyz"]))
            self.node_of[joint["name"]] = len(self.net.points) - 1
        cuts: dict[str, set[float]] = {}
        for item in self.masses + self.springs + self.supports:
            if isinstance(item["at"], dict):
                cuts.setdefault(item["at"]["member"], set()).add(float(item["at"]["s"]))
        for member in self.model["members"]:
            self.cut(member, cuts.get(member["name"], set()))

    def cut(self, member: dict[str, Any], cuts: set[float]) -> None:
        n = member["elements"]
        stations = [i / n for i in range(n + 1)]
        stations += [s for s in cuts if all(abs(s - t) > 1e-9 for t in stations)]
        stations.sort()
        first, last = (self.corner[name] for name in member["ends"])
        nodes = []
        for s in stations:
            if s == 0.0 or s == 1.0:
                nodes.append(self.node_of[member["ends"][int(s)]])
            else:
                self.net.points.append(tuple(first + s * (last - first)))
                nodes.append(len(self.net.points) - 1)
            self.node_of[member["name"], round(s, 9)] = nodes[-1]
        for k in range(len(nodes) - 1):
            span = (stations[k], stations[k + 1])
            rod = Rod(nodes[k], nodes[k + 1], member["name"], span, self.constants(member))
            self.net.rods.append(rod)

    def constants(self, member: dict[str, Any]) -> dict[str, float]:
        material = self.model["materials"][member["material"]]
        E, nu, rho = (float(material[key]) for key in ("E", "nu", "rho"))
        G = E / (2 * (1 + nu))
        s = section_numbers(self.model["sections"][member["section"]], nu)
        timoshenko = self.model["beam"] == "timoshenko"
        return {
            "EA": E * s["A"],
            "EI": E * s["Iy"],
            "GJ": G * s["J"],
            "shear": 1 / (s["kappa"] * G * s["A"]) if timoshenko else 0.0,
            "rhoA": rho * s["A"],
            "rhoJp": rho * s["Jp"],
            "rhoI": rho * s["Iy"] if timoshenko else 0.0,
        }

    def node(self, at: Any) -> int:
        if isinstance(at, str):
            return self.node_of[at]
        return self.node_of[at["member"], round(float(at["s"]), 9)]

    # -- matrices ------------------------------------------------------------------------------

    def solve(self) -> None:
        size = 3 * len(self.net.points)
        K, M = np.zeros((size, size)), np.zeros((size, size))
        for rod in self.net.rods:
            T, L = self.turn(rod)
            k = T.T @ local_stiffness(rod.constants, L, self.plane) @ T
            m = T.T @ local_mass(rod.constants, L, self.plane) @ T
            dofs = [3 * rod.start + i for i in range(3)] + [3 * rod.stop + i for i in range(3)]
            for a in range(6):
                for b in range(6):
                    K[dofs[a], dofs[b]] += k[a, b]
                    M[dofs[a], dofs[b]] += m[a, b]
        for item in self.masses:
            d = 3 * self.node(item["at"])
            lever = self.lever(item.get("offset", [0.0, 0.0, 0.0]))
            M[d : d + 3, d : d + 3] += float(item["mass"]) * lever.T @ lever
        for item in self.springs:
            direction = item["direction"].lstrip("-+")
            d = 3 * self.node(item["at"]) + self.names.index(direction)
            K[d, d] += float(item["stiffness"])
        held = {
            3 * self.node(item["at"]) + self.names.index(name)
            for item in self.supports
            for name in item["fixed"]
        }
        self.free = [i for i in range(size) if i not in held]
        grid = np.ix_(self.free, self.free)
        self.values, vectors = scipy.linalg.eigh(K[grid], M[grid])
        self.shapes = np.zeros((size, len(self.free)))
        self.shapes[self.free] = vectors
        self.frequencies = np.sqrt(np.maximum(self.values, 0.0)) / (2 * math.pi)

    def lever(self, offset: list[float]) -> Matrix:
        dx, dy, dz = (float(v) for v in offset)
        if self.plane == "in-plane":
            return np.array([[1.0, 0.0, dz], [0.0, 1.0, -dx]])
        return np.array([[1.0, dy, -dx]])

    def turn(self, rod: Rod) -> tuple[Matrix, float]:
        """Return the matrix to local dofs, (along, across, slope) or (across, twist, slope)."""
        step = np.subtract(self.net.points[rod.stop], self.net.points[rod.start])
        L = float(np.linalg.norm(step))
        if self.plane == "in-plane":
            c, s = step[0] / L, step[2] / L
            block = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, -1.0]])
        else:
            c, s = step[0] / L, step[1] / L
            # The slope along the member is minus the rotation about its local y axis.
            block = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, s, -c]])
        return scipy.linalg.block_diag(block, block), L

    # -- sensors -------------------------------------------------------------------------------

    def readings(self) -> Matrix:
        """Return the sensors' readings of all modes, (n_sensors, m)."""
        with (self.folder / self.text["measurement"]["sensors"]).open() as stream:
            rows = list(csv.DictReader(stream))
        return np.array([self.reading(row) for row in rows])

    def reading(self, row: dict[str, str]) -> Matrix:
        direction = row["direction"]
        sign = -1.0 if direction.startswith("-") else 1.0
        index = self.names.index(direction.lstrip("-+"))
        if row.get("at"):
            return sign * self.shapes[3 * self.node_of[row["at"]] + index]
        point = np.array([float(row[axis]) for axis in "xyz"])
        for rod in self.net.rods:
            a, b = (np.array(self.net.points[i]) for i in (rod.start, rod.stop))
            along = float((point - a) @ (b - a) / ((b - a) @ (b - a)))
            if -1e-9 <= along <= 1 + 1e-9 and np.linalg.norm(a + along * (b - a) - point) < 1e-6:
                T, L = self.turn(rod)
                lag = rod.constants["EI"] * rod.constants["shear"]
                local = interpolation(along * L, L, self.plane, lag)
                back = T[:3, :3].T  # orthogonal
                dofs = [3 * rod.start + i for i in range(3)] + [3 * rod.stop + i for i in range(3)]
                return sign * (back @ local @ T @ self.shapes[dofs])[index]
        raise ValueError(f"sensor {row['label']} lies on no member")


def section_numbers(section: dict[str, Any], nu: float) -> dict[str, float]:
    """Return A, Iy, J, Jp and kappa of a section given by a shape or by numbers."""
    shape = section.get("shape")
    if shape is None:
        return {key: float(section.get(key, 1.0)) for key in ("A", "Iy", "J", "Jp", "kappa")}
    if shape in ("round-tube", "solid-circle"):
        R = section["diameter"] / 2
        r = R - section["wall"] if shape == "round-tube" else 0.0
        polar, m2 = math.pi / 2 * (R**4 - r**4), (r / R) ** 2
        top = 6 * (1 + nu) * (1 + m2) ** 2
        kappa = top / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        return {"A": math.pi * (R * R - r * r), "Iy": polar / 2, "J": polar, "Jp": polar,
                "kappa": kappa}  # fmt: skip
    width = section["width"]
    height = section.get("height", width)
    if shape in ("square-tube", "rectangular-tube"):
        t = section["wall"]
        w, h = width - 2 * t, height - 2 * t
        b, d = width - t, height - t  # centre lines
        n = b / d
        bottom = 12 + 72 * n + 150 * n**2 + 90 * n**3
        bottom += nu * (11 + 66 * n + 135 * n**2 + 90 * n**3)
        bottom += 10 * n**2 * ((3 + nu) * n + 3 * n**2)
        Iy, Iz = (width * height**3 - w * h**3) / 12, (height * width**3 - h * w**3) / 12
        return {"A": width * height - w * h, "Iy": Iy, "J": 4 * (b * d) ** 2 * t / (2 * (b + d)),
                "Jp": Iy + Iz, "kappa": 10 * (1 + nu) * (1 + 3 * n) ** 2 / bottom}  # fmt: skip
    long, short = max(width, height), min(width, height)
    series = sum(math.tanh(k * math.pi * long / 2 / short) / k**5 for k in range(1, 80, 2))
    J = long * short**3 / 3 * (1 - 192 / math.pi**5 * short / long * series)
    Iy, Iz = width * height**3 / 12, height * width**3 / 12
    kappa = 10 * (1 + nu) / (12 + 11 * nu)
    return {"A": width * height, "Iy": Iy, "J": J, "Jp": Iy + Iz, "kappa": kappa}


def local_stiffness(c: dict[str, float], L: float, plane: str) -> Matrix:
    """Return the stiffness from the flexibility of a cantilever and from equilibrium."""
    bending = [
        [L**3 / 3 / c["EI"] + c["shear"] * L, L**2 / 2 / c["EI"]],
        [L**2 / 2 / c["EI"], L / c["EI"]],
    ]
    if plane == "in-plane":  # along, across, slope
        flexibility = scipy.linalg.block_diag(L / c["EA"], bending)
        statics = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, -L, -1.0]])
    else:  # across, twist, slope
        flexibility = np.zeros((3, 3))
        flexibility[np.ix_([0, 2], [0, 2])] = bending
        flexibility[1, 1] = L / c["GJ"]
        statics = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [-L, 0.0, -1.0]])
    far = np.linalg.inv(flexibility)
    both = np.vstack([statics, np.eye(3)])  # forces at both ends from those at the far one
    return both @ far @ both.T


def interpolation(x: float, L: float, plane: str, lag: float = 0.0) -> Matrix:
    """Return local displacements at x from the local dofs of both ends, (3, 6).

    Without load between its ends a beam has a cubic deflection w, and since its shear force is
    -EI w''', its section turns by w' + lag w''' with lag = EI / (kappa G A).
    """

    def turned(at: float) -> list[float]:
        return [0.0, 1.0, 2.0 * at, 3.0 * at**2 + 6.0 * lag]

    powers = np.array([[1.0, 0.0, 0.0, 0.0], turned(0.0), [1.0, L, L**2, L**3], turned(L)])
    cubic = np.linalg.inv(powers)  # coefficients from (w, rotation) at both ends
    across = np.array([1, x, x**2, x**3]) @ cubic
    slope = np.array(turned(x)) @ cubic
    linear = np.array([1 - x / L, x / L])
    rows = np.zeros((3, 6))
    w, s, other = (1, 2, 0) if plane == "in-plane" else (0, 2, 1)
    rows[w, [w, s, 3 + w, 3 + s]] = across
    rows[s, [w, s, 3 + w, 3 + s]] = slope
    rows[other, [other, 3 + other]] = linear
    return rows


def local_mass(c: dict[str, float], L: float, plane: str) -> Matrix:
    """Return the mass by five-point Gauss integration of the interpolation."""
    if plane == "in-plane":
        density = np.diag([c["rhoA"], c["rhoA"], c["rhoI"]])
    else:
        density = np.diag([c["rhoA"], c["rhoJp"], c["rhoI"]])
    mass = np.zeros((6, 6))
    for t, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
        rows = interpolation(L * (t + 1) / 2, L, plane, c["EI"] * c["shear"])
        mass += weight * L / 2 * rows.T @ density @ rows
    return mass
