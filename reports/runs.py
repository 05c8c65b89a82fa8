"""A run on the screen and in Markdown: leaderboard, failures, frequencies, design changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import structs

from femubench.reports import study
from femubench.reports.blocks import Block, Cell, Column, Items, Passage, Table
from femubench.reports.cells import NOTHING, hertz, interval, plain, whole
from femubench.reports.markdown import escape, to_markdown
from femubench.reports.page.papers import list_drawn_frequencies, papers_of
from femubench.reports.summary import (
    cases_of,
    failures,
    finding,
    first_seed,
    group_reasons,
    header,
    lead,
    notes_of,
    strategies_of,
    troubles,
)
from femubench.reports.terminal import to_terminal
from femubench.reports.twins import MEANING, describe_twins, suspicions
from femubench.results import (
    FLOORS,
    JobResult,
    PairedMode,
    Run,
    StudyAxes,
    interval_kind,
    leaderboard,
    modes_frame,
    ranks_by_floor,
    tell_apart,
    twin_gains,
)

if TYPE_CHECKING:
    from femubench import Identification
    from femubench.reproduction import Study


_FIGURES = {
    "gain": Column("gain", 5, digits=3),
    "gain_drawn": Column("from\ndrawn", 5, digits=3),
    "higher_percent": Column("high\n%", 4, digits=2),
    "modified_percent": Column("mod.\n%", 4, digits=2),
    "used_percent": Column("given\n%", 4, digits=2),
    "rigid_modes_lost": Column("rig.\nlost", 4),
    "negative_eigenvalues": Column("neg.\neig.", 4),
    "parameters": Column("par.", 5),
    "seconds": Column("s", 4, digits=3),
}
_ALWAYS = 2 + len(_FIGURES)  # columns that are there whatever is known
_MORE_FIGURES = {
    "gain_tests": Column("on\ntests", 5, digits=3),
    "coverage90": Column("in\n90 %", 4, digits=2),
    "crps_percent": Column("CRPS\n%", 4, digits=2),
    "evaluations": Column("eval.", 5),
}
# No reason for a second table by themselves.
_NEXT_TO = {_MORE_FIGURES[name].title for name in ("crps_percent", "evaluations")}
_LEGEND = {
    "high, mod., given": "rms frequency error in percent over the higher modes and those after a "
    "design change, which no strategy is given, and over the modes that it was given; a mode "
    "without partner counts 100 %; median over the cases, as are par., eval. and s: unknowns that "
    "were free, eigenvalue solutions, wall time",
    "on tests": "gain on tests alone, no computed truths",
    "in 90 %, CRPS": "unseen modes inside the stated 90 % interval, and the continuous ranked "
    "probability score in percent of the frequency, less is better, without a stated uncertainty "
    "the absolute error; means over structures",
    "rig. lost, neg. eig.": "rigid-body modes that the updated models lost, and negative "
    "eigenvalues that they have, in all jobs",
    "!": "unphysical for one of these, or for surplus partners; below all others",
    "*": "some jobs gave no model: ten times the error, left out of the errors shown",
}
_GAIN = (
    "1 - r, where r is the geometric mean over structures, each the mean of its blocks of unseen "
    "data, of (rms + 0.05 %) / (rms of the textbook model + 0.05 %). A job that failed, crashed or "
    "timed out counts 10 in r, one that is not applicable as the model that it was given"
)


class TerminalReporter:
    """Plain text for the screen."""

    name = "terminal"
    suffix = ".txt"

    def render(self, run: Run) -> str:
        """Return the ranking, the failures and what the columns mean."""
        if StudyAxes.from_run(run) is not None:
            return to_terminal(study.sections_of(run))
        failed = failures(troubles(run.results))
        stated = [*failed, *_notes(run)]
        return to_terminal([*_board(run), *(Passage("", [block]) for block in stated)])

    def notes(self, run: Run) -> list[str]:
        """Return what a reader has to know of a run, where a format has no room for it."""
        return notes_of(run)

    def render_diagnosis(self, data: Mapping[str, Any]) -> str:
        """Return a diagnosis in 80 columns."""
        from femubench.reports.diagnosis import diagnosis_text

        return diagnosis_text(data)

    def diagnosis_lines(self, data: Mapping[str, Any]) -> list[str]:
        """Return the verdict of a diagnosis and its causes, a line each."""
        from femubench.reports.diagnosis import summary_lines

        return summary_lines(data)

    def render_comparison(self, data: Mapping[str, Any]) -> str:
        """Return a comparison in 80 columns."""
        from femubench.reports.compare_page import comparison_text

        return comparison_text(data)

    def render_studies(self, studies: Sequence[Study], drawings: Mapping[str, str]) -> str:
        """Return papers worked through, in 80 columns."""
        from femubench.reports.reproduction import reproduction_text

        return reproduction_text(studies)

    def render_modes(self, found: Identification, source: str = "") -> str:
        """Return identified modes in 80 columns."""
        from femubench.reports.identification import identification_text

        return identification_text(found)


class MarkdownReporter:
    """A report to keep, in GitHub's Markdown."""

    name = "markdown"
    suffix = ".md"

    def render(self, run: Run) -> str:
        """Return the report."""
        if StudyAxes.from_run(run) is not None:
            sections = [*study.sections_of(run), study.about_axes(run)]
            return to_markdown(sections, study.title_of(run))
        title = f"Updating strategies compared: run {run.meta.get('run', '')}".rstrip()
        return to_markdown(_document(run), title)

    def render_diagnosis(self, data: Mapping[str, Any]) -> str:
        """Return a diagnosis in Markdown."""
        from femubench.reports.diagnosis import diagnosis_markdown

        return diagnosis_markdown(data)

    def render_comparison(self, data: Mapping[str, Any]) -> str:
        """Return a comparison in Markdown."""
        from femubench.reports.compare_page import comparison_markdown

        return comparison_markdown(data)

    def render_studies(self, studies: Sequence[Study], drawings: Mapping[str, str]) -> str:
        """Return papers worked through; where there are drawings, with links to their files."""
        from femubench.reports.reproduction import reproduction_markdown

        return reproduction_markdown(studies, figures=bool(drawings))

    def render_list(self, title: str, lines: Iterable[str]) -> str:
        """Return lines as a list with a title above."""
        return "\n".join([f"# {escape(title)}", *(f"- {escape(line)}" for line in lines)])


