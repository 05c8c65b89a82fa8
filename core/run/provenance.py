"""What makes two jobs the same, where a result comes from, where a run was made."""

from __future__ import annotations

import hashlib
import os
import platform
import secrets
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from femubench.core.case.case import Case
from femubench.core.modal.factorisation import solver_name, solver_note
from femubench.core.modal.questions import question_measurement
from femubench.core.plugin.distribution import about
from femubench.core.plugin.foreign import ForeignStrategy
from femubench.core.plugin.variants import Variant
from femubench.core.roles import StrategyRole
from femubench.core.score.bounded_gain import Rule
from femubench.core.score.scoring import Reference
from femubench.core.source_files import Stamp, stamp, stamps
from femubench.core.version import __version__

_OWN = "femubench"


def job_key(case: Case, strategy: str, code: bytes, version: str, seed: int) -> str:
    """Return the key of a job: equal keys have equal results, anyone who computes them.

    Arguments:
        case: its name and the digest of its files go in.
        code: the pickled strategy: its class and its parameters.
        version: from `strategy_version`.
        seed: of the noise.
    """
    own = hashlib.sha256(code).hexdigest()
    return _hash(__version__, case.name, case.digest, strategy, own, version, str(seed))


def plan_digest(keys: Iterable[str]) -> str:
    """Return one digest for the keys of all jobs of a run, in any order."""
    return _hash(*sorted(keys))


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def strategy_version(strategy: StrategyRole) -> str:
    """Return the version of the package that a strategy comes from, and a digest of its source.

    The digest is there because a package in the making changes and keeps its number.
    """
    inner = strategy.base if isinstance(strategy, Variant) else strategy
    if isinstance(inner, ForeignStrategy):
        number = inner.handle.origin.distribution.rpartition(" ")[2]
        files = tuple(one for top in inner.modules for one in stamps(top))
        return f"{number}+{_digest(files)}"
    top, module = home_of(strategy)
    return f"{_number(top)}+{source_digest(top, module)}"


def about_of(strategy: StrategyRole) -> dict[str, str]:
    """Return what the package of a strategy says of it; of one given by hand, its DOI alone."""
    inner = strategy.base if isinstance(strategy, Variant) else strategy
    if isinstance(inner, ForeignStrategy):
        return dict(inner.about)
    return about(_OWN if comes_along(strategy) else "", getattr(inner, "doi", ""))


def comes_along(strategy: StrategyRole) -> bool:
    """Tell whether a strategy is one of those that come with femubench."""
    return home_of(strategy)[0] == _OWN


def home_of(strategy: StrategyRole) -> tuple[str, str]:
    """Return the package and the module of a strategy."""
    inner = strategy.base if isinstance(strategy, Variant) else strategy
    if isinstance(inner, ForeignStrategy):
        return inner.modules[0], inner.handle.origin.value.partition(":")[0]
    module = type(inner).__module__
    return module.partition(".")[0], module


def source_digest(top: str = _OWN, module: str = "") -> str:
    """Return a digest of the Python files of a package, or of the file of a lone module."""
    own = getattr(sys.modules.get(module), "__file__", None)
    return _digest(stamps(top) or ((stamp(own),) if own else ()))


def package_version(top: str) -> str:
    """Return the version of an installed package and a digest of its source, without importing it.

    Arguments:
        top: name of the package, or of a module that is no package.
    """
    found = stamps(top)
    return f"{_installed(top, '0')}+{_digest(found)}" if found else "not installed"


@cache
def _number(top: str) -> str:
    return str(getattr(sys.modules.get(top), "__version__", "") or _installed(top, "0"))


def _installed(package: str, missing: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return missing


@lru_cache(maxsize=64)
def _digest(stamps: tuple[Stamp, ...]) -> str:
    """Return a digest of files; they are read once as long as they stay as they are."""
    found = hashlib.sha256()
    for name, _, _ in stamps:
        file = Path(name)
        found.update(file.name.encode() + b"\0")
        with suppress(OSError):
            found.update(file.read_bytes())
    return found.hexdigest()[:12]


def provenance(meta: Mapping[str, Any], digest: str, version: str, seed: int) -> dict[str, Any]:
    """Return where a result comes from, in plain data."""
    machine = meta["machine"]
    return {
        **meta["versions"],
        "blas": machine["blas"],
        "cpu": machine["cpu"],
        "sandbox": meta["sandbox"],
        "git": meta["git_commit"],
        "case": digest,
        "strategy": version,
        "seed": seed,
    }


@cache
def cpu_name() -> str:
    """Return what the machine calls its processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return " ".join(line.partition(":")[2].split())
    except OSError:
        pass
    return platform.processor() or platform.machine()


@cache
def blas_name() -> str:
    """Return the linear algebra libraries that are loaded, with version and kernel."""
    from threadpoolctl import threadpool_info

    found = {
        " ".join(
            str(item[key]) for key in ("internal_api", "version", "architecture") if item.get(key)
        )
        for item in threadpool_info()
        if item.get("user_api") == "blas"
    }
    return ", ".join(sorted(found)) or "unknown"


_PACKAGES = ("femubench", "numpy", "scipy")


def new_run_id() -> str:
    """Return a run id that sorts by time: UTC time stamp and six random hexadecimal digits."""
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


def run_meta(
    cases: Sequence[Case],
    strategies: Sequence[StrategyRole],
    references: Mapping[str, Reference],
    seeds: Sequence[int],
    settings: Mapping[str, Any],
    stated: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the meta data of a run: id, seeds, versions, machine, commit, cases, references.

    Arguments:
        settings: ``seed`` of the run's statistics, ``jobs``, ``timeout`` in s, ``memory`` in bytes,
            ``plan`` (digest of the keys of all jobs), ``request`` (what was asked for, so that the
            run can be continued and repeated).
        stated: what else is said of the cases, by case: ``starts``, ``classes``.
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
            "solver": solver_name(),
            "blas": blas_name(),
        },
        "git_commit": git_commit(),
        "structures": {case.name: case.structure or case.name for case in cases},
        "notes": [
            *(f"{case.name}: {note.rstrip('.')}" for case in cases for note in _notes(case)),
            *solver_note(),
        ],
        "cases": {case.name: {"title": case.title, "digest": case.digest} for case in cases},
        **stated,
        "strategies": [strategy.name for strategy in strategies],
        "citations": {strategy.name: strategy.citation for strategy in strategies},
        "about": {s.name: known for s in strategies if (known := about_of(s))},
        "baseline": next((s.name for s in strategies if getattr(s, "baseline", False)), None),
        "yardsticks": {
            s.name: str(said) for s in strategies if (said := getattr(s, "yardstick", ""))
        },
        "rule": Rule().to_json(),
        "reference": {name: item.rms_percent for name, item in references.items()},
    }


def _notes(case: Case) -> tuple[str, ...]:
    given = replace(case.measurement, responses=case.used_measurement().responses)
    return *case.notes, *question_measurement(case.model, given)


def versions(*more: str) -> dict[str, str]:
    """Return the versions of Python, of the packages that results depend on, and of more."""
    packages = (*_PACKAGES, *more)
    installed = {package: _installed(package, "not installed") for package in packages}
    return {"python": platform.python_version(), **installed}


def git_commit() -> str | None:
    """Return the commit of the repository around the working directory, None without one."""
    try:
        command = ["git", "rev-parse", "HEAD"]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() or None
