"""What is drawn of cases and jobs, in files next to a store that results do not depend on."""

from __future__ import annotations

import base64
import json
import re
import time
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from femubench.core.drawing.findings import Finding
from femubench.core.drawing.wireframe import Point, Wireframe, check_same
from femubench.core.errors import InputError, OutputError
from femubench.core.files import read_bytes, write_atomically
from femubench.core.schema.bounds import Real
from femubench.core.schema.records import parse_json, to_plain
from femubench.core.schema.validation import read_plain

FOLDER = "exhibits"
MOST_BYTES = 4 * 2**20
_CASE = "structure-"
_SCHEMA = 2
_KEY = re.compile(r"[0-9a-f]{8,64}")
_MOST = 20_000
_STALE = 60.0  # s; a file is written in a fraction of one
_TAIL = len(b',"sum":"01234567"}')  # what `_seal` ends a file with

_Row = Annotated[list[Real | None], Meta(max_length=_MOST)]
_Hertz = Annotated[list[Real], Meta(max_length=_MOST)]
_Label = Annotated[str, Meta(max_length=500)]


class _Measured(Struct, kw_only=True):
    mode: int
    block: Literal["used", "higher", "modified"]
    modification: _Label | None = None
    hz: Real
    shape: _Row


class _Receptance(Struct):
    hz: _Hertz = []
    damping: Real | None = None
    measured: dict[str, list[Real | None]] = {}
    note: Annotated[str, Meta(max_length=1000)] = ""


class _DrawnMode(Struct, kw_only=True):
    hz: Real
    paired: int | None = None
    modification: _Label | None = None
    shape: Annotated[list[Point], Meta(max_length=_MOST)]


class _Mac(Struct):
    rows: Annotated[list[int], Meta(max_length=1000)]
    columns: Annotated[list[Real], Meta(max_length=100)]
    values: Annotated[list[_Row], Meta(max_length=1000)]

    def __post_init__(self) -> None:
        check_same(self.values, self.rows)
        for row in self.values:
            check_same(row, self.columns)


class _Difference(Struct):
    size: Annotated[int, Meta(ge=1, le=64)]
    nodes: Annotated[int, Meta(ge=1)]
    labels: Annotated[list[_Label], Meta(max_length=64)]
    values: Annotated[str, Meta(max_length=8192)]
    lowest: Real
    highest: Real
    unit: Annotated[str, Meta(max_length=10)]

    def __post_init__(self) -> None:
        check_same(self.labels, range(self.size))
        check_same(base64.b64decode(self.values, validate=True), range(self.size**2))


class _Exhibit(Struct):
    modes: Annotated[list[_DrawnMode], Meta(max_length=2000)]
    mac: _Mac
    receptance: dict[str, list[Real | None]] = {}
    findings: Annotated[list[Finding], Meta(max_length=_MOST)] = []
    elements: _Row | None = None
    difference: _Difference | None = None


@dataclass(frozen=True, slots=True)
class _CaseDrawing(Wireframe):
    measured: tuple[_Measured, ...] = ()
    drive: str | None = None
    thinned: tuple[int, int] | None = None
    receptance: _Receptance = field(default_factory=_Receptance)
    nominal: _Exhibit | None = None

    def __post_init__(self) -> None:
        Wireframe.__post_init__(self)
        for mode in self.measured:
            check_same(mode.shape, self.sensors)


class Exhibits:
    """What is drawn of the cases and jobs of a store."""

    def __init__(self, folder: Path) -> None:
        self.store, self._folder = folder, folder / FOLDER
        self.notes: list[str] = []

    def of(self, key: str) -> dict[str, Any] | None:
        """Return the exhibit of a job by its key; None where there is none that is whole."""
        return self._read(key, _Exhibit)

    def case(self, digest: str) -> dict[str, Any] | None:
        """Return the structure of a case by the digest of its files; None likewise."""
        return self._read(f"{_CASE}{digest[:32]}", _CaseDrawing)

    def tidy(self) -> None:
        """Remove what a killed process left half-written."""
        for part in self._folder.glob(".*.*"):
            with suppress(OSError):
                if time.time() - part.stat().st_mtime > _STALE:
                    part.unlink()

    def has_case(self, digest: str) -> bool:
        """Tell whether a case is drawn already, or cannot be."""
        path = self._path(f"{_CASE}{digest[:32]}")
        return path is None or path.exists()

    def faults(self) -> list[InputError]:
        """Return an error for every file that is not as it was written."""
        found = []
        for path in sorted(self._folder.glob("*.json")):
            try:
                _whole(path)
            except InputError as fault:
                found.append(fault)
        return found

    def put_case(self, digest: str, drawing: Mapping[str, Any]) -> None:
        """Keep what is drawn of a case."""
        self.put(f"{_CASE}{digest[:32]}", drawing)

    def _path(self, name: str) -> Path | None:
        known = _KEY.fullmatch(name.removeprefix(_CASE))
        return self._folder / f"{name}.json" if known else None

    def _read(self, name: str, kind: type) -> dict[str, Any] | None:
        path = self._path(name)
        if path is None or not path.is_file():
            return None
        try:
            data = parse_json(_whole(path), file=path, expected="an exhibit")
            plain: dict[str, Any] = to_plain(read_plain(kind, data, file=path))
        except InputError as error:
            self.notes.append(f"{path.name}: a picture was left out: {error}")
            return None
        return plain

    def put(self, key: str, data: Mapping[str, Any]) -> None:
        """Keep the exhibit of a job; a store without room does without."""
        path = self._path(key)
        if path is None or path.exists():
            return
        # Pictures are worth no failed run: the results say that a disk is full.
        with suppress(OSError, OutputError, ValueError):
            plain = {"schema": _SCHEMA, **data}
            text = json.dumps(plain, allow_nan=False, separators=(",", ":"))
            if len(text) > MOST_BYTES - _TAIL:
                return
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, _seal(text.encode()[:-1]))


def _seal(body: bytes) -> bytes:
    """Return a table of JSON without its last bracket, closed with its own checksum."""
    return body + b',"sum":"%08x"}' % zlib.crc32(body)


def _whole(path: Path) -> bytes:
    """Return the content of a file; raises InputError when it is not as it was written."""
    content = read_bytes(path, MOST_BYTES)
    if content != _seal(content[:-_TAIL]):
        raise InputError("damaged", file=path, expected="the picture that was written")
    return content
