"""What the reports say of a run apart from the leaderboard: failures, design changes, header."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from femubench.reports.blocks import Block, Column, Table
from femubench.reports.cells import first_of, format_fixed, interval, join_names, plain
from femubench.results import JobResult, PairedMode, Rule, RunData, Standings, Store

FINE = ("ok", "not-applicable")
_HEADER = (
    *("run", "started", "seed", "seeds", "jobs", "timeout"),
    *("versions", "machine", "git_commit"),
)
_SHOWN = 0.0005  # gain that is printed as more than 0
_TITLES = {"jobs": "workers", "timeout": "timeout in s", "git_commit": "git commit"}


@dataclass(frozen=True)
class Trouble:
    """Jobs of one strategy on one case that ended alike; the reason is that of the first."""

    case: str
    strategy: str
    status: str
    seeds: tuple[int, ...]
    reason: str


def troubles(results: Iterable[JobResult], *, fine: bool = False) -> list[Trouble]:
    """Return the jobs without a model, seeds taken together.

    Arguments:
        fine: return those that are not applicable instead of the failures.
    """
    listed = list(results)
    both = len({result.nominal for result in listed}) > 1
    groups: dict[tuple[str, str, str], list[JobResult]] = {}
    for result in listed:
        if result.status != "ok" and (result.status in FINE) == fine:
            case = result.case + (", as drawn" if both and result.nominal == "drawn" else "")
            groups.setdefault((case, result.strategy, result.status), []).append(result)
    return [
        Trouble(*key, tuple(job.seed for job in jobs), plain(jobs[0].reason))
        for key, jobs in groups.items()
    ]


def failures(items: Sequence[Trouble]) -> list[Block]:
    """Return a table of jobs without a model, with their reasons; nothing where there is none."""
    widths = {"case": 20, "strategy": 16, "seeds": 9, "status": 14, "reason": 0}
    rows = [[t.case, t.strategy, first_of(t.seeds, 5), t.status, t.reason] for t in items]
    heads = [Column(name, width, left=True, wrap=True) for name, width in widths.items()]
    return [Table(heads, rows, most=20)] if rows else []


def group_reasons(results: Iterable[JobResult]) -> dict[str, list[str]]:
    """Return from the reason for which strategies are not applicable to their names."""
    reasons: dict[str, list[str]] = {}
    for item in troubles(results, fine=True):
        names = reasons.setdefault(item.reason, [])
        if item.strategy not in names:
            names.append(item.strategy)
    return reasons


def first_seed(run: RunData) -> int:
    """Return the lowest seed of a run, the one whose frequencies are shown."""
    return min((result.seed for result in run.results), default=0)


def cases_of(run: RunData) -> list[str]:
    """Return the cases in the order in which they were run."""
    return list(dict.fromkeys([*run.meta.get("cases", ()), *(r.case for r in run.results)]))


def strategies_of(run: RunData) -> list[str]:
    """Return the strategies in the order in which they were run."""
    named = run.meta.get("strategies", ())
    return list(dict.fromkeys([*named, *(result.strategy for result in run.results)]))


def header(run: RunData) -> Iterator[tuple[str, str]]:
    """Return what a reader needs to repeat a run: seeds, versions, machine."""
    meta = run.meta
    for key in _HEADER:
        if meta.get(key) not in (None, "", []):
            yield _TITLES.get(key, key), _spoken(meta[key])


def _spoken(value: Any) -> str:  # noqa: ANN401 - plain data of any kind
    if isinstance(value, Mapping):
        return ", ".join(f"{plain(key)} {plain(entry)}" for key, entry in value.items())
    if isinstance(value, (list, tuple)):
        return " ".join(plain(entry) for entry in value)
    return plain(value)


def measured_modes(run: RunData, case: str) -> list[tuple[str, PairedMode]]:
    """Return the measured modes of a case as tested with their blocks, from any of its results."""
    found: dict[tuple[str, int], PairedMode] = {}
    for result in run.results:
        for name in ("used", "higher") if result.case == case else ():
            block = result.blocks.get(name)
            for mode in block.modes if block is not None else ():
                found.setdefault((name, mode.number), mode)
    return [(name, mode) for (name, _), mode in found.items()]


def lead(run: RunData) -> str:
    """Return what the gain of a run says, and from where its strategies started."""
    models = "textbook" if run.meta.get("yardstick") == "textbook" else "nominal"
    stated = [
        f"Gain is what a model gains over the {models} one, -1 to 1: the part of that one's error "
        "that it removes, or minus the part of its own that it adds; mean of the frequencies "
        "out of the given band and of their changes by modifications."
    ]
    if len(run.nominals) > 1:
        stated.append(
            "Ranks are from the textbook models; the start from the drawn ones stands next to it."
        )
    elif models == "textbook":
        start = "as drawn" if run.nominals[0] == "drawn" else "of the textbooks"
        stated.append(f"All start from the models {start}.")
    if Standings.basis_of(run) != "unseen":
        stated.append(
            "No case holds data back: the gain is that on the modes that were given, and nothing "
            "here shows what was learnt."
        )
    stated += [f"{doubt[0].upper()}{doubt[1:]}." for doubt in _doubts(run)]
    rule = Rule.of(run.meta).to_json()["version"]
    return " ".join(stated) + f" Rule {rule}."


def unconfined(run: RunData) -> frozenset[str]:
    """Return the strategies of which a job ran without a sandbox."""
    usual, jobs = run.meta.get("sandbox"), (*run.results, *run.companions)
    return frozenset(r.strategy for r in jobs if r.provenance.get("sandbox", usual) == "none")


def _doubts(run: RunData) -> Iterator[str]:
    if Standings.basis_of(run) == "unseen" and not (run.meta.get("twins") or {}).get("of"):
        yield "no twins ran, so that memory of the cases is not excluded"
    if unconfined(run):
        reason = plain(run.meta.get("sandbox_reason") or "")
        why = f" ({reason})" * bool(reason)
        yield f"strategies ran without a sandbox{why} and could read what they were not given"


def shortfalls(run: RunData) -> list[str]:
    """Return why the ranks of a run may not hold: no twins, no sandbox, jobs that are not there."""
    jobs = (*run.results, *run.companions)
    ended = [f"{t.strategy} on {t.case} ({t.status})" for t in troubles(jobs)]
    count = sum(result.status not in FINE for result in jobs)
    failed = [f"{count} of {len(jobs)} jobs failed: {first_of(ended, 3)}"] if ended else []
    missing = Store.note_missing_jobs(run.meta, jobs)
    return [*_doubts(run), *([plain(missing)] if missing else []), *map(plain, failed)]


def finding(run: RunData, board: Sequence[Mapping[Any, Any]]) -> list[str]:
    """Return what a run shows, in sentences made from its figures; the first is the headline."""
    kind = Standings.interval_of(run)
    structures = {run.structures.get(case, case) for case in cases_of(run)}
    count = len(seeds_of(run) if kind == "seeds" else structures)
    models = "handbooks" if run.meta.get("yardstick") == "textbook" else "the nominal models"
    unseen = Standings.basis_of(run) == "unseen"
    where = "Above the given band" if unseen else "On the modes that were given"
    stated = headline(board, where, models, len(structures), f"{count} {kind}" * bool(kind))
    best = next((row for row in board if row["rank"] == 1), None)
    if best is not None and math.isfinite(best["gain_tests"]):
        stated.append(f"On tests alone, no computed truths, its gain is {best['gain_tests']:.3f}.")
    return [sentence.replace(" -", " \u2212") for sentence in stated]


def headline(
    board: Sequence[Mapping[Any, Any]], where: str, models: str, structures: int, over: str
) -> list[str]:
    """Return what a board shows, in percent of frequency and in gain; what is not shown is said.

    Arguments:
        board: rows of a leaderboard, best first.
        over: what the intervals are over; empty where there are none.
    """
    # Who never gave a model may share the first rank with who gave back the one that was given.
    best = [row for row in board if row["rank"] == 1 and row["answered"]]
    if not best:
        only = all(row["yardstick"] for row in board)
        said = "Only yardsticks ran." if only else "No strategy gave a possible model."
        return [said] if board else []
    lines = [row for row in board if row["yardstick"]]
    first, percent = best[0], [f"{models} are {_percent(best[0]['textbook_percent'])} off"]
    line = max(lines, key=lambda row: float(row["gain"]), default=None)
    if line is not None and line["gain"] > _SHOWN:
        percent.append(f"{line['yardstick']} {_percent(line['error_percent'])}")
    name = join_names([plain(row["strategy"]) for row in best])
    who = "the best strategy" if len(best) == 1 else "the best strategies"
    percent.append(f"{who}, {name}, {_percent(first['error_percent'])}")
    sure = ""
    if over:
        sure = f" (95 % interval {interval(first['gain_low'], first['gain_high'])} over {over})"
    stated = [f"{where} {', '.join(percent)}."]
    if first["gain"] < _SHOWN:
        stated.insert(0, f"No strategy gains on {models}.")
    if math.isfinite(first["better_share"]):
        shares = [f"{100.0 * first[name]:.0f} %" for name in ("better_share", "worse_share")]
        stated.append(
            f"It is better than {models} on {shares[0]} of the {structures} structures, worse by "
            f"more than a quarter on {shares[1]}."
            if structures > 1
            else f"That is {'better' if first['better_share'] else 'not better'} than {models}."
        )
    stated.append(f"Its gain is {format_fixed(first['gain'], 3, 7)}{sure}.")
    return [*stated, *_how_sure(first, board, lines)]


def _how_sure(
    best: Mapping[Any, Any], board: Sequence[Mapping[Any, Any]], lines: Sequence[Mapping[Any, Any]]
) -> Iterator[str]:
    """Yield what is shown of the best strategy and of all against the yardsticks."""
    others = [row["strategy"] for row in board if not row["yardstick"] and row is not best]
    if not any(row["better_than"] for row in board):
        yield "No difference between any two lines of the board is shown."
        return
    worse = [name for name in others if name in best["better_than"]]
    if others:
        yield f"It is shown to be better than {len(worse)} of {len(others)} other strategies."
    none = []
    for row in lines:
        above = [
            plain(other["strategy"]) for other in board
            if not other["yardstick"] and row["strategy"] in other["better_than"]
        ]  # fmt: skip
        if above:
            yield f"Shown to be better than {row['yardstick']}: {first_of(above, 4)}."
        else:
            none.append(plain(row["yardstick"]))
    if none:
        yield f"No strategy is shown to be better than {' or '.join(none)}."


def _percent(value: float) -> str:
    return f"{value:.1f} %"


def notes_of(run: RunData) -> list[str]:
    """Return what a reader has to know before anything else: what was left out, what is missing."""
    stated = run.meta.get("notes")
    notes = [plain(note) for note in stated] if isinstance(stated, (list, tuple)) else []
    if missing := Store.note_missing_jobs(run.meta, (*run.results, *run.companions)):
        notes.append(plain(missing))  # the store may have said so
    return list(dict.fromkeys(notes))


def seeds_of(run: RunData) -> list[int]:
    """Return the seeds that were asked for and those that are there, in order."""
    return sorted({*run.meta.get("seeds", ()), *(result.seed for result in run.results)})
