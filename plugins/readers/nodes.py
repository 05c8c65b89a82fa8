"""Read the nodes of input files of CalculiX and Abaqus."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from femubench import InputError

_LARGEST = 256 * 2**20  # bytes
_DEEPEST = 8  # files that include each other
Point = tuple[float, float, float]
Line = tuple[Path, int, str]


def read_nodes(path: Path) -> dict[str, Point]:
    """Return the places of the nodes below all *NODE keywords, in the units of the file.

    Raises:
        InputError: for a line that is no node, a node at two places, no node at all.
    """
    nodes: dict[str, Point] = {}
    inside = False
    for file, number, line in read_lines(path):
        if line.startswith("*"):
            keyword, _, options = line[1:].upper().replace(" ", "").partition(",")
            inside = keyword == "NODE"
            if inside and "SYSTEM=" in options and "SYSTEM=R" not in options:
                what = "nodes in cylindrical or spherical coordinates"
                raise InputError(what, file=file, line=number, expected="x, y, z")
            continue
        if not inside:
            continue
        cells = [cell.strip() for cell in line.split(",")]
        try:
            name = str(int(cells[0]))
            x, y, z = (float(cell or 0.0) for cell in (*cells[1:4], "", "", "")[:3])
        except ValueError:
            what, expected = f"{line[:40]!r} is no node", "number, x, y, z"
            raise InputError(what, file=file, line=number, expected=expected) from None
        if nodes.setdefault(name, (x, y, z)) != (x, y, z):
            what = f"node {name} lies at two places"
            raise InputError(what, file=file, line=number, expected="one place")
    if not nodes:
        raise InputError("no *NODE", file=path, expected="an input file with nodes")
    return nodes


def list_included(path: Path) -> tuple[Path, ...]:
    """Return the files that an input file includes, in order, each once."""
    found = dict.fromkeys(file for file, _, _ in read_lines(path))
    return tuple(file for file in found if file != path)


def read_lines(path: Path, above: Path | None = None, depth: int = 0) -> Iterator[Line]:
    """Return file, number and text of every line that says something, included ones in place.

    Arguments:
        above: the folder that included files must lie in; None for that of the file.
        depth: of the file among those that include each other.
    """
    above = path.parent.resolve() if above is None else above
    found = path.resolve()
    if depth > _DEEPEST or not found.is_relative_to(above):
        what = (
            "includes itself" if depth > _DEEPEST else "leads out of the folder of the input file"
        )
        raise InputError(what, file=path, expected="files next to the input file")
    if not found.is_file() or found.stat().st_size > _LARGEST:
        what = "is too large" if found.is_file() else "is not there"
        raise InputError(what, file=path, expected="a file of at most 256 MiB")
    for number, line in enumerate(found.read_text(encoding="latin-1").splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        yield path, number, line
        if line.upper().replace(" ", "").startswith("*INCLUDE,INPUT="):
            name = line.partition("=")[2].strip().strip('"')
            try:
                inner = Path(os.path.normpath(path.parent / name))
                yield from read_lines(inner, above, depth + 1)
            except (OSError, ValueError):
                what = f"{name[:40]!r} cannot be read"
                raise InputError(what, file=path, line=number, expected="a file") from None