def board_text(run: Run) -> str:
    """Return the ranking, what its columns mean, and which strategies differ from the best."""
    return to_terminal(_board(run))


def floors_said(run: Run) -> tuple[str, str]:
    """Return a label and which ranks rest on what is added to all errors."""
    ranks = ranks_by_floor(run)
    moved = {name: found for name, found in ranks.items() if len(set(found)) > 1}
    label = f"Ranks with {', '.join(f'{floor:g}' for floor in FLOORS)} % added to all errors"
    named = "; ".join(f"{name} {', '.join(map(str, found))}" for name, found in moved.items())
    return label, f"the same but for {named}." if moved else "the same."


def _marks(row: Mapping[Any, Any]) -> str:
    """Return what must not be overlooked: lost physics, and jobs that the errors leave out."""
    incomplete = row["ok"] + row["not_applicable"] < row["total"]
    return ("!" if row["unphysical"] else "") + ("*" if incomplete else "")


def _board(run: Run, title: str = "") -> Iterator[Passage]:
    """Yield the leaderboard, what its columns mean, and what the run shows."""
    rows = leaderboard(run).to_dict("records")
    tested = tell_apart(run, [row["strategy"] for row in rows])
    tiers = tested.tier_of()
    letters = tested.letters()
    heads = (
        *(Column("#", 6), Column("strategy", 16, left=True), *_FIGURES.values()),
        *(Column(f"95 % interval\nover {interval_kind(run)}", 16), *_MORE_FIGURES.values()),
        *(Column("tier", 4), Column("group", 10, left=True)),
    )
    cells: list[list[Cell]] = [
        [
            _marks(row) + whole(row["rank"]),
            row["strategy"],
            *(row[key] for key in _FIGURES),
            interval(row["gain_low"], row["gain_high"]),
            *(row[key] for key in _MORE_FIGURES),
            str(tiers.get(row["strategy"], NOTHING)),
            letters.get(row["strategy"], ""),
        ]
        for row in rows
    ]
    # Columns that nothing is known of are left out.
    known = [
        k
        for k, head in enumerate(heads)
        if k < _ALWAYS or {head.text(line[k]) for line in cells} - {NOTHING, ""}
    ]
    if not title and not {heads[k].title for k in known[_ALWAYS:]} - _NEXT_TO:
        known = known[:_ALWAYS]
    table = Table([heads[k] for k in known], [[line[k] for k in known] for line in cells], names=1)
    yield Passage(title, [table])
    titles = " ".join([*(c.title.replace("\n", " ") for c in table.columns), *map(_marks, rows)])
    legend = [entry for entry in _LEGEND.items() if entry[0].partition(",")[0] in titles]
    if title or not tested.tiers:
        legend.append(("tier, group" if tested.tiers else "#", tested.note))
    yield Passage("", [lead(run), Items(legend)])
    if said := finding(run, rows, tested.tiers):
        yield Passage("", [" ".join(said)])
    if twins := list(_twins(run)):
        yield Passage("Twins" if title else "", twins)


