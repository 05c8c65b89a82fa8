"""The aeroplane of the GARTEUR action group 19, as cards and as a frame from the same facts.

Balmes & Wright (DETC'97 / IMAC 1997), without the layer on the wing. Run it to write
`tests/bulk_data/garteur.bdf`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femubench.fem import (
    Frame,
    GroundSpring,
    Joint,
    Link,
    Material,
    Member,
    Place,
    PointMass,
    Section,
)

FILE = Path(__file__).parent / "bulk_data" / "garteur.bdf"
E, NU, RHO = 72e9, 0.3, 2700.0
CORD = 9200.0  # N/m, a bounce of 2.3 Hz


Point = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """A solid bar: its stations in mm, and its size along the vector `wide` and across it."""

    name: str
    points: Sequence[Point]
    width: float
    height: float
    wide: Point


def _along(axis: int, stations: Sequence[float], at: Sequence[float]) -> list[Point]:
    """Return points on a line along an axis, the other two coordinates given."""
    points: list[Point] = []
    for station in stations:
        x, y, z = np.insert(np.array(at, dtype=float), axis, station).tolist()
        points.append((x, y, z))
    return points


_HALF = (200.0, 400.0, 600.0, 800.0, 950.0, 1000.0)
_WING = (*(-s for s in reversed(_HALF)), 0.0, *_HALF)
_DRUM = (-200.0, -100.0, 0.0, 100.0, 180.0, 200.0)
PARTS = (
    Part("fuselage", _along(0, (600, 300, 0, -290, -600, -850, -900), (0, 0)), 50, 150, (0, 1, 0)),
    Part("wing", _along(1, _WING, (0, 96)), 100, 10, (1, 0, 0)),
    Part("drum left", _along(0, _DRUM, (950, 106)), 100, 10, (0, 1, 0)),
    Part("drum right", _along(0, _DRUM, (-950, 106)), 100, 10, (0, 1, 0)),
    Part("fin", _along(2, (50, 150, 250, 350), (-850, 0)), 100, 10, (1, 0, 0)),
    Part("tailplane", _along(1, (-200, -100, 0, 100, 200), (-850, 355)), 100, 10, (1, 0, 0)),
)
LINKS = (
    ((0, 0, 0), (0, 0, 96)),
    ((0, 950, 96), (0, 950, 106)),
    ((0, -950, 96), (0, -950, 106)),
    ((-850, 0, 0), (-850, 0, 50)),
    ((-850, 0, 350), (-850, 0, 355)),
)
MASSES = (  # kg, at, offset
    (0.2, (180, 950, 106), (0, -30, 0)),
    (0.2, (180, -950, 106), (0, 30, 0)),
    (1.143, (0, 0, 96), (0, 0, 0)),
    (0.353, (-850, 0, 350), (0, 0, 0)),
)
HUNG = (-290, 0, 0)


def grids() -> dict[Point, int]:
    """Return the number of the grid at every point: hundreds count the parts."""
    return {
        (float(x), float(y), float(z)): 100 * i + k
        for i, part in enumerate(PARTS, 1)
        for k, (x, y, z) in enumerate(part.points, 1)
    }


def bars() -> Iterator[tuple[int, int, int, int]]:
    """Yield number, property and grids of every bar."""
    for i, part in enumerate(PARTS, 1):
        for k in range(1, len(part.points)):
            yield 100 * i + k, i, 100 * i + k, 100 * i + k + 1


def cards() -> str:
    """Return the aeroplane in mm, t, N: grids in large, bars in small, the rest in free fields."""
    number = grids()
    lines = ["$ GARTEUR SM-AG19 without the layer on the wing; mm, t, N", "SOL 103", "CEND"]
    lines += ["METHOD = 1", "BEGIN BULK", "EIGRL,1,,,20", "PARAM,COUPMASS,1"]
    for (x, y, z), n in number.items():
        lines += [f"GRID*   {n:>16}{'':16}{x:>16}{y:>16}", f"*       {z:>16}"]
    for bar, i, first, last in bars():
        v = "".join(f"{float(c):>8}" for c in PARTS[i - 1].wide)
        lines.append(f"CBAR    {bar:>8}{i:>8}{first:>8}{last:>8}{v}")
    for i, part in enumerate(PARTS, 1):
        lines += [f"$ {part.name}", f"PBARL,{i},1,,BAR,,,,,+"]
        lines.append(f"+,{float(part.height)},{float(part.width)}")
    lines.append(f"MAT1,1,{E / 1e6},,{NU},2.7-9")
    for i, (leads, follows) in enumerate(LINKS, 1):
        lines.append(f"RBE2,{900 + i},{number[leads]},123456,{number[follows]}")
    for i, (mass, at, offset) in enumerate(MASSES, 1):
        x, y, z = (float(c) for c in offset)
        lines.append(f"CONM2,{910 + i},{number[at]},,{mass / 1e3},{x},{y},{z}")
    lines.append(f"CELAS2,920,{CORD / 1e3},{number[HUNG]},3")
    return "\n".join([*lines, "ENDDATA", ""])


def frame() -> Frame:
    """Return the aeroplane in SI, built here and not read from cards."""
    number = grids()
    metal = Material(E, NU, RHO)

    members = []
    for bar, i, first, last in bars():
        part = PARTS[i - 1]
        section = Section.solid_rectangle(part.width / 1e3, part.height / 1e3)
        up = (0.0, 1.0, 0.0) if part.name == "fin" else (0.0, 0.0, 1.0)
        members.append(Member(f"E{bar}", (str(first), str(last)), 1, section, metal, up))
    return Frame(
        plane="3d",
        beam="timoshenko",
        joints=tuple(Joint(str(n), (x / 1e3, y / 1e3, z / 1e3)) for (x, y, z), n in number.items()),
        members=tuple(members),
        masses=tuple(
            PointMass(Place(joint=str(number[at])), mass, (x / 1e3, y / 1e3, z / 1e3))
            for mass, at, (x, y, z) in MASSES
        ),
        springs=(GroundSpring(Place(joint=str(number[HUNG])), "z", CORD),),
        links=tuple(Link(str(number[one]), (str(number[other]),)) for one, other in LINKS),
    )


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(cards())
