"""Gain by axes: every cell is a leaderboard of its own, relative to the textbook models."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

from femubench.core.schema.results import DONE, JobResult, Nominal, RunData
from femubench.core.score.leaderboard import row_of
from femubench.core.study.axes import StudyAxes, Value

if TYPE_CHECKING:
    import pandas as pd

_Arm = tuple[Nominal, str, str]  # nominal model, case and strategy, as the run names them
FIGURES = (
    *("gain", "gain_low", "gain_high", "ok", "failed", "not_applicable", "missing", "jobs"),
    *("unphysical", "seconds"),
)


def gain_by(run: RunData, *axes: str) -> pd.DataFrame:
    """Return one row a cell of a study; see `Run.gain_by`."""
    import pandas as pd

    known = StudyAxes.of(run)
    chosen = axes or tuple(name for name in known.varied if name != "case") or ("strategy",)
    for name in chosen:
        known.values(name)
    by_arm: dict[_Arm, list[JobResult]] = defaultdict(list)
    for nominal in known.nominals:
        for result in run.started_from(nominal):
            by_arm[nominal, result.case, result.strategy].append(result)
    found: dict[tuple[Value, ...], list[_Arm]] = defaultdict(list)
    for nominal, case, strategy in product(known.nominals, known.cases, known.strategies):
        place = known.place(case, strategy, nominal)
        if "strategy" in chosen or all(name in place for name in chosen):
            found[tuple(place.get(name) for name in chosen)].append((nominal, case, strategy))
    orders = [{value: i for i, value in enumerate(known.values(name))} for name in chosen]

    def order(cell: tuple[Value, ...]) -> list[int]:
        return [places.get(value, -1) for places, value in zip(orders, cell, strict=True)]

    rows = [
        {**dict(zip(chosen, cell, strict=True)), **_figures(run, found[cell], by_arm)}
        for cell in sorted(found, key=order)
    ]
    return pd.DataFrame(rows, columns=[*chosen, *FIGURES])


def _figures(
    run: RunData, arms: Sequence[_Arm], by_arm: dict[_Arm, list[JobResult]]
) -> dict[str, Any]:
    """Return the figures of a cell, whose jobs go as one strategy on distinct cases."""
    structures, models = run.meta.get("structures") or {}, run.meta.get("models") or {}
    yardstick = run.meta.get("yardstick") or "drawn"
    names = {arm: f"{number}" for number, arm in enumerate(arms)}
    results = tuple(
        replace(result, case=name, strategy="cell", nominal="drawn")
        for arm, name in names.items()
        for result in by_arm.get(arm, ())
    )
    meta = {
        "seeds": run.meta.get("seeds", ()),
        "seed": run.meta.get("seed", 0),
        "strategies": ["cell"],
        "structures": {name: structures.get(arm[1], arm[1]) for arm, name in names.items()},
        "rule": run.meta.get("rule"),
        "yardstick": "textbook",
        "models": {
            name: {
                "textbook": models[case][yardstick],
                "drawn": models[case].get(nominal, models[case][yardstick]),
            }
            for (nominal, case, _), name in names.items()
            if case in models
        },
    }
    row = row_of(RunData(meta, results), "cell")
    stated = {name: row[name] for name in ("gain", "gain_low", "gain_high", "ok", "unphysical")}
    failed = sum(result.status not in DONE for result in results)
    jobs = int(row["total"])
    return {
        **stated,
        "failed": failed,
        "not_applicable": row["not_applicable"],
        "missing": jobs - len(results),
        "jobs": jobs,
        "seconds": row["seconds"],
    }