def _twins(run: Run) -> Iterator[Block]:
    """Yield the gains on twins next to those on their cases, and who may know these."""
    found = sorted(twin_gains(run).items(), key=lambda entry: -entry[1].original_gain)
    if found:
        heads = (Column(head, 8, digits=3) for head in ("on twins", "on cases", "p"))
        rows = [
            [name + " (knows the cases?)" * own.suspicious, own.gain, own.original_gain, own.p]
            for name, own in found
        ]
        said = f"{MEANING} Here: gain on {describe_twins(run)}."
        yield Table([Column("strategy", 30, left=True), *heads], rows, said)
    yield from (f"?: {stated}" for stated in suspicions(run))


def _notes(run: Run) -> Iterator[str]:
    """Yield what else a reader of the screen has to know."""
    yield from (f"Note: {note}." for note in notes_of(run))
    yield from _moving(run)
    for reason, names in group_reasons(run.results).items():
        named = ", ".join(map(plain, names))
        yield f"Not applicable, counted as the model that was given: {named}: {reason}."


def _moving(run: Run) -> Iterator[str]:
    moving = Counter(
        result.strategy
        for result in run.results
        if result.status == "ok" and result.diagnostics.get("converged") == 0.0
    )
    if moving:
        named = ", ".join(f"{plain(name)} ({count})" for name, count in moving.items())
        yield f"Still moving at their last iteration (jobs): {named}."


def _document(run: Run) -> Iterator[Passage]:
    notes = [("Note", note) for note in notes_of(run)]
    about = Table([Column("", 9, left=True)] * 2, list(header(run)))
    yield Passage("", [about, *([Items(notes)] if notes else [])])
    yield from _board(run, "Leaderboard")
    yield Passage("", [Items([("gain", _GAIN), floors_said(run)])])
    rows: list[list[Cell]] = []
    for name in strategies_of(run):
        found = [result.status for result in run.results if result.strategy == name]
        ok, spared_jobs = found.count("ok"), found.count("not-applicable")
        rows.append([name, ok, spared_jobs, len(found) - ok - spared_jobs, len(found)])
    heads = [Column(name, 14) for name in ("ok", "not applicable", "failed", "jobs")]
    both = ["Jobs from both nominal models."] if len(run.nominals) > 1 else []
    counted = Table([Column("strategy", 16, left=True), *heads], rows)
    yield Passage("Coverage", [*both, counted, *_moving(run)])
    for title, fine in (("Failures", False), ("Not applicable", True)):
        ended = failures(troubles(run.results, fine=fine))
        yield Passage(title, ended or ["None."], level=3)
    drawn, papers, ranked = list_drawn_frequencies(run), papers_of(run), Run(run.meta, run.ranked)
    for case in cases_of(run):
        start, printed = drawn.get(case, {}), papers.get(case, {})
        others = (("from the model as drawn", start), ("as the paper prints it", printed))
        yield Passage(f"Case {case}", list(_case(ranked, case, others)))
    yield from _changes(ranked)
    if cited := run.meta.get("citations"):
        yield Passage("Strategies", [Items(list(cited.items()))])


