"""Where and when a run was made, in plain data."""

from __future__ import annotations

import os
import platform
import secrets
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from typing import Any

from femubench.core.case.case import Case
from femubench.core.harness.keys import blas_name, cpu_name
from femubench.core.harness.scoring import Reference
from femubench.core.strategy import Strategy

_PACKAGES = ("femubench", "numpy", "scipy")


def new_run_id(now: datetime | None = None) -> str:
    """Return a run id that sorts by time: UTC time stamp and six random hexadecimal digits."""
    moment = datetime.now(UTC) if now is None else now
    return f"{moment:%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


def run_meta(
    cases: Sequence[Case],
    strategies: Sequence[Strategy],
    references: Mapping[str, Reference],
    seeds: Sequence[int],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the meta data of a run: id, seeds, versions, machine, commit, cases, references.

    Arguments:
        settings: ``seed`` of the run's statistics, ``jobs``, ``timeout`` in s, ``memory`` in bytes,
            ``plan`` (digest of the keys of all jobs), ``request`` (what was asked for, so that the
            run can be continued and repeated).
    """
    return {
        "run": new_run_id(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "seeds": list(seeds),
        **settings,
        "versions": versions(),
        "machine": {
            "platform": platform.platform(),
            "cpu": cpu_name(),
            "cpu_count": os.cpu_count(),
            "blas": blas_name(),
        },
        "git_commit": git_commit(),
        "cases": {case.name: {"title": case.title, "digest": case.digest} for case in cases},
        "strategies": [strategy.name for strategy in strategies],
        "citations": {strategy.name: strategy.citation for strategy in strategies},
        "reference": {name: item.rms_percent for name, item in references.items()},
    }


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results depend on."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def git_commit() -> str | None:
    """Return the commit of the repository around the working directory, None without one."""
    try:
        answer = subprocess.run(
            ["git", "rev-parse", "HEAD"],
            capture_output=True,
            text=True,
            timeout=5.0,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() or None
