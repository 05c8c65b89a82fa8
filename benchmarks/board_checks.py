"""How far the board of the suite rests on the numbers of the rule and on single structures.

python benchmarks/board_checks.py    # docs/data/board-rules.csv and board-families.csv; a minute

Both are of the run that docs/figures keeps: nothing is run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

import femubench
from femubench import Run
from femubench.core.score.leaderboard import GainTable
from femubench.core.score.statistics import tell_apart
from femubench.core.typing import FloatArray
from femubench.results import Rule, leaderboard, structures_of

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
RUN = ROOT / "docs" / "figures" / "board-suite.json"
# One number of the rule at a time.
VARIED = {
    "change_share": (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0),
    "floor": (0.0005, 0.001, 0.005),
    "cap": (0.1, 0.2, 0.7),
    "change_cap": (0.05, 0.2),
    "mac": (0.3, 0.7),
    "window": (0.1, 0.3),
    "above": (1.0, 1.5),
    "same_mac": (0.7, 0.9),
}
TRIALS = 200


def ranks_of(run: Run) -> dict[str, int]:
    """Return the place of every line of a board, yardsticks among them, by gain."""
    table = GainTable.of(run, run.ranked, run.nominals[0])
    gains = pd.Series({name: float(table.gains(name).mean()) for name in table.names})
    ranks: dict[str, int] = gains.round(6).rank(ascending=False, method="min").to_dict()
    return ranks


def without(run: Run) -> Iterator[tuple[str, Run]]:
    """Yield the run without each of its structures."""
    owners = structures_of(run)
    for structure in dict.fromkeys(owners.values()):
        kept = {case for case, owner in owners.items() if owner != structure}
        models = {case: own for case, own in run.meta["models"].items() if case in kept}
        meta = {**run.meta, "models": models}
        yield structure, Run(meta, tuple(r for r in run.results if r.case in kept))


def vary(run: Run) -> pd.DataFrame:
    """Return the place of every line by the rule, without one structure, and by varied rules."""
    board = leaderboard(run).set_index("strategy")
    base = ranks_of(run)
    left = pd.DataFrame({name: ranks_of(part) for name, part in without(run)})
    found = {
        "gain": board["gain"].round(4),
        "place": pd.Series(base),
        "one_left_out_best": left.min(axis=1),
        "one_left_out_worst": left.max(axis=1),
    }
    for name, values in VARIED.items():
        for value in values:
            rule = Rule().changed([f"{name}={value}"]).to_json()
            varied = Run({**run.meta, "rule": rule}, run.results)
            found[f"{name}={value:.3g}"] = pd.Series(ranks_of(varied))
    table = pd.DataFrame(found).loc[board.index]
    whole = [column for column in table if column != "gain"]
    return table.astype(dict.fromkeys(whole, int))


def error_rate(gains: Mapping[str, FloatArray], true: list[str], trials: int = TRIALS) -> float:
    """Return how often a difference is claimed where there is none.

    Arguments:
        gains: by strategy, one a structure.
        true: strategies that keep their gains; those of all others are dealt out anew on every
            structure, so that none of them is better than another.
    """
    random, names = np.random.default_rng(0), list(gains)
    null = [name for name in names if name not in true]
    table = np.column_stack([gains[name] for name in null])
    wrong = 0
    for _ in range(trials):
        dealt = random.permuted(table, axis=1)
        found = {**{name: gains[name] for name in true}, **dict(zip(null, dealt.T, strict=True))}
        pairs = tell_apart(found).pairs
        wrong += any(p < 0.05 and {a, b} <= set(null) for a, b, p in pairs)
    return wrong / trials


def families(run: Run) -> pd.DataFrame:
    """Return the error rate of the family under complete and partial nulls."""
    table = GainTable.of(run, run.ranked, run.nominals[0])
    gains = {name: table.gains(name) for name in table.names}
    order = sorted(gains, key=lambda name: -float(gains[name].mean()))
    kept: dict[str, list[str]] = {"none": [], "better half": order[: len(order) // 2]}
    rows = [
        {"true_differences_of": name, "permuted": len(order) - len(true),
         "trials": TRIALS, "error_rate": error_rate(gains, true)}
        for name, true in kept.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def main() -> None:
    """Write both tables."""
    run = femubench.read_run(RUN)
    for name, table in (("board-rules", vary(run)), ("board-families", families(run))):
        print(table.to_string())
        table.to_csv(DATA / f"{name}.csv", index=name == "board-rules", lineterminator="\n")


if __name__ == "__main__":
    main()
