"""Seal a truth so that nobody sees it by accident, and so that nobody can change it unnoticed.

The seal hides from a casual look and commits the one who drew the case: the sha256 of nonce and
truth can be published. It is no cryptography against a determined reader: the truth is in
the file, merely compressed and encoded.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import secrets
import zlib
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

from femubench.core.challenge.truth import Truth
from femubench.core.challenge.truth_file import GivenTruth
from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text

SEALED_FILE = "truth.sealed"
_FORMAT = "femubench-sealed-1"
# What was drawn here, and what was given from outside.
_TRUTHS: dict[str, type[Truth | GivenTruth]] = {"truth": Truth, "given": GivenTruth}


class _Seal(Struct, frozen=True, forbid_unknown_fields=True):
    format: Annotated[str, Meta(max_length=40)]
    commitment: Annotated[str, Meta(pattern=r"^[0-9a-f]{64}$")]
    sealed: str


def seal(truth: Truth | GivenTruth, nonce: str | None = None) -> tuple[str, str]:
    """Return the text of a sealed file and the commitment to it.

    Arguments:
        truth: what is sealed.
        nonce: hexadecimal; None for a random one, so that a truth cannot be guessed from its
            commitment.
    """
    key = "given" if isinstance(truth, GivenTruth) else "truth"
    content = json.dumps(
        {"nonce": nonce or secrets.token_hex(16), key: msgspec.to_builtins(truth)}, sort_keys=True
    ).encode()
    commitment = hashlib.sha256(content).hexdigest()
    text = base64.b64encode(zlib.compress(content, 9)).decode()
    file = {"format": _FORMAT, "commitment": commitment, "sealed": text}
    return json.dumps(file, indent=1) + "\n", commitment


def unseal(text: str, file: Path | None = None) -> tuple[Truth | GivenTruth, str]:
    """Return the truth of a sealed file and the commitment that it keeps.

    Raises:
        InputError: when it is no sealed truth, or was changed after it was sealed.
    """
    wanted = "a file that `bench challenge new` wrote"
    try:
        content = msgspec.json.decode(text, type=_Seal)
        if content.format != _FORMAT:
            raise InputError(f"format {content.format!r}", file=file, expected=repr(_FORMAT))
        unpacking = zlib.decompressobj()
        raw = unpacking.decompress(base64.b64decode(content.sealed, validate=True), MIB)
    except (msgspec.DecodeError, binascii.Error, zlib.error, ValueError):
        raise InputError("not a sealed truth", file=file, expected=wanted) from None
    if hashlib.sha256(raw).hexdigest() != content.commitment:
        raise InputError("changed since it was sealed", file=file, expected=wanted)
    try:
        stated = json.loads(raw)
        (key,) = stated.keys() & _TRUTHS.keys()
        truth: Truth | GivenTruth = msgspec.convert(stated[key], _TRUTHS[key])
    except (msgspec.ValidationError, ValueError, AttributeError, TypeError, RecursionError):
        raise InputError("not a sealed truth", file=file, expected=wanted) from None
    return truth, content.commitment


def read_sealed(path: Path) -> tuple[Truth | GivenTruth, str]:
    """Return the truth in a sealed file and its commitment.

    Raises:
        InputError: when the file is missing, too large, no sealed truth, or was changed.
    """
    return unseal(read_text(path, MIB), path)
