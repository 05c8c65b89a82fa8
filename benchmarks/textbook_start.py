"""What handbook values alone are worth: all strategies, given the model as drawn or a better one.

    python benchmarks/textbook_start.py      # a minute; writes docs/figures/textbook-start.json

The textbook model is the drawn one with every value that an effect states without any fit: the
torsion constant of the shape, shear, rotary inertia. All errors are taken against the drawn model.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from femubench import Case, FemubenchError, Model, NotApplicable, Run, Strategy
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.effect import textbook_model
from femubench.plugins.strategies.diagnosed import Diagnosed
from femubench.results import JobResult, leaderboard, score_model

FIGURES = Path(__file__).parents[1] / "docs" / "figures" / "textbook-start.json"


def board(
    cases: Iterable[Case], starts: Mapping[str, Model], strategies: Iterable[Strategy]
) -> dict[str, dict[str, float]]:
    """Return skill and skill on unseen data by strategy, against the models as drawn.

    Arguments:
        starts: the model that the strategies are given, by case.
    """
    results, reference = [], {}
    for case in cases:
        drawn = score_model(case, case.model)
        reference[case.name] = {name: block.rms_percent for name, block in drawn.items()}
        used = case.measurement.select(case.used)
        for strategy in strategies:
            try:
                model = strategy.update(starts[case.name], used, np.random.default_rng(0)).model
                found = JobResult(
                    case.name, strategy.name, 0, "ok", blocks=score_model(case, model)
                )
            except NotApplicable:
                found = JobResult(case.name, strategy.name, 0, "not-applicable")
            except FemubenchError as error:
                found = JobResult(case.name, strategy.name, 0, "failed", str(error))
            results.append(found)
    run = Run({"reference": reference, "seeds": [0]}, tuple(results))
    return {
        row["strategy"]: {"skill": row["skill"], "skill_unseen": row["skill_unseen"]}
        for row in leaderboard(run).to_dict("records")
    }


def figures() -> dict[str, dict[str, dict[str, float]]]:
    """Return the boards: from the model as drawn, from textbook, and without textbook effects."""
    plugins = load_plugins()
    effects, strategies = tuple(plugins.effects.values()), tuple(plugins.strategies.values())
    cases = read_cases((), plugins)
    drawn = {case.name: case.model for case in cases}
    better = {name: textbook_model(model, effects) for name, model in drawn.items()}
    return {
        "drawn": board(cases, drawn, strategies),
        "textbook": board(cases, better, strategies),
        "without textbook effects": board(cases, drawn, [Diagnosed(textbook=False)]),
    }


def main() -> None:
    """Write the figures and show those on unseen data."""
    with threadpool_limits(1):
        found = figures()
    FIGURES.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    for start, rows in found.items():
        listed = sorted(rows.items(), key=lambda item: item[1]["skill_unseen"])
        print(f"{start}: " + ", ".join(f"{n} {row['skill_unseen']:.3f}" for n, row in listed))


if __name__ == "__main__":
    main()
