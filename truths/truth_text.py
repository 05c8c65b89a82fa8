"""Write what is known of a truth as the file that `femubench.core.challenge` reads."""

from __future__ import annotations

import tomlkit

from femubench.core.challenge.truth_file import KnownCase

DIGITS = 4  # of what is computed: more would differ between kernels of linear algebra


def rounded(value: float) -> float:
    """Return a number with as many digits as truth files have."""
    return float(f"{value:.{DIGITS}g}")


def truth_text(truth: KnownCase) -> str:
    """Return the content of the truth file."""
    document = tomlkit.document()
    document.update(
        {"structure": truth.structure, "kind": truth.kind, "held": truth.held, "seed": truth.seed}
    )
    if truth.mass is not None:
        mass = tomlkit.inline_table()
        mass.update({"value": truth.mass[0], "std": truth.mass[1]})
        document["mass"] = mass
    if truth.chi2 is not None and truth.chi2_frequencies is not None:
        visible = tomlkit.table()
        visible["chi2"] = rounded(truth.chi2)
        visible["chi2_frequencies"] = rounded(truth.chi2_frequencies)
        if truth.appears:
            visible["appears"] = truth.appears
        document["visible"] = visible
    causes = tomlkit.aot()
    for cause in truth.causes:
        table = tomlkit.table()
        table.update({"what": cause.what, "effect": cause.effect})
        if cause.also:
            table["also"] = list(cause.also)
        table["place"] = cause.place
        if cause.size is not None:
            table.update({"size": rounded(cause.size), "unit": cause.unit})
        causes.append(table)
    if truth.causes:
        document["cause"] = causes
    return tomlkit.dumps(document)
