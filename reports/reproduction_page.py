"""Papers worked through as one HTML document: tables as printed, and why every cell has its colour.

Nothing runs in it: what is chosen among conventions is shown by the style sheet.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple

from markupsafe import Markup

from femubench.reports.cells import plain
from femubench.reports.digits import Digits, off
from femubench.reports.reproduction import (
    AGREE,
    DEVIATION,
    MEANING,
    WORDS,
    cells_in_words,
    digits_of,
    extra_blocks,
    heading,
    sentence_of_counts,
    summary,
)
from femubench.reports.svg import drawing, embedded
from femubench.reports.templating import templates
from femubench.reproduction import (
    VERDICTS,
    Cell,
    Convention,
    Figure,
    PrintedTable,
    StructureMap,
    Study,
    Verdict,
    as_printed,
    places_of,
    under,
)

_FAULTS: tuple[Verdict, ...] = ("misprint", "does-not-follow")
# Colours of drawings, and the names by which the style sheet has them by day and by night.
_INKS = {
    "#000000": "ink", "#1b1b1b": "ink", "#565656": "soft", "#ffffff": "panel", "#cccccc": "line",
    "#e0e0e0": "grid", "#0072b2": "blue", "#d55e00": "vermilion", "#009e73": "green",
    "#e69f00": "orange", "#cc79a7": "purple", "#56b4e9": "sky",
}  # fmt: skip


def reproduction_html(studies: Sequence[Study], drawings: Mapping[str, str]) -> str:
    """Return studies as one HTML document that needs nothing besides itself.

    Arguments:
        drawings: SVG of every figure by its name.
    """
    numbers = count(1)
    papers = [_Paper(study, *_worked_through(study, numbers)) for study in studies]
    offers = [offer for paper in papers for offer in paper.offers]
    return templates().get_template("reproduction.html").render(
        papers=papers,
        cells=[cell for study in studies for cell in study.cells],
        offers=offers,
        options=[one for offer in offers for one in offer.options[1:]],
        words=WORDS, meaning=MEANING, reading=(AGREE, DEVIATION), verdicts=VERDICTS, faults=_FAULTS,
        drawings={f.name: _shown(f, drawings[f.name]) for s in studies for f in s.figures},
        cells_in_words=cells_in_words, digits_of=digits_of, drawing=drawing, embedded=embedded,
        extra_blocks=extra_blocks, heading=heading, off=off, places_of=places_of,
        sentence=sentence_of_counts, summary=summary, tally=_tally,
    )  # fmt: skip


Key = tuple[str, str, str]  # table, row and column of a cell


class _Change(NamedTuple):
    """How many cells more a table has of a verdict, and the variable of the style for it."""

    variable: str
    table: str
    verdict: Verdict
    more: int


class _Option(NamedTuple):
    """A way to read a text, and the cells that it is about."""

    key: str
    label: str
    agreeing: str
    cells: Mapping[Key, Cell]
    changes: Sequence[_Change]


class _Offer(NamedTuple):
    """A convention and what can be chosen, that which was judged first."""

    name: str
    convention: Convention
    table: str
    options: Sequence[_Option]


class _Spot(NamedTuple):
    """A cell on the page: as judged, and by the key of every other option."""

    id: str
    cell: Cell
    others: Sequence[tuple[str, Cell]]


class _Table(NamedTuple):
    """A printed table with its spots by row and column, and conventions that begin in it."""

    id: str
    printed: PrintedTable
    cells: Sequence[Cell]
    digits: Mapping[str, Digits]
    spots: Mapping[tuple[str, str], _Spot]
    offers: Sequence[_Offer]


class _Paper(NamedTuple):
    study: Study
    tables: Sequence[_Table]
    offers: Sequence[_Offer]


def _worked_through(study: Study, numbers: Iterator[int]) -> tuple[list[_Table], list[_Offer]]:
    """Return the tables of a study and what can be chosen in them.

    Arguments:
        numbers: of tables, cells and conventions, unique in the page.
    """
    cells = {(cell.table, cell.row, cell.column): cell for cell in study.cells}
    offers = [_offer(one, cells, f"v{next(numbers)}") for one in study.conventions()]
    others = [one for offer in offers for one in offer.options[1:]]
    tables = []
    for printed, found in as_printed(study.tables, study.cells):
        spots = {}
        for place, cell in found.items():
            key = (cell.table, *place)
            changed = [(one.key, one.cells[key]) for one in others if key in one.cells]
            spots[place] = _Spot(f"c{next(numbers)}", cell, changed)
        begun = [offer for offer in offers if offer.table == printed.table]
        if own := list(found.values()):
            name = f"t{next(numbers)}"
            tables.append(_Table(name, printed, own, digits_of(own), spots, begun))
    return tables, offers


def _offer(convention: Convention, cells: Mapping[Key, Cell], name: str) -> _Offer:
    """Return a convention with the cells that any of its choices changes, under each of them."""
    own = {key: cell for key, cell in cells.items() if key in convention.keys}
    before = Counter((cell.table, cell.verdict) for cell in own.values())
    read: list[tuple[str, Mapping[Key, Cell]]] = [(convention.judged, {})]
    read += [(choice.label, under(choice, list(cells.values()))) for choice in convention.choices]
    options = []
    for rank, (label, changed) in enumerate(read):
        found = {key: changed.get(key, cell) for key, cell in own.items()}
        more = Counter((cell.table, cell.verdict) for cell in found.values())
        more.subtract(before)
        changes = [
            _Change(re.sub(r"\W", "-", f"--{name}-{table}-{verdict}"), table, verdict, number)
            for (table, verdict), number in more.items()
            if number
        ]
        options.append(_Option(f"{name}-{rank}", label, _agreeing(found.values()), found, changes))
    return _Offer(name, convention, next(iter(own.values())).table, options)


def _agreeing(cells: Iterable[Cell]) -> str:
    verdicts = [cell.verdict for cell in cells]
    unseen = verdicts.count("cannot-be-checked")
    if unseen == len(verdicts):
        return f"{unseen} cells, none of which can be checked"
    wrong = sum(map(verdicts.count, _FAULTS))
    return f"{len(verdicts) - wrong - unseen} of {len(verdicts)} cells agree"


def _tally(
    cells: Sequence[Cell],
    offers: Iterable[_Offer],
    verdicts: Sequence[Verdict] = _FAULTS,
    table: str | None = None,
) -> Markup:
    """Return how many cells have one of some verdicts, which follows what is chosen.

    Arguments:
        cells: as judged.
        offers: that change some of them.
        table: the only one that counts; None: all.
    """
    judged = sum(cell.verdict in verdicts for cell in cells)
    variables = {
        change.variable
        for offer in offers
        for option in offer.options
        for change in option.changes
        if change.verdict in verdicts and table in (None, change.table)
    }
    if not variables:
        return Markup(judged)
    total = " + ".join([str(judged), *(f"var({name}, 0)" for name in sorted(variables))])
    shown = '<span class="tally" style="counter-reset: n calc({})"><span>{}</span></span>'
    return Markup(shown).format(total, judged)


def _shown(figure: Figure, svg: str) -> Markup:
    """Return a drawing in the colours of the page, by night too.

    A map of a structure stays on white: by night its darkest shades, the largest values, would go.
    """

    def named(found: re.Match[str]) -> str:
        role = _INKS.get(found[0].lower())
        return f"var(--{role})" if role else found[0]

    if not isinstance(figure, StructureMap):
        svg = re.sub(r"#[0-9a-fA-F]{6}\b", named, svg)
    return embedded(svg, figure.name, plain(figure.title))
