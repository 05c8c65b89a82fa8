"""Bytes that hold a head of plain data and arrays of numbers, and cannot hold anything else.

Of the formats at hand safetensors 0.8 scrambles arrays in Fortran's order, on which the last bit of
a product depends, and the members of an NPZ are inflated before their sizes are known. The head is
MessagePack, read as the classes that it is to hold: unlike JSON it knows nan and infinity.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta, Struct

from femubench.core.errors import FemubenchError
from femubench.core.schema.records import encodable, to_builtin
from femubench.core.schema.validation import say_fault
from femubench.core.typing import AnyArray

_LENGTH = 8  # bytes that hold the length of the head
_LONGEST_HEAD = 32 * 2**20  # bytes: each may take a hundred of memory once it is read
_Size = Annotated[int, Meta(ge=0, lt=2**40)]
_T = TypeVar("_T")


class BytesError(FemubenchError):
    """Bytes are no head with arrays; the text says why."""


class _Table(Struct, array_like=True):
    """Form of an array whose numbers follow the head."""

    entries: Literal["<f8", "<f4", "<f2", "<i8", "<i4", "<i2", "|i1"]
    shape: Annotated[list[_Size], Meta(max_length=2)]
    order: Literal["C", "F"]


_Tables = Annotated[list[_Table], Meta(max_length=10_000)]
_ENTRIES = get_args(get_type_hints(_Table)["entries"])


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

    def seal(self, head: object) -> bytes:
        """Return a head and all arrays as bytes.

        Raises:
            TypeError, ValueError, OverflowError: when the head is no plain data.
        """
        tables, parts = list[_Table](), list[bytes]()
        for array in self._arrays:
            order = "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
            tables.append(_Table(array.dtype.str, list(array.shape), order))  # type: ignore[arg-type]
            parts.append(array.tobytes(order))  # type: ignore[arg-type]
        try:
            text = _ENCODER.encode((head, tables))
        except UnicodeEncodeError:
            plain = msgspec.to_builtins((head, tables), enc_hook=to_builtin)
            text = _ENCODER.encode(encodable(plain))
        return b"".join([len(text).to_bytes(_LENGTH, "big"), text, *parts])


_ENCODER = msgspec.msgpack.Encoder(enc_hook=to_builtin)


def open_bytes(kind: type[_T], data: bytes | memoryview) -> tuple[_T, list[AnyArray]]:
    """Return the head and the arrays of `Shelf.seal`.

    No array is allocated before its size is known to be that of the bytes.

    Arguments:
        data: from anybody.

    Raises:
        BytesError: when they are something else.
    """
    view = memoryview(data)
    size = int.from_bytes(view[:_LENGTH], "big")
    if len(view) < _LENGTH or size > min(_LONGEST_HEAD, len(view) - _LENGTH):
        raise BytesError(f"a head of {size} bytes in {len(view)}, allowed {_LONGEST_HEAD}")
    form: Any = tuple[kind, _Tables]  # type: ignore[valid-type]
    try:
        head, tables = msgspec.msgpack.decode(view[_LENGTH : _LENGTH + size], type=form)
    except msgspec.ValidationError as error:
        raise BytesError(f"the head{say_fault(form, None, error).removeprefix('[0]')}") from None
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise BytesError(f"the head cannot be read: {error}") from error
    return head, _arrays(tables, view[_LENGTH + size :])


def _arrays(tables: list[_Table], rest: memoryview) -> list[AnyArray]:
    kinds = [np.dtype(table.entries) for table in tables]
    counts = [math.prod(table.shape) for table in tables]
    whole = sum(kind.itemsize * count for kind, count in zip(kinds, counts, strict=True))
    if whole != len(rest):
        raise BytesError(f"arrays of {str(whole)[:30]} bytes in {len(rest)}")
    found, start = list[AnyArray](), 0
    for table, kind, count in zip(tables, kinds, counts, strict=True):
        flat = np.frombuffer(rest, dtype=kind, count=count, offset=start).copy()
        found.append(flat.reshape(table.shape, order=table.order))
        start += kind.itemsize * count
    return found
