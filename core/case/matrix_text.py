"""Matrix files as streams that a parser written in C can be trusted with."""

from __future__ import annotations

import bz2
import gzip
from collections.abc import Callable
from io import BufferedIOBase
from pathlib import Path
from typing import IO, Any

from femubench.core.case.files import LARGEST_FILE
from femubench.core.errors import InputError
from femubench.core.reading import MIB, open_regular

_OPENERS: dict[str, Callable[..., Any]] = {".gz": gzip.open, ".bz2": bz2.open}


class MatrixText(BufferedIOBase):
    """The bytes of a text file, as many as the limit allows: a few can unpack to any number.

    SciPy looks for the end of a line without looking for the end of its buffer, and crashes where
    there is none (scipy issue 19949): after a NUL byte, and in a last line without line end. So
    the former is refused and the latter gets one.
    """

    def __init__(self, file: Path) -> None:
        self._stream: IO[bytes] | Any
        self._file, self._left, self._last = file, LARGEST_FILE, b"\n"
        self._plain = open_regular(file, LARGEST_FILE)
        opener = _OPENERS.get(file.suffix.lower())
        self._stream = self._plain if opener is None else opener(self._plain)

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes.

        Raises:
            InputError: behind the limit, and for what is no text.
        """
        wanted = self._left + 1 if size is None or size < 0 else min(size, self._left + 1)
        content = self._stream.read(wanted)
        self._left -= len(content)
        if self._left < 0:
            expected = f"at most {LARGEST_FILE // MIB} MiB once it is unpacked"
            raise InputError("file is too large", file=self._file, expected=expected)
        if b"\0" in content:
            raise InputError("not a text: a NUL byte", file=self._file, expected="Matrix Market")
        if not content and wanted > 0 and self._last != b"\n":
            content = b"\n"
        self._last = content[-1:] or self._last
        return content

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        self._plain.close()
        super().close()
