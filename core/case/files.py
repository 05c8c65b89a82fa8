"""The files of a case: found inside its folder only, read with limits, remembered for the hash."""

from __future__ import annotations

import hashlib
import posixpath
from pathlib import Path, PurePosixPath, PureWindowsPath

from femubench.core.case.faults import Misfit
from femubench.core.errors import InputError

LARGEST_TEXT = 64 * 2**20  # bytes
CASE_FILE = "case.toml"


class CaseFiles:
    """A case folder and the files of it that were asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: set[str] = {CASE_FILE}
        if not folder.is_dir():
            expected = f"a folder with a {CASE_FILE}"
            raise InputError("folder does not exist", file=folder, expected=expected)
        if not self.case_file.is_file():
            raise InputError("missing file", file=self.case_file, expected="the file of the case")

    @property
    def case_file(self) -> Path:
        """Return the path of `case.toml`."""
        return self.folder / CASE_FILE

    def path(self, name: str) -> Path:
        """Return the path of a file that the case names.

        Raises:
            Misfit: when it lies outside the folder or does not exist.
        """
        windows = PureWindowsPath(name)
        normal = posixpath.normpath(name.replace("\\", "/"))
        outside = normal == ".." or normal.startswith("../")
        if outside or PurePosixPath(normal).is_absolute() or windows.drive or windows.root:
            raise Misfit(f"{name!r} leads out of the case folder", "a file inside the folder")
        path = self.folder / normal
        if not path.is_file():
            raise Misfit(f"there is no file {name!r}", f"a file in {self.folder}")
        self.names.add(normal)
        return path

    def digest(self) -> str:
        """Return the sha256 over names and contents of all files asked for so far."""
        total = hashlib.sha256()
        for name in sorted(self.names):
            content = (self.folder / name).read_bytes()
            total.update(f"{name}\0{len(content)}\0".encode())
            total.update(content)
        return total.hexdigest()


def read_text(path: Path) -> str:
    """Return the text of a file, without a byte order mark, with any kind of line ends.

    Raises:
        InputError: when it cannot be read, is too large, or is not UTF-8.
    """
    try:
        if path.stat().st_size > LARGEST_TEXT:
            expected = f"at most {LARGEST_TEXT // 2**20} MiB"
            raise InputError("file is too large", file=path, expected=expected)
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise InputError("not a text", file=path, line=line, expected="UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
