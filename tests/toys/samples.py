"""A few of what is committed, as parameters of a test; the others are left to `make nightly`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import pytest

Item = TypeVar("Item")


def one_of_each(items: Iterable[Item], kind: Callable[[Item], object]) -> list[Any]:
    """Return the items as parameters; all but the first of every kind are nightly."""
    seen: set[object] = set()
    found = []
    for item in items:
        known = kind(item) in seen
        seen.add(kind(item))
        found.append(pytest.param(item, marks=[pytest.mark.nightly] if known else []))
    return found
