"""Readers of file formats that the case format does not know by itself."""

from __future__ import annotations

from collections.abc import Iterable

from femubench import Reader, hookimpl
from femubench.plugins.readers.universal import UniversalReader


@hookimpl
def femubench_readers() -> Iterable[Reader]:
    """Return the built-in readers."""
    return (UniversalReader(),)
