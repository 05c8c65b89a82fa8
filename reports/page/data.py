"""What the page of a run is made of, in plain data for JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from femubench.reports.cells import plain, shortened
from femubench.reports.page.papers import papers_of, started_as_drawn
from femubench.reports.page.rounding import clean, plain_data, rounded
from femubench.reports.summary import (
    cases_of,
    first_seed,
    header,
    lead,
    measured_modes,
    notes_of,
    seeds_of,
    strategies_of,
)
from femubench.reports.twins import suspicions, twins_by_strategy
from femubench.results import (
    FEWEST,
    OFFSET_PERCENT,
    SCORE_OF_FAILURE,
    TIE,
    JobResult,
    Run,
    interval_tail,
    is_test,
    leaderboard,
    predictive,
    rank_results,
    structures_of,
    tell_apart,
    unsteady,
)

VERSION = 1
BLOCKS = ("used", "higher", "modified")
# Bytes of the details of all results together; a page has to open in a moment.
MOST_DETAILS = 6_000_000
_LONGEST_REASON = 500


class Exhibits(Protocol):
    """What can be drawn of a run; either is None where nothing is known."""

    def case(self, digest: str) -> Mapping[str, Any] | None:
        """Return the structure of a case with what was measured on it."""
        ...

    def of(self, key: str) -> Mapping[str, Any] | None:
        """Return shapes, receptances and changes of a job's model."""
        ...


def page_data(run: Run, exhibits: Exhibits | None = None) -> dict[str, Any]:
    """Return everything that the page of a run shows.

    Errors, scores and skills are those of the run to the last digit; other numbers are rounded.

    Arguments:
        exhibits: what the store has to draw.
    """
    reference, baseline = run.meta.get("reference") or None, run.meta.get("baseline")
    board, notes, about = leaderboard(run), notes_of(run), lead(run)
    drawn_models, told = started_as_drawn(run), suspicions(run)
    twins, differing = twins_by_strategy(run), unsteady(run)
    run = Run(run.meta, rank_results(run.ranked, reference, baseline))
    cases, strategies = cases_of(run), strategies_of(run)
    ranking = board.to_dict("records")
    listed = [_case(run, case, exhibits) for case in cases]
    stages = {case["name"]: case["stage"] for case in listed}
    details, left_out = _details(run, strategies, stages, exhibits)
    drawn = getattr(exhibits, "notes", ()) if exhibits is not None else ()
    return {
        "version": VERSION,
        "run": plain(run.meta.get("run", "")),
        "header": [list(item) for item in header(run)],
        "lead": about,
        "notes": [*notes, *told, *(plain(note) for note in drawn), *left_out],
        "blocks": list(BLOCKS),
        "offset_percent": OFFSET_PERCENT,
        "score_of_failure": SCORE_OF_FAILURE,
        "tie": TIE,
        "seeds": seeds_of(run),
        "scenarios": list(dict.fromkeys(_scenario(case) for case in cases)),
        "baseline": baseline,
        "strategies": [
            {**item, **_odd(item["name"], twins, differing)} for item in _strategies(run, ranking)
        ],
        "cases": listed,
        "results": [
            _result(found, cases.index(found.case), strategies.index(found.strategy))
            for found in run.results
        ],
        "board": [{str(key): clean(value) for key, value in row.items()} for row in ranking],
        "statistics": _statistics(run, list(board["strategy"])),
        "details": details,
        "papers": papers_of(run),
        "as_drawn": drawn_models,
    }


def _scenario(case: str) -> str:
    return case.partition("/")[0]


def _strategies(run: Run, board: Iterable[Mapping[Any, Any]]) -> list[dict[str, Any]]:
    """Return the strategies with what they cite, their version and how many unknowns they had."""
    citations = run.meta.get("citations") or {}
    counts = {row["strategy"]: row["parameters"] for row in board}
    versions: dict[str, str] = {}
    for result in run.results:
        version = result.provenance.get("strategy")
        if version is not None:
            versions.setdefault(result.strategy, plain(version))
    return [
        {
            "name": name,
            "citation": citations.get(name, ""),
            "version": versions.get(name, ""),
            "parameters": clean(counts.get(name)),
        }
        for name in strategies_of(run)
    ]


def _odd(
    name: str, twins: Mapping[str, Mapping[str, Any]], differing: Mapping[str, str]
) -> dict[str, Any]:
    """Return what twins and jobs that were run again say of a strategy; nothing without them."""
    found: dict[str, Any] = {"twins": twins[name]} if name in twins else {}
    return {**found, **({"unsteady": plain(differing[name])} if name in differing else {})}


def _case(run: Run, case: str, exhibits: Exhibits | None) -> dict[str, Any]:
    about = (run.meta.get("cases") or {}).get(case) or {}
    digest = (run.meta.get("drawings") or {}).get(case, about.get("digest"))
    stage = exhibits.case(digest) if exhibits is not None and isinstance(digest, str) else None
    if stage is not None:
        stage = {**stage, "nominal": _fitting(stage.get("nominal"), stage)}
    reference = (run.meta.get("reference") or {}).get(case) or {}
    measured = [
        {"mode": mode.number, "block": block, "hz": rounded(mode.measured_hz, 7)}
        for block, mode in measured_modes(run, case)
    ]
    return {
        "name": case,
        "scenario": _scenario(case),
        "structure": structures_of(run).get(case, case),
        "test": is_test((run.meta.get("classes") or {}).get(case)),
        "title": about.get("title") or "",
        "reference": {name: reference[name] for name in BLOCKS if name in reference},
        "stage": plain_data(None if stage is None else _with_short_points(stage)),
        "tables": {"measured": measured},
    }


