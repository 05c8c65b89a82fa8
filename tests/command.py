"""`bench`, called in this process."""

from __future__ import annotations

from typing import Any

from click.testing import CliRunner, Result

from femubench.core.cli.main import bench


def call_bench(*words: object, code: int | None = 0, **how: Any) -> Result:
    """Return what `bench` says to some words; it must end with a code, with any where None."""
    done = CliRunner().invoke(bench, [str(word) for word in words], **how)
    assert code in (None, done.exit_code), done.output
    return done
