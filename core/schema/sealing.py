"""A table of JSON on one line that ends with its own checksum: no changed bit goes unnoticed.

The last entry is ``"sum"``, 16 hexadecimal digits of BLAKE2b over all bytes before it.
"""

from __future__ import annotations

import hashlib

_BEFORE, _AFTER = b',"sum":"', b'"}'
_DIGITS = 16
TAIL = len(_BEFORE) + _DIGITS + len(_AFTER)


def sealed(text: bytes) -> bytes:
    """Return a table of JSON, not an empty one, with the checksum as its last entry.

    Arguments:
        text: on one line.
    """
    body = text[:-1]
    return b"".join((body, _BEFORE, _sum(body), _AFTER))


def is_whole(line: bytes) -> bool:
    """Tell whether a line, without its end, is as `sealed` gave it."""
    return line.endswith(b"".join((_BEFORE, _sum(line[:-TAIL]), _AFTER)))


def sum_of(line: bytes) -> bytes:
    """Return the checksum that a line says it has; nothing where it says none."""
    tail = line[-TAIL:]
    if not (tail.startswith(_BEFORE) and tail.endswith(_AFTER)):
        return b""
    return tail[len(_BEFORE) : -len(_AFTER)]


def _sum(body: bytes) -> bytes:
    return hashlib.blake2b(body, digest_size=_DIGITS // 2).hexdigest().encode()