def _with_short_points(stage: Mapping[str, Any]) -> dict[str, Any]:
    """Return the structure of a case with four digits of every coordinate."""
    found = {**stage, "nodes": [[rounded(v, 4) for v in xyz] for xyz in stage.get("nodes", ())]}
    for name in {"joints", "sensors", "masses", "springs", "supports"} & set(stage):
        found[name] = [
            {**item, "xyz": [rounded(v, 4) for v in item["xyz"]]} for item in stage[name]
        ]
    return found


def _result(result: JobResult, case: int, strategy: int) -> dict[str, Any]:
    blocks = [result.blocks.get(name) for name in BLOCKS]
    lost = (result.rigid_body_modes_expected or 0) - (result.rigid_body_modes or 0)
    return {
        "c": case,
        "s": strategy,
        "seed": result.seed,
        "status": result.status,
        "reason": shortened(plain(result.reason), _LONGEST_REASON),
        "score": clean(result.score),
        "rms": [None if block is None else clean(block.rms_percent) for block in blocks],
        "seconds": rounded(result.seconds, 4),
        "parameters": result.parameter_count,
        "evaluations": result.evaluations,
        "lost": max(lost, 0) if result.status == "ok" else 0,
        "negative": result.negative_eigenvalues or 0,
        "unphysical": result.unphysical,
        "mac": [None if block is None else rounded(block.mean_mac, 5) for block in blocks],
        "forecast": [_forecast(result, name) for name in BLOCKS],
    }


def _forecast(result: JobResult, name: str) -> list[float | None] | None:
    """Return number of unseen modes of a block, those in their 90 % interval, and summed CRPS."""
    found = predictive.Forecasts.of([result], {}, blocks=(name,))
    if not len(found.error):
        return None
    stated = bool(found.stated.any())
    crps = float(predictive.crps_normal(found.error, found.std).sum())
    covered = int((found.level <= predictive.LEVEL).sum()) if stated else None
    return [len(found.error), covered, clean(crps)]


def _statistics(run: Run, order: list[str]) -> dict[str, Any]:
    """Return tiers and groups, and what the page needs for intervals of a part of the run."""
    count = len(cases_of(run))
    found, names = tell_apart(run, order), strategies_of(run)
    return {
        "pairs": [[names.index(a), names.index(b), rounded(p, 4)] for a, b, p in found.pairs],
        "groups": [[names.index(name) for name in group] for group in found.groups],
        "tiers": [[names.index(name) for name in tier] for tier in found.tiers],
        "note": found.note,
        "fewest": FEWEST,
        "tails": [interval_tail(n) if n >= FEWEST else None for n in range(count + 1)],
    }


def _details(
    run: Run,
    strategies: list[str],
    stages: Mapping[str, Mapping[str, Any] | None],
    exhibits: Exhibits | None,
) -> tuple[dict[str, Any], list[str]]:
    """Return the details of the first seed's results, the best ones first, and what is missing."""
    seed, room, cases = first_seed(run), MOST_DETAILS, list(stages)
    shown = [result for result in run.results if result.seed == seed and result.status == "ok"]
    found: dict[str, Any] = {}
    undrawn = full = 0
    for result in sorted(shown, key=lambda result: result.rank or 0):
        exhibit = exhibits.of(result.key) if exhibits is not None and result.key else None
        exhibit = _fitting(exhibit, stages[result.case])
        entry = {**_detail(result), "exhibit": plain_data(exhibit)}
        size = len(json.dumps(entry))
        if size > room and exhibit is not None:
            entry["exhibit"] = exhibit = None
            size = len(json.dumps(entry))
        if size > room:
            full += 1
            continue
        undrawn += exhibit is None
        room -= size
        found[f"{cases.index(result.case)}:{strategies.index(result.strategy)}"] = entry
    notes = []
    if undrawn and undrawn == len(shown):
        notes.append("no shapes, receptances and element changes to draw come with these results")
    elif undrawn:
        notes.append(
            f"{undrawn} of {len(shown)} models of seed {seed} have no shapes, receptances and "
            "changes to draw: they are not in the store, or there was no room for them"
        )
    if full:
        notes.append(
            f"{full} of {len(shown)} models of seed {seed} are without modes, history and "
            "parameters, to keep the page small; those with the best scores have them"
        )
    return found, notes


def _fitting(
    exhibit: Mapping[str, Any] | None, stage: Mapping[str, Any] | None
) -> Mapping[str, Any] | None:
    """Return an exhibit if it is one of the structure of a stage, None otherwise."""
    if exhibit is None or stage is None:
        return exhibit
    nodes, elements = len(stage["nodes"]), len(stage["elements"])
    changes = exhibit.get("elements")
    whole = all(len(mode["shape"]) == nodes for mode in exhibit["modes"])
    return exhibit if whole and (changes is None or len(changes) == elements) else None


def _detail(result: JobResult) -> dict[str, Any]:
    return {
        "modes": [
            {
                "mode": mode.number,
                "block": name,
                "modification": mode.modification,
                "measured_hz": rounded(mode.measured_hz, 7),
                "predicted_hz": rounded(mode.predicted_hz, 7),
                "mac": rounded(mode.mac, 5),
            }
            for name, block in result.blocks.items()
            for mode in block.modes
        ],
        "history": [_numbers(step) for step in result.history],
        "parameters": [
            {
                "name": plain(item.get("name", "")),
                **{name: rounded(item.get(name), 6) for name in ("before", "after", "std")},
                "unit": plain(item.get("unit") or ""),
            }
            for item in result.parameters
        ],
        "diagnostics": _numbers(result.diagnostics),
    }


def _numbers(named: Mapping[str, float]) -> dict[str, Any]:
    return {name: rounded(value, 5) for name, value in named.items()}
