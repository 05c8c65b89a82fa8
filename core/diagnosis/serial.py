"""A diagnosis as plain data for JSON, and plain data checked field by field."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from femubench.core.case.case import Case
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.drawing.places import PlacedWireframe, placed_wireframe
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.roles import Wording
from femubench.core.schema.diagnosis import Verdict
from femubench.core.version import __version__


def diagnosis_to_json(
    diagnosis: Diagnosis, *, written: Path | None = None, case: Case | Model | None = None
) -> dict[str, Any]:
    """Return a diagnosis in the JSON contract of ``bench diagnose``; no NaN, no infinity in it.

    Arguments:
        diagnosis: what was found; its extended model is left out.
        written: folder of the extended case, if it was written.
        case: what was diagnosed, for the drawing of its structure; a model has no sensors.
    """
    names = [f.name for f in fields(diagnosis) if f.name not in ("extended", "subject")]
    tables = {name: _plain(getattr(diagnosis, name)) for name in names}
    for look in tables["looks"]:
        look["changes"] = [{"mode": mode, "percent": change} for mode, change in look["changes"]]
    return {
        **tables,
        "structure": None if case is None else _plain(placed_wireframe(case, _words(diagnosis))),
        "written": None if written is None else str(written),
        "version": __version__,
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
        return _DiagnosisRecord.model_validate(data).model_dump(mode="json")
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in first["loc"])
        raise InputError(first["msg"], file=file, key=path.lstrip(".") or None) from error


def _words(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield every place that causes, rivals, visible effects and the evidence name."""
    yield from (cause.place for cause in diagnosis.causes)
    for rival in diagnosis.rivals:
        yield from rival.place.split(" + ")
    yield from (row.place for row in diagnosis.smallest_visible)
    yield from (row.place for row in diagnosis.locations if row.indicator == "evidence")


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
    wording: Wording = "value"


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
    wording: Wording = "value"


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
    structure: PlacedWireframe | None = None
    written: str | None = None
    version: str = ""
