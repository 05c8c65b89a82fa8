"""What the page of a run is made of, in plain data for JSON."""

from __future__ import annotations

import base64
import gzip
import math
from collections.abc import Mapping
from typing import Any, Protocol

from femubench.reports.cells import plain, shorten_text
from femubench.reports.csvs import CsvReporter
from femubench.reports.jsons import JsonReporter
from femubench.reports.page.papers import list_drawn_frequencies, papers_of
from femubench.reports.page.rounding import clean, compact_json, plain_data, round_figures
from femubench.reports.predictive import predictive_json
from femubench.reports.summary import (
    cases_of,
    finding,
    first_seed,
    header,
    lead,
    notes_of,
    seeds_of,
    strategies_of,
    unconfined,
)
from femubench.reports.twins import suspicions, twins_by_strategy
from femubench.results import JobResult, PredictiveBoard, RunData, Standings, unsteady

BLOCKS = ("used", "higher", "modified")
# Bytes of the details of all results together, and of the files to be downloaded once they are
# packed; a page has to open in a moment.
MOST_DETAILS = 5_700_000
MOST_DOWNLOADS = 1_000_000
_LONGEST_REASON = 500
_COMPARED = ("gain", "error_percent")  # from one drawing and from another
_FILES: tuple[tuple[str, str, CsvReporter | JsonReporter], ...] = (
    ("Jobs (CSV)", "text/csv", CsvReporter()),
    ("Results (JSON)", "application/json", JsonReporter()),
)
_Named = Mapping[str, Any]


class ExhibitSource(Protocol):
    """What can be drawn of a run; either is None where nothing is known."""

    def case(self, digest: str) -> Mapping[str, Any] | None:
        """Return the structure of a case with what was measured on it."""
        ...

    def of(self, key: str) -> Mapping[str, Any] | None:
        """Return shapes, receptances and changes of a job's model."""
        ...


def page_data(run: RunData, exhibits: ExhibitSource | None = None) -> dict[str, Any]:
    """Return everything that the page of a run shows.

    Errors and gains are those of the run to the last digit; other numbers are rounded.
    """
    standings = Standings.of(run)
    board, apart = standings.rows, standings.apart
    shared = {
        "finding": finding(run, board),
        "lead": lead(run),
        "scored_on": "unseen data"
        if Standings.basis_of(run) == "unseen"
        else "the modes that were given",
        "yardstick": run.meta.get("yardstick"),
        "as_drawn": list_drawn_frequencies(run),
        "strategies": _strategies(standings),
    }
    downloads, too_large, room = [], [], MOST_DOWNLOADS
    for title, kind, reporter in _FILES:
        packed = gzip.compress(reporter.render(run).encode(), 6, mtime=0)
        name = f"{plain(run.meta.get('run', '')) or 'run'}{reporter.suffix}"
        text = base64.b64encode(packed).decode("ascii")
        if (room := room - len(packed)) >= 0:
            downloads.append({"title": title, "name": name, "type": kind, "gzip": text})
        else:
            room += len(packed)
            more = f"`bench report -f {reporter.name}` has it"
            too_large.append(f"{title}: too large for the page; {more}")
    notes = [*notes_of(run), *suspicions(run), *map(plain, getattr(exhibits, "notes", ()))]
    baseline = run.meta.get("baseline")
    run = RunData(run.meta, standings.results)
    cases, strategies = cases_of(run), strategies_of(run)
    listed = [_case(standings, case, exhibits) for case in cases]
    stages = {case["name"]: case["stage"] for case in listed}
    details, left_out = _details(run, stages, exhibits)
    return {
        **shared,
        "run": plain(run.meta.get("run", "")),
        "header": [list(item) for item in header(run)],
        "notes": [*notes, *left_out, *too_large],
        "blocks": list(BLOCKS),
        "tie": Standings.TIE,
        "seeds": seeds_of(run),
        "scenarios": list(dict.fromkeys(case["scenario"] for case in listed)),
        "baseline": baseline,
        "cases": listed,
        "results": [
            _result(found, cases.index(found.case), strategies.index(found.strategy), standings)
            for found in run.results
        ],
        "board": list(map(_cleaned, board)),
        "predictive": predictive_json(run),
        "statistics": {
            "pairs": [
                [strategies.index(a), strategies.index(b), round_figures(p, 4)]
                for a, b, p in apart.pairs
            ],
            "note": apart.note,
            "fewest": Standings.FEWEST,
            "tails": [
                Standings.interval_tail(n) if n > 1 else None
                for n in range(max(len(cases), len(seeds_of(run))) + 1)
            ],
        },
        "details": details,
        "papers": papers_of(run),
        "downloads": downloads,
    }


def _cleaned(figures: _Named) -> dict[str, Any]:
    """Return figures as they are, null for what is not known."""
    return {name: clean(value) for name, value in figures.items()}


def _strategies(standings: Standings) -> list[dict[str, Any]]:
    """Return the strategies: what they cite, their version, what twins, drawings, repeats say."""
    run, drawings = standings.run, standings.drawings
    citations, twins = run.meta.get("citations") or {}, twins_by_strategy(run)
    differing, bare = unsteady(run), unconfined(run)
    said = [(found.strategy, found.provenance.get("strategy")) for found in reversed(run.results)]
    versions = {name: plain(version) for name, version in said if version is not None}
    return [
        {
            "name": name,
            "citation": citations.get(name, ""),
            "version": versions.get(name, ""),
            "yardstick": (run.meta.get("yardsticks") or {}).get(name, ""),
            "twins": twins.get(name),
            "drawings": {
                drawing: {key: [clean(own[key]) for own in found[name]] for key in _COMPARED}
                for drawing, found in drawings.items()
            },
            "unsteady": name in differing,
            "unconfined": name in bare,
        }
        for name in strategies_of(run)
    ]


