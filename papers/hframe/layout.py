"""Tables of the H-frame paper as printed, and how the updates of table 4 converge."""

from __future__ import annotations

from femubench.papers.hframe.meshes import MODES
from femubench.papers.hframe.rows import ROWS, Update, run
from femubench.papers.hframe.shapes import OUT_OF_PLANE, partner
from femubench.papers.hframe.updates import USED
from femubench.papers.printed import read_printed
from femubench.plot import Axis, Chart, Mark, Series
from femubench.reproduction import Entry, Grid, PrintedTable, Workbench


def layout(bench: Workbench) -> tuple[PrintedTable, ...]:
    """Return the tables; those of which nothing but cells is in print stand by their rows."""
    table = read_printed("hframe")["table3"]
    columns = [f"analytical {mode}" for mode in range(1, MODES + 1)]
    top: tuple[Entry, ...] = tuple(("analytical frequency", column) for column in columns)
    rows = [("analytical frequency", top)]
    for number, values in enumerate(table["mac"], 1):
        own = 0 if number == OUT_OF_PLANE else partner(number)
        entries: list[Entry] = [
            (f"measured {number}", columns[k]) if k + 1 == own else f"{value:.2f}"
            for k, value in enumerate(values)
        ]
        rows.append((f"measured {number}", tuple(entries)))
    return (
        PrintedTable("2", "Frequencies on four meshes, divided by those on the first", ()),
        PrintedTable("3", "MAC in %", (Grid(("", *columns), tuple(rows)),)),
        *(_update(bench, row) for row in ROWS),
    )


def _update(bench: Workbench, row: Update) -> PrintedTable:
    modes = [f"mode {i}" for i in range(1, USED + 1)]

    def pair(mode: str, column: str) -> Entry:
        return (mode, column), (mode, f"{column} error")

    frequencies = Grid(
        ("", "initial, Hz (error, %)", "updated, Hz (error, %)"),
        tuple((mode, (pair(mode, "initial"), pair(mode, "updated"))) for mode in modes),
    )
    columns = "initial", "updated", "ratio"
    parameters = Grid(
        ("", *columns),
        tuple((name, tuple((name, column) for column in columns)) for name in row.names),
    )
    return PrintedTable(row.table, row.title, (frequencies, parameters), _convergence(bench, row))


def _convergence(bench: Workbench, row: Update) -> Chart:
    """Return every parameter over its initial value, step by step, and the printed ratios."""
    words = row.converged or row.updated.words
    history = run(bench, words).history
    ratios = read_printed("hframe")["table4"][row.key]["ratios"]
    steps = [entry["iteration"] for entry in history]
    series, marks = [], []
    for symbol, name in row.names.items():
        if name in history[0] and history[0][name]:
            values = [entry[name] / history[0][name] for entry in history]
            series.append(Series(symbol, steps, values))
            marks.append(Mark("y", ratios[symbol], f"{symbol} printed"))
    return Chart(
        "line",
        f"Convergence of table {row.table}",
        Axis("iteration"),
        Axis("parameter / initial value"),
        tuple(series),
        tuple(marks),
        note=f"bench run hframe -s '{words}'",
    )
