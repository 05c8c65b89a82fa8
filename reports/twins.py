"""What twins of the cases, and jobs that were run again, say of strategies."""

from __future__ import annotations

from typing import Any

from femubench.reports.cells import first_of, plain
from femubench.reports.page.rounding import clean
from femubench.results import RunData, twin_gains, unsteady

MEANING = (
    "Twins are other structures under other names, drawn from a seed when the run began: similar "
    "ones have other sizes, moduli and densities, of which the truth follows exactly; stretched "
    "ones also other spans and sections, or parts of other materials, of which it follows from "
    "solids that were solved before. A strategy that reckons errs on them about as on their cases; "
    "one that is clearly better on the cases may know these by heart. An answer that is the same "
    "on stretched ones, though their data are not, counts there as the model that was given."
)


def twins_by_strategy(run: RunData) -> dict[str, dict[str, Any]]:
    """Return by strategy, in plain data, its gain on twins and on their cases, and what is odd."""
    keys = ("gain", "original_gain", "p", "suspicious")
    return {
        name: {**{key: clean(getattr(found, key)) for key in keys}, "known": list(found.known)}
        for name, found in twin_gains(run).items()
    }


def describe_twins(run: RunData) -> str:
    """Return how many twins there were, and from which seed."""
    stated = run.meta.get("twins") or {}
    twins = stated.get("of") or {}
    stretched = sum("stretched" in kinds for kinds in (stated.get("kinds") or {}).values())
    some = f" ({stretched} stretched)" * bool(stretched)
    return (
        f"{len(twins)} twins{some} of {len(set(twins.values()))} cases, seed {stated.get('seed')}"
    )


def suspicions(run: RunData) -> list[str]:
    """Return a sentence for every strategy that may know the cases, or that gave two answers."""
    stated = [
        f"{plain(name)} knows the cases? gain {found.original_gain:.3f} on them, "
        f"{found.gain:.3f} on their twins"
        + f" (more than three times the error on the twins of {first_of(found.known, 3)})"
        * bool(found.known)
        for name, found in twin_gains(run).items()
        if found.suspicious
    ]
    return stated + [
        f"{plain(name)} gave two answers to one job: {plain(what)}"
        for name, what in unsteady(run).items()
    ]
