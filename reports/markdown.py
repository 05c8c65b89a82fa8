"""The full report: header, leaderboard, failures, frequencies, design changes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

from femubench.reports.cells import NOTHING, fixed, hertz, interval, plain, whole
from femubench.reports.page.papers import papers_of, started_as_drawn
from femubench.reports.summary import (
    Trouble,
    cases_of,
    finding,
    first_seed,
    header,
    lead,
    notes_of,
    strategies_of,
    troubles,
    unconverged,
)
from femubench.reports.twins import MEANING, drawn_from, suspicions
from femubench.results import (
    FLOORS,
    JobResult,
    PairedMode,
    Run,
    interval_kind,
    leaderboard,
    modes_frame,
    ranks_by_floor,
    tell_apart,
    twin_skills,
)

_SPECIAL = re.compile(r"([\\`*_\[\]|~])")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
# Heads of the leaderboard's figures, their keys, and how they are written.
_COLUMNS: dict[str, tuple[str, Callable[[float], str]]] = {
    "skill": ("skill", partial(fixed, digits=3, width=6)),
    "from drawn": ("skill_drawn", partial(fixed, digits=3, width=6)),
    "tests": ("skill_tests", partial(fixed, digits=3, width=6)),
    "higher %": ("higher_percent", partial(fixed, width=7)),
    "modified %": ("modified_percent", partial(fixed, width=7)),
    "given %": ("used_percent", partial(fixed, width=7)),
    "in 90 %": ("coverage90", fixed),
    "CRPS %": ("crps_percent", partial(fixed, width=7)),
    "rigid lost": ("rigid_modes_lost", whole),
    "negative": ("negative_eigenvalues", whole),
    "parameters": ("parameters", whole),
    "evaluations": ("evaluations", whole),
    "seconds": ("seconds", partial(fixed, digits=3, width=7)),
}
_FOOTNOTES = (
    "**skill**: 1 - r, where r is the geometric mean over structures, each the mean of its blocks "
    "of unseen data, of (rms + 0.05 %) / (rms of the textbook model + 0.05 %). A job that failed, "
    "crashed or timed out counts 10 in r, one that is not applicable as the model that it was "
    "given, which is 1 from the textbook model. **from drawn**: the same with the start from the "
    "models as drawn. **tests**: on tests alone, no computed truths.",
    "**higher, modified, given**: rms relative frequency error in percent over the higher modes "
    "and those of the structure with a known design change, which no strategy is given, and over "
    "the modes that it was given; median over the cases. A measured mode without partner counts "
    "100 %.",
    "**in 90 %, CRPS**: share of unseen modes (higher, modified) in the 90 % interval that the "
    "strategy states, and the continuous ranked probability score in percent of the frequency, "
    "less is better; means over structures. Without a stated uncertainty the latter is the "
    "absolute error.",
    "**rigid lost, negative**: rigid-body modes that the updated models lost and negative "
    "eigenvalues that they have, in all jobs. Either makes a strategy *unphysical*: it ranks below "
    "all physical ones.",
    "**parameters, evaluations, seconds**: unknowns that were free, eigenvalue solutions, wall "
    "time; median over the cases.",
    "**ok**: jobs that gave a model, of those whose case has what the strategy needs.",
)


class MarkdownReporter:
    """A report to keep, in GitHub's Markdown."""

    name = "markdown"
    suffix = ".md"

    def render(self, run: Run) -> str:
        """Return the report."""
        drawn, papers = started_as_drawn(run), papers_of(run)
        notes = [f"- **Note**: {escape(note)}" for note in notes_of(run)]
        ranked = Run(run.meta, run.ranked)
        sections = [
            f"# Updating strategies compared: run {escape(run.meta.get('run', ''))}",
            table(["", ""], ([title, escape(text)] for title, text in header(run)), "ll"),
            *(["\n".join(notes)] if notes else []),
            "## Leaderboard",
            *_leaderboard(run),
            lead(run),
            *_FOOTNOTES,
            floors_sentence(run),
            *_twins(run),
            *_coverage(run),
            *chain.from_iterable(
                _case(
                    ranked,
                    case,
                    {
                        "from the model as drawn": drawn.get(case, {}),
                        "as the paper prints it": papers.get(case, {}),
                    },
                )
                for case in cases_of(run)
            ),
            *_changes(ranked),
            *_citations(run.meta.get("citations") or {}),
        ]
        return "\n\n".join(sections)


