"""A paper worked through, cell by cell, as a report of any form."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial

from femubench.reports.blocks import Block, Column, Drawing, Items, Passage, Table
from femubench.reports.cells import plain
from femubench.reports.digits import Digits, off
from femubench.reports.markdown import escape, to_markdown
from femubench.reports.terminal import WIDTH, to_terminal
from femubench.reproduction import Cell, Extra, Figure, Ground, Study, Verdict

Words = Mapping[Verdict, str]

# A mark that tells it apart without colour; a short word for the screen and a whole one; what a
# sentence says of a number of cells; what it means.
_VERDICTS: dict[Verdict, tuple[str, str, str, str, str]] = {
    "independent": ("✓", "yes", "independent", "independent",
        "the figures agree, and nothing was chosen for it"),
    "under-convention": ("≈", "if", "under a convention", "under a convention",
        "they agree under a convention that the text does not state, or states otherwise"),
    "searched": ("?", "tried", "searched", "searched", "they agree under a reading that was found "
        "by trying; the note says how many were tried"),
    "fitted": ("~", "fitted", "fitted", "fitted",
        "they agree after something was fitted to this figure or to its like"),
    "input": ("=", "input", "input", "input", "a count, a definition or a figure that the paper "
        "was given: its agreement shows nothing but care in copying"),
    "cannot-be-checked": ("·", "unseen", "cannot be checked", "cannot be checked",
        "what is not in print decides, such as mode shapes: ours is given for comparison alone"),
    "misprint": ("!", "misprint", "misprint", "misprinted",
        "other printed figures of the same paper contradict it"),
    "does-not-follow": ("✗", "no", "does not follow", "do not follow",
        "it does not follow from the text under any reading that was tried"),
}  # fmt: skip
_SHORT: Words = {verdict: f"{sign} {short}" for verdict, (sign, short, *_) in _VERDICTS.items()}
WORDS: Words = {verdict: f"{sign} {whole}" for verdict, (sign, _, whole, *_) in _VERDICTS.items()}
MEANING: Words = {verdict: meaning for verdict, (*_, meaning) in _VERDICTS.items()}
AGREE = (
    "Two figures agree when ours rounds to the printed one or lies within the tolerance of the "
    "row's kind. Of several grounds the weakest makes the verdict; the note names them all."
)
DEVIATION = (
    "Deviation: (ours - printed) / |printed| in percent; of figures that are percentages "
    "themselves, ours - printed in points (pt). A frequency with an i is imaginary and counts as "
    "negative. – : there is no value of ours."
)
_EDGE, _GAP = 2, 2
# A column of texts of so many characters is squeezed when it gets fewer than so many.
_SENTENCE, _SQUEEZED = 30, 14
_TITLE = 14  # characters of a title that stay on one line where there is room
_NUMERIC = frozenset("0123456789+-–<>.")


def counts_line(studies: Iterable[Study]) -> str:
    """Return how many cells agree with nothing chosen for it, then all other verdicts."""
    return sentence_of_counts([cell for study in studies for cell in study.cells])


def reproduction_text(studies: Sequence[Study]) -> str:
    """Return studies as plain text of 80 columns, but for the first line: all the counts."""
    sections = [*_legend(_SHORT), *_chapters(studies, _SHORT, "")]
    return f"{counts_line(studies)}\n\n{to_terminal(sections)}"


def reproduction_markdown(studies: Sequence[Study], *, figures: bool = False) -> str:
    """Return studies in GitHub's Markdown; `figures`: link to `FIGURES`/NAME.svg."""
    folder = f"{Study.FIGURES}/" if figures else ""
    sections = [*_legend(WORDS), *_chapters(studies, WORDS, folder)]
    return f"# {escape(counts_line(studies))}\n\n{to_markdown(sections)}"


def sentence_of_counts(cells: Sequence[Cell]) -> str:
    """Return how many cells there are of every verdict, as a sentence without its stop."""
    count = Cell.verdict_counts(cells)
    return (
        f"{count['independent']} of {len(cells)} printed {_noun(cells)} agree independently "
        f"({different(cells)}), "
        f"{count['under-convention']} under a stated convention, {count['searched']} after a "
        f"search and {count['fitted']} after a fit; {count['input']} are input, "
        f"{count['cannot-be-checked']} cannot be checked, {count['misprint']} are misprints and "
        f"{count['does-not-follow']} do not follow"
    )


def summary(cells: Sequence[Cell]) -> str:
    """Return the counts of a table without those that are zero."""
    counts = Cell.verdict_counts(cells)
    more = {"independent": f" ({different(cells)})"}
    parts = (
        f"{counts[v]} {_VERDICTS[v][3]}{more.get(v, '')}" for v in Ground.VERDICTS if counts[v]
    )
    return f"{len(cells)} {_noun(cells)}: {', '.join(parts)}"


def different(cells: Sequence[Cell]) -> str:
    """Return how many different figures agree independently, in words."""
    count = Cell.count_different(cells)
    return f"{count} different figure{'s' * (count != 1)}"


def _noun(cells: Sequence[Cell]) -> str:
    return "cell" if len(cells) == 1 else "cells"


def _legend(words: Words) -> Iterator[Passage]:
    entries = [(words[verdict], meaning) for verdict, meaning in MEANING.items()]
    yield Passage("How to read it", [AGREE, Items(entries), DEVIATION])


