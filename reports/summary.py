"""What the reports say of a run apart from the leaderboard: failures, design changes, header."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from femubench.reports.blocks import Block, Column, Table
from femubench.reports.cells import first_of, interval, join_names, plain
from femubench.results import (
    JobResult,
    PairedMode,
    Run,
    find_basis,
    interval_kind,
    note_missing_jobs,
    structures_of,
)

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


def first_seed(run: Run) -> int:
    """Return the lowest seed of a run, the one whose frequencies are shown."""
    return min((result.seed for result in run.results), default=0)


def cases_of(run: Run) -> list[str]:
    """Return the cases in the order in which they were run."""
    return list(dict.fromkeys([*run.meta.get("cases", ()), *(r.case for r in run.results)]))


def strategies_of(run: Run) -> list[str]:
    """Return the strategies in the order in which they were run."""
    named = run.meta.get("strategies", ())
    return list(dict.fromkeys([*named, *(result.strategy for result in run.results)]))


def header(run: Run) -> Iterator[tuple[str, str]]:
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


def measured_modes(run: Run, case: str) -> list[tuple[str, PairedMode]]:
    """Return the measured modes of a case as tested with their blocks, from any of its results."""
    found: dict[tuple[str, int], PairedMode] = {}
    for result in run.results:
        for name in ("used", "higher") if result.case == case else ():
            block = result.blocks.get(name)
            for mode in block.modes if block is not None else ():
                found.setdefault((name, mode.number), mode)
    return [(name, mode) for (name, _), mode in found.items()]


def _yardstick(run: Run) -> str:
    return "textbook" if run.meta.get("yardstick") == "textbook" else "nominal"


def lead(run: Run) -> str:
    """Return what the gain of a run says, and from where its strategies started."""
    unseen = find_basis(run) == "unseen"
    what = "unseen data" if unseen else "the modes that were given"
    stated = [
        f"Gain is the part of the {_yardstick(run)} model's error on {what} that a strategy takes "
        "away: 1 is all of it, 0 none, less than 0 is worse."
    ]
    if len(run.nominals) > 1:
        stated.append(
            "Ranks are from the textbook models; the start from the drawn ones stands next to it."
        )
    elif run.meta.get("yardstick") == "textbook":
        start = "as drawn" if run.nominals[0] == "drawn" else "of the textbooks"
        stated.append(f"All start from the models {start}.")
    if not unseen:
        stated.append("No case holds data back, so that nothing here shows what was learnt.")
    return " ".join(stated)


def finding(
    run: Run, board: Sequence[Mapping[Any, Any]], tiers: Sequence[Sequence[str]]
) -> list[str]:
    """Return what a run shows, in sentences made from its figures; the first is the headline.

    Arguments:
        board: rows of its leaderboard.
        tiers: strategies, the first those not shown to differ from the best; empty without a test.
    """
    best = next((row for row in board if row["ok"] and not row["unphysical"]), None)
    if best is None:
        return ["No strategy gave a possible model."] if board else []
    name, gain, models = plain(best["strategy"]), best["gain"], f"{_yardstick(run)} models"
    sure, data = "", "unseen data" if find_basis(run) == "unseen" else "the given modes"
    if kind := interval_kind(run):
        cases = {structures_of(run).get(case, case) for case in cases_of(run)}
        count = len(seeds_of(run) if kind == "seeds" else cases)
        ends = interval(best["gain_low"], best["gain_high"])
        sure = f", 95 % interval {ends} over {count} {kind}"
    first = [plain(row["strategy"]) for row in board if row["rank"] == best["rank"]]
    leads = "leads: it takes" if len(first) == 1 else "share the first rank: each takes"
    stated = [
        f"{join_names(first)} {leads} away {100.0 * gain:.0f} % of the {models}' error on "
        f"{data} (gain {gain:.3f}{sure})."
        if gain >= _SHOWN
        else f"No strategy improves on the {models} on {data}; the best, {name}, has a gain of "
        f"{gain:.3f}{sure}.",
        *_how_sure(name, tiers, len(board)),
    ]
    if gain >= _SHOWN and best["gain_low"] <= 0.0:
        stated.append(f"Its interval holds 0: an improvement on the {models} is not shown.")
    idle = [row["gain_drawn"] for row in board if row["strategy"] == run.meta.get("baseline")]
    if idle and math.isfinite(idle[0]):
        stated.append(
            f"Without data the {models} stand at 0 and the models as drawn at {idle[0]:.3f}; "
            f"started from the latter {name} reaches {best['gain_drawn']:.3f}."
        )
    if math.isfinite(best["gain_tests"]):
        stated.append(
            f"On tests alone, no computed truths, its gain is {best['gain_tests']:.3f}."
        )
    return [sentence.replace(" -", " \u2212") for sentence in stated]


def _how_sure(name: str, tiers: Sequence[Sequence[str]], count: int) -> Iterator[str]:
    """Return how many of the strategies are not shown to differ from the best."""
    peers = [plain(other) for other in (tiers or ((),))[0] if plain(other) != name]
    if count > 1 and not tiers:
        yield "Whether the others differ from it is not tested."
    elif count > 1 and not peers:
        yield "It is alone in tier 1: all others are shown to be worse."
    elif len(peers) == count - 1 > 0:
        yield "No other strategy is shown to differ from it: all are in tier 1."
    elif peers:
        below = f"{count - 1 - len(peers)} of {count} are below"
        first = first_of(peers, 4)
        yield f"Next to it in tier 1, not shown to differ from it: {first}; {below}."


def notes_of(run: Run) -> list[str]:
    """Return what a reader has to know before anything else: what was left out, what is missing."""
    stated = run.meta.get("notes")
    notes = [plain(note) for note in stated] if isinstance(stated, (list, tuple)) else []
    if missing := note_missing_jobs(run.meta, (*run.results, *run.companions)):
        notes.append(plain(missing))  # the store may have said so
    return list(dict.fromkeys(notes))


def seeds_of(run: Run) -> list[int]:
    """Return the seeds that were asked for and those that are there, in order."""
    return sorted({*run.meta.get("seeds", ()), *(result.seed for result in run.results)})
