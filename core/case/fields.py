"""The values that keys of `case.toml` take, and the base class of its tables."""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, InstanceOf, PlainValidator
from pydantic_core import PydanticCustomError

from femubench.core.fem.frame import Place

T = TypeVar("T")

LARGEST, SMALLEST = 1e30, 1e-30
# What a terminal obeys or what turns the direction of writing: no name and no title has it.
_CONTROL = r"\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069"
ID = rf"^[^\s{_CONTROL}@/:](?:[^{_CONTROL}@/:]*[^\s{_CONTROL}@/:])?$"
AT = 'a joint "A", a point "member@0.25" or {member = "name", s = 0.25}'
_CASE = rf"^[^\s{_CONTROL}](?:[^{_CONTROL}]*[^\s{_CONTROL}])?$"
_LINE = rf"^[^{_CONTROL}]*$"
_DIRECTION = r"^[+-]?(x|y|z|rx|ry|rz)$"


def misfit(what: str, expected: str) -> PydanticCustomError:
    """Return the error of a value that is not what its key needs."""
    return PydanticCustomError("misfit", "{what}", {"what": what, "expected": expected})


def _place(value: object) -> Place:
    if isinstance(value, str) and value:
        member, found, station = value.rpartition("@")
        if not found:
            return Place(joint=value)
        try:
            s = float(station)
        except ValueError:
            raise misfit(f"{station[:20]!r} is not a station", AT) from None
        return _station(member, s)
    if isinstance(value, dict) and set(value) == {"member", "s"}:
        member, s = value["member"], value["s"]
        if isinstance(member, str) and isinstance(s, (int, float)) and not isinstance(s, bool):
            return _station(member, s)
    raise misfit("not a place", AT)


def _station(member: str, s: float) -> Place:
    if not 0 <= s <= 1:
        raise misfit("the station lies outside 0..1", AT)
    return Place(member=member, s=float(s))


def _dof_name(value: object) -> int | str:
    if isinstance(value, (int, str)) and not isinstance(value, bool):
        return value
    raise misfit("not a degree of freedom", 'a row number, "node" or "node:direction"')


Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Name = Annotated[str, Field(strict=True, pattern=ID, max_length=80)]
CaseName = Annotated[str, Field(strict=True, pattern=_CASE, max_length=80)]
Text = Annotated[str, Field(strict=True, pattern=_LINE, max_length=2000)]
FileName = Annotated[str, Field(strict=True, pattern=_LINE, min_length=1, max_length=255)]
Direction = Annotated[str, Field(strict=True, pattern=_DIRECTION)]
At = Annotated[InstanceOf[Place], BeforeValidator(_place)]
DofName = Annotated[int | str, PlainValidator(_dof_name)]
Vector = tuple[Number, Number, Number]
Many = tuple[T, ...]

DIRECTIONS = "one of x, y, z, rx, ry, rz, with an optional sign"
NAME = "a name without @, / and :, in quotes"
XYZ = "[x, y, z] in m, finite numbers"


class Table(BaseModel):
    """A table of `case.toml`; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)
