"""The full report: header, leaderboard, failures, frequencies, design changes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
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
_FOOTNOTES = (
    "**skill**: 1 - r, where r is the geometric mean over structures, each the mean of its blocks "
    "of unseen data, of (rms + 0.05 %) / (rms of the textbook model + 0.05 %). A job that failed, "
    "crashed or timed out counts 10 in r, one that is not applicable 1. **from drawn**: the same "
    "with the start from the models as drawn. **tests**: on tests alone, no computed truths.",
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
    """Return the ranking with tiers and groups without a difference, and what they rest on."""
    board = leaderboard(run)
    tested = tell_apart(run, list(board["strategy"]))
    tiers, letters = tested.tier_of(), tested.letters()
    yield " ".join(map(escape, finding(run, board.to_dict("records"), tested.tiers)))
    headers = [
        *("rank", "strategy", "skill", "from drawn", "tests", "higher %", "modified %", "given %"),
        *("in 90 %", "CRPS %", "rigid lost", "negative", "parameters", "evaluations", "seconds"),
        *("ok", "tier", "group"),
    ]
    kind = interval_kind(run)
    if kind:
        headers.insert(3, f"95 % interval over {kind}")
    rows = []
    for row in board.to_dict("records"):
        cells = [
            whole(row["rank"]),
            escape(row["strategy"]) + (" (unphysical)" if row["unphysical"] else ""),
            fixed(row["skill"], 3, 6),
            fixed(row["skill_drawn"], 3, 6),
            fixed(row["skill_tests"], 3, 6),
            *(fixed(row[f"{block}_percent"], 2, 7) for block in ("higher", "modified", "used")),
            fixed(row["coverage90"], 2),
            fixed(row["crps_percent"], 2, 7),
            *(whole(row[key]) for key in ("rigid_modes_lost", "negative_eigenvalues")),
            *(whole(row[key]) for key in ("parameters", "evaluations")),
            fixed(row["seconds"], 3, 7),
            f"{whole(row['ok'])} of {whole(row['total'] - row['not_applicable'])}",
            str(tiers.get(row["strategy"], NOTHING)),
            letters.get(row["strategy"], NOTHING),
        ]
        if kind:
            cells.insert(3, interval(row["skill_low"], row["skill_high"]))
        rows.append(cells)
    yield table(headers, rows, "rl" + "r" * (len(headers) - 3) + "l")
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
        rows += [
            _beside(result.strategy, said, named[result.strategy], columns)
            for said, named in printed.items()
            if result.strategy in named
        ]
    yield table([*headers, "mean MAC", "error left"], rows, "l" + "r" * (len(columns) + 2))


def _beside(
    strategy: str,
    said: str,
    hertz_of: Mapping[int, float | None],
    columns: Mapping[tuple[str, int], PairedMode],
) -> list[str]:
    """Return a row of other frequencies of a strategy, to stand under its own."""
    cells = (
        _predicted(replace(mode, predicted_hz=hertz_of[number])) if number in hertz_of else NOTHING
        for (_, number), mode in columns.items()
    )
    return [f"*{escape(strategy)}, {said}*", *cells, NOTHING, NOTHING]


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
