"""Readers of file formats that the case format does not know by itself."""

from __future__ import annotations

from femubench import hookimpl


@hookimpl
def femubench_readers() -> dict[str, str]:
    """Return where the built-in readers are."""
    return {"universal file": f"{__name__}.universal:UniversalReader"}