def _case(
    run: Run, case: str, others: Iterable[tuple[str, Mapping[str, Mapping[int, float | None]]]]
) -> Iterator[Block]:
    """Yield the frequencies of one case, a strategy a row, as the papers tabulate them.

    Arguments:
        others: further frequencies in Hz, by where they come from, strategy and number of the mode.
    """
    seed = first_seed(run)
    found = [r for r in run.results if r.case == case and r.seed == seed and r.blocks]
    about = (run.meta.get("cases") or {}).get(case) or {}
    if about.get("title"):
        yield f"{about['title']}."
    if not found:
        yield "No strategy gave a model."
        return
    columns = {key: mode for result in found for key, mode in _tested(result).items()}
    rows: list[list[Cell]] = [
        ["measured", *(hertz(mode.measured_hz) for mode in columns.values()), None, None]
    ]
    for result in sorted(found, key=lambda result: result.rank or 0):
        modes, mark = _tested(result), " (unphysical)" * result.unphysical
        known = (_predicted(modes[key]) if key in modes else NOTHING for key in columns)
        rows.append([result.strategy + mark, *known, _mac(modes.values()), result.score])
        for said, by_strategy in others:
            if stated := by_strategy.get(result.strategy):
                cells = (
                    _predicted(structs.replace(mode, predicted_hz=stated[number]))
                    if number in stated
                    else NOTHING
                    for (_, number), mode in columns.items()
                )
                rows.append([f"{result.strategy}, {said}", *cells, None, None])
    heads = [Column(" ".join(map(str, key)), 16) for key in columns]
    heads += [Column("mean MAC", 8, digits=3), Column("error left", 8, digits=3)]
    caption = f"Frequencies in Hz, in brackets the error in percent; seed {seed}."
    yield Table([Column("strategy", 16, left=True), *heads], rows, caption)


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


def _mac(modes: Iterable[PairedMode]) -> float | None:
    values = [mode.mac for mode in modes if mode.mac is not None]
    return sum(values) / len(values) if values else None


def _changes(run: Run) -> Iterator[Passage]:
    """Yield the errors after every design change, a table a scenario, a strategy a row."""
    modes, seed = modes_frame(run), first_seed(run)
    modes = modes[(modes["block"] == "modified") & (modes["seed"] == seed)]
    modes = modes.assign(
        square=modes["counted_percent"] ** 2, name=modes["modification"].fillna("")
    )
    said = f"Rms frequency error in percent of the modes after each change; seed {seed}."
    for scenario, own in modes.groupby(modes["case"].str.split("/").str[0], sort=False):
        # Changes and strategies in the order in which they were run.
        changes = list(dict.fromkeys(zip(own["case"], own["name"], strict=True)))
        means = own.groupby(["strategy", "case", "name"])["square"].mean().pow(0.5).to_dict()
        present = set(own["strategy"])
        rows = [
            [name, *(means.get((name, *change)) for change in changes)]
            for name in strategies_of(run)
            if name in present
        ]
        stated = [(str(number), ": ".join(change)) for number, change in enumerate(changes, 1)]
        heads = [Column("strategy", 16, left=True), *(Column(n, 7, digits=2) for n, _ in stated)]
        yield Passage(f"Design changes of {scenario}", [said, Items(stated), Table(heads, rows)])
