"""A run on the screen and in Markdown: leaderboard, failures, frequencies, design changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import structs

import femubench
from femubench.reports import study
from femubench.reports.blocks import Block, Cell, Column, Items, Passage, Table
from femubench.reports.cells import NOTHING, hertz, interval, plain, whole
from femubench.reports.markdown import escape, to_markdown
from femubench.reports.page.papers import list_drawn_frequencies, papers_of
from femubench.reports.predictive import predictive_blocks
from femubench.reports.summary import (
    cases_of,
    failures,
    finding,
    first_seed,
    group_reasons,
    header,
    lead,
    notes_of,
    shortfalls,
    strategies_of,
    troubles,
    unconfined,
)
from femubench.reports.terminal import to_terminal
from femubench.reports.twins import MEANING, describe_twins, suspicions
from femubench.results import JobResult, PairedMode, RunData, Standings, StudyAxes, twin_gains

if TYPE_CHECKING:
    from femubench import Identification
    from femubench.reproduction import Study


_FIGURES = {
    "gain": Column("gain", 6, digits=3),
    "interval": Column("95 % interval", 16),
    "error_percent": Column("off\n%", 4, digits=2),
    "better_share": Column("better\n%", 6),
    "error_gain": Column("out of\nband", 6, digits=3),
    "change_gain": Column("of\nchanges", 7, digits=3),
    "answered": Column("answered", 8),
    "gain_drawn": Column("from\ndrawn", 6, digits=3),
    "gain_tests": Column("on\ntests", 6, digits=3),
    "band_percent": Column("in band\n%", 7, digits=2),
    "shape_error": Column("1-MAC", 5, digits=3),
    "false_modes": Column("false\nmodes", 5, digits=2),
    "used_percent": Column("given\n%", 5, digits=2),
    "responses_db": Column("resp.\ndB", 5, digits=2),
    "responses_floor_db": Column("noise\ndB", 5, digits=2),
    "parameters": Column("par.", 5),
    "seconds": Column("s", 4, digits=3),
    "better_than": Column("above", 5),
    "worse_than": Column("below", 5),
}
_LEGEND = {
    "gain": "mean of `out of band` and `of changes`, over structures; a job without a possible "
    "model counts as the model that was given",
    "off, better": "mean |ln(f_p / f_m)| in percent out of the given band, and the share of the "
    "structures where it is less than the textbook model's",
    "on tests": "gain on tests alone, no computed truths",
    "in band, 1-MAC, false modes": "error in percent of modified modes in the given band, where "
    "the given frequencies nearly are the answer; shapes; modes that a test would see and did not",
    "given": "rms error in percent of the modes that were given; median over the cases, as are "
    "par. and s: unknowns that were free, wall time",
    "resp., noise": "rms error of the log-magnitude of held-out responses, and what the noise of "
    "the test makes of it; median over the cases, no part of the gain",
    "above, below": "number of lines that it is shown to be better and worse than",
    "=": "yardstick that knows nothing of the structure; without rank",
    "!": "some models lost rigid-body modes or have negative eigenvalues",
    "*": "some jobs gave no model",
    "^": "ran without a sandbox, and could read what it was not given",
}


class TerminalReporter:
    """Plain text for the screen."""

    name = "terminal"
    suffix = ".txt"

    def render(self, run: RunData) -> str:
        """Return the ranking, the failures and what the columns mean."""
        if StudyAxes.from_run(run) is not None:
            return to_terminal(study.sections_of(run))
        failed = failures(troubles(run.results))
        stated = [*failed, *_notes(run)]
        return to_terminal([*_board(run), *(Passage("", [block]) for block in stated)])

    def notes(self, run: RunData) -> list[str]:
        """Return what a reader has to know of a run, where a format has no room for it."""
        return notes_of(run)

    def shortfalls(self, run: RunData) -> list[str]:
        """Return why the ranks of a run may not hold, where its report is not shown."""
        return shortfalls(run)

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

    def render(self, run: RunData) -> str:
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


def board_text(run: RunData) -> str:
    """Return the ranking, what its columns mean, and which strategies differ from the best."""
    return to_terminal(_board(run))


def _marks(row: Mapping[Any, Any], bare: frozenset[str]) -> str:
    """Return what must not be overlooked: yardsticks, lost physics, no model, no sandbox."""
    marks = {"=": row["yardstick"], "!": row["unphysical"], "*": row["ok"] < row["total"]}
    marks["^"] = row["strategy"] in bare
    return "".join(mark for mark, is_so in marks.items() if is_so)


def _cells(row: Mapping[Any, Any]) -> dict[str, Cell]:
    """Return the figures of a row as the board shows them."""
    counts = {key: len(row[key]) for key in ("better_than", "worse_than")}
    return {
        **{key: row.get(key) for key in _FIGURES},
        "interval": interval(row["gain_low"], row["gain_high"]),
        "better_share": 100.0 * row["better_share"],
        "answered": f"{row['answered']} of {row['total']}",
        **{key: str(count) for key, count in counts.items()},
    }


def _board(run: RunData, title: str = "") -> Iterator[Passage]:
    """Yield the leaderboard, what its columns mean, and what the run shows."""
    standings = Standings.of(run)
    rows, bare = standings.rows, unconfined(run)
    tested = any(row["better_than"] for row in rows)
    heads = {"#": Column("#", 6), "strategy": Column("strategy", 16, left=True), **_FIGURES}
    listed = [
        {"#": _marks(row, bare) + whole(row["rank"]) * (row["rank"] is not None),
         "strategy": row["strategy"], **_cells(row)}
        for row in rows
    ]  # fmt: skip
    # Columns that nothing is known of are left out.
    known = [
        key
        for key, head in heads.items()
        if key in ("#", "strategy", "gain")
        or (
            {head.text(line[key]) for line in listed} - {NOTHING, ""}
            and (tested or key not in ("better_than", "worse_than"))
        )
    ]
    table = Table(
        [heads[key] for key in known], [[line[key] for key in known] for line in listed], names=1
    )
    yield Passage(title, [table])
    titles = " ".join([c.title.replace("\n", " ") for c in table.columns])
    titles += "".join(_marks(row, bare) for row in rows)
    legend = [entry for entry in _LEGEND.items() if entry[0].partition(",")[0] in titles]
    if title or not tested:
        legend.append(("tested", standings.apart.note))
    yield Passage("", [lead(run), Items(legend)])
    if said := finding(run, rows):
        yield Passage("", [" ".join(said)])
    if drawn := list(_drawings(standings)):
        yield Passage("Drawings" if title else "", drawn)
    if twins := list(_twins(run)):
        yield Passage("Twins" if title else "", twins)


def _drawings(standings: Standings) -> Iterator[Table]:
    """Yield gain and error from a further drawing next to those from the first one."""
    keys = ("gain", 3), ("error_percent", 2)
    for drawing, figures in standings.drawings.items():
        heads = [
            Column(f"{_FIGURES[key].title}\n{which}", 8, digits=digits)
            for key, digits in keys
            for which in ("first", plain(drawing))
        ]
        rows = [
            [row["strategy"], *(own[key] for key, _ in keys for own in figures[row["strategy"]])]
            for row in standings.rows
        ]
        said = "On the cases that have both; first: from the drawing of case.toml."
        yield Table([Column("strategy", 16, left=True), *heads], rows, said)


def _twins(run: RunData) -> Iterator[Block]:
    """Yield the gains on twins next to those on their cases, and who may know these."""
    found = sorted(twin_gains(run).items(), key=lambda entry: -entry[1].original_gain)
    if found:
        heads = (Column(head, 8, digits=3) for head in ("on twins", "on cases", "p"))
        rows = [
            [name + " (knows the cases?)" * own.suspicious, own.gain, own.original_gain, own.p]
            for name, own in found
        ]
        said = f"{MEANING} The lower gain counts. Here: gain on {describe_twins(run)}."
        yield Table([Column("strategy", 30, left=True), *heads], rows, said)
    yield from (f"?: {stated}" for stated in suspicions(run))


def _notes(run: RunData) -> Iterator[str]:
    """Yield what else a reader of the screen has to know."""
    yield from (f"Note: {note}." for note in notes_of(run))
    yield from _moving(run)
    for reason, names in group_reasons(run.results).items():
        named = ", ".join(map(plain, names))
        yield f"Not applicable, counted as the model that was given: {named}: {reason}."


def _moving(run: RunData) -> Iterator[str]:
    moving = Counter(
        result.strategy
        for result in run.results
        if result.status == "ok" and result.diagnostics.get("converged") == 0.0
    )
    if moving:
        named = ", ".join(f"{plain(name)} ({count})" for name, count in moving.items())
        yield f"Still moving at their last iteration (jobs): {named}."


def _document(run: RunData) -> Iterator[Passage]:
    notes = [("Note", note) for note in notes_of(run)]
    about = Table([Column("", 9, left=True)] * 2, list(header(run)))
    yield Passage("", [about, *([Items(notes)] if notes else [])])
    yield from _board(run, "Leaderboard")
    yield Passage("Predictive board", predictive_blocks(run))
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
    drawn, papers, ranked = (
        list_drawn_frequencies(run),
        papers_of(run),
        RunData(run.meta, run.ranked),
    )
    for case in cases_of(run):
        start, printed = drawn.get(case, {}), papers.get(case, {})
        others = (("from the model as drawn", start), ("as the paper prints it", printed))
        yield Passage(f"Case {case}", list(_case(ranked, case, others)))
    yield from _changes(ranked)
    if cited := run.meta.get("citations"):
        yield Passage("Strategies", [Items(list(cited.items()))])


def _case(
    run: RunData, case: str, others: Iterable[tuple[str, Mapping[str, Mapping[int, float | None]]]]
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
        rows.append([result.strategy + mark, *known, _mac(modes.values()), result.gain])
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
    heads += [Column("mean MAC", 8, digits=3), Column("gain", 8, digits=3)]
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


def _changes(run: RunData) -> Iterator[Passage]:
    """Yield the errors after every design change, a table a scenario, a strategy a row."""
    modes, seed = femubench.Run.of(run).modes, first_seed(run)
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
