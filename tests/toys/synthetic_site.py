"""A published site of runs that nobody made, to see how its pages cope."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from synthetic_run import synthetic_run

from femubench import publish
from femubench.results import RunData


def synthetic_site(
    folder: Path,
    strategies: int = 40,
    scenarios: int = 54,
    *,
    names: Sequence[str] = (),
    kind: str = "frame",
    **stated: Any,
) -> Path:
    """Publish two runs into a folder; the second has another version of the first two strategies.

    Arguments:
        strategies, scenarios, names: see `synthetic_run`.
        kind: class of every second case, and part of the name of the other version.
        stated: meta data instead of those that are made up.
    """
    run = synthetic_run(strategies, scenarios, names=names)
    cases = list(run.meta["cases"])
    classes = {case: (kind,) if k % 2 else ("plain",) for k, case in enumerate(cases)}
    meta = {**run.meta, "structures": {c: c.partition("/")[0] for c in cases}, "classes": classes}
    digests = {case: about["digest"] for case, about in meta["cases"].items()}
    for number, version in enumerate(("1.0", f"2.0 {kind}")):
        results = [
            replace(
                result,
                key=sha256(f"{version} {result.case} {result.strategy}".encode()).hexdigest()[:32],
                provenance={
                    "case": digests[result.case],
                    "strategy": version,
                    "femubench": "0.1.0",
                },
            )
            for result in run.results
            if number == 0 or result.strategy in meta["strategies"][:2]
        ]
        moment = {"run": f"run {number}", "started": f"2026-01-0{number + 1}T00:00:00Z"}
        made = RunData({**meta, **moment, **stated}, tuple(results))
        publish(folder, made, unverified=True, address="https://example.org/board")
    return folder
