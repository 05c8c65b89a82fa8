"""Cases whose unseen data are encrypted: what a strategy is given is open, the rest is not.

A folder of the set has the case with its used modes alone, and in one file all of the case as it
is, which opens with the key of the set's keeper. Unlike a sealed truth nobody can read it without,
so that the set says how strategies do on truths that nobody has.
"""

from __future__ import annotations

import csv
import io
import os
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.challenge.posing import CASE_FILE, case_text, parse_case
from femubench.core.errors import InputError, require
from femubench.core.files import MIB, check_new, read_bytes

if TYPE_CHECKING:
    from cryptography.fernet import Fernet

KEY = "FEMUBENCH_CLOSED_KEY"  # of the environment; the key itself is written nowhere
CLOSED = "closed"  # the encrypted file of a case
_LARGEST = 256 * MIB  # bytes of a case
_GIVEN = ("sensors", "modes", "shape_std", "used", "mass")  # of a measurement, to a strategy


def _cipher() -> Fernet:
    """Return what encrypts with the key of the environment.

    Raises:
        InputError: without a key, for one that is none, or without the library.
    """
    require("cryptography", "closed", "a closed set")
    from cryptography.fernet import Fernet

    try:
        return Fernet(os.environ.get(KEY, ""))
    except ValueError:
        what = f"{KEY} of the environment is {'no key' if KEY in os.environ else 'not set'}"
        raise InputError(what, expected="what `Fernet.generate_key()` gives") from None


def close_cases(cases: Sequence[Path], target: Path) -> dict[Path, str]:
    """Write cases whose unseen data are encrypted; return the digest of each whole case by folder.

    A digest that is published now shows that a case which is published later is the one closed.

    Arguments:
        cases: folders, each with unseen data.
        target: new or empty.

    Raises:
        InputError: for a faulty case, one that holds nothing back or whose modes are in no table,
            two of one name, a target that is not empty, no key.
    """
    cipher = _cipher()
    check_new(target)
    known = {target / folder.absolute().name: read_case(folder) for folder in cases}
    if len(known) < len(cases):
        raise InputError("two cases in folders of one name", expected="a name for each")
    parts = [_open_part(case) for case in known.values()]
    for (folder, case), part in zip(known.items(), parts, strict=True):
        folder.mkdir(parents=True)
        for name, content in part.items():
            (folder / name).write_bytes(content)
        (folder / CLOSED).write_bytes(cipher.encrypt(_zipped(case.folder)))
    return {folder: case.digest for folder, case in known.items()}


def _open_part(case: Case) -> dict[str, bytes]:
    """Return the files of a case with what a strategy is given, by their names."""
    file = case.folder / CASE_FILE
    if not case.held_out and not case.modifications:
        raise InputError("holds nothing back", file=file, expected="held-out or modified modes")
    tables = parse_case(file)
    for name in ("modification", "reference", "diagnosis"):
        tables.pop(name, None)
    measured = tables["measurement"]
    for name in set(measured) - set(_GIVEN):
        del measured[name]
    modes = str(measured["modes"])
    if not modes.endswith(".csv"):
        what, expected = f"modes in {modes}", "a table modes.csv, as `bench init` writes it"
        raise InputError(what, file=file, key="measurement.modes", expected=expected)
    text = case_text(tables)
    found = {
        path.name: read_bytes(path, _LARGEST)
        for path in sorted(case.folder.iterdir())
        if path.is_file() and f'"{path.name}"' in text
    }
    found[modes] = _used_rows(found[modes].decode("utf-8"), case.used)
    return {**found, CASE_FILE: text.encode()}


def _used_rows(table: str, used: Sequence[int]) -> bytes:
    """Return a table of modes with the used ones alone."""
    head, *rows = csv.reader(io.StringIO(table))
    place = [word.strip() for word in head].index("mode")
    text = io.StringIO()
    kept = (row for row in rows if row and int(row[place]) in used)
    csv.writer(text, lineterminator="\n").writerows([head, *kept])
    return text.getvalue().encode()


def _zipped(folder: Path) -> bytes:
    """Return all files of a folder in one, the same for the same content."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in folder.iterdir() if path.is_file()):
            archive.writestr(zipfile.ZipInfo(path.name), read_bytes(path, _LARGEST))
    return content.getvalue()


@contextmanager
def opened_cases(folder: Path) -> Iterator[list[Case]]:
    """Give the cases of a set with all of their data, which are on the disk within the block alone.

    Arguments:
        folder: that `close_cases` wrote.

    Raises:
        InputError: without a key or with another one, for a file that was changed, or no set.
    """
    cipher = _cipher()
    from cryptography.fernet import InvalidToken

    files = sorted(folder.glob(f"*/{CLOSED}"))
    if not files:
        raise InputError("no closed set", file=folder, expected="what `bench challenge close` made")
    with TemporaryDirectory(prefix="femubench-") as made:
        cases = []
        for file in files:
            try:
                content = cipher.decrypt(read_bytes(file, _LARGEST))
            except InvalidToken:
                what = "does not open: another key, or the file was changed"
                raise InputError(what, file=file, expected=f"the key of the set in {KEY}") from None
            target = Path(made) / file.parent.name
            target.mkdir()
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                for name in archive.namelist():
                    (target / Path(name).name).write_bytes(archive.read(name))
            cases.append(read_case(target))
        yield cases
