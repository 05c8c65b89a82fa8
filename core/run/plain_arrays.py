"""Bytes that hold a head of JSON and arrays of numbers, and cannot hold anything else.

Of the formats at hand safetensors 0.8 scrambles arrays in Fortran's order, on which the last bit of
a product depends, and the members of an NPZ are inflated before their sizes are known.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from femubench.core.errors import FemubenchError
from femubench.core.typing import AnyArray

_LENGTH = 8  # bytes that hold the length of the head
_LONGEST_HEAD = 64 * 2**20  # bytes
_MOST_VALUES = 4_000_000  # in a head: each takes a hundred bytes of memory once it is read
_MOST_ARRAYS = 10_000
_ENTRIES = {name: np.dtype(name) for name in ("<f8", "<f4", "<f2", "<i8", "<i4", "<i2", "|i1")}
_BEFORE_VALUES = b",:[{"


class BytesError(FemubenchError):
    """Bytes are no head with arrays; the text says why."""


class Shelf:
    """Arrays on their way out, each known by its number."""

    def __init__(self) -> None:
        self._arrays: list[AnyArray] = []
        self._places: dict[int, int] = {}

    def put(self, array: AnyArray) -> int:
        """Return the number of an array of real numbers.

        Raises:
            BytesError: for entries that are none.
        """
        place = self._places.setdefault(id(array), len(self._arrays))
        if place == len(self._arrays):
            entries = array.dtype.newbyteorder("<").str
            if array.dtype.kind == "u" or (array.dtype.kind in "fi" and entries not in _ENTRIES):
                # What is computed with them is computed in doubles.
                wide = "<f8" if array.dtype.kind == "f" else "<i8"
                array, entries = array.astype(wide, copy=False), wide
            if entries not in _ENTRIES:
                raise BytesError(f"entries of type {array.dtype}, expected real numbers")
            self._arrays.append(array.astype(entries, copy=False))
        return place

    def sealed(self, head: Mapping[str, Any]) -> bytes:
        """Return a head and all arrays as bytes.

        Raises:
            TypeError, ValueError: when the head is no JSON.
        """
        tables, parts = [], []
        for array in self._arrays:
            order = "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
            tables.append([array.dtype.str, list(array.shape), order])
            parts.append(array.tobytes(order))  # type: ignore[arg-type]
        text = json.dumps({**head, "arrays": tables}, default=_number).encode()
        return b"".join([len(text).to_bytes(_LENGTH, "big"), text, *parts])


def _number(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is no plain data")


def opened(
    data: bytes | memoryview, longest_head: int = _LONGEST_HEAD
) -> tuple[dict[str, Any], list[AnyArray]]:
    """Return the head and the arrays of `Shelf.sealed`.

    Nothing is allocated before its size is known to be that of the bytes.

    Arguments:
        data: from anybody.
        longest_head: bytes of the JSON.

    Raises:
        BytesError: when they are something else.
    """
    view = memoryview(data)
    size = int.from_bytes(view[:_LENGTH], "big")
    if len(view) < _LENGTH or size > min(longest_head, len(view) - _LENGTH):
        raise BytesError(f"a head of {size} bytes in {len(view)}, allowed {longest_head}")
    text = bytes(view[_LENGTH : _LENGTH + size])
    if sum(text.count(bytes([mark])) for mark in _BEFORE_VALUES) > _MOST_VALUES:
        raise BytesError("more figures than anybody reads")
    try:
        head = json.loads(text, object_pairs_hook=_once)
    except BytesError:
        raise
    except (ValueError, RecursionError) as error:
        raise BytesError(f"the head is no JSON: {' '.join(str(error).split())[:200]}") from error
    if not isinstance(head, dict):
        raise BytesError(f"the head is {type(head).__name__}, expected an object")
    return head, _arrays(head.pop("arrays", None), view[_LENGTH + size :])


def _once(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise BytesError(f"the key {name[:100]!r} comes twice")
        found[name] = value
    return found


def _arrays(tables: object, rest: memoryview) -> list[AnyArray]:
    if not isinstance(tables, list) or len(tables) > _MOST_ARRAYS:
        raise BytesError("no table of arrays")
    kinds = [_kind(table) for table in tables]
    sizes = [kind.itemsize * math.prod(shape) for kind, shape, _ in kinds]
    if sum(sizes) != len(rest):
        raise BytesError(f"arrays of {str(sum(sizes))[:30]} bytes in {len(rest)}")
    found, start = [], 0
    for (kind, shape, order), size in zip(kinds, sizes, strict=True):
        flat = np.frombuffer(rest[start : start + size], dtype=kind).copy()
        found.append(flat.reshape(shape, order=order))
        start += size
    return found


def _kind(table: object) -> tuple[np.dtype[Any], tuple[int, ...], Any]:
    match table:
        case [str(entries), list(shape), "C" | "F" as order] if (
            entries in _ENTRIES
            and len(shape) <= 2
            and all(type(count) is int and 0 <= count < 2**40 for count in shape)
        ):
            return _ENTRIES[entries], tuple(shape), order
    raise BytesError(f"{str(table)[:100]} is no array of real numbers")
