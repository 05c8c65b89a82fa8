"""Papers worked through as one HTML document: tables as printed, and why every cell has its colour.

Nothing runs in it: what is chosen among conventions is shown by the style sheet.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from markupsafe import Markup

from femubench.reports.cells import plain
from femubench.reports.digits import Digits, off
from femubench.reports.reproduction import (
    AGREE,
    DEVIATION,
    MEANING,
    WORDS,
    cells_in_words,
    counts_line,
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
    Entry,
    Figure,
    PrintedTable,
    StructureMap,
    Study,
    as_printed,
    places_of,
    under,
)

_FAULTS = ("misprint", "does-not-follow")
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
    page = templates().get_template("reproduction.html")
    papers = [_Paper(study, numbers) for study in studies]
    return page.render(
        papers=papers,
        counts=counts_line(studies),
        choices=[key for paper in papers for key in paper.keys],
        words=WORDS, meaning=MEANING, reading=(AGREE, DEVIATION), verdicts=VERDICTS,
        drawings={f.name: _shown(f, drawings[f.name]) for s in studies for f in s.figures},
        embedded=embedded, drawing=drawing, extra_blocks=extra_blocks,
    )  # fmt: skip


@dataclass(frozen=True)
class _Reading:
    """A cell as one convention has it; `key`: of the choice, empty for the verdict's own."""

    cell: Cell
    digits: Digits
    key: str = ""
    judged: str = ""

    @property
    def classes(self) -> str:
        return f"other {self.key}" if self.key else self.judged

    @property
    def sign(self) -> str:
        return WORDS[self.cell.verdict][0]

    @property
    def words(self) -> str:
        return WORDS[self.cell.verdict][2:]

    @property
    def printed(self) -> str:
        return self.digits.printed(self.cell.printed, self.cell.unit)

    @property
    def ours(self) -> str:
        return self.digits.ours(self.cell.ours, self.cell.unit, beside=self.cell.printed)

    @property
    def off(self) -> str:
        return off(self.cell.deviation_percent, self.cell.unit)

    @property
    def place(self) -> str:
        return f"{self.cell.row}, {self.cell.column}"

    @property
    def label(self) -> str:
        return f"{heading(self.cell.table)}, {self.place}: {self.words}"


@dataclass(frozen=True)
class _Spot:
    """Where a cell stands on the page, and what it says there."""

    id: str
    readings: tuple[_Reading, ...]


# Name, and what can be chosen: key, label, how many cells agree then.
_Offer = tuple[str, Convention, tuple[tuple[str, str, str], ...]]


@dataclass(frozen=True)
class _Table:
    """A printed table with its spots by row and column, and conventions that begin in it."""

    printed: PrintedTable
    spots: Mapping[tuple[str, str], _Spot]
    conventions: Sequence[_Offer]

    @property
    def cells(self) -> list[Cell]:
        return [spot.readings[0].cell for spot in self.spots.values()]

    @property
    def heading(self) -> str:
        return heading(self.printed.table)

    @property
    def id(self) -> str:
        return next(iter(self.spots.values())).id.replace("c", "t")

    @property
    def summary(self) -> str:
        return summary(self.cells)

    @property
    def wrong(self) -> int:
        return _wrong(self.cells)

    @property
    def in_words(self) -> list[object]:
        return list(cells_in_words(self.cells, WORDS))

    def at(self, entry: Entry) -> list[_Spot]:
        return [self.spots[place] for place in places_of(entry) if place in self.spots]


@dataclass(frozen=True)
class _Paper:
    """A study as the page has it; `numbers`: of cells and conventions, unique in the page."""

    study: Study
    numbers: Iterator[int]
    tables: list[_Table] = field(init=False)
    keys: list[tuple[str, str]] = field(init=False)

    def __post_init__(self) -> None:
        """Number cells and conventions, and judge the cells under each of these."""
        object.__setattr__(self, "keys", [])
        object.__setattr__(self, "tables", list(self._tables()))

    @property
    def sentence(self) -> str:
        return sentence_of_counts(self.study.cells)

    @property
    def wrong(self) -> int:
        return _wrong(self.study.cells)

    @property
    def size(self) -> int:
        return len(self.study.cells)

    def _tables(self) -> Iterator[_Table]:
        others, begun = self._others()
        for printed, cells in as_printed(self.study.tables, self.study.cells):
            if cells:
                yield _Table(printed, self._spots(cells, others), begun.get(printed.table, ()))

    def _spots(
        self, cells: Mapping[tuple[str, str], Cell], others: Mapping[object, list[tuple[str, Cell]]]
    ) -> dict[tuple[str, str], _Spot]:
        digits = {
            unit: Digits.of(cell.printed for cell in cells.values() if cell.unit == unit)
            for unit in {cell.unit for cell in cells.values()}
        }
        found = {}
        for place, cell in cells.items():
            more = others.get((cell.table, *place), [])
            judged = f"judged {more[0][0].partition('-')[0]}" if more else ""
            own = digits[cell.unit]
            readings = _Reading(cell, own, "", judged), *(_Reading(c, own, k) for k, c in more)
            found[place] = _Spot(f"c{next(self.numbers)}", readings)
        return found

    def _others(self) -> tuple[dict[object, list[tuple[str, Cell]]], dict[str, list[_Offer]]]:
        """Return the cells under every choice, and the conventions by their first table."""
        others: dict[object, list[tuple[str, Cell]]] = {}
        begun: dict[str, list[_Offer]] = {}
        for convention in self.study.conventions():
            name = f"v{next(self.numbers)}"
            own = [c for c in self.study.cells if (c.table, c.row, c.column) in convention.keys]
            options = [(f"{name}-0", convention.judged, _agreeing(own, convention, own))]
            for rank, choice in enumerate(convention.choices, 1):
                key, found = f"{name}-{rank}", under(choice, self.study.cells)
                self.keys.append((name, key))
                for cell in own:
                    place = cell.table, cell.row, cell.column
                    others.setdefault(place, []).append((key, found.get(place, cell)))
                read = [found.get((c.table, c.row, c.column), c) for c in own]
                options.append((key, choice.label, _agreeing(read, convention, own)))
            begun.setdefault(own[0].table, []).append((name, convention, tuple(options)))
        return others, begun


def _wrong(cells: Sequence[Cell]) -> int:
    return sum(cell.verdict in _FAULTS for cell in cells)


def _agreeing(cells: Sequence[Cell], convention: Convention, own: Sequence[Cell]) -> str:
    unseen = sum(cell.verdict == "cannot-be-checked" for cell in cells)
    if unseen == len(own):
        return f"{len(own)} cells, none of which can be checked"
    return f"{len(cells) - _wrong(cells) - unseen} of {len(convention.keys)} cells agree"


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
