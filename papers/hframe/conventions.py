"""What the text of the H-frame paper leaves open, and its cells read otherwise."""

from __future__ import annotations

from femubench.papers.hframe.meshes import frequencies
from femubench.papers.hframe.rows import FREE_EI, SPRINGS, parameter_values, row_of, run
from femubench.papers.hframe.shapes import compute_expanded_mac, partner
from femubench.papers.hframe.updates import USED
from femubench.reproduction import Choice, Convention, Verdict, Workbench

Key = tuple[str, str, str]


def conventions(bench: Workbench) -> tuple[Convention, ...]:
    """Return the conventions on MAC and on the updated columns of table 4."""
    mac = compute_expanded_mac(bench.cases["hframe"], "translations")
    pairs: dict[Key, float | None] = {
        ("3", f"measured {number}", f"analytical {partner(number)}"): float(
            values[partner(number) - 1]
        )
        for number, values in mac.items()
    }
    return (
        Convention(
            "Degrees of freedom that MAC is taken over",
            "all",
            (Choice("translations alone", pairs),),
        ),
        Convention(
            "Where the update of table 4b ends",
            "after six damped steps",
            (_updated(bench, "b", "at convergence", "local", "independent"),),
        ),
        Convention(
            "Springs of table 4c",
            "rigid in the updated column",
            (
                _updated(
                    bench, "c", "as printed in both columns", f"spring:variant=global,{SPRINGS}"
                ),
            ),
        ),
        Convention(
            "EI in table 4d",
            "frozen",
            (_updated(bench, "d", "free, as the text has it", FREE_EI, "independent"),),
        ),
    )


def _updated(
    bench: Workbench, letter: str, label: str, words: str, worth: Verdict = "under-convention"
) -> Choice:
    """Return the updated column of a row of table 4 under other words."""
    row = row_of(letter)
    hertz = frequencies(run(bench, words).model, USED)
    ours: dict[Key, float | None] = {
        (row.table, f"mode {i}", "updated"): float(value) for i, value in enumerate(hertz, 1)
    }
    for symbol, (_, after) in parameter_values(bench, row, words).items():
        ours[row.table, symbol, "updated"] = after
    return Choice(label, ours, worth)
