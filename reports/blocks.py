"""A report as sections of text, lists, tables and drawings, which every form of it shows alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from femubench.reports.cells import chance, format_fixed, plain, whole

Cell = str | float | None


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Arguments:
        width: the most characters that a cell takes on the screen; 0 for what the others leave.
        left: whether it holds words rather than figures.
        wrap: whether a longer cell goes on below, instead of being cut.
        say: how a number is written; None for `digits`.
        digits: decimals where there is room; 0 for a count.
        bar: the look of a bar in HTML, of a length as its number; empty for none.
    """

    title: str
    width: int
    left: bool = False
    wrap: bool = False
    say: Callable[[Any], str] | None = None
    digits: int = 0
    bar: str = ""

    @property
    def side(self) -> Literal["left", "right"]:
        """Return where the cells stand."""
        return "left" if self.left else "right"

    def text(self, cell: Cell, width: int = 7) -> str:
        """Return a cell on one line; `width` is what a number with decimals has."""
        if isinstance(cell, str):
            return plain(cell)
        if self.say is not None:
            return self.say(cell)
        return format_fixed(cell, self.digits, width) if self.digits else whole(cell, max(width, 4))


@dataclass(frozen=True)
class Table:
    """Rows of cells; a table that is wider than the screen goes on below there.

    Arguments:
        caption: one line on the whole, may be empty.
        tones: a word for each row that HTML may know it by; nothing may rest on it alone.
        most: rows on the screen; None for all.
        names: the place of the column that stands in every part of a table on the screen.
        sortable: whether a reader of the HTML may sort it by any column.
        folded: in HTML, what stands for it until it is asked for; empty where it always shows.
        full: the number whose bar is full.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    caption: str = ""
    tones: Sequence[str] = ()
    most: int | None = None
    names: int = 0
    sortable: bool = False
    folded: str = ""
    full: float = 1.0


@dataclass(frozen=True)
class Items:
    """A list of remarks.

    Arguments:
        entries: label, which may be empty, text, and what is said about it.
        whole: whether words wider than the screen stay whole, as commands must to be copied.
        look: in HTML ``tiles`` or ``parameters``, or a list that is styled by this word.
    """

    entries: Sequence[tuple[str, ...]]
    whole: bool = False
    look: str = ""
    folded: str = ""


@dataclass(frozen=True)
class FindingCard:
    """Something that was found, with everything that is known of it.

    Arguments:
        title, at: what it is, and where.
        number: among its like.
        chances: names and probabilities, each with a bar.
        lines: clauses.
        facts: entries of a list.
    """

    title: str
    at: str
    number: int
    chances: Sequence[tuple[str, float | None]]
    lines: Sequence[str]
    facts: Sequence[tuple[str, ...]]

    @property
    def text(self) -> str:
        """Return all of it but the title in one line."""
        parts = [*(f"{name} {chance(p)}" for name, p in self.chances), *self.lines]
        return "; ".join([*parts, *(f"{name} {', '.join(said)}" for name, *said in self.facts)])


@dataclass(frozen=True)
class Cards:
    """What was found, one by one."""

    cards: Sequence[FindingCard]

    @property
    def entries(self) -> Sequence[tuple[str, ...]]:
        """Return them as a list of remarks."""
        return [(f"{card.title} {card.at}".strip(), card.text) for card in self.cards]


@dataclass(frozen=True)
class Drawing:
    """A figure.

    Arguments:
        caption: what it shows and where it comes from.
        svg: its drawing, for HTML; may be empty.
        file: where the drawing lies from the Markdown document; empty for nowhere.
    """

    title: str
    caption: str
    svg: str = ""
    file: str = ""


@dataclass(frozen=True)
class Row:
    """Small figures next to each other."""

    drawings: Sequence[Drawing]


Block = str | Table | Items | Cards | Drawing | Row


@dataclass(frozen=True)
class Passage:
    """Blocks under a title; without a title they stand by themselves.

    Arguments:
        level: 2 for a chapter, 3 for a part of one.
        area: where HTML has it: ``first`` under the heading, ``aside`` next to it, or in its turn.
    """

    title: str
    blocks: Sequence[Block]
    level: int = 2
    area: Literal["", "first", "aside"] = ""
    look: str = ""
