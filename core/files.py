"""Read files of third parties with limits, and write files in one step."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from femubench.core.errors import InputError, OutputError

MIB = 2**20
# A pipe is not waited for, and Windows leaves the line ends alone.
_READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def check_regular(path: Path, largest: int) -> None:
    """Check that a path is a file with bytes in it, and not too many, before it is opened.

    A pipe would be waited for and a device may act on being opened.

    Arguments:
        largest: the size in bytes up to which it is read.

    Raises:
        InputError: for anything else.
    """
    try:
        found = path.stat()
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    _check(found, path, largest)


def open_regular(path: Path, largest: int) -> BinaryIO:
    """Return a stream on a regular file, without ever waiting for it to open.

    Raises:
        InputError: when it is no regular file, is too large or cannot be opened.
    """
    check_regular(path, largest)
    try:
        # Should a pipe have taken its place meanwhile, this does not wait for a writer.
        descriptor = os.open(path, _READ)
    except OSError as error:
        raise unreadable(path, error) from None
    try:
        _check(os.fstat(descriptor), path, largest)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_bytes(path: Path, largest: int) -> bytes:
    """Return the content of a regular file.

    Raises:
        InputError: when it is no regular file, is too large or cannot be read.
    """
    with open_regular(path, largest) as stream:
        try:
            content = stream.read(largest + 1)
        except OSError as error:
            raise unreadable(path, error) from None
    if len(content) > largest:
        raise _too_large(path, largest)
    return content


def read_text(path: Path, largest: int) -> str:
    """Return the text of a file, without a byte order mark, with any kind of line ends.

    Raises:
        InputError: when it cannot be read, is too large, or is not UTF-8.
    """
    try:
        text = read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise InputError("not a text", file=path, line=line, expected="UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def resolve_path(path: Path) -> Path:
    """Return the path without links; raises InputError where links lead round in a circle."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:  # the latter before Python 3.13
        what = "is a link that leads back to itself"
        raise InputError(what, file=path, expected="a file or a folder") from error


def unreadable(path: Path, error: OSError | ValueError) -> InputError:
    """Return the error of a file that the system does not hand out."""
    why = error.strerror if isinstance(error, OSError) else str(error)
    return InputError(f"cannot be read: {why}", file=path, expected="a file that can be read")


def _check(found: os.stat_result, path: Path, largest: int) -> None:
    if not stat.S_ISREG(found.st_mode):
        what = "is a folder" if stat.S_ISDIR(found.st_mode) else "is a pipe or a device"
        raise InputError(what, file=path, expected="a regular file")
    if found.st_size > largest:
        raise _too_large(path, largest)


def _too_large(path: Path, largest: int) -> InputError:
    limit = f"{largest // MIB} MiB" if largest >= MIB else f"{largest} bytes"
    return InputError("file is too large", file=path, expected=f"at most {limit}")


@contextmanager
def limit_memory(most: int) -> Iterator[None]:
    """Let what is done inside take so many bytes more than now; beyond, MemoryError is raised.

    Libraries take memory for what the header of a file claims. Only Linux counts it; elsewhere
    nothing is limited.
    """
    try:
        import resource
    except ModuleNotFoundError:
        resource = None  # type: ignore[assignment]
    if resource is None or not sys.platform.startswith("linux"):
        yield
        return
    taken = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    lower = min(v for v in (taken + most, soft, hard) if v != resource.RLIM_INFINITY)
    resource.setrlimit(resource.RLIMIT_DATA, (lower, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write bytes, or a text with a final newline; a reader sees the old file or the new.

    Raises:
        OutputError: where that fails; then the old file is as it was.
    """
    if isinstance(content, str):
        content = (content.rstrip("\n") + "\n").encode()
    try:
        _write_next_to(path, content)
    except OSError as error:
        raise OutputError(path, error) from error


def _write_next_to(path: Path, content: bytes) -> None:
    """Write a file under another name, then give it its own."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        # mkstemp gives 0600; a report is as public as any file that the user makes.
        part.chmod(0o666 & ~_umask())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_writable(path: Path) -> None:
    """Make sure that a file can be written before hours are spent on its content.

    Raises:
        InputError: when it is a folder, or its folder is missing or may not be written to.
    """
    if path.is_dir():
        raise InputError("is a folder", file=path, expected="the name of a file")
    if not path.parent.is_dir():
        raise InputError("its folder does not exist", file=path, expected="an existing folder")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError("its folder cannot be written to", file=path)


def check_can_make(folder: Path) -> None:
    """Make sure that a folder is there or can be made, before the work that fills it.

    Raises:
        InputError: when it, or the nearest folder above it, cannot be written to.
    """
    above = folder
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise InputError("cannot be written to", file=above, expected="a folder of yours")


def make_folder(folder: Path) -> None:
    """Make a folder with its parents.

    Raises:
        InputError: when that fails or the folder may not be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"cannot make the folder: {fault.strerror}", file=folder) from fault
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError("folder cannot be written to", file=folder)


@contextmanager
def folder_made(folder: Path) -> Iterator[None]:
    """Make a folder with its parents; those that are empty go again where what follows fails.

    Raises:
        InputError: when that fails or the folder may not be written to.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    make_folder(folder)
    try:
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def check_new(folder: Path) -> None:
    """Make sure that a case can be written to a folder before the search starts.

    Raises:
        InputError: when it holds something or cannot be made.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError("is not empty", file=folder, expected="a new or an empty folder")
    check_can_make(folder)
