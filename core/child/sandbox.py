"""What a strategy's process may see, and whether this machine can hold it to that.

The code that it needs is there, read-only: the system's programs and libraries, the interpreter,
the environment, and of other folders on the search path what can be imported. Cases, data of
scenarios, stores, the working folder and home are not.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from femubench.core.child.confinement import Confinement
from femubench.core.child.guarded_child import GuardedChild, wait_for
from femubench.core.child.limits import Limits, Mode
from femubench.core.child.namespaces import Walls
from femubench.core.child.server import WalledServer
from femubench.core.child.syscall_filter import knows_processor
from femubench.core.errors import InputError

OFF = "it is switched off"
_OLDEST = (5, 14)  # Linux: counts the processes of a user in each namespace of users apart
_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store")
_SETTINGS = ("ld.so.cache", "ld.so.conf", "ld.so.conf.d", "alternatives", "localtime", "timezone")
_SITES = frozenset({"site-packages", "dist-packages"})
_DATA = frozenset({"scenarios", "papers"})  # parts of femubench that hold measured values
_MODULES = (".py", ".pyc", ".so", ".pth", ".zip", ".egg")
_ABOUT = (".dist-info", ".egg-info", ".egg-link", ".libs", ".data")
_PATIENCE = 20.0  # s
_PACKAGE = Path(__file__).absolute().parents[2]


@dataclass(frozen=True)
class Enclosure:
    """How strategies run on this machine.

    Arguments:
        sandbox: ``namespaces`` or ``none``.
        reason: why there is none.
    """

    sandbox: Literal["namespaces", "none"]
    reason: str = ""


def enclosure(mode: Mode) -> Enclosure:
    """Return how strategies run here.

    Arguments:
        mode: ``off`` or ``processes`` for no sandbox, ``auto`` for one where that is possible,
            ``require`` for no run without.

    Raises:
        InputError: where one is required and is not possible.
    """
    if mode in ("off", "processes"):
        return Enclosure("none", OFF)
    reason = missing()
    if reason is None:
        return Enclosure("namespaces")
    if mode == "require":
        expected = "Linux 5.14 or later that lets users make namespaces, or --sandbox auto"
        raise InputError(f"no sandbox: {reason}", key="sandbox", expected=expected)
    return Enclosure("none", reason)


def missing() -> str | None:
    """Return why no sandbox is possible, None where one is."""
    return _unfit() or _tried(tuple(sys.path))


def _unfit() -> str | None:
    """Return why none need be tried."""
    if sys.platform != "linux":
        return f"namespaces are of Linux, and this is {platform.system() or 'another system'}"
    release = platform.release()
    numbers = [int(part) for part in release.split(".")[:2] if part.isdigit()]
    if tuple(numbers) < _OLDEST:
        return f"Linux {release} is older than 5.14"
    if not knows_processor():
        return f"the system calls of {platform.machine()} are not known"
    return None


@cache
def _tried(path: tuple[str, ...]) -> str | None:
    """Return why a process could not go apart, None where one could."""
    how = Confinement(Limits(_PATIENCE), path, own=False, walled=True)
    with tempfile.TemporaryDirectory(prefix="femubench-try-") as folder:
        within = WalledServer(Limits.__module__, walls_around(()), folder)
        try:
            child = GuardedChild.start(how, Limits.__module__, within)
            child.ask(bytes, b"", how.limits)
            while (ending := child.progress(look=False)) is None:
                wait_for([child], _PATIENCE)
            child.kill()
            child.bury()
        except OSError as error:
            return (within.said or str(error)).rpartition("no sandbox: ")[2]
        finally:
            within.end()
    return None if ending.how == "answer" else ending.reason.rpartition("no sandbox: ")[2]


def walls_around(hidden: Iterable[str], code: Iterable[str] = ()) -> Walls:
    """Return what a strategy's process sees of this machine, with the search path as it is.

    Arguments:
        hidden: folders that are empty there, wherever they are.
        code: files that are there in addition to what can be imported.
    """
    links = tuple((path, os.readlink(path)) for path in _SYSTEM if os.path.islink(path))
    shown = {path for path in _SYSTEM if os.path.isdir(path) and not os.path.islink(path)}
    shown.update(p for p in (f"/etc/{name}" for name in _SETTINGS) if os.path.exists(p))
    for prefix in {sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix}:
        shown.update(_environment(Path(prefix)))
    for entry in dict.fromkeys([*sys.path, *_editable()]):
        shown.update(map(str, _code_of(Path(entry or os.curdir).absolute())))
    shown.update(map(str, _own_code()))
    shown.update(path for path in code if os.path.isfile(path))
    both = shown | {os.path.realpath(path) for path in shown}
    known = {*_own_folders(), *_other_own()}
    covers = {str(folder / name) for folder in known for name in _DATA}
    covers.update(path for given in hidden for path in (given, os.path.realpath(given)))
    outermost = tuple(path for path in _outermost(both) if path not in covers)
    covers.update(_elsewhere(covers, outermost))
    inside = (path for path in covers if any(Path(path).is_relative_to(top) for top in outermost))
    return Walls(outermost, links, tuple(_outermost(inside)))


def _environment(prefix: Path) -> Iterator[str]:
    """Yield the folders of an interpreter or environment, not what else may lie in its prefix."""
    if prefix in (Path("/"), Path("/usr")):
        return
    for name in ("bin", "lib", "lib64", "include", "share", "pyvenv.cfg"):
        if (prefix / name).exists():
            yield str(prefix / name)


def _own_folders() -> set[Path]:
    """Return where femubench lies: its package, and the clone that its links lead to."""
    linked = (path.resolve().parent for path in _PACKAGE.iterdir())
    return {_PACKAGE, _PACKAGE.resolve(), *linked}


def _other_own() -> Iterator[Path]:
    """Yield where femubench is installed as well, in a place whose other packages are shown."""
    for prefix in dict.fromkeys((sys.prefix, sys.base_prefix, "/usr", "/usr/local")):
        yield from Path(prefix).glob("lib*/python3*/*-packages/femubench")
    yield from (Path(entry or os.curdir).absolute() / "femubench" for entry in sys.path)


def _own_code() -> Iterator[Path]:
    """Yield the package of femubench, and where its links lead but to data."""
    yield _PACKAGE
    for part in _PACKAGE.resolve().iterdir():
        if part.is_symlink() and part.name not in _DATA:
            yield part.resolve()


def _editable() -> Iterator[str]:
    """Yield where packages lie that were installed in editable mode and have a finder."""
    for name, module in tuple(sys.modules.items()):
        if name.startswith("__editable__"):
            mapping = getattr(module, "MAPPING", None)
            if isinstance(mapping, dict):
                yield from map(str, mapping.values())


def _code_of(entry: Path) -> Iterator[Path]:
    """Yield what can be imported from an entry of the search path, or a package of its own."""
    if entry.name in _SITES or entry.is_file():
        yield entry
        return
    if (entry / "__init__.py").is_file():
        yield from () if _is_own(entry) else (entry,)
        return
    try:
        inside = sorted(entry.iterdir())
    except OSError:
        return
    # A clone of femubench is on the path where it is worked on: `_own_code` knows its parts.
    if any(_is_own(part) for part in inside):
        return
    for part in inside:
        if part.suffix in (_MODULES if part.is_file() else _ABOUT):
            yield part
        elif part.is_dir() and any(part.glob("*.py")):
            # A folder without __init__.py is a package too, and often holds more than code.
            yield from _code_of(part)


def _is_own(package: Path) -> bool:
    return package.name == "femubench" and package.resolve() in _own_folders()


def _outermost(paths: Iterable[str]) -> Iterator[str]:
    """Yield paths that are below no other, in order."""
    last = None
    for path in sorted(paths, key=lambda path: Path(path).parts):
        if last is None or not Path(path).is_relative_to(last):
            last = path
            yield path


def _elsewhere(paths: Iterable[str], shown: Iterable[str]) -> Iterator[str]:
    """Yield where paths also lie, in what is shown by another name: of lib as lib64, say."""
    listed = tuple(paths)
    for other in shown:
        real = os.path.realpath(other)
        for path in listed if real != other else ():
            if Path(path).is_relative_to(real):
                yield os.path.normpath(os.path.join(other, os.path.relpath(path, real)))
