"""`bench`, called in this process, and Python in a fresh one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from click.testing import CliRunner, Result

from femubench.core.cli.main import bench


def call_bench(*words: object, code: int | None = 0, **how: Any) -> Result:
    """Return what `bench` says to some words; it must end with a code, with any where None."""
    done = CliRunner().invoke(bench, [str(word) for word in words], **how)
    assert code in (None, done.exit_code), done.output
    return done


def run_python(
    *words: object, code: int | None = 0, path: Path | None = None, **how: Any
) -> subprocess.CompletedProcess[str]:
    """Return what a fresh interpreter says, which finds what this one does; likewise.

    Arguments:
        path: a folder in which it looks first.
        how: as `subprocess.run` has it.
    """
    places = [str(place) for place in (path, *sys.path) if place]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
    command = [sys.executable, *map(str, words)]
    how = {"env": environment, "capture_output": True, "text": True, "check": False, **how}
    done = subprocess.run(command, **how)
    assert code in (None, done.returncode), done.stderr
    return done
