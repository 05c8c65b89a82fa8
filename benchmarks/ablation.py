"""What each part of `diagnosed` is worth: the same strategy with one part left out at a time.

    python benchmarks/ablation.py             # the default set, six minutes on two cores
    python benchmarks/ablation.py frame hframe --jobs 2

An effect is left out where `diagnosed` put it into the model; elsewhere the model stays. Figures
are errors on unseen data over those of the textbook model, geometric means over structures: less is
better.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import get_args

from tabulate import tabulate
from unseen import mean_ratio, unseen_logs

import femubench
from femubench import Run
from femubench.core.schema.results import Nominal

WHOLE, ZERO = "diagnosed", "textbook"
PARTS = {
    f"{WHOLE}:textbook=false": "without the effects that handbooks have a value of",
    f"{WHOLE}:meet_frequencies=false": "without meeting the frequencies at the end",
}


def effects_of(run: Run) -> dict[str, list[str]]:
    """Return the cases in whose model an effect stands, by effect."""
    found: dict[str, list[str]] = {}
    for result in run.results:
        if result.strategy == WHOLE:
            for name in dict.fromkeys(p["name"].partition(" ")[0] for p in result.parameters):
                found.setdefault(name, []).append(result.case)
    return found


def ablated(cases: Sequence[str], nominal: Nominal, jobs: int) -> dict[str, tuple[float, int]]:
    """Return the mean ratio of every variant, and in how many cases its model differs.

    Arguments:
        cases: names; the default set where there is none.
        nominal: the model that all start from.
        jobs: worker processes.
    """
    run = femubench.rank(cases, [ZERO, WHOLE, *PARTS], nominal=nominal, jobs=jobs)
    logs = unseen_logs(run)
    count = len(run.meta["cases"])
    found = {name: (mean_ratio(logs[name]), count) for name in (ZERO, WHOLE, *PARTS)}
    for effect, touched in effects_of(run).items():
        variant = f"{WHOLE}:without={effect}"
        again = femubench.rank(touched, [ZERO, variant], nominal=nominal, jobs=jobs)
        kept = [r for r in run.results if r.strategy == WHOLE and r.case not in touched]
        own = [r for r in again.results if r.strategy == variant]
        zeros = [r for r in run.results if r.strategy == ZERO]
        results = (*zeros, *own, *(replace(r, strategy=variant) for r in kept))
        found[variant] = (mean_ratio(unseen_logs(Run(run.meta, results))[variant]), len(touched))
    return found


def rows(boards: dict[str, dict[str, tuple[float, int]]]) -> Iterable[list[str]]:
    """Yield a line a variant, those of both boards, the worst loss first."""
    names = list(dict.fromkeys(name for board in boards.values() for name in board))
    first = [ZERO, WHOLE, *PARTS]
    rest = [name for name in names if name not in first]
    least = {n: max(b[n][0] for b in boards.values() if n in b) for n in rest}
    for name in [*first, *sorted(rest, key=lambda n: -least[n])]:
        cells = [
            f"{board[name][0]:.2f} ({board[name][1]})" if name in board else "-"
            for board in boards.values()
        ]
        yield [f"`{name}`", *cells]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("cases", nargs="*", help="names of cases; the default set")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    boards = {f"from {n}": ablated(given.cases, n, given.jobs) for n in get_args(Nominal)}
    print(tabulate(rows(boards), ["variant", *boards], "github", colalign=("left",)))
    for name, meaning in PARTS.items():
        print(f"{name}: {meaning}")
    print("In brackets: cases whose model has what is left out, all for the first four.")


if __name__ == "__main__":
    main()
