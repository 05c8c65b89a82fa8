"""How much of a gain is the method, and how much are the parameters that it fits.

python benchmarks/method_by_parameters.py --store DIR    # docs/data/method-by-parameters.csv
python benchmarks/method_by_parameters.py    # of that table: docs/figures and docs/strategies.md

Every method fits every set of changes on the same structures: the first 20 of the suite by name
that have members, joints and sections with factors. A job without a possible model has the gain of
the model that was given, 0, so that the layout is balanced.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
from boards import put
from scipy import stats
from tabulate import tabulate

import femubench
from femubench import NotApplicable, plot
from femubench.core.score.ranking import rank_results
from femubench.core.update.change_lists import element_sets
from femubench.fem import FloatArray
from femubench.plot import Axis, Chart
from femubench.update import ParametricStrategy

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data" / "method-by-parameters.csv"
FIGURE = ROOT / "docs" / "figures" / "method-by-parameters.svg"
# Those whose unknowns are the factors of a list of changes and nothing else, or a prior on them.
METHODS = ("bayesian", "cross-model", "eigensensitivity", "global")
METHODS += ("multi-start", "physical", "sparse", "strain-energy")
SETS, FACTORS = ("own", "members", "joints", "sections"), ("structure", "method", "parameters")
COUNT = 20
# A fixed effect is weighed by how far it differs from structure to structure.
AGAINST = {
    "method": "structure x method",
    "parameters": "structure x parameters",
    "method x parameters": "remainder",
}


def structures() -> list[str]:
    """Return the structures on which every set of changes exists."""
    found = []
    for name in sorted(n for n in femubench.cases if n.startswith("suite/")):
        with suppress(NotApplicable):
            frame = femubench.cases[name].model.frame_structure
            found += [name] * all(element_sets(frame, word) for word in SETS[1:])
    return found[:COUNT]


def run(store: str) -> pd.DataFrame:
    """Run every method with every set, and return a row a job."""
    # What the baselines of a list of changes have by themselves are the members.
    alike = [n for n in METHODS if isinstance(femubench.strategies[n].base, ParametricStrategy)]
    pairs = [(method, name) for name in SETS for method in METHODS]
    words = [f"{m}:changes={name}" for m, name in pairs if name != "own" or m not in alike]
    where = {"jobs": 1, "store": store}
    found = femubench.rank(structures(), words, nominal="textbook", resume=True, **where)
    rows = [
        {
            "structure": result.case,
            "method": result.strategy.partition(":")[0],
            "parameters": result.strategy.partition("changes=")[2] or "own",
            "gain": round(result.gain or 0.0, 6),
            "status": "unphysical" if result.unphysical else result.status,
        }
        for result in rank_results(found.results, found.meta)
    ]
    table = pd.DataFrame(rows)
    twice = table[table["method"].isin(alike) & (table["parameters"] == "members")]
    table = pd.concat([table, twice.assign(parameters="own")])
    return table.sort_values(list(FACTORS), ignore_index=True)


def read_gains() -> FloatArray:
    """Return the gains that are kept, by structure, method and set."""
    gains = pd.read_csv(DATA).set_index(list(FACTORS))["gain"].unstack(["method", "parameters"])
    cells = gains[[(method, name) for method in METHODS for name in SETS]].to_numpy()
    return cells.reshape(-1, len(METHODS), len(SETS))


def analyse(gains: FloatArray) -> dict[str, tuple[int, float]]:
    """Return degrees of freedom and squares of every source of a balanced layout of blocks.

    Arguments:
        gains: by structure, method and set.

    Source: Montgomery (2017), Design and Analysis of Experiments, chapter 5.
    """
    parts: dict[tuple[int, ...], FloatArray] = {(): np.full((1, 1, 1), gains.mean())}
    found = {}
    for axes in (axes for size in (1, 2, 3) for axes in combinations(range(3), size)):
        others = tuple(axis for axis in range(3) if axis not in axes)
        below = [part for key, part in parts.items() if set(key) < set(axes)]
        parts[axes] = gains.mean(axis=others, keepdims=True) - sum(below)
        squares = np.broadcast_to(np.square(parts[axes]), gains.shape).sum()
        freedom = int(np.prod([gains.shape[axis] - 1 for axis in axes]))
        name = " x ".join(FACTORS[axis] for axis in axes) if others else "remainder"
        found[name] = freedom, float(squares)
    return found


def components(gains: FloatArray) -> FloatArray:
    """Return the variance components by source, in the order of `analyse`.

    Structures are a random effect, with all that they interact with; of method, parameters and
    these two together it is the variance of the fixed effects. In a balanced layout these are what
    REML gives too, as long as no random component is negative.

    Source: Searle, Casella & McCulloch (1992), Variance Components, sections 4.3 and 6.6.
    """
    count, methods, sets = gains.shape
    freedom, squares = np.array(list(analyse(gains).values())).T
    s, m, p, sm, sp, mp, rest = squares / freedom
    alone = (s - sm - sp + rest) / (methods * sets), (m - sm) / (count * sets)
    both = (sm - rest) / sets, (sp - rest) / methods, (mp - rest) / count
    return np.array([*alone, (p - sp) / (count * methods), *both, rest])


def summarise(gains: FloatArray) -> pd.DataFrame:
    """Return the deviation of every source, its share of the variance, and p of fixed effects.

    The 95 % intervals are those of a jackknife over structures (Arvesen 1969, Annals of
    Mathematical Statistics 40), and p by the F test with 1 and n - 1 degrees of freedom, which
    holds however cells vary together (Geisser & Greenhouse 1958, the same 29): gains are not
    normal, and some methods have one set twice.
    """
    sources, n = analyse(gains), len(gains)
    found = components(gains)
    left = np.array([components(np.delete(gains, i, axis=0)) for i in range(n)])
    left /= left.sum(axis=1, keepdims=True)
    share = found / found.sum()
    reach = stats.t.ppf(0.975, n - 1) * np.sqrt((n - 1) * left.var(axis=0))
    mean = {name: squares / freedom for name, (freedom, squares) in sources.items()}
    p = {
        fixed: stats.f.sf(mean[fixed] / mean[against], 1, n - 1)
        for fixed, against in AGAINST.items()
    }
    return pd.DataFrame(
        {"source": list(sources), "df": [freedom for freedom, _ in sources.values()],
         "deviation": np.sqrt(found.clip(0.0)), "share": share,
         "low": (share - reach).clip(0.0), "high": share + reach,
         "p": [p.get(name, np.nan) for name in sources]}
    )  # fmt: skip


def draw(gains: FloatArray) -> str:
    """Return the mean gains by method and set as SVG."""
    title, values = "Mean gain by method and set of changes", gains.mean(axis=0).tolist()
    x, y = Axis("set of changes", names=SETS), Axis("method", names=METHODS)
    value = Axis("gain over the textbook model")
    chart = Chart("cells", title, x, y, values=tuple(map(tuple, values)), value=value)
    said = f"Means over {len(gains)} structures of the suite; 0 is the textbook model."
    return plot.svg(lambda ax: chart.draw(ax), name="method", title=title, caption=said)


def main() -> None:
    """Run, or analyse and print what was run."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--store", help="run, and keep the results there")
    if store := parser.parse_args().store:
        run(store).to_csv(DATA, index=False, lineterminator="\n")
    cells = read_gains()
    table = summarise(cells).astype(object)
    text = tabulate(table.where(table.notna(), ""), "keys", "github", ".3f", showindex=False)
    put("method-by-parameters", text, ROOT / "docs" / "strategies.md")
    FIGURE.write_text(draw(cells) + "\n", encoding="utf-8")
    print(text, pd.DataFrame(cells.mean(axis=0), METHODS, SETS).round(3), sep="\n\n")


if __name__ == "__main__":
    main()
