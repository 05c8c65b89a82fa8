"""Break files that are no text: cut them, flip bits, put other numbers where lengths stand."""

from __future__ import annotations

import numpy as np

_NUMBERS = (b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0",
            b"\0\0\1\0", b"\0\0\x80\x7f", b"9999", b"-  1", b"\n\n\n\n")  # fmt: skip


def broken(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the content with one to three faults; half of them are in the first kilobyte."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        size = len(data)
        if size < 8:
            break
        at = int(rng.integers(min(size, 1024) if rng.random() < 0.5 else size))
        kind = rng.integers(5)
        if kind == 0:
            del data[at:]
        elif kind == 1:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            data[at : at + 4] = _NUMBERS[rng.integers(len(_NUMBERS))]
        elif kind == 3:
            del data[at : at + int(rng.integers(1, 64))]
        else:
            part = data[at : at + int(rng.integers(1, 64))]
            data[at:at] = part
    return bytes(data)
