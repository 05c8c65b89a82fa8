"""Exhibits in files beside a store: one a job, one a case; nobody's but a picture's sake."""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Iterable, Mapping, Sized
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from femubench.core.errors import InputError
from femubench.core.files import read_text, write_atomically
from femubench.core.schema.records import parse_json

FOLDER = "exhibits"
MOST_BYTES = 4 * 2**20
_KEY = re.compile(r"[0-9a-f]{8,64}")
_MOST = 20_000
_STALE = 60.0  # s; a file is written in a fraction of one

Number = float | None
Row = list[Number]
_Ends = Annotated[list[int], Field(min_length=2, max_length=2)]
_Point = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _Sensor(_Part):
    label: str = Field(max_length=500)
    xyz: _Point
    axis: _Point
    rotation: bool = False


class _Measured(_Part):
    mode: int
    block: Literal["used", "higher", "modified"]
    modification: str | None = Field(default=None, max_length=500)
    hz: float
    shape: Row = Field(max_length=_MOST)


class _Joint(_Part):
    name: str = Field(max_length=500)
    type: str | None = Field(default=None, max_length=500)
    node: int


class _Lump(_Part):
    xyz: _Point
    kg: float


class _Spring(_Part):
    xyz: _Point
    axis: _Point
    rotation: bool = False
    stiffness: float


class _Support(_Part):
    xyz: _Point
    fixed: list[str] = Field(max_length=6)


class _Receptance(_Part):
    hz: list[float] = Field(default=[], max_length=_MOST)
    damping: float | None = None
    measured: dict[str, list[Number]] = {}
    note: str = Field(default="", max_length=1000)


class _Mode(_Part):
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
        _same(self.values, self.rows)
        for row in self.values:
            _same(row, self.columns)
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
        _same(self.labels, range(self.size))
        _same(base64.b64decode(self.values, validate=True), range(self.size**2))
        return self


class _Exhibit(_Part):
    modes: list[_Mode] = Field(max_length=2000)
    mac: _Mac
    receptance: dict[str, list[Number]] = {}
    elements: Row | None = Field(default=None, max_length=_MOST)
    difference: _Difference | None = None


class _Stage(_Part):
    plane: Literal["out-of-plane", "in-plane", "3d", "matrices"]
    nodes: list[_Point] = Field(max_length=_MOST)
    elements: list[_Ends] = Field(max_length=_MOST)
    element_labels: list[str] = Field(max_length=_MOST)
    member_of: list[int] = Field(max_length=_MOST)
    members: list[str] = Field(max_length=_MOST)
    joints: list[_Joint] = Field(max_length=_MOST)
    sensors: list[_Sensor] = Field(max_length=_MOST)
    masses: list[_Lump] = Field(max_length=_MOST)
    springs: list[_Spring] = Field(max_length=_MOST)
    supports: list[_Support] = Field(max_length=_MOST)
    measured: list[_Measured] = Field(max_length=1000)
    drive: str | None = None
    receptance: _Receptance = _Receptance()
    nominal: _Exhibit | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        nodes = {end for ends in self.elements for end in ends}
        _within([*nodes, *(joint.node for joint in self.joints)], self.nodes)
        _same(self.element_labels, self.elements)
        _same(self.member_of, self.elements)
        for mode in self.measured:
            _same(mode.shape, self.sensors)
        return self


def _same(one: Sized, other: Sized) -> None:
    if len(one) != len(other):
        raise ValueError(f"{len(one)} entries instead of {len(other)}")


def _within(places: Iterable[int], listed: Sized) -> None:
    if not all(0 <= place < len(listed) for place in places):
        raise ValueError("a place that is not there")


_P = TypeVar("_P", bound=_Part)


class Exhibits:
    """The exhibits of a store.

    Arguments:
        folder: of the store.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self.notes: list[str] = []

    def of(self, key: str) -> dict[str, Any] | None:
        """Return the exhibit of a job by its key; None where there is none that is whole."""
        return self._read(key, _Exhibit)

    def stage(self, digest: str) -> dict[str, Any] | None:
        """Return the stage of a case by the digest of its files; None likewise."""
        return self._read(f"case-{digest[:32]}", _Stage)

    def tidy(self) -> None:
        """Remove what a killed process left half-written."""
        for part in self._folder.glob(".*.*"):
            with suppress(OSError):
                if time.time() - part.stat().st_mtime > _STALE:
                    part.unlink()

    def has_stage(self, digest: str) -> bool:
        """Tell whether there is a stage of a case, or can be none."""
        path = self._path(f"case-{digest[:32]}")
        return path is None or path.exists()

    def put(self, key: str, exhibit: Mapping[str, Any]) -> None:
        """Keep the exhibit of a job; a store without room does without."""
        self._write(key, exhibit)

    def put_stage(self, digest: str, stage: Mapping[str, Any]) -> None:
        """Keep the stage of a case."""
        self._write(f"case-{digest[:32]}", stage)

    def _path(self, name: str) -> Path | None:
        known = _KEY.fullmatch(name.removeprefix("case-"))
        return self._folder / f"{name}.json" if known else None

    def _read(self, name: str, kind: type[_P]) -> dict[str, Any] | None:
        path = self._path(name)
        if path is None or not path.is_file():
            return None
        try:
            data = parse_json(read_text(path, MOST_BYTES), file=path, expected="an exhibit")
            return kind.model_validate(data).model_dump()
        except (InputError, ValidationError) as error:
            first = str(error).splitlines()[0] if isinstance(error, InputError) else "not whole"
            self.notes.append(f"{path.name}: a picture was left out: {first}")
            return None

    def _write(self, name: str, data: Mapping[str, Any]) -> None:
        path = self._path(name)
        if path is None or path.exists():
            return
        # Pictures are worth no failed run: a full disk is told by the results.
        with suppress(OSError, ValueError):
            text = json.dumps(data, allow_nan=False, separators=(",", ":"))
            if len(text) > MOST_BYTES:
                return
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, text)
