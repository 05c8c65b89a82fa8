"""What the text of the ladder-frame paper leaves open, and its cells read otherwise."""

from __future__ import annotations

from collections.abc import Iterator

from femubench.papers.frame.common import CASE, PAPER, TRUTH, rigid_modes, strain_modes
from femubench.papers.frame.readings import CUTOFFS, kabe_words
from femubench.papers.frame.tables import LS_FORCED, rigid_figure
from femubench.papers.printed import read_printed
from femubench.reproduction import Choice, Convention, Verdict, Workbench

Key = tuple[str, str, str]


def conventions(bench: Workbench) -> tuple[Convention, ...]:
    """Return the conventions on the updates of tables 2 to 4."""
    return (_cutoff(bench), _shapes(bench), _asked(bench), _expansion(bench))


def _column(
    bench: Workbench, table: str, key: str, name: str, words: str, case: str = CASE, first: int = 0
) -> Iterator[tuple[Key, float | None]]:
    """Yield the cells of a column under an update.

    Arguments:
        first: mode from which on they count, 0 for the rigid-body modes too.
    """
    theirs = read_printed(PAPER)[f"table{table}"][key]["rigid"]
    if not first:
        yield (
            (table, "rigid-body modes", name),
            rigid_figure(theirs, rigid_modes(bench, words, case)),
        )
    for mode, value in enumerate(strain_modes(bench, words, case), 1):
        if mode >= first:
            yield (table, f"mode {mode}", name), float(value)


def _cutoff(bench: Workbench) -> Convention:
    name = "changing non-zeros"
    choices = tuple(
        Choice(
            f"cutoff {cutoff:g}",
            dict(_column(bench, "2", "nonzeros", name, kabe_words(cutoff))),
            "fitted",
        )
        for cutoff in CUTOFFS
        if cutoff != 0.03
    )
    return Convention("Small singular values of Kabe's equations", "cutoff 0.03", choices)


def _shapes(bench: Workbench) -> Convention:
    name = "changing non-zeros + rigid modes"
    ours = dict(_column(bench, "2", "nonzeros_rigid", name, "kabe-rigid", TRUTH, 4))
    return Convention(
        "Shapes of the used modes, which are not in print",
        "those of a solid twin with the accelerometer",
        (Choice("those of the beam truth", ours),),
    )


def _asked(bench: Workbench) -> Convention:
    ours: dict[Key, float | None] = {}
    for key, name in (("physical", "physical parameters"), ("nobari", "Nobari's method")):
        ours.update(_column(bench, "3", key, name, f"{key}:frequencies=nominal"))
    return Convention(
        "Frequencies that the updates of table 3 are asked for",
        "the measured ones, as the text has it",
        (Choice("the nominal ones, against the text", ours),),
    )


def _expansion(bench: Workbench) -> Convention:
    tables = ("generic_ls", "LS solution"), ("generic_adjusted", "adjusted solution")

    def choice(label: str, option: str, worth: Verdict) -> Choice:
        ours: dict[Key, float | None] = {}
        for key, name in tables:
            words = key.replace("_", "-") + option
            ours.update(_column(bench, "4", key, name, words, first=1))
        return Choice(label, ours, worth)

    return Convention(
        "How measured shapes are expanded for table 4",
        f"by (15) for the LS solution ({LS_FORCED}), by (16)-(17) for the adjusted one",
        (
            choice("by (16)-(17) for both, as the text has it", "", "under-convention"),
            choice("by (15) for both", ":expansion=force", "fitted"),
            choice("(16)-(17), equations of motion alone", ":orthogonality=false", "fitted"),
        ),
    )
