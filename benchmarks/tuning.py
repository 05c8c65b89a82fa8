"""Free choices tuned on half of the structures, and what that gains on the other half.

    python benchmarks/tuning.py                            # every strategy on the suite
    python benchmarks/tuning.py global local --jobs 2      # some of them
    python benchmarks/tuning.py --structures 12 --seed 3   # the smallest models, another split

The settings are those that a strategy lists itself as `settings`. All start from the textbook
model; the figures are errors on unseen data over those of that model, geometric means over
structures: less is better.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from tabulate import tabulate
from unseen import interval, mean_ratio, unseen_logs

import femubench
from femubench import Case
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins

ZERO = "textbook"
FIRST = "suite:before the rule"  # nothing is tuned on the structures that decide

Logs = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Tuned:
    """What tuning says of one strategy.

    Arguments:
        strategy: its name.
        best: the best setting of the first half, the default one included.
        default, tuned: errors on the other half.
        gain: interval of tuned / default over the structures of the other half.
        best_of_all: the best setting over both halves, with its error and that of the default.
    """

    strategy: str
    best: str
    default: float
    tuned: float
    gain: str
    best_of_all: tuple[str, float, float]


def tuned(strategy: str, names: Sequence[str], logs: Logs, first: set[str]) -> Tuned:
    """Return what tuning says.

    Arguments:
        names: the strategy as it is, then with each setting.
        logs: by name and structure.
        first: the structures of the half on which the setting is chosen.
    """
    rest = [name for name in logs[strategy] if name not in first]
    best = min(names, key=lambda name: mean_ratio(logs[name], first))
    of_all = min(names, key=lambda name: mean_ratio(logs[name]))
    return Tuned(
        strategy,
        best.partition(":")[2] or "default",
        mean_ratio(logs[strategy], rest),
        mean_ratio(logs[best], rest),
        "-" if best == strategy else interval(logs[best][s] - logs[strategy][s] for s in rest),
        (
            of_all.partition(":")[2] or "default",
            mean_ratio(logs[of_all]),
            mean_ratio(logs[strategy]),
        ),
    )


def settings_of(strategies: Iterable[str]) -> dict[str, list[str]]:
    """Return every strategy that has settings, as it is and with each of them."""
    known = load_plugins().strategies
    found = {}
    for name in strategies or known:
        settings = getattr(known[name], "settings", ())
        if settings:
            found[name] = [name, *(f"{name}:{setting}" for setting in settings)]
    return found


def halves(cases: Sequence[Case], seed: int) -> set[str]:
    """Return the structures of the half on which settings are chosen."""
    names = sorted(case.name for case in cases)
    return set(np.random.default_rng(seed).permutation(names)[: len(names) // 2].tolist())


def main() -> None:
    """Run all settings and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("strategies", nargs="*", help="all that have settings by default")
    parser.add_argument("--structures", type=int, help="the smallest models of the suite alone")
    parser.add_argument("--seed", type=int, default=1, help="of the split, 1 by default")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--store", help="folder of results; those that are there are taken")
    given = parser.parse_args()
    cases = sorted(read_cases([FIRST], load_plugins()), key=lambda case: case.model.size)
    cases = cases[: given.structures]
    wanted = settings_of(given.strategies)
    names = [name for listed in wanted.values() for name in listed]
    run = femubench.rank(
        cases,
        [ZERO, *names],
        nominal="textbook",
        jobs=given.jobs,
        store=given.store,
        overwrite="missing",
    )
    logs, first = unseen_logs(run), halves(cases, given.seed)
    found = [tuned(name, listed, logs, first) for name, listed in wanted.items()]
    print(
        f"{len(cases)} structures, split by seed {given.seed}; tuned on {', '.join(sorted(first))}"
    )
    print()
    table = [
        [
            f"`{one.strategy}`",
            len(wanted[one.strategy]),
            f"`{one.best}`" if one.best != "default" else "default",
            f"{one.default:.2f}",
            f"{one.tuned:.2f}",
            one.gain,
            f"`{one.best_of_all[0]}`" if one.best_of_all[0] != "default" else "default",
            f"{one.best_of_all[2]:.2f}",
            f"{one.best_of_all[1]:.2f}",
        ]
        for one in found
    ]
    head = [
        *(
            "strategy",
            "settings",
            "best on the first half",
            "default, other half",
            "tuned, other half",
        ),
        *("tuned / default, 95 %", "best of all", "default, all", "best, all"),
    ]
    print(tabulate(table, head, "github", disable_numparse=True))
    print()
    for name, listed in wanted.items():
        cells = ", ".join(
            f"{n.partition(':')[2] or 'default'} {mean_ratio(logs[n]):.2f}" for n in listed
        )
        print(f"- `{name}`: {cells}")


if __name__ == "__main__":
    main()
