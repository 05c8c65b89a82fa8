"""What the result of a strategy must be, one check a function."""

from __future__ import annotations

from femubench.core.conformance.kit import Bench, Verdict, check, not_applicable
from femubench.core.conformance.looking import of_results, with_results
from femubench.core.conformance.trial import promises_of


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
