"""A diagnosis as plain data for JSON, and plain data checked field by field."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

import femubench
from femubench.core.case.case import Case
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.sketch import PlaceKind, Plane, sketch_of
from femubench.core.errors import InputError
from femubench.core.schema.diagnosis import Verdict


def diagnosis_to_json(
    diagnosis: Diagnosis, *, written: Path | None = None, case: Case | None = None
) -> dict[str, Any]:
    """Return a diagnosis in the JSON contract of ``bench diagnose``; no NaN, no infinity in it.

    Arguments:
        diagnosis: what was found; its extended model is left out.
        written: folder of the extended case, if it was written.
        case: what was diagnosed, for the drawing of its structure.
    """
    names = [f.name for f in fields(diagnosis) if f.name != "extended"]
    tables = {name: _plain(getattr(diagnosis, name)) for name in names}
    for look in tables["looks"]:
        look["changes"] = [{"mode": mode, "percent": change} for mode, change in look["changes"]]
    return {
        **tables,
        "structure": None if case is None else _plain(sketch_of(case, diagnosis)),
        "written": None if written is None else str(written),
        "version": femubench.__version__,
    }


def diagnosis_from_json(data: object, *, file: Path | str | None = None) -> dict[str, Any]:
    """Return a diagnosis as plain data with every field of the contract in it.

    Arguments:
        data: what `diagnosis_to_json` gave; keys that this version does not know are left out.
        file: where it was read, for the message.

    Raises:
        InputError: naming the first field that is wrong.
    """
    try:
        return _DiagnosisRecord.model_validate(data).model_dump()
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in first["loc"])
        raise InputError(first["msg"], file=file, key=path.lstrip(".") or None) from error


def _plain(value: Any) -> Any:  # noqa: ANN401 - data of any form
    """Return data classes as mappings, tuples as lists, what is no finite number as None."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    return [_plain(item) for item in value]


class _Record(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, strict=True)


_Number = float | None
# Before and after.
_Pair = Annotated[list[float | None], Field(min_length=2, max_length=2)]


class _ParameterRecord(_Record):
    name: str
    value: _Number
    std: _Number
    unit: str
    textbook: bool = False


class _CauseRecord(_Record):
    effect: str
    place: str
    parameters: list[_ParameterRecord]
    probability: _Number
    summary: str = ""


class _RivalRecord(_Record):
    effect: str
    place: str
    delta_chi2: _Number
    probability: _Number
    angle: _Number = None


class _AdviceRecord(_Record):
    measurement: str
    separation: _Number


class _VisibleRecord(_Record):
    effect: str
    place: str = ""
    size: _Number
    unit: str


class _ResidualRecord(_Record):
    kind: str
    mode: int | None
    sensor: str
    measured: _Number
    before: _Number
    after: _Number


class _ChangeRecord(_Record):
    mode: int
    percent: _Number


class _LookRecord(_Record):
    what: str
    where: str
    effect: str
    changes: list[_ChangeRecord] = []


class _LocationRecord(_Record):
    indicator: str
    place: str
    value: _Number


class _GainRecord(_Record):
    used_percent: _Pair
    held_out_percent: _Pair | None = None
    modified_percent: _Pair | None = None
    cross_validated_percent: _Pair | None = None


_Index = Annotated[int, Field(ge=0)]
_Station = Annotated[float, Field(ge=0.0, le=1.0)]
_Point = Annotated[list[float], Field(min_length=3, max_length=3)]


class _JointRecord(_Record):
    name: str
    type: str = ""
    xyz: _Point


class _MemberRecord(_Record):
    name: str
    ends: Annotated[list[_Index], Field(min_length=2, max_length=2)]
    elements: Annotated[int, Field(ge=1)]


class _SensorRecord(_Record):
    label: str
    xyz: _Point
    direction: str = ""


class _SupportRecord(_Record):
    xyz: _Point
    fixed: list[str] = []


class _SpanRecord(_Record):
    member: _Index
    start: _Station
    end: _Station


class _PlaceRecord(_Record):
    place: str
    kind: PlaceKind
    spans: list[_SpanRecord] = []
    points: list[_Point] = []


class _StructureRecord(_Record):
    plane: Plane
    joints: list[_JointRecord]
    members: list[_MemberRecord]
    sensors: list[_SensorRecord] = []
    supports: list[_SupportRecord] = []
    places: list[_PlaceRecord] = []

    @model_validator(mode="after")
    def _point_into_the_lists(self) -> _StructureRecord:
        if any(end >= len(self.joints) for member in self.members for end in member.ends):
            raise ValueError("a member ends at a joint that is not in the list")
        spans = (span for place in self.places for span in place.spans)
        if any(span.member >= len(self.members) for span in spans):
            raise ValueError("a place lies on a member that is not in the list")
        return self


class _DiagnosisRecord(_Record):
    case: str = ""
    verdict: Verdict
    sentence: str = ""
    causes: list[_CauseRecord]
    rivals: list[_RivalRecord]
    reason: str = ""
    advice: list[_AdviceRecord]
    smallest_visible: list[_VisibleRecord]
    residuals: list[_ResidualRecord]
    gain: _GainRecord
    chi2: _Pair = [None, None]
    data_count: int = 0
    adequacy_p: _Number
    nothing: _Number = None
    looks: list[_LookRecord] = []
    locations: list[_LocationRecord] = []
    base: list[str] = []
    notes: list[str] = []
    seconds: _Number = None
    structure: _StructureRecord | None = None
    written: str | None = None
    version: str = ""