def _case(standings: Standings, case: str, exhibits: ExhibitSource | None) -> dict[str, Any]:
    run, scale = standings.run, standings.own.scale
    about = (run.meta.get("cases") or {}).get(case) or {}
    digest = (run.meta.get("drawings") or {}).get(case, about.get("digest"))
    stage = exhibits.case(digest) if exhibits is not None and isinstance(digest, str) else None
    if stage is not None:
        stage = {**stage, "nominal": _fitting(stage.get("nominal"), stage)}
    reference = (run.meta.get("reference") or {}).get(case) or {}
    return {
        "name": case,
        "scenario": case.partition("/")[0],
        "structure": run.structures.get(case, case),
        "start": _cleaned(scale.figures(case, scale.start(case, run.nominals[0]))),
        "textbook_percent": clean(100.0 * scale.textbook[case].error),
        "counts": scale.holds_back(case) or Standings.basis_of(run) == "given",
        "test": standings.is_test(case),
        "title": about.get("title") or "",
        "reference": {name: reference[name] for name in BLOCKS if name in reference},
        "stage": plain_data(stage),
    }


def _result(result: JobResult, case: int, strategy: int, standings: Standings) -> dict[str, Any]:
    scale = standings.own.scale
    blocks = [result.blocks.get(name) for name in BLOCKS]
    return {
        "c": case,
        "s": strategy,
        "seed": result.seed,
        "status": result.status,
        "reason": shorten_text(plain(result.reason), _LONGEST_REASON),
        **_cleaned(scale.figures(result.case, scale.errors(result))),
        "answered": result.answered,
        "rms": [None if block is None else clean(block.rms_percent) for block in blocks],
        "seconds": round_figures(result.seconds, 4),
        "parameters": result.parameter_count,
        "responses": None
        if result.responses is None
        else round_figures(result.responses.rms_db, 4),
        "lost": result.rigid_modes_lost if result.status == "ok" else 0,
        "negative": result.negative_eigenvalues or 0,
        "unphysical": result.unphysical,
        "mac": [None if block is None else round_figures(block.mean_mac, 5) for block in blocks],
        "levels": _levels(result, standings),
    }


def _levels(result: JobResult, standings: Standings) -> list[float] | None:
    """Return the levels of the stated intervals that just reach the unseen modes.

    They are rounded up, so that a mode lies in no interval that does not hold it.
    """
    found = PredictiveBoard.levels(standings.own.scale.modes[result.case], result.blocks)
    return None if found is None else [math.ceil(1e6 * level) / 1e6 for level in found]


def _details(
    run: RunData, stages: Mapping[str, _Named | None], exhibits: ExhibitSource | None
) -> tuple[dict[str, Any], list[str]]:
    """Return the details of the first seed's results, the best ones first, and what is missing.

    Figures come before drawings.
    """
    seed, room = first_seed(run), MOST_DETAILS
    cases, strategies = list(stages), strategies_of(run)
    done = [result for result in run.results if result.seed == seed and result.status == "ok"]
    found: dict[str, dict[str, Any]] = {}
    shown = []
    for result in sorted(done, key=lambda result: result.rank or 0):
        key = f"{cases.index(result.case)}:{strategies.index(result.strategy)}"
        entry = {**_detail(result), "exhibit": None}
        if (size := len(compact_json({key: entry}))) <= room:
            found[key], room = entry, room - size
            shown.append((entry, result))
    drawn = 0
    for entry, result in shown:
        exhibit = exhibits.of(result.key) if exhibits is not None and result.key else None
        picture = plain_data(_fitting(exhibit, stages[result.case]))
        if picture is not None and (size := len(compact_json(picture))) <= room:
            entry["exhibit"], room, drawn = picture, room - size, drawn + 1
    notes, models = [], f"of {len(done)} models of seed {seed}"
    if done and not drawn:
        notes.append("no shapes, receptances and element changes to draw come with these results")
    elif drawn < len(done):
        notes.append(
            f"{len(done) - drawn} {models} have no shapes, receptances and changes to draw: they "
            "are not in the store, or there was no room"
        )
    if len(found) < len(done):
        notes.append(
            f"{len(done) - len(found)} {models} are without modes, history and parameters, to keep "
            "the page small; those with the best gains have them"
        )
    return found, notes


def _fitting(exhibit: _Named | None, stage: _Named | None) -> _Named | None:
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
                "measured_hz": round_figures(mode.measured_hz, 7),
                "predicted_hz": round_figures(mode.predicted_hz, 7),
                "mac": round_figures(mode.mac, 5),
            }
            for name, block in result.blocks.items()
            for mode in block.modes
        ],
        "history": [
            {name: round_figures(value, 5) for name, value in step.items()}
            for step in result.history
        ],
        "parameters": [
            {
                "name": plain(item.get("name", "")),
                **{name: round_figures(item.get(name), 6) for name in ("before", "after", "std")},
                "unit": plain(item.get("unit") or ""),
            }
            for item in result.parameters
        ],
    }
