"""Papers worked through as one HTML document: tables as printed, and why every cell has its colour.

Nothing runs in it: what is chosen among conventions is shown by the style sheet.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from markupsafe import Markup

from femubench.reports import reproduction as words
from femubench.reports.blocks import Drawing
from femubench.reports.digits import off
from femubench.reports.svg import drawing
from femubench.reports.templating import templates
from femubench.reproduction import (
    Cell,
    Convention,
    Figure,
    Grid,
    Ground,
    PrintedTable,
    StructureMap,
    Study,
    Verdict,
)

_FAULTS: tuple[Verdict, ...] = ("misprint", "does-not-follow")
# Colours of drawings, and the names by which the style sheet has them by day and by night.
_INKS = {
    "#000000": "ink", "#1b1b1b": "ink", "#565656": "soft", "#ffffff": "panel", "#cccccc": "line",
    "#e0e0e0": "grid", "#0072b2": "blue", "#d55e00": "vermilion", "#009e73": "green",
    "#e69f00": "orange", "#cc79a7": "purple", "#56b4e9": "sky",
}  # fmt: skip

Key = tuple[str, str, str]  # table, row and column of a cell


def reproduction_html(studies: Sequence[Study], drawings: Mapping[str, str]) -> str:
    """Return studies as one HTML document that needs no other file.

    Arguments:
        drawings: SVG of every figure by its name.
    """
    papers = [_Paper(study, f"p{number}") for number, study in enumerate(studies)]
    return templates().get_template("reproduction.html").render(
        papers=papers,
        cells=[cell for study in studies for cell in study.cells],
        options=[option for paper in papers for option in paper.options],
        drawn=lambda one: Drawing(one.title, one.caption, _shown(one, drawings[one.name])),
        drawing=drawing, faults=_FAULTS, off=off, places_of=Grid.places_of,
        say=words, tally=_tally, verdicts=Ground.VERDICTS,
    )  # fmt: skip


class _Option(NamedTuple):
    """A way to read a text: its cells, and how many more a table has of a verdict then."""

    convention: str
    key: str
    label: str
    cells: Mapping[Key, Cell]
    more: Mapping[tuple[str, Verdict], int]

    @property
    def agreeing(self) -> str:
        verdicts = [cell.verdict for cell in self.cells.values()]
        unseen = verdicts.count("cannot-be-checked")
        if unseen == len(verdicts):
            return f"{unseen} cells, none of which can be checked"
        wrong = sum(map(verdicts.count, _FAULTS))
        return f"{len(verdicts) - wrong - unseen} of {len(verdicts)} cells agree"

    def changes(self, verdicts: Sequence[Verdict], table: str = "") -> Iterator[tuple[str, int]]:
        """Yield variables of the style and how many cells more each stands for."""
        for (own, verdict), number in self.more.items():
            if number and verdict in verdicts and table in ("", own):
                yield re.sub(r"\W", "-", f"--{self.convention}-{own}-{verdict}"), number


class _Paper:
    """A study as the page has it."""

    def __init__(self, study: Study, name: str) -> None:
        self.study, self._name = study, name
        self._cells = {_key(cell): cell for cell in study.cells}
        self._ids = {key: f"{name}c{number}" for number, key in enumerate(self._cells)}

    def id_of(self, cell: Cell) -> str:
        """Return where a cell stands on the page."""
        return self._ids[_key(cell)]

    def others(self, cell: Cell) -> list[tuple[_Option, Cell]]:
        """Return a cell under the options that may change it."""
        return [(one, one.cells[_key(cell)]) for one in self.options if _key(cell) in one.cells]

    @cached_property
    def tables(self) -> list[tuple[str, PrintedTable, dict[tuple[str, str], Cell]]]:
        """Return id, layout and cells of every table that has some."""
        found = PrintedTable.filled(self.study.tables, self.study.cells)
        return [(f"{self._name}t{k}", table, own) for k, (table, own) in enumerate(found) if own]

    @cached_property
    def conventions(self) -> list[tuple[str, Convention, list[_Option]]]:
        """Return conventions by the table that they begin in; what was judged is first."""
        found = []
        for number, convention in enumerate(self.study.conventions()):
            options = list(self._read(convention, f"{self._name}v{number}"))
            found.append((next(iter(options[0].cells))[0], convention, options))
        return found

    @cached_property
    def options(self) -> list[_Option]:
        """Return what can be chosen in addition to what was judged."""
        return [option for *_, options in self.conventions for option in options[1:]]

    def _read(self, convention: Convention, name: str) -> Iterator[_Option]:
        own = {key: cell for key, cell in self._cells.items() if key in convention.keys}
        judged = Counter((cell.table, cell.verdict) for cell in own.values())
        yield _Option(name, f"{name}-0", convention.judged, own, {})
        for number, choice in enumerate(convention.choices, 1):
            cells = own | choice.under(self.study.cells)
            more = Counter((cell.table, cell.verdict) for cell in cells.values())
            more.subtract(judged)
            yield _Option(name, f"{name}-{number}", choice.label, cells, more)


def _key(cell: Cell) -> Key:
    return cell.table, cell.row, cell.column


def _tally(
    cells: Sequence[Cell],
    options: Iterable[_Option],
    verdicts: Sequence[Verdict] = _FAULTS,
    table: str = "",
) -> Markup:
    """Return how many cells have one of some verdicts; the number follows what is chosen.

    Arguments:
        table: the only one that counts; empty: all.
    """
    judged = sum(cell.verdict in verdicts for cell in cells)
    changes = sorted({name for one in options for name, _ in one.changes(verdicts, table)})
    total = " + ".join([str(judged), *(f"var({name}, 0)" for name in changes)])
    shown = '<span class="tally" style="counter-reset: n calc({})"><span>{}</span></span>'
    return Markup(shown).format(total, judged) if changes else Markup(judged)


def _shown(figure: Figure, svg: str) -> Markup:
    """Return a drawing in the colours of the page, by night too.

    A map of a structure stays on white: by night its darkest shades, the largest values, would go.
    """

    def named(found: re.Match[str]) -> str:
        role = _INKS.get(found[0].lower())
        return f"var(--{role})" if role else found[0]

    if not isinstance(figure, StructureMap):
        svg = re.sub(r"#[0-9a-fA-F]{6}\b", named, svg)
    return Markup(svg)
