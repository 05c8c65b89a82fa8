"""A diagnosis as plain data for JSON, and plain data checked field by field."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from femubench.core.case.case import Case
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.drawing.places import PlacedWireframe, find_wireframe
from femubench.core.fem.model import Model
from femubench.core.schema.bounds import Number
from femubench.core.schema.diagnosis import DiagnosisReport, LookWarning
from femubench.core.schema.records import to_plain
from femubench.core.schema.validation import read_plain
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
    names = [field.name for field in fields(DiagnosisReport)]
    structure = None if case is None else find_wireframe(case, _words(diagnosis))
    tables: dict[str, Any] = to_plain({name: getattr(diagnosis, name) for name in names})
    for look in tables["looks"]:
        look["changes"] = [{"mode": mode, "percent": change} for mode, change in look["changes"]]
    return {
        **tables,
        "structure": to_plain(structure),
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
    plain: dict[str, Any] = to_plain(read_plain(_Written, data, file=file))
    return plain


def _words(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield every place that causes, budget, rivals, visible effects and the evidence name."""
    yield from (cause.place for cause in diagnosis.causes)
    yield from (row.place for row in diagnosis.budget)
    for rival in diagnosis.rivals:
        yield from rival.place.split(" + ")
    yield from (row.place for row in diagnosis.smallest_visible)
    yield from (row.place for row in diagnosis.locations if row.indicator == "evidence")


@dataclass(frozen=True, slots=True)
class _Change:
    mode: int
    percent: Number


@dataclass(frozen=True, slots=True)
class _Look(LookWarning):
    changes: tuple[_Change, ...] = ()  # type: ignore[assignment]


@dataclass(frozen=True, kw_only=True, slots=True)
class _Written(DiagnosisReport):
    """The contract of ``bench diagnose --json``."""

    looks: tuple[_Look, ...] = ()
    structure: PlacedWireframe | None = None
    written: str | None = None
    version: str = ""
