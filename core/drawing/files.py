"""What is drawn of cases and jobs, in files beside a store that results do not depend on."""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from femubench.core.drawing.findings import Finding
from femubench.core.drawing.wireframe import Wireframe, adapter, check_same
from femubench.core.errors import InputError, OutputError
from femubench.core.files import read_bytes, write_atomically
from femubench.core.schema.records import parse_json
from femubench.core.schema.sealing import TAIL, is_whole, sealed, sum_of

FOLDER = "exhibits"
MOST_BYTES = 4 * 2**20
_CASE = "structure-"
_SCHEMA = 2  # of 1 there were no checksums
_HEAD = b'{"schema":2,'
_KEY = re.compile(r"[0-9a-f]{8,64}")
_MOST = 20_000
_STALE = 60.0  # s; a file is written in a fraction of one

Number = float | None
Row = list[Number]
_Point = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _Measured(_Part):
    mode: int
    block: Literal["used", "higher", "modified"]
    modification: str | None = Field(default=None, max_length=500)
    hz: float
    shape: Row = Field(max_length=_MOST)


class _Receptance(_Part):
    hz: list[float] = Field(default=[], max_length=_MOST)
    damping: float | None = None
    measured: dict[str, list[Number]] = {}
    note: str = Field(default="", max_length=1000)


class _DrawnMode(_Part):
    hz: float
    paired: int | None = None
    modification: str | None = Field(default=None, max_length=500)
    shape: list[_Point] = Field(max_length=_MOST)


class _Mac(_Part):
    rows: list[int] = Field(max_length=1000)
    columns: list[float] = Field(max_length=100)
    values: list[Row] = Field(max_length=1000)

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_same(self.values, self.rows)
        for row in self.values:
            check_same(row, self.columns)
        return self


class _Difference(_Part):
    size: int = Field(ge=1, le=64)
    nodes: int = Field(ge=1)
    labels: list[Annotated[str, Field(max_length=500)]] = Field(max_length=64)
    values: str = Field(max_length=8192)
    lowest: float
    highest: float
    unit: str = Field(max_length=10)

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_same(self.labels, range(self.size))
        check_same(base64.b64decode(self.values, validate=True), range(self.size**2))
        return self


class _Exhibit(_Part):
    modes: list[_DrawnMode] = Field(max_length=2000)
    mac: _Mac
    receptance: dict[str, list[Number]] = {}
    findings: list[Finding] = Field(default=[], max_length=_MOST)
    elements: Row | None = Field(default=None, max_length=_MOST)
    difference: _Difference | None = None


@dataclass(frozen=True)
class _CaseDrawing(Wireframe):
    measured: tuple[_Measured, ...] = ()
    drive: str | None = None
    thinned: tuple[int, int] | None = None
    receptance: _Receptance = field(default_factory=_Receptance)
    nominal: _Exhibit | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for mode in self.measured:
            check_same(mode.shape, self.sensors)


class Exhibits:
    """What is drawn of the cases and jobs of a store.

    Arguments:
        folder: of the store.
    """

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
            found = adapter(kind)
            plain: dict[str, Any] = found.dump_python(found.validate_python(data), mode="json")
        except (InputError, ValidationError) as error:
            first = str(error).splitlines()[0] if isinstance(error, InputError) else "not whole"
            self.notes.append(f"{path.name}: a picture was left out: {first}")
            return None
        return plain

    def put(self, key: str, data: Mapping[str, Any]) -> None:
        """Keep the exhibit of a job; a store without room does without."""
        path = self._path(key)
        if path is None or path.exists():
            return
        # Pictures are worth no failed run: a full disk is told by the results.
        with suppress(OSError, OutputError, ValueError):
            plain = {"schema": _SCHEMA, **data}
            text = json.dumps(plain, allow_nan=False, separators=(",", ":"))
            if len(text) > MOST_BYTES - TAIL:
                return
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, sealed(text.encode()))


def _whole(path: Path) -> bytes:
    """Return the content of a file; one of an earlier version has no checksum.

    Raises:
        InputError: when it is not as it was written.
    """
    content = read_bytes(path, MOST_BYTES)
    if not is_whole(content) and (content.startswith(_HEAD) or sum_of(content)):
        raise InputError("damaged", file=path, expected="the picture that was written")
    return content
