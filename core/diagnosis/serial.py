"""A diagnosis as plain data for JSON, and plain data checked field by field."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, create_model

from femubench.core.case.case import Case
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.drawing.places import PlacedWireframe, placed_wireframe
from femubench.core.fem.model import Model
from femubench.core.schema.diagnosis import (
    Advice,
    Cause,
    CauseParameter,
    Evidence,
    Gain,
    LocationRow,
    LookWarning,
    ResidualRow,
    Rival,
    Scatter,
    SmallestVisible,
)
from femubench.core.schema.validation import validated
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
    names = [f.name for f in fields(diagnosis) if f.name not in _UNTOLD]
    tables = {name: _plain(getattr(diagnosis, name)) for name in names}
    for look in tables["looks"]:
        look["changes"] = [{"mode": mode, "percent": change} for mode, change in look["changes"]]
    tables["model_error"] = [{"class": row.pop("name"), **row} for row in tables["model_error"]]
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
    return validated(_DiagnosisRecord, data, file).model_dump(mode="json")


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


_CONFIG = ConfigDict(extra="ignore", allow_inf_nan=False, strict=True)


class _Scale(BaseModel):
    model_config = _CONFIG | ConfigDict(serialize_by_alias=True)

    name: str = Field(alias="class")
    scale: float | None
    unit: str


class _Change(BaseModel):
    model_config = _CONFIG

    mode: int
    percent: float | None


def _json_type(kind: Any) -> Any:  # noqa: ANN401 - any type of a field
    """Return the type of what `_plain` makes of it: any number may be None, tuples are lists."""
    inside = tuple(_json_type(part) for part in get_args(kind) if part is not Ellipsis)
    size = len(inside)
    if get_origin(kind) is tuple:
        entries = list[Union[inside]]  # type: ignore[valid-type]  # noqa: UP007
        several = Ellipsis in get_args(kind)
        return entries if several else Annotated[entries, Field(min_length=size, max_length=size)]
    if get_origin(kind) in (Union, UnionType):
        return Union[inside]  # noqa: UP007 - as many as there are
    if is_dataclass(kind) and kind in _OPTIONAL:
        return _record(cast(type, kind))
    return float | None if kind is float else kind


def _record(kind: type, **more: tuple[Any, Any]) -> type[BaseModel]:
    """Return the contract of a data class, and more fields with their types and defaults."""
    hints, given = get_type_hints(kind), _OPTIONAL[kind] | more
    own = {
        f.name: (_json_type(hints[f.name]), ... if f.default is MISSING else _plain(f.default))
        for f in fields(kind)
        if f.name not in _UNTOLD
    }
    changed = {
        name: value if isinstance(value, tuple) else (own[name][0], value)
        for name, value in given.items()
    }
    parts: dict[str, Any] = {**own, **changed}
    return create_model(kind.__name__, __config__=_CONFIG, **parts)


_UNTOLD = ("extended", "subject", "examination")
# What older versions did not write, by the data class; a type goes with what is no field of it.
_OPTIONAL: dict[Any, dict[str, Any]] = {
    **{k: {} for k in (Advice, Cause, CauseParameter, Evidence, Gain)},
    **{k: {} for k in (LocationRow, ResidualRow, Rival, Scatter)},
    SmallestVisible: {"place": ""},
    LookWarning: {"changes": (list[_Change], [])},
    Diagnosis: {
        **dict.fromkeys(("case", "sentence", "reason"), ""),
        **{"chi2": [None, None], "data_count": 0, "nothing": None, "seconds": None},
        **{name: [] for name in ("looks", "locations", "base")},
        "model_error": (list[_Scale], []),
    },
}
_DiagnosisRecord = _record(
    Diagnosis,
    structure=(PlacedWireframe | None, None),
    written=(str | None, None),
    version=(str, ""),
)
