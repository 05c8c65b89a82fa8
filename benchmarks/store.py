"""What a store of many results costs: to write, to load and rank, to resume, in time and memory.

    python benchmarks/store.py [--results 100000] [--store DIR] [--times 3]

The results are made up from those of one job, 25 cases x 20 strategies x seeds. Seconds are of the
processor, the least of three fresh processes, next to those of an anchor in the same process: ten
solutions of a dense symmetric eigenvalue problem of 600 unknowns. DIR is kept and used again.
`--times 0` measures once in this process.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from femubench.core.run.recording import Results, begin_run
from femubench.core.run.store import Store
from femubench.core.schema.results import Block
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.ranking import list_models
from femubench.results import JobResult, PairedMode

CASES, STRATEGIES = 25, 20
RUN = "20260101T000000Z-5e7e71"
BARS = {"load": 5.0, "resume": 3.0}  # s: loading with the leaderboard, and resuming


class Slot(NamedTuple):
    """As much of a job as is needed to know whether it is done."""

    key: str
    nominal: str
    case: Any = None


def meta_of(seeds: int) -> dict[str, Any]:
    """Return the meta data of a run that nobody made."""
    cases = [f"case-{n:02d}" for n in range(CASES)]
    draw = [3.0, 2.5, 0.0, 0.0, 3.0, -2.0, 4.0, -5.0, 6.0]
    return {
        "run": RUN,
        "seed": 0,
        "seeds": list(range(1, seeds + 1)),
        "plan": "plan",
        "cases": {name: {"title": name, "digest": f"{n:064d}"} for n, name in enumerate(cases)},
        "strategies": [f"strategy-{n:02d}" for n in range(STRATEGIES)],
        "yardstick": "textbook",
        "models": list_models({name: {"textbook": _blocks_of(draw, 0)} for name in cases}),
    }


def results_of(meta: dict[str, Any]) -> Iterator[JobResult]:
    """Yield results as large as those of a strategy with three parameters and ten iterations."""
    random = np.random.default_rng(20260101)
    own = {"blas": "openblas 0.3.30 SkylakeX", "git": "0" * 40, "cpu": "x" * 30, "case": "1" * 64}
    names = [f"E at joint {n}" for n in range(3)]
    for case in meta["cases"]:
        for seed in meta["seeds"]:
            for strategy in meta["strategies"]:
                draw = random.lognormal(0.0, 0.5, 48).tolist()
                blocks = _blocks_of(draw, int(strategy[-2:]))
                steps = [draw[9 + 3 * n : 12 + 3 * n] for n in range(10)]
                yield JobResult(
                    case,
                    strategy,
                    seed,
                    "ok",
                    seconds=draw[2],
                    blocks=blocks,
                    rigid_body_modes=3,
                    rigid_body_modes_expected=3,
                    negative_eigenvalues=0,
                    parameter_count=3,
                    evaluations=12,
                    parameters=tuple(
                        {"name": n, "before": 1.0, "after": v, "unit": "", "std": None}
                        for n, v in zip(names, draw[40:43], strict=True)
                    ),
                    history=tuple({"iteration": 1.0, "cost": c, "step": s} for c, s, _ in steps),
                    diagnostics={"iterations": 10.0, "converged": 1.0},
                    key=f"{case}{strategy}{seed:08d}",
                    provenance={"python": "3.11.7", "numpy": "2.4.6", "seed": seed, **own},
                    nominal="textbook",
                )


def _blocks_of(draw: list[float], strategy: int) -> dict[str, Block]:
    return {
        "used": _block(draw[0], draw[4:7], 1, strategy),
        "higher": _block(draw[1], draw[7:9], 4, strategy),
    }


def _block(percent: float, errors: list[float], first: int, strategy: int) -> Block:
    std = 0.5 if strategy % 2 else None
    modes = (
        PairedMode(
            first + n, 100.0 * (first + n), 100.0 * (first + n) + e, 1.0 / (1.0 + abs(e)), None, std
        )
        for n, e in enumerate(errors)
    )
    return Block(percent, 0.99, tuple(modes))


def make(folder: Path, results: int) -> Store:
    """Write a store of about so many results, unless it is there."""
    store = Store(folder)
    if not store.files:
        meta = meta_of(results // (CASES * STRATEGIES))
        store.begin(meta)
        for result in results_of(meta):
            store.append(RUN, result)
        store.end(RUN, {"finished": "2026-01-01T00:00:00+00:00", "interrupted": False})
    return store


def load(store: Store) -> int:
    """Load a run and rank its strategies."""
    run = store.load()
    leaderboard(run)
    return len(run.results)


def resume(store: Store) -> int:
    """Find that nothing of a run is missing; return the number of its results."""
    from contextlib import ExitStack

    meta = meta_of(1)
    with ExitStack() as stack:
        meta, known = begin_run(stack, store, meta, None, resume=True)
        slots: Any = [Slot(key, "textbook") for key in known.found]
        found = Results((), None, meta["run"], None)
        found._slots = slots
        assert found.keep(known, 1) == []
    return len(slots)


def check(store: Store) -> int:
    """Read every record to the end; return the number of faults."""
    return len(store.faults())


def append(store: Store) -> int:
    """Write a thousand results into a run of their own."""
    meta = {**meta_of(2), "run": "appended"}
    results = [*results_of(meta)][:1000]
    with tempfile.TemporaryDirectory(dir=store.folder) as folder, Store(folder).exclusive(RUN):
        other = Store(folder)
        other.begin(meta)
        start = time.process_time()
        for result in results:
            other.append(meta["run"], result)
        _APPENDED.append(time.process_time() - start)
    return len(results)


_APPENDED: list[float] = []
MEASURED: dict[str, Callable[[Store], int]] = {
    "append": append,
    "load": load,
    "resume": resume,
    "check": check,
}


@cache
def anchor() -> float:
    """Return the seconds of ten dense eigenvalue solutions."""
    matrix = np.random.default_rng(0).standard_normal((600, 600))
    start = time.process_time()
    for _ in range(10):
        np.linalg.eigh(matrix + matrix.T)
    return time.process_time() - start


def measured(folder: Path, what: str, times: int) -> dict[str, float]:
    """Return seconds of processor, those of the anchor, peak memory in MB: the least of several.

    Arguments:
        folder: of the store.
        what: a name of `MEASURED`.
    """
    if not times:
        return one(folder, what)
    command = [sys.executable, __file__, "--store", str(folder), "--one", what]
    runs = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(times)
    ]
    return {name: min(run[name] for run in runs) for name in runs[0]}


def one(folder: Path, what: str) -> dict[str, float]:
    """Measure once in this process."""
    import pandas as pd  # noqa: F401 - what is imported is not measured
    import scipy.stats  # noqa: F401

    reference = anchor()
    start = time.process_time()
    count = MEASURED[what](Store(folder))
    # What makes the results is not measured.
    seconds = _APPENDED.pop() if _APPENDED else time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"seconds": seconds, "anchor": reference, "megabytes": peak, "count": count}


def main() -> None:
    """Measure and print."""
    words = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    words.add_argument("--results", type=int, default=100_000)
    words.add_argument("--store", type=Path)
    words.add_argument("--times", type=int, default=3)
    words.add_argument("--one", choices=list(MEASURED), help=argparse.SUPPRESS)
    asked = words.parse_args()
    if asked.one is not None:
        print(json.dumps(one(asked.store, asked.one)))
        return
    with tempfile.TemporaryDirectory() as made:
        folder = asked.store or Path(made)
        (file,) = make(folder, asked.results).files
        print(f"{asked.results} results, {file.stat().st_size / 1e6:.0f} MB")
        for what in MEASURED:
            found = measured(folder, what, asked.times)
            bar = f", asked for {BARS[what]:g} s" if what in BARS else ""
            print(
                f"{what}: {found['seconds']:.2f} s{bar}, {found['seconds'] / found['anchor']:.1f} "
                f"of the anchor's {found['anchor']:.2f} s; {found['megabytes']:.0f} MB"
            )


if __name__ == "__main__":
    main()
