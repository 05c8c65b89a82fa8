"""How far the boards rest on the numbers of the rule, on single structures and on noise.

python benchmarks/board_checks.py    # board-rules, -families and -means.csv in docs/data; minutes
python benchmarks/board_checks.py --noise run.json    # board-noise.csv, of a run with several seeds

All are of runs that are there, the first of those that docs/figures keeps: nothing is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import trim_mean

import femubench
from femubench import Run
from femubench.core.score.leaderboard import GainTable, leaderboard
from femubench.core.score.statistics import tell_apart
from femubench.core.typing import FloatArray
from femubench.results import Rule

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
BOARDS = ("suite", "after")  # of the structures before and after the rule
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


# What could stand in place of the mean over structures, of gains by structure and strategy.
MEANS: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "mean": lambda gains: gains.mean().round(6),
    "median": lambda gains: gains.median().round(6),
    "mean without a twentieth at either end": lambda gains: pd.Series(
        trim_mean(gains, 0.05, axis=0), gains.columns
    ),
    "mean place": lambda gains: -gains.rank(axis=1, ascending=False).mean().round(6),
    "mean in hundredths": lambda gains: gains.mean().round(2),
}


def gains_of(run: Run) -> pd.DataFrame:
    """Return the gains of what has a rank, by structure and strategy."""
    table = GainTable.of(run, run.ranked, run.nominals[0])
    ranked = [name for name in table.names if name not in run.meta["yardsticks"]]
    return pd.DataFrame({name: table.gains(name) for name in ranked}, index=list(table.units))


def places(figures: pd.Series) -> pd.Series:
    """Return the place of every strategy by a figure of which more is better."""
    return figures.rank(ascending=False, method="min").astype(int)


def ranks_of(run: Run) -> pd.Series:
    """Return the rank of every strategy on the board of a run."""
    return places(MEANS["mean"](gains_of(run)))


def leave_one_out(gains: pd.DataFrame, mean: str) -> pd.DataFrame:
    """Return the place of every strategy without each structure, by strategy and structure."""
    found = {unit: places(MEANS[mean](gains.drop(unit))) for unit in gains.index}
    return pd.DataFrame(found)


def vary(run: Run) -> pd.DataFrame:
    """Return the place of every strategy by the rule, without a structure, and by varied rules."""
    board = leaderboard(run).set_index("strategy")
    gains = gains_of(run)
    left = leave_one_out(gains, "mean")
    found = {
        "gain": board["gain"].round(4),
        "place": places(MEANS["mean"](gains)),
        "one_left_out_best": left.min(axis=1),
        "one_left_out_worst": left.max(axis=1),
    }
    for name, values in VARIED.items():
        for value in values:
            rule = Rule().changed([f"{name}={value}"]).to_json()
            varied = Run({**run.meta, "rule": rule}, run.results)
            found[f"{name}={value:.3g}"] = ranks_of(varied)
    table = pd.DataFrame(found).loc[[name for name in board.index if name in gains]]
    whole = [column for column in table if column != "gain"]
    return table.astype(dict.fromkeys(whole, int))


def error_rate(gains: Mapping[str, FloatArray], true: list[str], trials: int) -> float:
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


def families(run: Run, trials: int) -> pd.DataFrame:
    """Return the error rate of the family under complete and partial nulls."""
    table = GainTable.of(run, run.ranked, run.nominals[0])
    gains = {name: table.gains(name) for name in table.names}
    order = sorted(gains, key=lambda name: -float(gains[name].mean()))
    kept: dict[str, list[str]] = {"none": [], "better half": order[: len(order) // 2]}
    rows = [
        {"true_differences_of": name, "permuted": len(order) - len(true),
         "trials": trials, "error_rate": error_rate(gains, true, trials)}
        for name, true in kept.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def compare_means(run: Run) -> pd.DataFrame:
    """Return by kind of mean the first strategy, and how far one structure moves a place."""
    gains = gains_of(run)
    usual, rows = places(MEANS["mean"](gains)), []
    for name, mean in MEANS.items():
        own = places(mean(gains))
        moves = leave_one_out(gains, name).sub(own, axis=0).abs().max(axis=1)
        rows.append(
            {"mean": name, "first": own.idxmin(), "largest_move": moves.max(),
             "moved_by_more_than_4": int((moves > 4).sum()),
             "largest_difference": (own - usual).abs().max()}
        )  # fmt: skip
    return pd.DataFrame(rows)


def weigh_noise(gains: FloatArray) -> dict[str, float]:
    """Return how far gains vary over draws of noise and, these taken off, over structures.

    Arguments:
        gains: (structures, draws).

    Source: one-way analysis of variance with random effects (Searle, Casella & McCulloch 1992,
    section 3.6).
    """
    means, noise = gains.mean(axis=1), float(gains.var(axis=1, ddof=1).mean())
    others = max(float(means.var(ddof=1)) - noise / gains.shape[1], 0.0)
    boards = gains.mean(axis=0)  # one for each draw
    return {
        "gain": means.mean(), "lowest": boards.min(), "highest": boards.max(),
        "draws_std": np.sqrt(noise), "structures_std": np.sqrt(others),
        "noise_share": noise / max(noise + others, 1e-12),
    }  # fmt: skip


def compare_noise(run: Run) -> pd.DataFrame:
    """Return by strategy what noise and structures do to its gain."""
    table = GainTable.of(run, run.ranked, run.nominals[0])
    gains = {name: table.by_structure(table.values[name])[..., 0] for name in table.names}
    rows = [{"strategy": name, **weigh_noise(own)} for name, own in gains.items()]
    return pd.DataFrame(rows).sort_values("gain", ascending=False).round(4)


def main() -> None:
    """Write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--noise", metavar="FILE", help="a run of `bench run --seeds N --json`")
    parser.add_argument("--boards", nargs="*", default=BOARDS)
    parser.add_argument("--trials", type=int, default=4000, help="of an error rate")
    words = parser.parse_args()
    file = words.noise
    if file is not None:
        run = femubench.read_run(file)
        if len(run.meta["seeds"]) < 2:
            parser.error(f"{file} has one seed, several expected: bench run --seeds 5 --json")
        made = {"noise": compare_noise(run)}
    else:
        figures = ROOT / "docs" / "figures"
        runs = {name: femubench.read_run(figures / f"board-{name}.json") for name in words.boards}
        kinds = {
            "rules": vary,
            "families": partial(families, trials=words.trials),
            "means": compare_means,
        }
        made = {
            kind: pd.concat(
                {name: make(run) for name, run in runs.items()}, names=["board"]
            ).reset_index("board")
            for kind, make in kinds.items()
        }
    for name, table in made.items():
        print(table.to_string())
        file = DATA / f"board-{name}.csv"
        table.to_csv(file, index=name == "rules", lineterminator="\n")


if __name__ == "__main__":
    main()
