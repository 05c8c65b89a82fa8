"""The results as JSON, in the form that other programs rely on."""

from __future__ import annotations

import json
from typing import Any

import femubench
from femubench.reports.page.rounding import clean
from femubench.reports.predictive import predictive_json
from femubench.reports.summary import finding, lead
from femubench.reports.twins import twins_by_strategy
from femubench.results import RunData, Standings, StudyAxes, run_to_json, unsteady

# Columns of the leaderboard that are figures, under the names of the contract.
_SAME = (
    *("error_percent", "textbook_percent", "better_share", "worse_share", "error_gain"),
    *("change_gain", "gain_drawn", "gain_tests", "band_percent", "shape_error", "false_modes"),
    *("higher_percent", "modified_percent", "responses_db", "responses_floor_db"),
    *("answered", "ok"),
)
_FIGURES = {**dict(zip(_SAME, _SAME, strict=True)), "given_percent": "used_percent", "of": "total"}


class JsonReporter:
    """Meta data, the leaderboard and one entry a job."""

    name = "json"
    suffix = ".json"

    def render(self, run: RunData) -> str:
        """Return strict JSON: what is not a finite number is null."""
        board = board_of(run)
        said = {"lead": lead(run), "finding": finding(run, Standings.of(run).rows)}
        plain = {**run_to_json(run), **said, "leaderboard": board}
        plain["predictive"] = predictive_json(run)
        if StudyAxes.from_run(run) is not None:
            cells = femubench.Run.of(run).gain_by().to_dict("records")
            plain["cells"] = [{str(name): clean(v) for name, v in row.items()} for row in cells]
        return json.dumps(plain, indent=1, allow_nan=False)


class JsonLinesReporter:
    """One line for the run and one a job, to search in and to read one by one."""

    name = "jsonl"
    suffix = ".jsonl"

    def render(self, run: RunData) -> str:
        """Return a table of strict JSON on each line."""
        plain = run_to_json(run)
        results = [*plain["results"], *plain.get("companions", ())]
        of_run = {"run": plain["meta"].get("run")}
        lines = [{"record": "run", **of_run, "meta": plain["meta"]}]
        lines += [{"record": "result", **of_run, "result": result} for result in results]
        return "\n".join(json.dumps(line, allow_nan=False) for line in lines)


def board_of(run: RunData) -> list[dict[str, Any]]:
    """Return the rows of the leaderboard as plain data, best first."""
    twins, differing = twins_by_strategy(run), unsteady(run)
    return [
        {
            "strategy": row["strategy"],
            "rank": row["rank"],
            "yardstick": row["yardstick"] or None,
            "gain": clean(row["gain"]),
            "interval": [clean(row["gain_low"]), clean(row["gain_high"])],
            **{name: clean(row[column]) for name, column in _FIGURES.items()},
            "better_than": list(row["better_than"]),
            "worse_than": list(row["worse_than"]),
            "physical": not row["unphysical"],
            **({"twins": twins[row["strategy"]]} if row["strategy"] in twins else {}),
            **({"unsteady": differing[row["strategy"]]} if row["strategy"] in differing else {}),
        }
        for row in Standings.of(run).rows
    ]
