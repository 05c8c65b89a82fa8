"""The files of a case: found inside its folder only, read with limits, remembered for the hash."""

from __future__ import annotations

import hashlib
import os
import posixpath
from pathlib import Path, PurePosixPath, PureWindowsPath

from femubench.core import files as reading
from femubench.core.case.drawn import CASE_FILE
from femubench.core.case.faults import Misfit
from femubench.core.errors import InputError
from femubench.core.files import MIB

LARGEST_CASE = 16 * MIB  # bytes of case.toml
LARGEST_TEXT = 64 * MIB  # of a table
LARGEST_FILE = 1024 * MIB  # of a matrix, or what a reader plugin reads
_CHUNK = MIB


class CaseFiles:
    """A case folder and the files of it that were asked for.

    The folder itself may be reached by links, which are the user's own; a link inside it that
    leads out of it is refused, for it came with the case.

    Arguments:
        folder: with a `case.toml`.
        links: whether links may lead out all the same.
    """

    def __init__(self, folder: Path, *, links: bool = False) -> None:
        self.folder, self.links = folder, links
        self.names: set[str] = {CASE_FILE}
        if not os.path.isdir(folder):  # False for what may not be looked into, where Path raises
            expected = f"a folder with a {CASE_FILE}"
            raise InputError("folder does not exist", file=folder, expected=expected)
        if not os.path.lexists(self.case_file):
            expected = "the file of a case, which `bench init` writes"
            raise InputError("missing file", file=self.case_file, expected=expected)
        if not self._holds(self.case_file):
            what = "a link that leads out of the case folder, or nowhere"
            raise InputError(what, file=self.case_file, expected="a file inside the folder")

    @property
    def case_file(self) -> Path:
        """Return the path of `case.toml`."""
        return self.folder / CASE_FILE

    def path(self, name: str) -> Path:
        """Return the path of a file that the case names.

        Raises:
            Misfit: when it lies outside the folder, also by a link, does not exist, is no regular
                file or is too large.
        """
        windows = PureWindowsPath(name)
        normal = posixpath.normpath(name.replace("\\", "/"))
        outside = normal == ".." or normal.startswith("../")
        if outside or PurePosixPath(normal).is_absolute() or windows.drive or windows.root:
            raise Misfit(f"{name!r} leads out of the case folder", "a file inside the folder")
        path = self.folder / normal
        if not os.path.lexists(path):
            raise Misfit(f"there is no file {name!r}", f"a file in {self.folder}")
        if not self._holds(path):
            what = f"{name!r} is a link that leads out of the case folder, or nowhere"
            raise Misfit(what, "a file inside the folder")
        try:
            reading.check_regular(path, LARGEST_FILE)
        except InputError as error:
            raise Misfit(f"{name!r}: {error.what}", error.expected or "a file") from None
        self.names.add(normal)
        return path

    def _holds(self, path: Path) -> bool:
        """Tell whether a path ends inside the folder once all links are followed."""
        try:
            found = path.resolve(strict=True)
            return self.links or found.is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError):  # RuntimeError: links in a circle
            return False

    def digest(self) -> str:
        """Return the sha256 over names and contents of all files asked for so far."""
        total = hashlib.sha256()
        for name in sorted(self.names):
            path = self.folder / name
            with reading.open_regular(path, LARGEST_FILE) as stream:
                size = os.fstat(stream.fileno()).st_size
                total.update(f"{name}\0{size}\0".encode())
                try:
                    while chunk := stream.read(_CHUNK):
                        total.update(chunk)
                except OSError as error:
                    raise reading.unreadable(path, error) from None
        return total.hexdigest()
