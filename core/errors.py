"""The errors that femubench raises on purpose; everything else is a bug."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

# Characters of one part of a message, which may quote what a third party wrote; a command that
# helps may have five paths.
_LONGEST = 1000


def clipped(text: str, longest: int = _LONGEST) -> str:
    """Return text that is no longer, with dots where its end is missing."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def harmless(text: str) -> str:
    """Return text on one line, with escapes for what a terminal would obey or could not show.

    Names of files and keys come from third parties; they must not move a cursor or hide a line.
    """
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)


def harmless_lines(text: str) -> str:
    """Return a text of several lines, likewise."""
    lines = text.split("\n")
    return "\n".join("".join(c if c.isprintable() else ascii(c)[1:-1] for c in x) for x in lines)


class FemubenchError(Exception):
    """Base of all errors that a user can act upon."""


class InputError(FemubenchError):
    """Tell in one line what is wrong in an input, where, and what was expected.

    Arguments:
        what: the fault, e.g. ``"negative density -2700.0"``.
        file: the file that holds it.
        line: its line there, from 1.
        key: the dotted key or the column, e.g. ``model.members[2].ends``.
        expected: what would have been right, e.g. ``"a number > 0"``.
    """

    remedy: object = None  # the keys that would make it right, where they are known

    def __init__(
        self,
        what: str,
        *,
        file: Path | str | None = None,
        line: int | None = None,
        key: str | None = None,
        expected: str | None = None,
    ) -> None:
        self.what, self.file, self.line, self.key, self.expected = what, file, line, key, expected
        where = "" if file is None else str(file)
        where += "" if line is None else f":{line}"
        parts = [part for part in (where, clipped(key or ""), clipped(what)) if part]
        text = ": ".join(parts) + ("" if expected is None else f" (expected {clipped(expected)})")
        super().__init__(harmless(text))

    def __reduce__(self) -> tuple[object, ...]:
        return _input_error, (self.what, self.file, self.line, self.key, self.expected)


class OutputError(FemubenchError):
    """Tell in one line which file could not be written, and why."""

    def __init__(self, file: Path | str, error: OSError) -> None:
        self.file, self.error = file, error
        super().__init__(harmless(f"{file}: cannot be written: {error.strerror or error}"))

    def __reduce__(self) -> tuple[object, ...]:
        return OutputError, (self.file, self.error)


class UnknownNameError(InputError, KeyError):
    """A name that is not there, with the near matches; a KeyError to who looks it up."""

    __str__ = Exception.__str__  # that of KeyError quotes the whole sentence

    def __reduce__(self) -> tuple[object, ...]:
        return UnknownNameError, (self.what,)


def _input_error(
    what: str, file: Path | str | None, line: int | None, key: str | None, expected: str | None
) -> InputError:
    return InputError(what, file=file, line=line, key=key, expected=expected)


def require(package: str, extra: str, what: str) -> None:
    """Make sure that a package of an extra is there.

    Arguments:
        what: needs it, e.g. ``"format parquet"``.

    Raises:
        InputError: naming the extra to install.
    """
    if find_spec(package) is None:
        raise InputError(f"{what} needs {package}", expected=f"pip install 'femubench[{extra}]'")


class ModelError(FemubenchError):
    """A model that cannot be built or solved, e.g. a degree of freedom without any stiffness.

    Arguments:
        item: the part of the frame that is at fault, e.g. a member; None where it is no single one.
    """

    def __init__(self, what: str, item: object = None) -> None:
        super().__init__(what)
        self.item = item


class PluginError(FemubenchError):
    """A plugin that cannot be loaded or breaks its contract; names plugin and hook."""


class NotApplicable(FemubenchError):  # noqa: N818 - a verdict of the contract, not a fault
    """A strategy needs what the case does not have; the reason says what."""


class StrategyFailure(FemubenchError):  # noqa: N818 - names the status `failed`
    """A strategy cannot give a model; the reason carries the measured figure."""


class SelfCheckFailed(StrategyFailure):
    """A strategy's own promise is not met by its result.

    Arguments:
        promise: what was promised, in words, e.g. ``"sum of the masses kept"``.
        measured: the relative error that was found.
        allowed: the largest one that would have been accepted.
    """

    def __init__(self, promise: str, measured: float, allowed: float) -> None:
        self.promise, self.measured, self.allowed = promise, measured, allowed
        super().__init__(f"{promise}: off by {measured:.3g}, the method promises {allowed:.3g}")

    def __reduce__(self) -> tuple[object, ...]:
        return SelfCheckFailed, (self.promise, self.measured, self.allowed)


class Diverged(StrategyFailure):
    """An iteration that left every sensible range; the reason says at which step."""