def _chapters(studies: Iterable[Study], words: Words, folder: str) -> Iterator[Passage]:
    for study in studies:
        yield Passage(study.title, [study.citation, f"{sentence_of_counts(study.cells)}."])
        yield from _remarks("What was taken from where", study.premises)
        tables: dict[str, list[Cell]] = {}
        for cell in study.cells:
            tables.setdefault(cell.table, []).append(cell)
        for table, cells in tables.items():
            title = heading(table)
            yield Passage(title, list(cells_in_words(cells, words)), level=3)
        yield from parts_of(study, partial(_drawing, folder=folder))


def parts_of(study: Study, drawn: Callable[[Figure], Drawing]) -> Iterator[Passage]:
    """Yield what follows the tables of a paper."""
    yield from _remarks("What the re-run shows", study.findings)
    for extra in study.extras:
        yield Passage(extra.title, list(_extra_blocks(extra)), level=3)
    if study.figures:
        yield Passage("Figures", [drawn(figure) for figure in study.figures], level=3)


def _remarks(title: str, sentences: Sequence[str]) -> Iterator[Passage]:
    if sentences:
        yield Passage(title, [Items([("", sentence) for sentence in sentences])], level=3)


def cells_in_words(cells: Sequence[Cell], words: Words) -> Iterator[Block]:
    """Return the cells of one table, then every note once."""
    notes = list(dict.fromkeys(cell.note for cell in cells if cell.note))
    marks = {note: f"[{number}]" for number, note in enumerate(notes, 1)}
    digits = digits_of(cells)
    units = list(digits)
    several = len(units) > 1  # then they have a column
    rows = [
        [
            cell.row,
            cell.column,
            *([cell.unit] if several else []),
            digits[cell.unit].format(cell.printed, cell.unit),
            digits[cell.unit].ours(cell.ours, cell.unit, printed=cell.printed),
            off(cell.deviation_percent, cell.unit),
            f"{words[cell.verdict]} {marks.get(cell.note, '')}".rstrip(),
        ]
        for cell in cells
    ]
    titles = ["row", "column", *(["unit"] * several), "printed", "ours", "dev. %", "verdict"]
    sides = "ll" + "l" * several + "rrrl"
    caption = f"{summary(cells)}{f'; in {units[0]}' if units[0] and not several else ''}."
    yield Table(_columns(titles, rows, sides), rows, caption, [cell.verdict for cell in cells])
    if notes:
        yield Items([(marks[note], note) for note in notes], whole=True)


def digits_of(cells: Iterable[Cell]) -> dict[str, Digits]:
    """Return how the figures of one table are written, by unit."""
    printed: dict[str, list[float]] = {}
    for cell in cells:
        printed.setdefault(cell.unit, []).append(cell.printed)
    return {unit: Digits.of(figures) for unit, figures in printed.items()}


def _extra_blocks(extra: Extra) -> Iterator[Block]:
    """Return a table; a column of sentences that the screen has no room for stands below it."""
    columns = list(zip(*extra.rows, strict=True)) or [()] * len(extra.columns)
    figures = (all(not cell or cell[0] in _NUMERIC for cell in cells) for cells in columns[1:])
    sides = "l" + "".join("r" if numeric else "l" for numeric in figures)
    made = _columns(extra.columns, extra.rows, sides)
    squeezed = [
        place
        for place, (column, cells) in enumerate(zip(made, columns, strict=True))
        if place and column.width < _SQUEEZED and max(map(len, cells), default=0) >= _SENTENCE
    ]
    kept = [place for place in range(len(made)) if place not in squeezed]
    rows = [[row[place] for place in kept] for row in extra.rows]
    titles = [extra.columns[place] for place in kept]
    yield Table(_columns(titles, rows, "".join(sides[place] for place in kept)), rows)
    notes = [(row[0], row[place]) for place in squeezed for row in extra.rows]
    if notes or extra.note:
        yield Items([*notes, *([("Note", extra.note)] if extra.note else [])], whole=True)


def _columns(titles: Sequence[str], rows: Sequence[Sequence[str]], sides: str) -> list[Column]:
    """Return columns that fit on the screen together: titles break, then cells between words."""
    lengths, words = [], []
    for title, *cells in zip(titles, *rows, strict=True):
        title_words = plain(title).split()
        lengths.append(max(min(len(plain(title)), _TITLE), *map(len, map(plain, cells)), 1))
        words.append(max(map(len, [*title_words, *(w for c in cells for w in plain(c).split())])))
    room = WIDTH - _EDGE - _GAP * (len(titles) - 1)
    widths = [max(pair) for pair in zip(lengths, words, strict=True)]
    widths = _narrowed(_narrowed(widths, words, room), [1] * len(words), room)
    return [
        Column("\n".join(textwrap.wrap(plain(title), width)), width, side == "l", wrap=True)
        for title, width, side in zip(titles, widths, sides, strict=True)
    ]


def _narrowed(widths: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Return widths of which the largest give way until all fit, or none has room to give."""
    narrow = list(widths)
    for most in range(max(widths), 0, -1):
        for place, width in enumerate(narrow):
            if sum(narrow) > room and width == most > least[place]:
                narrow[place] -= 1
    return narrow


def _drawing(figure: Figure, folder: str) -> Drawing:
    file = f"{folder}{figure.name}.svg" if folder else ""
    return Drawing(figure.title, figure.caption, "", file)


def heading(table: str) -> str:
    """Return a heading for a table by the paper's number, or by what the cells are from."""
    if table[:1].isdigit():
        return f"Table {table}"
    return "Said in the text" if table == "text" else table[:1].upper() + table[1:]
