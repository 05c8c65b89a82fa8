"""Readers of file formats that the case format does not know by itself."""

from __future__ import annotations

from femubench import hookimpl


@hookimpl
def femubench_readers() -> dict[str, str]:
    """Return where the built-in readers are."""
    return {
        "Nastran bulk data": f"{__name__}.bulk_data:BulkDataReader",
        "universal file": f"{__name__}.universal:UniversalReader",
    }
