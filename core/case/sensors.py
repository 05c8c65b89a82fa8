"""Read the table of sensors: at coordinates or at places of the structure."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femubench.core.case.faults import Misfit, WrongDirection
from femubench.core.case.frames import Site
from femubench.core.case.matching import Alignment, Placed, Placement, describe_matches
from femubench.core.case.tables import RESERVED, CsvRow, parse_place, read_table
from femubench.core.errors import InputError
from femubench.core.fem.frame import Vector
from femubench.core.fem.sensors import Sensors
from femubench.core.typing import FloatArray

_MOST_SENSORS = 50_000


def read_sensors(file: Path, site: Site, alignment: Alignment) -> Placed:
    """Return the sensors of a CSV file on the structure.

    Arguments:
        file: label,x,y,z,direction or label,at,direction.
        alignment: of coordinates and their directions; a unit that it lacks is seen.

    Raises:
        InputError: for a duplicate label, a sensor off the structure, an impossible direction.
    """
    table = read_table(file)
    by_place = "at" in table.columns
    place = ("at",) if by_place else ("x", "y", "z")
    table.check_columns(("label", *place, "direction"))
    if len(table.rows) > _MOST_SENSORS:
        raise InputError("too many sensors", file=file, expected=f"at most {_MOST_SENSORS}")
    labels: dict[str, None] = {}
    rows = [row for row in table.rows if row.cells["label"] not in alignment.without]
    for row in rows:
        label = row.text("label")
        if label in labels or label in RESERVED:
            what = f"{label!r} is listed twice" if label in labels else f"{label!r} is reserved"
            raise row.error("label", what, "a label of its own")
        labels[label] = None
    if not labels:
        raise InputError("no sensors", file=file, expected="a row for every sensor")
    directions = [row.direction() for row in rows]
    if by_place:
        pairs = zip(rows, directions, strict=True)
        points = [_point_at(row, way, site) for row, way in pairs]
        return Placed(
            Sensors(tuple(labels), np.array(points, dtype=float), tuple(directions)),
            (),
            (),
            alignment,
        )
    every = np.array([row.vector() for row in rows], dtype=float)
    test = Placement(site, alignment, every, tuple(labels), tuple(directions))
    test, taken = test.in_its_unit(file.name)
    matches = tuple(test.match_labels(test.labels))
    for row, match in zip(rows, matches, strict=True):
        try:
            test.check_near(match)
        except Misfit as misfit:
            raise misfit.at(file, row.line, "x") from None
    directions = [alignment.direction(way) for way in directions]
    for row, match, way in zip(rows, matches, directions, strict=True):
        _check_sensor(row, match.xyz, way, site, "x")
    try:
        close = test.check_span(matches, file.name)
        test.check_apart(list(zip(matches, directions, strict=True)))
    except Misfit as misfit:
        raise misfit.at(file) from None
    xyz = np.array([match.xyz for match in matches], dtype=float)
    sensors = Sensors(tuple(labels), xyz, tuple(directions))
    return Placed(
        sensors, matches, (*taken, *close, *describe_matches(matches, file.name)), test.alignment
    )


def _point_at(row: CsvRow, direction: str, site: Site) -> Vector:
    try:
        xyz = site.point(parse_place(row.text("at")))
    except Misfit as misfit:
        what = f"sensor {row.cells['label']!r}: {misfit.what}"
        raise row.error("at", what, misfit.expected) from None
    _check_sensor(row, np.array(xyz), direction, site, "at")
    return xyz


def _check_sensor(row: CsvRow, xyz: FloatArray, direction: str, site: Site, column: str) -> None:
    x, y, z = (float(v) for v in xyz)
    try:
        site.check_sensor((x, y, z), direction)
    except Misfit as misfit:
        what = f"sensor {row.cells['label']!r}: {misfit.what}"
        faulty = "direction" if isinstance(misfit, WrongDirection) else column
        raise row.error(faulty, what, misfit.expected) from None
