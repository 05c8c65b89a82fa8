"""Tables in the layout in which a paper prints them: cells, and what stands between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from femubench.core.plot.chart import Chart
from femubench.core.reproduction.cell import Cell

Place = tuple[str, str]  # row and column of a cell
# Text, a cell, or a cell and one more in brackets behind it.
Entry = str | Place | tuple[Place, Place]


@dataclass(frozen=True)
class Grid:
    """Rows and columns.

    Arguments:
        heads: of the columns, that of the names of the rows first.
        rows: name, and an entry for each other column.
    """

    heads: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Entry, ...]], ...]

    @property
    def places(self) -> Iterator[Place]:
        """Yield where its cells belong, from left to right and down."""
        for _, entries in self.rows:
            for entry in entries:
                yield from self.places_of(entry)

    @staticmethod
    def places_of(entry: Entry) -> tuple[Place, ...]:
        """Return where the cells of an entry belong: none, one or two.

        Examples:
            >>> reproduction.Grid.places_of((("mode 1", "FE"), ("mode 1", "error")))
            (('mode 1', 'FE'), ('mode 1', 'error'))
        """
        if isinstance(entry, str):
            return ()
        return (entry,) if isinstance(entry[0], str) else entry


@dataclass(frozen=True)
class PrintedTable:
    """One table of a paper.

    Arguments:
        table: as its cells have it, e.g. ``"4d"``.
        title: what it shows.
        grids: its parts, one below the other; cells that none has follow by their own rows.
        chart: what belongs next to it.
    """

    table: str
    title: str
    grids: tuple[Grid, ...]
    chart: Chart | None = None

    @staticmethod
    def filled(
        tables: Sequence[PrintedTable], cells: Sequence[Cell]
    ) -> Iterator[tuple[PrintedTable, dict[Place, Cell]]]:
        """Yield every table with its cells; those that no layout has follow by their own rows.

        Arguments:
            tables: layouts.
            cells: of all tables.

        Examples:
            >>> fit = reproduction.Ground("fitted", "the length is fitted to this frequency")
            >>> page = reproduction.Page("paper", "1", (fit,), unit="Hz", tolerance=0.1)
            >>> cell = page.cell("mode 1", "FE", 255.8, 255.83)
            >>> [(table, own)] = reproduction.PrintedTable.filled([], [cell])
            >>> table.grids[0].heads, own["mode 1", "FE"].ours
            (('', 'FE'), 255.83)
        """
        left: dict[str, dict[Place, Cell]] = {}
        for cell in cells:
            left.setdefault(cell.table, {})[cell.row, cell.column] = cell
        for table in tables:
            own = left.pop(table.table, {})
            placed = {place for grid in table.grids for place in grid.places}
            rest = [cell for place, cell in own.items() if place not in placed]
            further = (by_rows(rest),) if rest else ()
            grids = (*table.grids, *further)
            yield PrintedTable(table.table, table.title, grids, table.chart), own
        for name, own in left.items():
            yield PrintedTable(name, "", (by_rows(own.values()),)), own


def by_rows(cells: Iterable[Cell]) -> Grid:
    """Return cells by their own rows and columns, in the order in which these come up."""
    places = [(cell.row, cell.column) for cell in cells]
    columns, there = tuple(dict.fromkeys(column for _, column in places)), set(places)
    return Grid(
        ("", *columns),
        tuple(
            (row, tuple((row, c) if (row, c) in there else "" for c in columns))
            for row in dict.fromkeys(row for row, _ in places)
        ),
    )