def escape(text: object) -> str:
    """Return text that Markdown shows as it is, on one line."""
    safe = "".join(_ENTITIES.get(letter, letter) for letter in plain(text))
    return _SPECIAL.sub(r"\\\1", safe)


def table(headers: Sequence[str], rows: Iterable[Iterable[str]], align: str) -> str:
    """Return a table of cells that are escaped already; `align` has an l or r a column."""
    rules = {"l": ":---", "r": "---:"}
    lines = [headers, [rules[side] for side in align], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _leaderboard(run: Run) -> Iterator[str]:
    """Return what the run shows, the ranking, and what its tiers and groups rest on."""
    board = leaderboard(run)
    tested, listed = tell_apart(run, list(board["strategy"])), board.to_dict("records")
    tiers, letters, kind = tested.tier_of(), tested.letters(), interval_kind(run)
    heads = ["rank", "strategy", *_COLUMNS, "ok", "tier", "group"]
    rows = [
        [
            whole(row["rank"]),
            escape(row["strategy"]) + (" (unphysical)" if row["unphysical"] else ""),
            *(say(row[key]) for key, say in _COLUMNS.values()),
            f"{whole(row['ok'])} of {whole(row['total'] - row['not_applicable'])}",
            str(tiers.get(row["strategy"], NOTHING)),
            letters.get(row["strategy"], NOTHING),
        ]
        for row in listed
    ]
    if kind:
        heads.insert(3, f"95 % interval over {kind}")
        for cells, row in zip(rows, listed, strict=True):
            cells.insert(3, interval(row["skill_low"], row["skill_high"]))
    yield " ".join(map(escape, finding(run, listed, tested.tiers)))
    yield table(heads, rows, "rl" + "r" * (len(heads) - 3) + "l")
    yield f"**tier, group**: {escape(tested.note)}"


def floors_sentence(run: Run) -> str:
    """Return which ranks rest on what is added to all errors."""
    ranks = ranks_by_floor(run)
    moved = {name: found for name, found in ranks.items() if len(set(found)) > 1}
    floors = ", ".join(f"{floor:g}" for floor in FLOORS)
    said = f"**Ranks with {floors} % added to all errors**: "
    if not moved:
        return f"{said}the same."
    named = (f"{escape(name)} {', '.join(map(str, found))}" for name, found in moved.items())
    return f"{said}the same but for {'; '.join(named)}."


def _twins(run: Run) -> Iterator[str]:
    """Return the skills on twins beside those on their cases, and who may know these."""
    found, told = twin_skills(run), suspicions(run)
    if found:
        yield "## Twins"
        yield f"{MEANING} Here: {escape(drawn_from(run))}."
        rows = (
            [
                escape(name) + (" (knows the cases?)" if item.suspicious else ""),
                fixed(item.skill, 3, 6),
                fixed(item.original_skill, 3, 6),
                fixed(item.p, 3),
            ]
            for name, item in sorted(found.items(), key=lambda entry: -entry[1].original_skill)
        )
        yield table(["strategy", "skill on twins", "skill on their cases", "p"], rows, "lrrr")
    if told:
        yield "\n".join(f"- **{escape(sentence)}**" for sentence in told)


def _coverage(run: Run) -> Iterator[str]:
    """Return how many jobs each strategy finished, then the failures and what did not apply."""
    yield "## Coverage"
    if len(run.nominals) > 1:
        yield "Jobs from both nominal models."
    rows = []
    for name in strategies_of(run):
        found = [result.status for result in run.results if result.strategy == name]
        counts = (found.count("ok"), found.count("not-applicable"))
        rows.append([escape(name), *map(str, (*counts, len(found) - sum(counts), len(found)))])
    yield table(["strategy", "ok", "not applicable", "failed", "jobs"], rows, "lrrrr")
    moving = unconverged(run.results)
    if moving:
        named = ", ".join(f"{escape(name)} ({count})" for name, count in moving.items())
        yield f"Still moving at their last iteration (jobs): {named}."
    for title, items in (
        ("### Failures", troubles(run.results)),
        ("### Not applicable", troubles(run.results, fine=True)),
    ):
        yield title
        yield _troubles(items) if items else "None."


def _troubles(items: Iterable[Trouble]) -> str:
    rows = (
        map(escape, (i.case, i.strategy, " ".join(map(str, i.seeds)), i.status, i.reason))
        for i in items
    )
    return table(["case", "strategy", "seeds", "status", "reason"], rows, "lllll")


def _case(
    run: Run, case: str, printed: Mapping[str, Mapping[str, Mapping[int, float | None]]]
) -> Iterator[str]:
    """Return the frequencies of one case, a strategy a row, as the papers tabulate them.

    Arguments:
        printed: further frequencies in Hz, by where they come from, strategy and number of the
            mode.
    """
    seed = first_seed(run)
    found = [r for r in run.results if r.case == case and r.seed == seed]
    shown = [result for result in found if result.blocks]
    yield f"## Case {escape(case)}"
    about = (run.meta.get("cases") or {}).get(case) or {}
    if about.get("title"):
        yield f"{escape(about['title'])}."
    if not shown:
        yield "No strategy gave a model."
        return
    columns = {key: mode for result in shown for key, mode in _tested(result).items()}
    yield f"Frequencies in Hz, in brackets the error in percent; seed {seed}."
    headers = ["strategy", *(f"{block} {number}" for block, number in columns)]
    measured = (hertz(mode.measured_hz) for mode in columns.values())
    rows = [["*measured*", *measured, NOTHING, NOTHING]]
    for result in sorted(shown, key=lambda result: result.rank or 0):
        modes = _tested(result)
        rows.append(
            [
                escape(result.strategy) + (" (unphysical)" if result.unphysical else ""),
                *(_predicted(modes[key]) if key in modes else NOTHING for key in columns),
                _mac(modes.values()),
                fixed(result.score, 3, 6),
            ]
        )
        for said, named in printed.items():
            if others := named.get(result.strategy):
                cells = (
                    _predicted(replace(mode, predicted_hz=others[number]))
                    if number in others
                    else NOTHING
                    for (_, number), mode in columns.items()
                )
                rows.append([f"*{escape(result.strategy)}, {said}*", *cells, NOTHING, NOTHING])
    yield table([*headers, "mean MAC", "error left"], rows, "l" + "r" * (len(columns) + 2))


def _tested(result: JobResult) -> dict[tuple[str, int], PairedMode]:
    """Return the modes of the structure as tested by block and number."""
    return {
        (block, mode.number): mode
        for block in ("used", "higher")
        if block in result.blocks
        for mode in result.blocks[block].modes
    }


def _predicted(mode: PairedMode) -> str:
    if mode.predicted_hz is None:
        return f"{NOTHING} (no partner)"
    error = 100.0 * (mode.predicted_hz / mode.measured_hz - 1.0)
    return hertz(mode.predicted_hz) + (f" ({error:+.2f})" if mode.predicted_hz > 0.0 else "")


def _mac(modes: Iterable[PairedMode]) -> str:
    values = [mode.mac for mode in modes if mode.mac is not None]
    return f"{sum(values) / len(values):.3f}" if values else NOTHING


def _changes(run: Run) -> Iterator[str]:
    """Return the errors after every design change, a table a scenario, a strategy a row."""
    modes, seed = modes_frame(run), first_seed(run)
    modes = modes[(modes["block"] == "modified") & (modes["seed"] == seed)]
    modes = modes.assign(
        square=modes["counted_percent"] ** 2, name=modes["modification"].fillna("")
    )
    for scenario, own in modes.groupby(modes["case"].str.split("/").str[0], sort=False):
        # Changes and strategies in the order in which they were run.
        changes = list(dict.fromkeys(zip(own["case"], own["name"], strict=True)))
        means = own.groupby(["strategy", "case", "name"])["square"].mean().pow(0.5).to_dict()
        present = set(own["strategy"])
        rows = (
            [escape(name), *(fixed(means.get((name, *change)), 2, 7) for change in changes)]
            for name in strategies_of(run)
            if name in present
        )
        yield f"## Design changes of {escape(scenario)}"
        yield f"Rms frequency error in percent of the modes after each change; seed {seed}."
        told = (f"{escape(case)}: {escape(name)}" for case, name in changes)
        yield "\n".join(f"{number}. {text}" for number, text in enumerate(told, start=1))
        headers = ["strategy", *map(str, range(1, len(changes) + 1))]
        yield table(headers, rows, "l" + "r" * len(changes))


def _citations(citations: Mapping[str, str]) -> Iterator[str]:
    if citations:
        yield "## Strategies"
        yield "\n".join(f"- {escape(name)}: {escape(text)}" for name, text in citations.items())
