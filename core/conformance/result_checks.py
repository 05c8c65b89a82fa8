"""What the result of a strategy must be, one check a function."""

from __future__ import annotations

from collections.abc import Sequence

from femubench.core.conformance.kit import (
    Bench,
    Verdict,
    Want,
    check,
    failed,
    not_applicable,
    passed,
)
from femubench.core.conformance.problems import CROSSED, PLAIN, PROBLEMS
from femubench.core.conformance.trial import promises_of

ALONE = "matrices alone"
_HONEST = "expected a result, or NotApplicable or StrategyFailure with a sentence"
PLANES = ("grounded frame in plane", "grounded frame in space")
FREE = ("free frame out of plane", "free frame in space")
MISSING = ("some shape cells missing", "one mode without a shape")
MASSLESS = ("joints without mass", "joints without mass, free")
NOISE = tuple(name for name in PROBLEMS if " with noise, " in name)
# The problem without the feature that is looked at, where that is not the plain one.
_SIMPLER = {
    "free frame in space": "grounded frame in space",
    "joints without mass, free": "free frame out of plane",
    **{name: name.partition(" with noise, ")[0] for name in NOISE},
}


def runs(*names: str) -> Sequence[Want]:
    """Return one trial of every problem named."""
    return [Want(name) for name in names]


def with_results(bench: Bench) -> Sequence[Want]:
    """Return the trials whose results every check of results looks at."""
    names = (PLAIN, *PLANES, *FREE, *MASSLESS, *NOISE, *MISSING, CROSSED, ALONE, "one used mode")
    return runs(*names, *bench.cases)


def survives(bench: Bench, names: Sequence[str]) -> Verdict:
    """Judge whether every problem gave a result or an honest refusal.

    What already fails without the feature that is looked at is no matter of that feature.
    """
    found = bench.observe(runs(*names))
    simpler = bench.observe(runs(*(_SIMPLER.get(name, PLAIN) for name in names)))
    pairs = zip(names, found, simpler, strict=True)
    told = [item for name, item, base in pairs if name == PLAIN or base.survived]
    if not told:
        return not_applicable(f"not looked at: {simpler[0].problem} fails already")
    lost = [item for item in told if not item.survived]
    if lost:
        more = f" (and on {len(lost) - 1} more)" if len(lost) > 1 else ""
        return failed(f"{lost[0].problem}: {lost[0].text}, {_HONEST}{more}")
    if all(item.kind == "lacking" for item in told):
        return not_applicable(told[0].text)
    refused = [item for item in told if item.kind in ("not-applicable", "failed")]
    return passed(f"refused {refused[0].problem}: {refused[0].text}" if refused else "")


def of_results(bench: Bench, name: str) -> Verdict:
    """Judge what the workers saw of every result."""
    found = [item for item in bench.observe(with_results(bench)) if item.kind == "result"]
    if not found:
        return not_applicable("there is no result to look at")
    wrong = [item for item in found if name in item.faults]
    if wrong:
        more = f" (and on {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        return failed(f"{wrong[0].problem}: {wrong[0].faults[name]}{more}")
    return passed()


@check(
    "strategy",
    "sizes",
    "The matrices are sparse and as large as the model has dofs.",
    wants=with_results,
)
def sizes(bench: Bench) -> Verdict:
    """Look at the sizes of every result."""
    return of_results(bench, "sizes")


@check("strategy", "finite", "The matrices hold finite real numbers.", wants=with_results)
def finite(bench: Bench) -> Verdict:
    """Look at the entries of every result."""
    return of_results(bench, "finite")


@check("strategy", "symmetric", "The matrices are symmetric.", wants=with_results)
def symmetric(bench: Bench) -> Verdict:
    """Compare every result with its transpose."""
    return of_results(bench, "symmetric")


@check(
    "strategy",
    "figures",
    "History, diagnostics and parameters hold finite numbers.",
    wants=with_results,
)
def figures(bench: Bench) -> Verdict:
    """Look at the figures that come with every result."""
    return of_results(bench, "figures")


@check(
    "strategy",
    "parameter-count",
    "The number of unknowns is whole, and not 0 for another model.",
    wants=with_results,
)
def parameter_count(bench: Bench) -> Verdict:
    """Look at the number of unknowns of every result."""
    return of_results(bench, "parameter-count")


@check(
    "strategy",
    "promises",
    "Every result keeps what the class attribute `promises` lists.",
    wants=with_results,
)
def promises(bench: Bench) -> Verdict:
    """Measure the promises on every result."""
    if not promises_of(bench.subject):
        return not_applicable("nothing promised")
    return of_results(bench, "promises")
