"""What ``run`` and ``report`` share: reporters by name or by suffix, and the exit code of a run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from femubench.core.cli.registry import unknown
from femubench.core.errors import FemubenchError, InputError, PluginError

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins
    from femubench.core.plugin.roles import Reporter
    from femubench.core.schema.results import Run

# A strategy that a case has no room for is no failure.
FINE = frozenset({"ok", "not-applicable"})


def exit_code(run: Run) -> int:
    """Return 1 when some result is a failure, else 0."""
    return int(any(result.status not in FINE for result in run.results))


def reporter(plugins: Plugins, name: str) -> Reporter:
    """Return the reporter of that name.

    Raises:
        PluginError: when there is none, which for a built-in name means a broken installation.
    """
    if name not in plugins.reporters:
        raise PluginError(unknown("report format", name, plugins.reporters))
    return plugins.reporters[name]


def rendered(found: Reporter, run: Run, exhibits: object = None) -> str | bytes:
    """Return a reporter's text, or its bytes where the format is no text.

    Arguments:
        exhibits: what the store has to draw of the run, for a reporter that can.

    Raises:
        PluginError: naming the reporter, whatever it raised.
    """
    as_bytes, with_exhibits = (
        getattr(found, name, None) for name in ("render_bytes", "render_with")
    )
    try:
        if callable(as_bytes):
            content = as_bytes(run)
        elif callable(with_exhibits):
            content = with_exhibits(run, exhibits)
        else:
            content = found.render(run)
    except FemubenchError:
        raise
    except Exception as error:
        what = f"reporter {found.name!r} failed: {type(error).__name__}: {error}"
        raise PluginError(what) from error
    expected = bytes if callable(as_bytes) else str
    if not isinstance(content, expected):
        raise PluginError(
            f"reporter {found.name!r} gave {type(content).__name__}, expected {expected.__name__}"
        )
    return content


def text_of(found: Reporter, content: str | bytes) -> str:
    """Return what a reporter gave, for the screen.

    Raises:
        InputError: for a format that is no text.
    """
    if isinstance(content, bytes):
        raise InputError(f"format {found.name} is not a text format", expected="a file")
    return content


def is_for_files(found: Reporter) -> bool:
    """Tell whether a format is of no use on the screen."""
    return found.name == "html" or callable(getattr(found, "render_bytes", None))


def reporter_for(plugins: Plugins, path: Path) -> Reporter:
    """Return the reporter that writes files of a path's suffix.

    Raises:
        InputError: when none does.
    """
    # Of two formats with one suffix the first, of two suffixes that fit the longer.
    suffixes = {found.suffix: found for found in reversed(list(plugins.reporters.values()))}
    for suffix, found in sorted(suffixes.items(), key=lambda item: -len(item[0])):
        if path.name.endswith(suffix):
            return found
    raise InputError(
        f"no report format has the suffix {path.suffix!r}",
        file=path,
        expected=f"one of {', '.join(sorted(suffixes))}",
    )


def run_name(run: Run) -> str:
    """Return the run's id as it may stand in a file name."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", str(run.meta.get("run", "run"))).strip(".-") or "run"
